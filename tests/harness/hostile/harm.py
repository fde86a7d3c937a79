"""Violations that a storm must never cause."""


class Harm(AssertionError):
    """Violation caused by a hostile frame."""
