"""Interpretation of a recording by joint, and the figures of all checks."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from hil.imports.clock import clocks, common_ratio
from hil.imports.misread import FITS, compared
from hil.imports.plausibility import coarse

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from hil.imports.evidence import Evidence, Excerpt
    from hil.imports.map_file import MapFile
    from hil.model.robot import Robot


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
    of = mapped.torque.unit if mapped.torque.unknown else robot.torque_unit(joint)
    return f"joint {joint + 1}: {', '.join(parts)}; {does}, up to {tau:.3g} {of}"


def _checks(robot: Robot, excerpts: Sequence[Excerpt], evidence: Evidence) -> Iterator[str]:
    limited = np.fmax(
        np.abs(evidence.qd).max(axis=0) / robot.velocity_limit,
        np.abs(evidence.tau).max(axis=0) / robot.torque_limit,
    )
    ways = np.ptp(evidence.q, axis=0) / (robot.q_max - robot.q_min)
    yield f"check range: motion over {_each(100 * ways)} % of the ranges"
    if np.isfinite(limited).any():
        yield f"check range: up to {_each(100 * limited)} % of the limits of speed or torque"
    noise = np.max([each.extent.noise for each in excerpts], axis=0)
    over = np.ptp(evidence.q, axis=0) / noise.clip(1e-300)
    yield f"check still: motion over position noise {_each(over)}"
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
    power = np.sqrt(np.mean(evidence.qdd**2, axis=0))
    poor = [str(joint + 1) for joint in np.flatnonzero(coarse(evidence) & evidence.moves)]
    hidden = f"; hidden for joint {', '.join(poor)}" if poor else ""
    share = evidence.noise_qdd / power.clip(1e-300)
    yield f"check velocity: noise over accelerations {_each(share)}{hidden}"


def _each(values: Sequence[float]) -> str:
    return ", ".join("unknown" if not np.isfinite(value) else f"{value:.2g}" for value in values)
