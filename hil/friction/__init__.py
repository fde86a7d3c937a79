"""Friction of axes: terms, laws, selection of a law, warmth of gears, drift over time."""
