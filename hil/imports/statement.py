"""Statement of an import: samples, rate, gaps, velocities, motions, findings.

The explanation (``--explain``) adds the interpretation by joint and the figures of all checks.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from hil.imports.clock import clocks, common_ratio
from hil.imports.misread import FITS, compared
from hil.imports.plausibility import coarse
from hil.runs.journal import FIRST, LAST

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from hil.imports.evidence import Evidence, Excerpt, Suspicion
    from hil.imports.map_file import MapFile
    from hil.imports.stamps import Timing
    from hil.model.robot import Robot
    from hil.planning.free_motion import FreeMotion


def explanation(
    the_map: MapFile, robot: Robot, excerpts: Sequence[Excerpt], evidence: Evidence
) -> tuple[str, ...]:
    """Return lines with the interpretation of the joints, then lines for the checks."""
    joints = (_joint(the_map, robot, evidence, joint) for joint in range(robot.n_joints))
    return (*joints, *_checks(robot, excerpts, evidence))


def _joint(the_map: MapFile, robot: Robot, evidence: Evidence, joint: int) -> str:
    """Describe columns, units, signs and motion of a joint."""
    mapped, unit = the_map.content.joints[joint], robot.position_unit(joint)
    parts = []
    for key in ("position", "velocity", "torque"):
        part = getattr(mapped, key)
        if part is not None:
            sign = " x -1" if part.sign < 0 else ""
            gain = f" x {part.factor:g}" if key == "torque" and not part.unknown else sign
            parts.append(f"{key} {part.column.column} [{part.unit}]{gain}")
    q, tau = evidence.q[:, joint], np.abs(evidence.tau[:, joint]).max()
    does = (
        f"{q.min():.3g} to {q.max():.3g} {unit}, up to"
        f" {np.abs(evidence.qd[:, joint]).max():.3g} {unit}/s"
        if evidence.moves[joint]
        else f"rests at {q.mean():.3g} {unit}"
    )
    if mapped.torque is None:
        return f"joint {joint + 1}: {', '.join(parts)}; {does}, without motor"
    of = mapped.torque.unit if mapped.torque.unknown else robot.torque_unit(joint)
    return f"joint {joint + 1}: {', '.join(parts)}; {does}, up to {tau:.3g} {of}"


def _checks(robot: Robot, excerpts: Sequence[Excerpt], evidence: Evidence) -> Iterator[str]:
    limited = np.fmax(
        np.abs(evidence.qd).max(axis=0) / robot.velocity_limit,
        np.abs(evidence.tau).max(axis=0) / robot.torque_limit,
    )
    ways = np.ptp(evidence.q, axis=0) / (robot.q_max - robot.q_min)
    yield f"check range: motion covers {_each(100 * ways)} % of the ranges"
    if np.isfinite(limited).any():
        yield f"check range: up to {_each(100 * limited)} % of the limits of speed or torque"
    noise = np.max([each.extent.noise for each in excerpts], axis=0)
    over = np.ptp(evidence.q, axis=0) / noise.clip(1e-300)
    yield f"check still: ratio of motion to position noise {_each(over)}"
    shown = compared(evidence)
    if not shown.any():
        yield "check velocity: no recorded velocity above the noise of velocity and position"
    for joint in np.flatnonzero(shown):
        own, other = evidence.recorded_qd[:, joint], evidence.qd[:, joint]
        size = float(np.linalg.norm(own) * np.linalg.norm(other))
        correlation = float(own @ other) / max(size, np.finfo(float).tiny)
        yield (
            f"check velocity: joint {joint + 1} is {float(own @ other / (other @ other)):.4g} times"
            f" the derivative of the position, correlation {correlation:.4f} of at least {FITS}"
        )
    timed = clocks(evidence)
    if timed.any():
        ratio, error = common_ratio(excerpts, evidence, timed)
        yield (
            f"check time: sampling rate by the velocities is {ratio:.4g} times that of the map, "
            f"uncertain by {100 * error:.2g} %"
        )
    poor = [str(joint + 1) for joint in np.flatnonzero(coarse(evidence) & evidence.moves)]
    hidden = f"; accelerations hidden by noise for joint {', '.join(poor)}" if poor else ""
    share = _each(evidence.noise_share.tolist())
    yield f"check velocity: ratio of noise to accelerations {share}{hidden}"


def _each(values: Sequence[float]) -> str:
    return ", ".join("unknown" if not np.isfinite(value) else f"{value:.2g}" for value in values)


_INSTANTS = {
    "even": "equidistant as recorded",
    "counted": "replaced by equidistant ones, which make positions smoother",
    "stamped": "used with resampling by cubics, which makes positions smoother",
}


@dataclass(frozen=True)
class Statement:
    """Findings about the recording of a map.

    Attributes
    ----------
    timing : Timing
        Timing without the stretches, whose arrays are as long as the recording.
    wraps : int
        Number of position steps above half a turn.
    recorded : tuple of bool
        True for joints with a recorded velocity.
    suspicions : tuple of Suspicion
        Suspicions accepted by the map, and uncertain ones.
    notes : tuple of str
        Notes on files as a whole.
    explanation : tuple of str
        Interpretation of the joints, and the figures of the checks.
    """

    the_map: MapFile
    timing: Timing
    wraps: int
    recorded: tuple[bool, ...]
    motions: tuple[FreeMotion, ...]
    suspicions: tuple[Suspicion, ...]
    notes: tuple[str, ...] = ()
    explanation: tuple[str, ...] = ()

    def lines(self) -> list[str]:
        """Return the findings as sentences."""
        return [
            *self._samples(),
            *self.notes,
            *self._left_out(),
            *self._velocities(),
            *self._gains(),
            self._motions(),
            *(
                f"{self.the_map.named(s.location)}: {self.the_map.worded(s.message)}"
                for s in self.suspicions
            ),
        ]

    @property
    def doubts(self) -> tuple[Suspicion, ...]:
        """Suspicions not accepted by the map, the gravest first."""
        accepted = self.the_map.content.accept
        left = (each for each in self.suspicions if each.check not in accepted)
        return tuple(sorted(left, key=lambda each: each.gravity))

    @property
    def warnings(self) -> tuple[str, ...]:
        """Doubts with the line of the map and the remedy."""
        return tuple(
            f"{self.the_map.wrong(s.location, s.message)};"
            f" {FIRST if s.first else LAST if s.last else 'correct the map'}, or write accept:"
            f" [{s.check}] at the"
            " top level of the map if this is correct, and import again"
            for s in self.doubts
        )

    def _samples(self) -> Iterator[str]:
        timing, counts = self.timing, self.timing.counts
        files = ", ".join(self.the_map.content.files)
        yield (
            f"{files}: {counts.rows} rows at {1 / timing.period:.5g} Hz, jitter "
            f"{1e3 * counts.jitter:.2g} ms; time stamps {_INSTANTS[timing.instants]}"
        )

    def _left_out(self) -> Iterator[str]:
        counts = self.timing.counts
        if counts.held > 1:
            yield (
                f"held samples: each position repeats over {counts.held} rows; {counts.repeated} "
                "repeated rows are left out"
            )
        gaps, short = f"{counts.lost:.3g} s in all", f"{counts.short_time:.3g} s in all"
        for number, one, many in (
            (counts.missing, "row lacks a number", "rows lack a number"),
            (counts.doubled, "row has a duplicate time stamp", "rows have duplicate time stamps"),
            (counts.at_rate.surplus, *self._surplus()),
            (counts.repeating, *self._repeating()),
            (counts.disordered, "row was out of order in time", "rows were out of order in time"),
            (self.wraps, "jump of a whole turn is removed", "jumps of whole turns are removed"),
            (counts.bridged, "missing sample is interpolated", "missing samples are interpolated"),
            (counts.gaps, f"gap, {gaps}, is left out", f"gaps, {gaps}, are left out"),
            (counts.short, f"stretch is too short, {short}", f"stretches are too short, {short}"),
        ):
            if number:
                yield f"{number} {one if number == 1 else many}"

    def _repeating(self) -> tuple[str, str]:
        """Return words for repeated rows, singular and plural."""
        counts = self.timing.counts
        first = f"the row before in all columns, from row {counts.first_repeating} on"
        rest = f"{first}, and count as missing"
        return f"row repeats {rest}", f"rows repeat {rest}"

    def _surplus(self) -> tuple[str, str]:
        """Return words for rows written twice, singular and plural."""
        first = self.timing.counts.at_rate.first_surplus
        rest = (
            f"written twice, from row {first} on, as the next step of the moving joints is an "
            "ordinary one; left out"
        )
        return f"row is {rest}", f"rows are {rest}"

    def _velocities(self) -> Iterator[str]:
        joints = [joint for joint, recorded in enumerate(self.recorded, start=1) if recorded]
        if joints:
            which = _joints(joints, len(self.recorded))
            yield f"velocity of {which} was recorded; identification states whether it is used"

    def _gains(self) -> Iterator[str]:
        joints = [joint + 1 for joint in self.the_map.unknown_gains]
        if joints:
            torques = [self.the_map.content.joints[joint - 1].torque for joint in joints]
            units = {torque.unit for torque in torques if torque}
            yield (
                f"gain of {_joints(joints, len(self.recorded))} unknown: torques stay in"
                f" {', '.join(sorted(units))}, and hil identify finds the gain with the parameters"
            )

    def _motions(self) -> str:
        seconds = sum(motion.duration for motion in self.motions)
        parts = sum(motion.cycles for motion in self.motions)
        alone = self.motions[0].alone
        what = "blocks" if alone is None else f"pairs of strokes of joint {alone}"
        first, last = self.motions[0].id, self.motions[-1].id
        ids = first if len(self.motions) == 1 else f"{first} to {last}"
        plural = "s" if len(self.motions) > 1 else ""
        return f"{len(self.motions)} motion{plural}, {ids}: {seconds:.4g} s in {parts} {what}"


def _joints(joints: Sequence[int], of: int) -> str:
    if len(joints) == of:
        return "all joints" if of > 1 else "joint 1"
    return f"joint{'s' * (len(joints) > 1)} {', '.join(map(str, joints))}"
