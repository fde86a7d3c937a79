"""`hil payload measure`: a load in minutes from slow, then faster
motion, with a run without load.
"""

from dataclasses import replace

import numpy as np
import pytest
from small_run import COUNTS, NOISE, SIMULATED
from synthetic import TABLE_3_A, Friction, record

from drivers.drive_bus import AxisInfo
from hil import cli
from hil.cli.payload import LEAST_MINUTES
from hil.commands.payload import advised, unsure, verdict
from hil.errors import InvalidValue, Mismatch, NoLoad, NotEnoughData
from hil.model.base_parameters import base_parameters
from hil.model.robot import Robot
from hil.planning.design.by_counts import design
from hil.planning.design.load import (
    HOLD,
    SLOW_SHARE,
    fast_plan,
    feasible_options,
    helpful_poses,
    load_capacity,
    slow_plan,
)
from hil.planning.plan import PlannedRobot, dump_plan, load_plan
from hil.planning.timetable import timetable
from hil.results.load import (
    BareRun,
    LoadFit,
    estimate_load,
    find_load,
    require_load,
)
from hil.results.load_file import NAME, write_load
from hil.runs.journal import axis_records
from hil.runs.recording_file import Measured
from hil.runs.run import Run
from hil.runs.run_folder import RunFolder

MASS, DISTANCE = 10.86, 0.14
LOAD = {"m6": MASS, "sz6": MASS * DISTANCE, "Ixx6": 0.2387, "Iyy6": 0.2387, "Izz6": 0.047}
MINUTES = 3.0


@pytest.fixture(scope="module")
def robot():
    return Robot.load("manutec-r15")


@pytest.fixture(scope="module")
def bare(robot, tmp_path_factory):
    path = tmp_path_factory.mktemp("load") / "bare"
    return BareRun(carried_out(path, design(robot, COUNTS), robot, TABLE_3_A, seed=1))


def loaded_parameters(robot):
    return TABLE_3_A + base_parameters(robot).matrix[:, -10:] @ load_of(robot)


def load_of(robot):
    return np.array([LOAD.get(name, 0.0) for name in robot.standard_parameters])[-10:]


def carried_out(path, plan, robot, p, seed=7, machine=None):
    """Return a run of `plan` by a machine with base parameters `p`, common or per measurement.

    Offsets differ between seeds. `machine` may have parameters that `robot` lacks.
    """
    p = np.broadcast_to(p, (len(plan.measurements), np.shape(p)[-1]))
    folder = RunFolder.create(path, plan, robot)
    rng, begin = np.random.default_rng(seed), 0.0
    offset = np.array([1.0, -1.0, 0.4, -0.3, 0.2, 0.1]) * rng.uniform(0.5, 1.5, 6)
    friction = Friction(coulomb=2.0, viscous=0.3, root=0.3, growth=2e-4, offset=offset)
    with folder.session(SIMULATED) as session:
        axes = [
            AxisInfo(f"joint {n}", f"drive no. {n}", -3.0, 3.0, 3.0, 99.0, 0.1, 1e-5)
            for n in range(1, 7)
        ]
        folder.keep(axes=axis_records(axes))
        for measurement, own in zip(plan.measurements, p, strict=True):
            recording = record(
                machine or robot, measurement, own, friction, begin=begin, noise=NOISE, rng=rng
            )
            folder.write(Measured(measurement, recording, session=session))
            begin = float(recording.time[-1]) + 1.0
    return Run.open(path)


def lasts(plan, robot):
    return sum(each.travel + each.duration for each in timetable(plan, robot, plan.measurements))


@pytest.fixture(scope="module")
def slow(bare):
    return slow_plan(bare.known, MINUTES)


@pytest.fixture(scope="module")
def stages(bare, slow, robot, tmp_path_factory):
    """Both runs with the load, and the plan of the second."""
    place, p = tmp_path_factory.mktemp("stages"), loaded_parameters(robot)
    first = carried_out(place / "slow", slow, robot, p)
    fast = fast_plan(bare.known, MINUTES, slow, estimate_load(bare, [first]))
    return [first, carried_out(place / "fast", fast, robot, p, seed=8)], fast


@pytest.fixture(scope="module")
def found(bare, stages):
    return find_load(bare, stages[0])


