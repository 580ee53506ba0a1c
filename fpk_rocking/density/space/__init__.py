"""The space of the densities: mesh lines, the finite elements on them, and a density as a function."""
