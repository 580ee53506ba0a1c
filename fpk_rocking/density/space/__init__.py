"""Where a density lives: mesh lines, the finite-element space on them, and a density as a function."""
