"""Friction: one set of terms, laws made up of them and their search, warmth, drift, symmetry."""
