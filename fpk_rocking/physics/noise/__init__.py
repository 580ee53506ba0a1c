"""Noise: harmonics of a band, white noise through filters, envelopes, and the white noise that stands for another."""
