"""Envelopes g(τ): how the strength of a noise rises and dies away, η(τ) g(τ) in place of η(τ)."""

from fpk_rocking.physics.noise.envelope import Envelope, Exponential, Table, Trapezoid

__all__ = ["Envelope", "Exponential", "Table", "Trapezoid"]
