"""Checks of recordings while they can still be repeated, and of the limits that hold on axes."""