def test_slow_strokes_come_first_and_all_of_it_takes_the_time_that_it_may(
    robot, bare, slow, stages
):
    _, fast = stages
    assert {m.kind for m in slow.measurements} == {"gravity"}
    assert "inertia" in {m.kind for m in fast.measurements}
    assert 30.0 < lasts(slow, robot) <= 60 * MINUTES * SLOW_SHARE
    assert 120.0 < lasts(slow, robot) + lasts(fast, robot) <= 60 * MINUTES
    known = bare.known
    first, both = (
        np.linalg.inv(known.load_information(known.before(feasible_options(known), plans)))
        for plans in ((slow,), (slow, fast))
    )
    assert np.all(np.diag(both) < np.diag(first))


def test_no_axis_is_to_give_more_than_it_holds_with_the_load_found(robot, bare, stages):
    worst = max(bare.known.strain(m, [load_of(robot)]) for m in stages[1].measurements)
    assert 0.3 < worst <= HOLD


def test_the_load_is_found_and_stated_with_intervals(found):
    figures = {q.name: q for q in found.quantities()}
    truth = {"mass": MASS, "centre z": DISTANCE, "Izz": LOAD["Izz6"], "Ixx": LOAD["Ixx6"]}
    for name, value in truth.items():
        assert abs(figures[name].value - value) < 1.5 * figures[name].half_width, name
    assert figures["mass"].value == pytest.approx(MASS, rel=2e-3)
    assert figures["centre z"].value == pytest.approx(DISTANCE, abs=1e-3)
    assert figures["mass"].half_width < 0.01 * MASS
    assert verdict(found)[0].startswith("mass 10.8")
    assert " ± " in verdict(found)[0]
    assert "taken as zero: Ixy, Ixz, Iyz, sx, sy" in verdict(found)[-1]


def test_slow_strokes_alone_leave_the_inertia_about_the_flange_rough_or_open(bare, stages):
    lines = "\n".join(verdict(find_load(bare, stages[0][:1])))
    assert "imprecise: " in lines or "not identifiable: " in lines
    assert "Izz" in lines


def test_a_load_that_is_rigid_is_said_to_be(found):
    assert not found.is_loose
    said = verdict(found)[1]
    assert said.startswith("rigid and fixed, as far as axes ")
    # Ixx changes with a sag by twice the first moment
    (half,) = (q.half_width for q in found.quantities() if q.name == "Ixx")
    assert (
        f"sag of the centre of mass up to {1e3 * 2.108 * half / (2 * MASS * DISTANCE):.2g} mm"
        in said
    )


@pytest.fixture(scope="module")
def eccentric(bare, stages, robot, tmp_path_factory):
    """Return the estimate of an eccentric load, with its first moments and mass."""
    machine = robot.free_links([robot.n_joints - 1])
    mass, centre = 4.0, np.array([0.06, -0.03, 0.1])
    about = mass * (centre @ centre * np.eye(3) - np.outer(centre, centre)) + 0.01 * np.eye(3)
    load = {"m6": mass, "sx6": mass * 0.06, "sy6": mass * -0.03, "sz6": mass * 0.1,
            "Ixx6": about[0, 0], "Iyy6": about[1, 1], "Izz6": about[2, 2],
            "Ixy6": about[0, 1], "Ixz6": about[0, 2], "Iyz6": about[1, 2]}  # fmt: skip
    K = base_parameters(machine).matrix
    phi = np.array([load.get(name, 0.0) for name in machine.standard_parameters])
    p = K @ (base_parameters(robot).placement @ TABLE_3_A + phi)
    place = tmp_path_factory.mktemp("beside")
    runs = [
        carried_out(place / name, run.planned, robot, p, seed, machine)
        for name, run, seed in zip(("slow", "fast"), stages[0], (17, 18), strict=True)
    ]
    return find_load(bare, runs), runs


def test_a_load_beside_the_axis_is_rigid_and_found_with_its_centre(bare, eccentric, tmp_path):
    found, runs = eccentric
    figures = {q.name: q for q in found.quantities()}
    assert not found.is_loose
    assert found.unseen == ()
    truth = {"mass": 4.0, "centre x": 0.06, "centre y": -0.03, "centre z": 0.1}
    for name, value in truth.items():
        assert abs(figures[name].value - value) < 1.5 * figures[name].half_width, name
    assert figures["mass"].half_width < 0.05 * 4.0
    assert (
        write_load(tmp_path, bare.run, runs, LoadFit(bare.run.robot, found), verdict(found)).unseen
        == ()
    )


