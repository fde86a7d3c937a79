"""Motion imported from a foreign recording, as data.

It cannot be measured again: a plan that holds one describes a run that was imported.
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
        From the first to the last sample [s].
    cycles : int
        Groups of the recording, blocks of about equal length: friction may change from one to the
        next.
    alone : int, optional
        The axis that moves back and forth while all others stand still, if it is such a motion; the
        recording then numbers its strokes, and its groups are pairs of these.
    cut_off : float, optional
        Of the low-pass that its samples are to pass [Hz]; by default it is chosen from them.
    unknown_gains : tuple of int, optional
        Axes, from 1, whose torques are in units of unknown worth, the same in all motions of a run.
    source : str
        File and rows that it comes from.
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
