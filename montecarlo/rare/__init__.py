"""Rare overturning by adaptive multilevel splitting: paths that come near it are branched."""
