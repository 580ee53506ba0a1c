"""Forcings: the base class, and all kinds, also those that the front of the package does not have."""

from fpk_rocking.physics.forcing import *  # noqa: F403  (a new kind is named there, and not here)
