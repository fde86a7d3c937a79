"""Hostile frames, and requirements during them; shared by benchmark and tests."""
