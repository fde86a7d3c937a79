"""Mistakes in what robot and drives files state, found as other readings of the recordings."""
