"""Checks of recordings while a repetition is possible, and of the limits on the axes."""