def test_an_inertia_that_no_body_has_is_doubted(eccentric):
    found, _ = eccentric
    phi = found.phi.copy()
    phi[1] += 20 * np.sqrt(found.covariance[1, 1]) + 0.1  # Ixy
    strange = replace(found, phi=phi)
    assert strange.is_loose
    assert "the inertia found is physically impossible" in verdict(strange)[1]


def test_a_load_on_the_axis_is_not_taken_for_one_beside_it(found):
    assert set(found.unseen) == {"Ixy", "Ixz", "Iyz", "sx", "sy"}


def test_a_load_that_gives_way_is_named_and_no_more_than_that_advised(
    bare, stages, robot, tmp_path
):
    plan = stages[1]
    K = loaded_parameters(robot) - TABLE_3_A
    sags = np.random.default_rng(2).uniform(-0.03, 0.03, (len(plan.measurements), 1))
    run = carried_out(tmp_path / "loose", plan, robot, TABLE_3_A + (1 + sags) * K)
    found = find_load(bare, [stages[0][0], run])
    assert found.is_loose
    lines = verdict(found)
    assert lines[1].startswith("load not rigid, not fixed, or friction changed: ")
    assert "fasten the load" in lines[1]
    assert not any(line.startswith("rough") for line in lines)


def test_the_pose_that_would_help_is_named_and_helps(bare, stages, slow):
    found = find_load(bare, stages[0][:1])
    poses = helpful_poses(bare.known, [slow], found, unsure(found))
    assert set(poses) == set(unsure(found)) != set()
    lines = "\n".join(verdict(found, advised(bare.known, [slow], found)))
    for name, pose in poses.items():
        assert pose.share < 0.5, name
        assert f"axis {pose.axis}" in lines
    held = [pose for pose in poses.values() if pose.position is not None]
    for pose in held:
        assert f"--pose axis{pose.axis}={np.degrees(pose.position):.0f}" in lines


def test_a_pose_is_held_in_all_measurements(bare, slow, found):
    stated = ((4, np.pi / 2),)
    for plan in (
        slow_plan(bare.known, MINUTES, poses=stated),
        fast_plan(bare.known, MINUTES, slow, found, stated),
    ):
        assert all(m.q[4] == pytest.approx(np.pi / 2, abs=1e-6) for m in plan.measurements)
        assert all(4 not in m.moved for m in plan.measurements)


def test_plans_with_a_load_are_read_back_as_they_were_written(bare, slow, found, tmp_path):
    heavy = replace(found, phi=2.0 * found.phi)
    for number, plan in enumerate((
        slow_plan(bare.known, MINUTES, 15.0, poses=((4, np.pi / 2),)),
        fast_plan(bare.known, MINUTES, slow, heavy),
    )):  # fmt: skip
        file = tmp_path / f"{number}.yaml"
        file.write_text(dump_plan(plan))
        assert load_plan(file).digest == plan.digest


def test_a_pose_out_of_range_is_refused(bare):
    with pytest.raises(InvalidValue, match=r"axis 5 at 9 must be within .* rad"):
        slow_plan(bare.known, MINUTES, poses=((4, 9.0),))


def test_a_mass_that_slow_strokes_leave_open_is_not_moved_fast(bare, slow, found):
    with pytest.raises(NotEnoughData, match="do not identify the mass of the load"):
        fast_plan(bare.known, MINUTES, slow, replace(found, unidentifiable=("m",)))


def test_a_stated_mass_is_held(bare, stages):
    found = find_load(bare, stages[0], MASS)
    assert found.phi[9] == MASS
    assert verdict(found)[0].startswith("mass 10.86 kg as stated; ")
    assert found.quantities()[2].value == pytest.approx(DISTANCE, abs=5e-4)


def test_a_stated_mass_that_contradicts_is_refused(bare, stages):
    with pytest.raises(Mismatch, match=r"a mass of 12 kg contradicts 10\.8.* correct the mass"):
        find_load(bare, stages[0], 12.0)


