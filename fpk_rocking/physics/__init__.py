"""The physics written once: flight, impact, rest, noise; compiled kernels that every engine calls."""
