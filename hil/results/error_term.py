"""One cause of error and what to do about it, as `model.yaml` keeps it."""

from __future__ import annotations

from checked_files.yaml_file import FileModel
from hil.estimation.causes import CauseName

REMEDIES = {
    CauseName.SOFT_GEARS: "nothing: links are placed where the gears let them be; a simulator or a"
    " feed-forward needs the compliances too",
    CauseName.LOAD_FRICTION: "nothing: it is fitted; methods without it find other parameters",
    CauseName.ASYMMETRY: "nothing: it is fitted; it shifts what the published method finds",
    CauseName.RIPPLE: "strokes at higher speeds, whose ripple the window takes away",
    CauseName.ENCODERS: "encoders of more increments, or longer measurements",
    CauseName.SLOW_SYNC: "a shorter SYNC period, in drives file and plan alike, or longer"
    " measurements",
    CauseName.WEAK_EXCITATION: "measurements that move more joints through more of their ranges"
    " (hil plan, hil trajectory plan)",
    CauseName.DISAGREEMENT: "a look at what differs between them: a hand that touches something, a"
    " machine that warms up, a motor that ripples",
}


class ErrorTerm(FileModel):
    """One cause of error.

    Attributes
    ----------
    cause : CauseName
    axes : tuple of int
        From 1; none where it concerns all.
    found : str
        What was found, with its figure.
    torque : float
        Error of the torques on a free motion, mean over joints of its root mean square over that of
        the torque; if the cause is accounted for, the error without that.
    share : float
        Of the sum of squares.
    accounted : bool
        Whether the estimate takes it into account.
    """

    cause: CauseName
    axes: tuple[int, ...]
    found: str
    torque: float
    share: float
    accounted: bool

    @property
    def remedy(self) -> str:
        """What to do about it."""
        return REMEDIES[self.cause]
