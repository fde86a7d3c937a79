"""Public recordings of real machines; skipped if unavailable."""

from __future__ import annotations

import gzip
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest
from real_recordings import DATA, at_hand
from scipy import signal

from hil.estimation.excluded.proof import changed
from hil.estimation.identify import estimate
from hil.imports.importing import import_recordings
from hil.model.base_parameters import base_parameters
from hil.model.dynamics import inverse_dynamics
from hil.model.robot import Robot
from hil.planning.free_motion import FreeMotion
from hil.results.identification import identify
from hil.results.model import Model
from hil.results.provenance import Provenance
from hil.results.recorded_torque import predict_recording
from hil.runs.pooling import Pooled
from hil.runs.recording import Recording

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

    from hil.estimation.estimate import Estimate
    from hil.runs.run import Run

    Array = NDArray[np.float64]

pytestmark = [at_hand, pytest.mark.usefixtures("skip_causes")]
VOLT = 35.15065188
RATIO = np.array([32.0, 32.0, 45.0, -48.0, 45.0, 32.0])


def table(name: str) -> Array:
    with gzip.open(DATA / name) as file:
        return np.loadtxt(file, delimiter=",", skiprows=1)


def recording(period: float, q: Array, tau: Array) -> tuple[FreeMotion, Recording]:
    n, none = len(q), np.full(len(q), -1, np.int16)
    motion = FreeMotion(id="r", q=tuple(q.mean(axis=0)), duration=period * n)
    flags = np.zeros(q.shape, np.uint8)
    return motion, Recording(period * np.arange(n), q, tau, flags, none, none, group=0 * none)


def emps(name: str) -> tuple[FreeMotion, Recording]:
    columns = table(f"emps/{name}.csv.gz")
    return recording(1e-3, columns[:, 1:2], VOLT * columns[:, 3:4])


def tx40() -> tuple[FreeMotion, Recording]:
    turns, sums = np.diag(RATIO), np.diag(RATIO)
    turns[5, 4] = sums[4, 5] = 32.0
    q = table("tx40/pos_read_data.csv.gz") @ np.linalg.inv(turns).T
    return recording(2e-4, q, table("tx40/curr_data.csv.gz") @ sums.T)


def model(robot: str, found: Estimate) -> Model:
    where = Provenance(
        robot=robot, robot_digest="", plan_digest="", measured="", bus="", measurements=1,
        left_out=(), identified="", method=found.method, version="",
    )  # fmt: skip
    return Model(**vars(found), provenance=where)


def test_emps_mass_and_friction_are_the_published_ones_and_the_other_record_is_predicted() -> None:
    found = estimate(Robot.load("emps"), [emps("estimation")], "free motion")
    (axis,) = found.details.axes
    assert found.values[0] == pytest.approx(95.11, rel=0.01)
    assert axis.plain["viscous"].value / axis.speed == pytest.approx(203.5, rel=0.03)
    assert axis.plain["Coulomb"].value == pytest.approx(20.39, rel=0.03)
    assert axis.plain["offset"].value == pytest.approx(-3.165, rel=0.03)
    assert found.details.overall_residual < 0.037
    assert predict_recording(model("emps", found), emps("pulses")[1]).overall < 0.046


def test_tx40_leaves_little_of_the_torque_and_its_mass_matrix_is_positive() -> None:
    found = estimate(Robot.load("staubli-tx40"), [tx40()], "free motion")
    assert found.details.overall_residual < 0.082
    assert found.details.least_inertia > 0
    # 40 base parameters and the coupled motor's inertia; its friction and that of six joints
    assert len(found.values) + 2 * len(found.details.coupled) + 18 == 61


def test_tx40_is_predicted_below_100_hz_at_every_tenth_sample_of_all_speeds() -> None:
    motion, each = tx40()
    found = model(
        "staubli-tx40", estimate(Robot.load("staubli-tx40"), [(motion, each)], "free motion")
    )
    b, a = signal.butter(4, 2 * 100.0 * each.period)
    q, tau = (signal.filtfilt(b, a, x, axis=0) for x in (each.q, each.tau))
    qd = np.gradient(q, each.period, axis=0)
    qdd = np.gradient(qd, each.period, axis=0)
    q, qd, qdd, tau = (x[500:-500:10] for x in (q, qd, qdd, tau))
    left = tau - found.predict(q, qd, qdd)
    assert np.linalg.norm(left) < 0.082 * np.linalg.norm(tau)
    assert (np.linalg.eigvalsh(found.mass_matrix(q[::50])).min(axis=1) > 0).all()


def test_tx40_by_plain_least_squares_leaves_no_more_than_others_found() -> None:
    found = estimate(Robot.load("staubli-tx40"), [tx40()], "least squares")
    assert (found.residual < [3.02, 3.79, 2.38, 0.95, 1.59, 0.99]).all()


