"""Closed-form results about a scene: Melnikov process, criteria of overturning, phase flux, symmetric orbits."""
