"""Mistakes in what is stated of a robot or its drives, found as other readings of the recordings."""
