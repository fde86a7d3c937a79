"""Motion imported from a foreign recording, as data.

An imported motion cannot be measured again; a plan that contains one describes an imported run.
"""

from __future__ import annotations

from typing import ClassVar, Literal

from pydantic import Field, model_validator

from checked_files.names import Line
from checked_files.yaml_file import FileModel
from hil.planning import CYCLES_MAX
from hil.planning.plan_values import Name, Positive, Real


class FreeMotion(FileModel):
    """Continuous motion of the joints recorded by another system.

    Attributes
    ----------
    q : tuple of float
        Mean configuration [rad or m].
    duration : float
        Time from the first to the last sample [s].
    cycles : int
        Number of blocks of about equal length; friction may change between blocks.
    alone : int, optional
        Axis moving back and forth while all others stand still, if any; strokes are then numbered,
        and blocks are pairs of strokes.
    cut_off : float, optional
        Cut-off frequency of the low-pass [Hz]; by default chosen from the samples.
    unknown_gains : tuple of int, optional
        Axes, from 1, with torques in an unknown unit, common to all motions of a run.
    source : str
        Source file and rows.
    """

    streamed: ClassVar[Literal[True]] = True
    """True: set-points are unknown and do not form strokes."""

    id: Name
    kind: Literal["free"] = "free"
    q: tuple[Real, ...] = Field(min_length=1)
    duration: Positive
    cycles: int = Field(default=1, ge=1, le=CYCLES_MAX)
    alone: int | None = Field(default=None, ge=1)
    cut_off: Positive | None = None
    unknown_gains: tuple[int, ...] | None = None
    source: Line = ""

    @model_validator(mode="after")
    def _axis_exists(self) -> FreeMotion:
        if self.alone is not None and self.alone > len(self.q):
            raise ValueError(f"alone {self.alone} must be one of the {len(self.q)} joints of q")
        return self

    @property
    def moved(self) -> tuple[int, ...]:
        """Joint indices of the moving axes, from 0."""
        return self.read if self.alone is None else (self.alone - 1,)

    @property
    def read(self) -> tuple[int, ...]:
        """Joint indices of all axes, from 0; torques of all were recorded."""
        return tuple(range(len(self.q)))

    @property
    def axes_in_words(self) -> str:
        """Moving axes in words."""
        return "all axes" if self.alone is None else f"axis {self.alone}"
