"""What a mistake is: its name, its axes, its size, and what to do about it."""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import StrEnum
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from hil.arrays import Array


class MistakeName(StrEnum):
    """What may be wrong in what is stated of a robot, its drives or its recordings."""

    DIRECTION = "wrong direction of an axis"
    POSITION_SIGN = "wrong sign of a position"
    TORQUE_SIGN = "wrong sign of a torque"
    ZERO = "wrong zero of an axis"
    GRAVITY = "wrong direction of gravity"
    GEAR = "wrong gear ratio"
    TORQUE_CONSTANT = "wrong torque constant"
    EXCHANGED = "two axes exchanged"
    LEFT_OUT = "load or link parameters left out"
    SATURATION = "torque at its limit"
    SLIP = "coupling or encoder that slips"
    DRIFT = "torque constant that drifts"
    SPRING = "spring left out"
    PERIODIC = "torque that repeats with the angle"
    UNKNOWN = "measurements that contradict each other"


REMEDIES = {
    MistakeName.DIRECTION: "turn its sign in the drives file or in the map, or its frame in the"
    " robot file",
    MistakeName.POSITION_SIGN: "correct the sign of its position in the map or the drives file",
    MistakeName.TORQUE_SIGN: "correct the sign of its current in the drives file, or of its torque"
    " in the map",
    MistakeName.ZERO: "correct its zero in the drives file (hil home), its offset in the map, or"
    " theta in the robot file",
    MistakeName.GRAVITY: "correct gravity in the robot file: how is the base mounted?",
    MistakeName.GEAR: "correct its gear_ratio in robot file and drives file",
    MistakeName.TORQUE_CONSTANT: "correct its torque_constant in robot file and drives file, and"
    " look whether currents are rms or peak values",
    MistakeName.EXCHANGED: "exchange their nodes in the drives file, or their columns in the map",
    MistakeName.LEFT_OUT: "take the load off, or state the missing parameters of that link in the"
    " robot file (hil diagnose ranks the parameters, hil payload finds a load)",
    MistakeName.SATURATION: "measure with lower accelerations, or raise the drive's limit",
    MistakeName.SLIP: "fasten the coupling, home the axis and measure again",
    MistakeName.DRIFT: "let the motors reach their temperature before measuring (magnets weaken as"
    " they warm), and look whether the current sensor drifts",
    MistakeName.SPRING: "add it to springs in the robot file, or take away what pulls there (a"
    " cable, a hose, a balancer)",
    MistakeName.PERIODIC: "look for what rubs or meshes so often in a turn (gear, bearing, cable);"
    " no base parameter holds such a torque",
    MistakeName.UNKNOWN: "look for what differs between them: a contact, a load that changed, a"
    " machine that was altered in between",
}


@dataclass(frozen=True, slots=True)
class Mistake:
    """The likeliest mistake behind recordings that do not agree with the robot.

    Attributes
    ----------
    name : MistakeName
    axes : tuple of int
        From 1; none where it concerns none in particular.
    detail : str
        Its size with standard error, or its evidence; a clause without subject.
    left : float
        Share of the sum of squares of residuals that remains once it is corrected.
    other : Mistake, optional
        Another one that explains the recordings as well.
    change : ndarray, shape (n_base,), optional
        Of the base parameters once it is corrected; None where that takes other parameters.
    """

    name: MistakeName
    axes: tuple[int, ...]
    detail: str
    left: float
    other: Mistake | None = None
    change: Array | None = field(default=None, compare=False)

    @property
    def remedy(self) -> str:
        """What to do about it; nothing about another that explains the recordings as well."""
        which = "" if self.other is None else "find out which before anything is changed: "
        return which + REMEDIES[self.name]

    def __str__(self) -> str:
        which = " and ".join(map(str, self.axes))
        where = f"axis {which}: " if len(self.axes) == 1 else f"axes {which}: " if which else ""
        other = f"; or {self.other}: the same in these data" if self.other else ""
        return f"{where}{self.detail}{other}"