def test_a_gain_of_the_tx40_that_is_taken_as_unknown_comes_out_as_it_was() -> None:
    (motion, recording) = tx40()
    unknown = motion.model_copy(update={"unknown_gains": (3,)})
    found = estimate(Robot.load("staubli-tx40"), [(unknown, recording)], "free motion").details
    assert found is not None
    (gain,) = found.gains
    assert gain.standard_error < 0.1
    assert abs(gain.value - 1.0) < 2 * gain.standard_error


def halves(whole: tuple[FreeMotion, Recording]) -> tuple[tuple[FreeMotion, Recording], ...]:
    """Return the first and the second half of a recording, each in four blocks."""
    _, each = whole
    found = []
    for q, tau in zip(np.array_split(each.q, 2), np.array_split(each.tau, 2), strict=True):
        motion, half = recording(each.period, q, tau)
        group = (np.arange(len(q)) * 4 // len(q)).astype(np.int16)
        found.append((motion, replace(half, group=group)))
    return tuple(found)


def test_the_second_half_of_the_tx40_s_motion_shows_no_change_of_the_robot() -> None:
    # axis 5 carries friction of the coupled motor 6 too
    first, second = halves(tx40())
    proof = changed(Robot.load("staubli-tx40"), [first], [second])
    assert proof is not None
    assert proof.found == ()
    assert {each.axis for each in proof.limits if each.cause == "friction"} >= {5}


@pytest.mark.parametrize("delay", [-0.01, 0.01])
def test_a_delay_of_several_times_the_stated_size_is_named(delay: float) -> None:
    before, (motion, after) = halves(emps("estimation"))
    tau = np.interp(after.time - delay, after.time, after.tau[:, 0])[:, np.newaxis]
    proof = changed(Robot.load("emps"), [before], [(motion, replace(after, tau=tau))])
    assert proof is not None
    (found,) = proof.found
    assert found.cause == "torque delay"
    assert found.size == pytest.approx(1e3 * delay, rel=0.05)


def test_no_small_backlash_is_excluded_where_no_change_of_contact_is_located() -> None:
    # a carriage at constant speed needs no force but friction, so its gear may be anywhere
    before, after = halves(emps("estimation"))
    proof = changed(Robot.load("emps"), [before], [after])
    assert proof is not None
    (size,) = (each.size for each in proof.limits if each.cause == "backlash")
    assert size is None or size > 0.1


def test_a_load_on_a_real_arm_is_named_though_its_model_is_not_exact(tmp_path: Path) -> None:
    before, after = (
        import_recordings([DATA / f"ur10/{each}.map.yaml"], tmp_path / each)
        for each in ("train", "val")
    )
    ((motion, each),) = Pooled([after])
    b, a = signal.butter(4, 2 * 10.0 * each.period)
    q = signal.filtfilt(b, a, each.q, axis=0)
    qd = np.gradient(q, each.period, axis=0)
    free = before.robot.free_links((5,))
    load = np.zeros(len(free.standard_parameters))  # 1 kg, 0.1 m in front of the flange
    for name, value in {"m6": 1.0, "sz6": 0.1, "Ixx6": 0.01, "Iyy6": 0.01}.items():
        load[free.standard_parameters.index(name)] = value
    qdd = np.gradient(qd, each.period, axis=0)
    tau = each.tau + inverse_dynamics(free, base_parameters(free).matrix @ load, q, qd, qdd)
    loaded = [(motion, replace(each, tau=tau))]
    proof = changed(before.robot, Pooled([before]), loaded)
    assert proof is not None
    assert [found.cause for found in proof.found][:1] == ["load"]


ONES = {
    "a joint sensor with zeros": ("lwr4/m1", "lwr4/m2"),
    "motor readings of a cobot": ("rokae/motor_train", "rokae/motor_val"),
    "motor torques with a counterbalance": ("kr300/B", "kr300/C"),
}


@pytest.mark.parametrize("name", ONES)
def test_the_default_leaves_no_more_than_weighted_least_squares(name: str, tmp_path: Path) -> None:
    seen, unseen = (
        import_recordings([DATA / f"{each}.map.yaml"], tmp_path / each.replace("/", "-"))
        for each in ONES[name]
    )
    default, plain = (identify(seen, method) for method in (None, "weighted least squares"))
    for run in (seen, unseen):
        ours, theirs = (left(model, run) for model in (default, plain))
        assert np.linalg.norm(ours) < 1.05 * np.linalg.norm(theirs)
        assert np.median(ours / theirs) < 1.01
        assert not np.flatnonzero(ours > 1.2 * theirs).tolist()


def left(model: Model, run: Run) -> Array:
    """Return the rms residual of a model for each axis of a run [N m]."""
    (measured,) = run
    return np.asarray(
        np.sqrt(np.mean(predict_recording(model, measured.recording).residual ** 2, 0))
    )
