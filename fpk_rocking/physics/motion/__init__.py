"""The motion of a block: flights, impacts, rest and lift-off, under a force that is a polynomial over some time."""

TERMS = 16
"""Coefficients of a piece of the forcing: for its `longest_piece` it is right to 1e-14 of the forcing's size."""
