"""What to measure, as data, and what it will take and give. Nothing moves here.

What the command line shows as defaults and bounds stands here, where it is read without numerics.
"""

BITRATE = 1_000_000
"""Bit rate that is assumed where nothing else is known [bit/s]."""
CYCLES_MAX = 10_000
"""Most times that one measurement goes back and forth, or repeats its period."""
LONGEST = 86400.0
"""Duration of a warm-up, or of a plan that is asked for by its time [s]."""
