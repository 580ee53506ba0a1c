"""Densities under filtered noise: at each value of the filter's states a density of angle and velocity, and a rest."""
