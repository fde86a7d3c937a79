"""Table of causes: possible errors of a robot, its drives, files or recordings.

Each cause has a unit, a usual size, words for a finding, and a remedy. A usual size makes a share
of the torque; for a cause that does not show, this share is all that can be stated.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from hil.model.drive_train_file import USUAL_BOUND

if TYPE_CHECKING:
    from hil.model.robot import Robot

Key = tuple[str, int]
"""Cause and axis, from 0; -1 for a cause of no axis. Names of torque ripple include the order.
"""
FIRST_ORDER = 0.5
"""Largest size described by a first-order column, as a share (of the travel of a prismatic joint)
or in rad. At this size the second term of the series of most causes, such as 1 / (1 + x) of a gain,
is half of the first term."""
LEFT_OUT = (
    "take the load off, or state the missing parameters of that link in the robot file (hil"
    " diagnose ranks the parameters, hil payload finds a load)"
)


def uncertain(size: float, error: float) -> str:
    """Format a size with its standard error, both without exponents below a million."""
    shown = f"{float(f'{size:.3g}'):g}"
    return f"{shown} ± {float(f'{error:.1g}'):g}" if math.isfinite(error) else f"some {shown}"


class Cause(NamedTuple):
    """Row of the table of causes.

    Attributes
    ----------
    words : str
        Finding, before its size; a clause without subject.
    unit : str
        Unit at a revolute joint; ``{torque}`` and ``{position}`` stand for the joint's units.
    slides : str
        Unit at a prismatic joint.
    usual : float
        Usual size, in `unit`; 0 if none is known.
    remedy : str
    whole : bool
        True if the cause makes all parameters useless at any size.
    accounted : bool
        True if an estimate accounts for the cause, where visible.
    least : float
        Least mechanically possible size, in `unit`.
    """

    words: str
    unit: str
    slides: str
    usual: float
    remedy: str
    whole: bool = False
    accounted: bool = False
    least: float = -np.inf

    def unit_of(self, robot: Robot, axis: int) -> str:
        """Return the unit of a cause at an axis, from 0; -1 for a cause of no axis."""
        if axis < 0:
            return self.unit
        unit = self.unit if robot.revolute[axis] else self.slides
        return unit.format(torque=robot.torque_unit(axis), position=robot.position_unit(axis))

    def sized(self, size: float, error: float, unit: str) -> str:
        """Return the words of a cause with size and standard error; "less" for a negative size."""
        words = self.words.replace("greater", "less") if size < 0.0 else self.words
        size = size if words == self.words else -size
        return f"{words} {uncertain(size, error)} {unit}"

    def largest(self, robot: Robot, axis: int, hours: float) -> float:
        """Return the largest size with a valid first-order column, in the cause's unit.

        Parameters
        ----------
        hours : float
            Duration of the recordings, for causes stated per hour.
        """
        unit = self.unit_of(robot, axis)
        shares = {"%": 100.0, "%/h": 100.0 / hours if hours else np.inf, "degrees": 180.0 / np.pi}
        if unit == "mm":
            shares[unit] = 1e3 * float(robot.q_max[axis] - robot.q_min[axis])
        return FIRST_ORDER * shares.get(unit, np.inf)


PERCENT = 100.0 * USUAL_BOUND
CAUSES = {
    "wrong sign of a position": Cause(
        "wrong sign of the position", "", "", 0.0,
        "correct the sign of its position in the map or the drives file", whole=True,
    ),
    "wrong sign of a torque": Cause(
        "wrong sign of the torque", "", "", 0.0,
        "correct the sign of its current in the drives file, or of its torque in the map",
        whole=True,
    ),
    "wrong sign of all torques": Cause(
        "torques of all joints have the wrong sign", "", "", 0.0,
        "correct the sign of all torques in the map, or of all currents in the drives file",
        whole=True,
    ),
    "wrong direction of an axis": Cause(
        "position and torque have the opposite sign", "", "", 0.0,
        "reverse its sign in the drives file or in the map, or its frame in the robot file",
        whole=True,
    ),
    "two axes exchanged": Cause(
        "recordings exchanged", "", "", 0.0,
        "exchange their nodes in the drives file, or their columns in the map", whole=True,
    ),
    "all axes exchanged": Cause(
        "columns in the alphabetical order of the joints' names", "", "", 0.0,
        "name the columns of each joint in the map", whole=True,
    ),
    "two positions exchanged": Cause(
        "positions exchanged", "", "", 0.0,
        "exchange the columns of their positions in the map", whole=True,
    ),
    "two torques exchanged": Cause(
        "torques exchanged", "", "", 0.0,
        "exchange the columns of their torques in the map", whole=True,
    ),
    "no gravity": Cause(
        "gravity is absent from the torques", "", "", 0.0,
        "record torques without gravity compensation (of the motors, not of the controller), or "
        "state gravity: [0, 0, 0] in the robot file if no joint carries weight", whole=True,
    ),
    "sampling rate": Cause(
        "sampling rate greater than stated by", "%", "%", 0.0,
        "correct the rate or the unit of time in the map, or lengths in the robot file",
        whole=True, least=-100.0,
    ),
    "torque at its limit": Cause(
        "torque saturated in many samples", "%", "%", 0.0,
        "measure with lower accelerations, or raise the drive's limit",
    ),
    "load": Cause(
        "a load on the last link, or link parameters missing in the robot file",
        "SI", "SI", 0.0, LEFT_OUT,
    ),
    # usual error: homing by eye or against a stop
    "joint offset": Cause(
        "joint offset error", "degrees", "mm", 0.5,
        "correct zero in the drives file (hil drives home), offset in the map, or theta in the "
        "robot file",
    ),
    "torque constant": Cause(
        "torque constant greater than stated by", "%", "%", PERCENT,
        "correct torque_constant in robot file and drives file (in a map its unit or gain), and "
        "check whether currents are rms or peak values", least=-100.0,
    ),
    "torques of all axes": Cause(
        "torque constants of all axes greater than stated by", "%", "%", PERCENT,
        "weigh a known mass (hil payload --mass); correct the unit or the gain of all torques",
        least=-100.0,
    ),
    # usual error: numbers of teeth are exact; an error by one tooth is 1 in 100
    "gear ratio": Cause(
        "gear ratio greater than stated by", "%", "%", 1.0,
        "correct its gear_ratio in robot file and drives file", least=-100.0,
    ),
    "position scale": Cause(
        "position scale greater than stated by", "%", "%", 1.0,
        "correct the unit or the increments per revolution of its position", least=-100.0,
    ),
    "rotor inertia": Cause(
        "rotor inertia greater than stated by", "%", "%", PERCENT,
        "correct rotor_inertia in the robot file; brake and coupling are part of it",
        least=-100.0,
    ),
    # usual drift: NdFeB loses 0.11 % of its flux per kelvin; motors warm by some 20 K in an hour
    "drift of torque constant": Cause(
        "torque constant drifts by", "%/h", "%/h", 2.2,
        "let the motors reach their temperature before measuring (magnets weaken as they warm), "
        "and check the current sensor for drift",
    ),
    "slip": Cause(
        "coupling slipped by", "degrees", "mm", 0.0,
        "fasten the coupling, home the axis and measure again",
    ),
    # usual tilt: mounting plates levelled by a spirit level, 1 mm/m, on a floor
    "gravity": Cause(
        "gravity direction error", "degrees", "degrees", 0.1,
        "correct gravity in the robot file according to the mounting of the base",
    ),
    "spring": Cause(
        "torque grows with position by", "{torque}/{position}", "{torque}/{position}", 0.0,
        "add a spring to the robot file, or remove the cause (a cable, a hose, a balancer); if the "
        "motor turns with another joint too (a parallelogram drive), state couplings in the robot "
        "file",
    ),
    "torque ripple": Cause(
        "torque ripple with an amplitude of", "{torque}", "{torque}", 0.0,
        "look for a part that rubs or meshes at this order (gear, bearing, cable); no base "
        "parameter describes torque ripple",
    ),
    "friction": Cause(
        "friction, apart from a change common to all axes, greater by", "%", "%", 0.0,
        "identify friction anew; look at bearing, gear, seal, lubricant and brake", accounted=True,
    ),
    "friction of the load": Cause(
        "friction grows with the transmitted torque by", "%", "%", 0.0,
        "no action: the estimate fits this term where held-out recordings show it", accounted=True,
        least=0.0,
    ),
    # usual delay: one cycle of a current controller
    "torque delay": Cause(
        "torque delay", "ms", "ms", 1.0,
        "record torque and position at the same instant, or shift the torque column by the delay",
    ),
    "position delay": Cause(
        "position delay", "ms", "ms", 1.0,
        "record positions of all axes at the same instant",
    ),
    # usual backlash: one arc minute, as data sheets of precision gears state
    "backlash": Cause(
        "half-width of the gear backlash", "degrees", "mm", 1 / 120,
        "no action: link and motor positions differ by at most the half-width",
        least=0.0,
    ),
    # from here on, parts of the estimate's own error (see `effects`)
    "soft gears": Cause(
        "", "", "", 0.0,
        "no action: link positions include the gears' elastic twist; a simulator or a "
        "feed-forward needs the compliances too", accounted=True,
    ),
    "friction that differs by direction": Cause(
        "", "", "", 0.0,
        "no action: the difference is fitted; only the published method's result is biased",
        accounted=True,
    ),
    "torque ripple of further orders": Cause(
        "", "", "", 0.0, "measure strokes at higher speeds, at which ripple averages out",
    ),
    "coarse encoders": Cause(
        "", "", "", 0.0, "use encoders of higher resolution, or measure longer",
    ),
    "slow SYNC": Cause(
        "", "", "", 0.0,
        "state a shorter SYNC period in both drives file and plan, or measure longer",
    ),
    "weak excitation": Cause(
        "", "", "", 0.0,
        "measure motions of more joints through more of their ranges (hil plan, with --kind"
        " trajectory too)",
    ),
    "measurements that disagree": Cause(
        "", "", "", 0.0,
        "look for differences between the measurements of an axis: contact, warming up, torque "
        "ripple",
    ),
    "unknown": Cause(
        "", "", "", 0.0,
        "look for differences between the measurements: a contact, a changed load, an altered "
        "machine",
    ),
}  # fmt: skip
"""All causes by name, most harmful first: of causes that data do not distinguish, the first is
named first. A load precedes a joint offset: homing an axis that only carries a load would spoil a
correct offset.
"""
FITTED = ("torque delay", "soft gears")
"""Causes fitted and accounted for by every estimate, and fitted together with tested causes."""
SHOWN_BY = {
    "load": "two runs, without and with the load, would show it (hil payload)",
    "joint offset": "base parameters absorb the offset, without any change of predicted torques",
    "torque constant": "a known mass on the flange would show it (hil payload --mass)",
    "torques of all axes": "a known mass on the flange would show it (hil payload --mass)",
    "rotor inertia": "a load of known inertia, or the motor's data sheet, would show the error",
    "gear ratio": "count the gear's teeth, or rotate the joint by a known angle",
    "position scale": "turn the joint by a known angle",
}
"""Evidence for causes within the span of base parameters, friction or other columns."""
