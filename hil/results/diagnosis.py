"""What a run tells against its robot file: left-out parameters, needless ones, Fig. 7.

The paper reads a left-out centre of mass from a phase: the gravity torque of one axis over the
angle of another is a sinusoid, and the measured one is shifted against the modelled one (Fig. 7).
Gravity is linear in the sine and cosine of each joint angle, so the phase follows from the torque
at three angles. For a significant candidate the pair of axes is shown whose phase it moves most,
at the measured configuration where the stated model's sinusoid is largest.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure

from drivers.yaml_file import FileError
from hil.estimation.identification import NotIdentifiable, estimate
from hil.estimation.model_errors import examine
from hil.estimation.signals import signals
from hil.measuring.atomic_file import write_file
from hil.measuring.run_folder import RunFolder
from hil.model.dynamics import gravity_torque
from hil.planning.trajectory import Trajectory
from hil.results.model_file import recorded
from hil.results.plot_style import MEASURED, MODEL, WIDTH, drawn, image, legend, panels_in_rows

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

    from hil.estimation.estimate import Estimate
    from hil.estimation.local_fits import LocalValue
    from hil.estimation.model_errors import ModelErrors
    from hil.model.robot import Robot

    Array = NDArray[np.float64]

_SMALL = 0.5
"""Amplitude below which a sinusoid is no place to read a phase [N m]."""


@dataclass(frozen=True, slots=True, eq=False)
class Phase:
    """Shift of a gravity torque's sinusoid by what the robot file leaves out.

    Attributes
    ----------
    axis, over : int
        Axis whose torque it is, axis whose angle it is drawn over; from 0.
    q : ndarray, shape (n_joints,)
        Configuration; that of `over` is varied [rad].
    shift : float
        Phase of the extended model less that of the stated one [rad].
    """

    axis: int
    over: int
    q: Array
    shift: float


@dataclass(frozen=True, slots=True, eq=False)
class Diagnosis:
    """Findings of one run; `phase` is None where nothing significant is left out."""

    robot: Robot
    estimate: Estimate
    errors: ModelErrors
    phase: Phase | None


def diagnose(run_folder: Path) -> Diagnosis:
    """Estimate a run anew and test its robot file.

    Raises
    ------
    FileError
        Measurements that do not suffice.
    """
    folder = RunFolder.open(run_folder)
    recordings = list(recorded(folder))
    try:
        best = estimate(folder.robot, recordings)
    except NotIdentifiable as error:
        raise FileError(f"{folder.path}: {error}") from error
    used = {value.id for value in best.local}
    prepared = [
        (measurement, signals(recording).torque_advanced(best.lag))
        for measurement, recording in recordings
        if measurement.id in used and not isinstance(measurement, Trajectory)
    ]
    errors = examine(folder.robot, prepared)
    return Diagnosis(folder.robot, best, errors, _phase(best, errors) if errors.found else None)


def write_plots(run_folder: Path, found: Diagnosis) -> Path:
    """Draw residuals and, where there is one, the shifted sinusoid; return the folder."""
    place = run_folder / "diagnosis"
    place.mkdir(exist_ok=True)
    with drawn():
        write_file(place / "residuals.svg", image(residuals_over_angles(found), "svg"))
        if found.phase is not None:
            write_file(place / "phase.svg", image(shifted_sinusoid(found, found.phase), "svg"))
    ranking = [[c.label, c.value, c.standard_error, c.p_value] for c in found.errors.alone]
    write_file(place / "candidates.json", json.dumps(ranking, indent=1).encode())
    return place


def residuals_over_angles(found: Diagnosis) -> Figure:
    """Gravity torques measured less modelled, of every axis against every joint angle."""
    values = [v for v in found.estimate.local if v.kind == "gravity"]
    axes, joints = sorted({v.axis for v in values}), range(found.robot.n_joints)
    figure = Figure(figsize=(WIDTH, 0.4 + 1.6 * len(axes)))
    panels = figure.subplots(len(axes), len(joints), squeeze=False, sharey="row")
    for axis, row in zip(axes, panels, strict=True):
        own = [v for v in values if v.axis == axis]
        for joint, panel in zip(joints, row, strict=True):
            panel.errorbar(np.degrees([v.q[joint] for v in own]), [v.value - v.model for v in own],
                           2 * np.nan_to_num([v.standard_error for v in own]), fmt="x",
                           color=MEASURED, markersize=3.5, elinewidth=0.7)  # fmt: skip
            panel.axhline(0.0, color=MODEL, linewidth=0.9)
            if axis == axes[-1]:
                panel.set_xlabel(f"q{joint + 1} [deg]")
        row[0].set_ylabel(f"Δ g{axis + 1} [N m]")
    figure.subplots_adjust(left=0.07, right=0.99, bottom=0.1, top=0.97, wspace=0.12, hspace=0.35)
    return figure


def shifted_sinusoid(found: Diagnosis, phase: Phase) -> Figure:
    """The paper's Fig. 7: stated and extended model, measurements brought to this configuration.

    A measurement at another configuration is drawn as the extended model here, plus what the
    extended model leaves of it there.
    """
    figure, [(panel,)] = panels_in_rows(1, height=3.2)
    angle = np.linspace(-np.pi, np.pi, 181)
    q = np.tile(phase.q, (len(angle), 1))
    q[:, phase.over] = angle
    stated, extended = (_torque(found.errors, q, phase.axis, p) for p in _models(found.errors))
    degrees = np.degrees(angle)
    panel.plot(degrees, stated, color=MODEL, linewidth=1.2, label="robot file")
    label = f"with {', '.join(c.label for c in found.errors.found)}"
    panel.plot(degrees, extended, color=MEASURED, linewidth=1.2, label=label)
    values = [v for v in found.estimate.local if v.kind == "gravity" and v.axis == phase.axis]
    level = [_brought_here(found.errors, value, phase) for value in values]
    panel.plot(np.degrees([v.q[phase.over] for v in values]), level, "x", color=MEASURED,
               markersize=4.5, label="measured")  # fmt: skip
    panel.set_xlabel(f"$q_{{{phase.over + 1}}}$ [deg]")
    panel.set_ylabel(f"$g_{{{phase.axis + 1}}}$ [N m]")
    legend(figure, panel)
    return figure


def _brought_here(errors: ModelErrors, value: LocalValue, phase: Phase) -> float:
    """Extended model at the phase's configuration plus the measurement's own residual."""
    extended, stated = _models(errors)[1], _models(errors)[0]
    here = phase.q.copy()
    here[phase.over] = value.q[phase.over]
    there = np.array([value.q])
    shifted = _torque(errors, there, phase.axis, extended - stated)[0]
    left = value.value - value.model - shifted
    return float(_torque(errors, here[np.newaxis], phase.axis, extended)[0] + left)


def _phase(best: Estimate, errors: ModelErrors) -> Phase:
    """The pair of axes whose phase is moved most."""
    candidates = []
    local = [v for v in best.local if v.kind == "gravity"]
    for axis in sorted({v.axis for v in local}):
        for over in range(errors.complete.n_joints):
            shown = [_shift(errors, v.q, axis, over) for v in local]
            largest = max(size for size, _ in shown)
            k = int(np.argmax([size for size, _ in shown]))
            candidates.append((largest, Phase(axis, over, local[k].q.copy(), shown[k][1])))
    clear = [phase for size, phase in candidates if size > _SMALL and phase.over != phase.axis]
    return max(clear or [phase for _, phase in candidates], key=lambda phase: abs(phase.shift))


def _shift(errors: ModelErrors, q: Array, axis: int, over: int) -> tuple[float, float]:
    """Amplitude of the stated sinusoid over one angle, and the extended one's phase against it."""
    turned = np.tile(q, (3, 1))
    turned[:, over] = [0.0, np.pi / 2, np.pi]
    phasors = []
    for p in _models(errors):
        zero, quarter, half = _torque(errors, turned, axis, p)
        phasors.append(complex((zero - half) / 2, quarter - (zero + half) / 2))
    stated, extended = phasors
    shift = float(np.angle(extended / stated)) if abs(stated) > 0 else 0.0
    return abs(stated), shift


def _models(errors: ModelErrors) -> tuple[Array, Array]:
    """Base parameters of the complete robot: as the file states it, and with what was found."""
    return errors.stated @ errors.p, errors.p_all


def _torque(errors: ModelErrors, q: Array, axis: int, p: Array) -> Array:
    torque: Array = gravity_torque(errors.complete, p, q)[:, axis]
    return torque
