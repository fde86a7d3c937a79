"""Which recordings are of an axis that moves back and forth, and the name of their method.

Apart from the method, so that to choose one loads none.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from hil.planning.free_motion import FreeMotion

if TYPE_CHECKING:
    from hil.planning.measurement import RecordedMotion

NAME = "back and forth"


def goes_back_and_forth(motion: RecordedMotion) -> bool:
    """Whether a recording is of one axis that moves back and forth by itself."""
    return isinstance(motion, FreeMotion) and motion.alone is not None
