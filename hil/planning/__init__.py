"""Planning: measurements as data, and predictions of their duration and precision; no motion.

Defaults and bounds of the command line are defined here, importable without numerics.
"""

BITRATE = 1_000_000
"""Bit rate assumed unless stated [bit/s]."""
CYCLES_MAX = 10_000
"""Maximum number of cycles or periods of a measurement."""
LONGEST = 86400.0
"""Maximum duration of a warm-up and of a plan limited by time [s]."""
