"""What a storm must never bring about."""


class Harm(AssertionError):
    """A hostile frame did what it must not do."""
