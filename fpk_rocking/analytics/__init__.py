"""Analytic results about a scene."""