def test_no_load_is_refused(bare, slow, robot, tmp_path):
    run = carried_out(tmp_path / "none", slow, robot, TABLE_3_A)
    with pytest.raises(NoLoad, match="load not significant"):
        find_load(bare, [run])


def test_runs_that_are_swapped_are_refused(found):
    with pytest.raises(NoLoad, match=r"would be -10\.8.*swapped"):
        require_load(replace(found, phi=-found.phi))


def test_the_run_without_the_load_is_none_with_it(bare):
    with pytest.raises(Mismatch, match="has the same recordings"):
        find_load(bare, [bare.run])


def test_runs_of_another_robot_are_refused(bare, slow, robot, tmp_path):
    other = tmp_path / "other.yaml"
    other.write_text(robot.text.replace("name: manutec-r15", "name: another"))
    another = Robot.load(other)
    plan = slow.model_copy(update={"robot": PlannedRobot(name=another.name, digest=another.digest)})
    run = carried_out(tmp_path / "run", plan, another, TABLE_3_A)
    with pytest.raises(Mismatch, match="another robot file"):
        find_load(bare, [run])


def test_a_load_that_no_pose_holds_is_refused_beforehand(bare):
    with pytest.raises(InvalidValue, match=r"a load of 500 kg, .* overloads an axis"):
        slow_plan(bare.known, MINUTES, 500.0)


def test_poses_hold_the_heaviest_load_that_was_stated(bare):
    assert load_capacity(bare.known, slow_plan(bare.known, MINUTES, 15.0)) >= 15.0


def test_a_load_that_overloads_an_axis_is_not_moved_faster(bare, slow, found):
    heavy = replace(found, phi=50 * found.phi)
    with pytest.raises(NotEnoughData, match="this load overloads an axis"):
        fast_plan(bare.known, MINUTES, slow, heavy)


def test_a_heavier_load_is_moved_more_slowly_or_less(robot, bare, slow, found):
    plan = fast_plan(bare.known, MINUTES, slow, replace(found, phi=2 * found.phi))
    twice = 2 * load_of(robot)
    assert max(bare.known.strain(m, [twice]) for m in plan.measurements) <= HOLD


def test_what_was_found_is_kept(bare, stages, found, tmp_path):
    kept = write_load(tmp_path, bare.run, stages[0], LoadFit(bare.run.robot, found), verdict(found))
    assert (tmp_path / NAME).exists()
    assert kept.verdict[0] == verdict(found)[0]
    assert kept.rigidity == found.misfit
    assert kept.load[0].half_width == pytest.approx(found.mass.half_width)
    assert all(
        (tmp_path / each.folder / "run.json").exists() for each in (kept.without, *kept.loaded)
    )


def refusal(capsys, *arguments):
    with pytest.raises(SystemExit) as ended:
        cli.main([str(each) for each in ("payload", "measure", *arguments)])
    assert ended.value.code
    return capsys.readouterr().err


@pytest.mark.parametrize("pose", ["5=90", "axis7=0", "axis5", "axis5=ninety"])
def test_a_pose_that_is_none_is_refused(bare, tmp_path, pose, capsys):
    said = refusal(capsys, "--model", bare.run.path, "-o", tmp_path / "load", "--pose", pose)
    assert "must be axis1 to axis6" in said


def test_the_folder_of_another_run_is_refused(bare, stages, tmp_path, capsys):
    path = bare.run.path
    assert "is the run without the load" in refusal(capsys, "--model", path, "-o", path)
    slow_run = stages[0][0].path
    assert "holds another run" in refusal(capsys, "--model", path, "-o", slow_run)
    said = refusal(capsys, "--model", path, "-o", slow_run.parent)
    assert "finish it with --resume" in said


def test_the_shortest_time_that_the_command_takes_is_enough_for_both_stages(bare, robot, tmp_path):
    slow = slow_plan(bare.known, LEAST_MINUTES)
    run = carried_out(tmp_path / "slow", slow, robot, loaded_parameters(robot))
    fast = fast_plan(bare.known, LEAST_MINUTES, slow, estimate_load(bare, [run]))
    assert fast.measurements
    assert lasts(slow, robot) + lasts(fast, robot) <= 60 * LEAST_MINUTES
