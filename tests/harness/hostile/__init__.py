"""Hostile frames, and what must hold while they arrive; shared by benchmark and tests."""
