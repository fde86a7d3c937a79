"""Page of a plan, a run or a robot: file and contained data."""

from __future__ import annotations

import hashlib
import json
import re
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from inflating import inflated
from sampled_depth import sampled_depth
from small_run import SIMULATED, state_hardware
from synthetic import TABLE_3_A, Friction, record

from hil.errors import FileError, InvalidValue
from hil.planning.design.by_counts import design
from hil.planning.dry_run import dry_run
from hil.planning.measurement import Friction as FrictionMeasurement
from hil.planning.plan import WarmUp
from hil.planning.trajectory import Trajectory
from hil.planning.workspace import Box, Workspace
from hil.runs.recording_file import Measured
from hil.runs.run import Run
from hil.runs.run_folder import RunFolder
from hil.show.html import deflate
from hil.view import page
from hil.view.packed import packed
from hil.view.scene import plan_scene, planned, robot_scene, run_scene

if TYPE_CHECKING:
    from hil.model.robot import Robot
    from hil.planning.plan import Plan

ROOT = Path(__file__).parents[3]
MOST = 20_000
DATA = re.compile(r'id="data">([^<]*)<')


def read(path: Path) -> Any:
    """Return the data of a page."""
    found = DATA.search(path.read_text(encoding="utf-8"))
    assert found
    return inflated(found[1])


def unpacked(given: dict[str, Any]) -> np.ndarray:
    return np.cumsum(given["differences"]) * given["step"]


@pytest.fixture(scope="module")
def whole_plan(manutec: Robot) -> Plan:
    """Plan of 34 minutes."""
    return design(manutec)


@pytest.fixture
def guarded(small_plan: Plan) -> Plan:
    boxes = (Box(name="table", low=(0.3, -1.0, -1.0), high=(1.2, 1.0, 0.0)),)
    return small_plan.model_copy(update={"workspace": Workspace(boxes=boxes)})


@pytest.fixture
def run(small_plan: Plan, manutec: Robot, tmp_path: Path) -> Run:
    folder = RunFolder.create(tmp_path / "run", small_plan, manutec)
    rng = np.random.default_rng(3)
    with folder.session(SIMULATED) as session:
        for n, measurement in enumerate(small_plan.measurements):
            recording = record(
                manutec, measurement, TABLE_3_A, Friction(), begin=100.0 * n, noise=0.0025, rng=rng
            )
            folder.write(Measured(measurement, recording, session=session))
    return folder


def test_a_page_is_one_file_that_asks_for_nothing(
    whole_plan: Plan, manutec: Robot, tmp_path: Path
) -> None:
    path = tmp_path / "plan.html"
    size = page.write_page(path, lambda most: plan_scene(whole_plan, manutec, most))
    text = path.read_text(encoding="utf-8")
    assert size == path.stat().st_size < 1_000_000
    assert not re.search(r'(src|href|url)\s*[=(]\s*["\']?\s*(https?:)?//', text)
    assert "default-src 'none'" in text
    assert "connect-src" not in text
    assert {*re.findall(r"https?://[\w./]+", text)} <= {
        "http://www.w3.org/1999/xhtml",
        "http://www.w3.org/2000/svg",
    }
    assert text.count("</script>") == 2


def test_the_licence_of_what_is_bundled_stands_in_the_page(manutec: Robot) -> None:
    text = page.html(robot_scene(manutec))
    assert "three.js authors" in text
    assert "MIT" in (page.ASSETS / "three.LICENSE").read_text(encoding="utf-8")


def test_the_bundle_is_that_of_its_sources() -> None:
    """Remedy for a difference: `make view-bundle`."""
    web = ROOT / "web"
    sources = [
        *(f"src/{path.name}" for path in (web / "src").iterdir()),
        "build.mjs",
        "package-lock.json",
    ]
    found = hashlib.sha256()
    for name in sorted(sources):
        found.update(name.encode() + b"\0" + (web / name).read_bytes() + b"\0")
    assert (page.ASSETS / "sources.sha256").read_text().strip() == found.hexdigest()


def test_the_lock_of_the_bundle_s_packages_names_no_host() -> None:
    assert "resolved" not in (ROOT / "web" / "package-lock.json").read_text(encoding="utf-8")


def test_time_is_that_of_the_dry_run(whole_plan: Plan, manutec: Robot) -> None:
    scene = plan_scene(whole_plan, manutec, 100)
    reckoned = dry_run(whole_plan, manutec)
    assert scene.segments[-1].end == pytest.approx(reckoned.duration)
    for kind, duration in reckoned.durations.items():
        shown = sum(each.end - each.begin for each in scene.segments if each.kind == kind)
        assert shown == pytest.approx(duration), kind


def test_segments_follow_each_other_in_the_plan_s_order(small_plan: Plan, manutec: Robot) -> None:
    plan = small_plan.model_copy(update={"warm_up": WarmUp(duration=10.0)})
    segments = plan_scene(plan, manutec, 100).segments
    assert [each.kind for each in segments] == [
        "warm-up", "travel", "gravity", "travel", "inertia", "travel", "coupling",
    ]  # fmt: skip
    assert all(a.end == b.begin for a, b in pairwise(segments))
    assert segments[2].words == "g1: gravity, axis 2"
    assert segments[-1].axes == (0,)


def test_the_page_holds_the_planned_motion(
    small_plan: Plan, manutec: Robot, tmp_path: Path
) -> None:
    """Compare instants in the middle of a ramp, in the middle of constant speed, and at the
    stroke's end.
    """
    page.write_page(tmp_path / "plan.html", lambda most: plan_scene(small_plan, manutec, most))
    data = read(tmp_path / "plan.html")
    g1 = small_plan.measurements[0]
    begin = data["segments"][1]["begin"]
    profile = g1.profile(1)
    time, value, slope = (unpacked(data["planned"][1][key]) for key in ("time", "value", "slope"))
    for t in (*profile.window, profile.duration):
        at = np.abs(time - (begin + g1.beginnings[1] + t)).argmin()
        assert value[at] == pytest.approx(profile.q(t), abs=2e-5)
        assert slope[at] == pytest.approx(profile.motion(t)[1], abs=2e-5) or t == profile.duration


def test_a_friction_measurement_is_preceded_by_rest_and_exercise(
    manutec: Robot, small_plan: Plan
) -> None:
    prepared = FrictionMeasurement(
        id="f1", axis=1, q=(0.0,) * 6, stroke=0.6, velocity=0.6, acceleration=3.0, rest=2.0,
        exercise=5.0,
    )  # fmt: skip
    plan = small_plan.model_copy(update={"measurements": (prepared,)})
    scene = plan_scene(plan, manutec, 100)
    assert scene.planned
    begin = scene.segments[-1].begin
    # corners between ramp and constant speed
    moving = scene.planned[0].time[scene.planned[0].slope != 0.0]
    after = moving[moving > begin]
    assert after.min() > begin + 2.0
    assert ((after > begin + 2.0) & (after < begin + 7.0)).sum() >= 4
    assert np.all(np.diff(scene.planned[0].time) >= 0)


def test_a_trajectory_is_drawn_as_planned(manutec: Robot, small_plan: Plan) -> None:
    sine = tuple((0.2, -0.1) if j == 0 else (0.0, 0.0) for j in range(6))
    trajectory = Trajectory(
        id="t1", q=(0.0,) * 6, period=4.0, sine=sine, cosine=((0.04, -0.01),) * 6
    )
    plan = small_plan.model_copy(update={"measurements": (trajectory,)})
    motion = planned(plan, manutec)
    t = np.linspace(0.0, 4.0, 500)
    q, qd, _ = motion.evaluate(motion.segments[-1].begin + 0.3 + t)
    wanted = trajectory.motion(t)
    np.testing.assert_allclose(q, wanted[0], atol=1e-5)
    np.testing.assert_allclose(qd, wanted[1], atol=1e-3)


def test_the_distance_is_that_of_the_safety_check(guarded: Plan, manutec: Robot) -> None:
    scene = plan_scene(guarded, manutec, 400)
    assert guarded.workspace
    assert scene.distances
    track = scene.distances.track
    motion = planned(guarded, manutec)
    for number in (0, 150, scene.distances.least):
        q = motion.evaluate(track.time[number : number + 1])[0]
        depth = sampled_depth(manutec, guarded.workspace, q)
        assert track.value[number] == pytest.approx(guarded.workspace.margin - depth)


def test_a_plan_that_the_dry_run_refuses_is_shown_with_the_reason(
    guarded: Plan, manutec: Robot
) -> None:
    scene = plan_scene(guarded, manutec, MOST)
    refused = [each.problem for each in scene.segments if each.problem]
    assert refused
    assert "into table" in refused[0] or "runs right" in refused[0]
    assert any("into table" in note for note in scene.notes)


def test_more_strokes_than_a_page_can_show_are_refused_at_once(
    small_plan: Plan, manutec: Robot
) -> None:
    endless = small_plan.measurements[0].model_copy(update={"cycles": 100_000_000})
    plan = small_plan.model_copy(update={"measurements": (endless,)})
    with pytest.raises(InvalidValue, match="lower cycles"):
        plan_scene(plan, manutec, MOST)


def test_a_run_shows_what_was_measured_beside_its_set_points(run: Run) -> None:
    scene = run_scene(run, MOST)
    assert scene.measured
    assert scene.planned
    for read_back in run:
        name = f"{read_back.measurement.id}:"
        segment = next(s for s in scene.segments if s.words.startswith(name))
        recording = read_back.recording
        time = segment.begin + recording.time - recording.time[0]
        for joint in range(6):
            track = scene.measured.position[joint]
            q = np.interp(time, track.time, track.value)
            assert np.abs(q - recording.q[:, joint]).max() < 1e-4
        joint = read_back.measurement.index
        set_point = np.interp(time, scene.planned[joint].time, scene.planned[joint].value)
        assert np.abs(set_point - recording.q[:, joint]).max() < 0.02
        track = scene.measured.torque[joint]
        torque = np.interp(time, track.time, track.value)
        assert np.abs(torque - recording.tau[:, joint]).max() < 2e-3 * np.abs(track.value).max()


def test_a_run_of_the_virtual_plant_says_so_and_no_other_does(run: Run) -> None:
    assert '<span class="badge">SIMULATED</span>' in page.html(run_scene(run, MOST))
    state_hardware(run.path / "run.json", "socketcan can0")
    assert ">SIMULATED<" not in page.html(run_scene(Run.open(run.path), MOST))


def test_a_run_of_many_samples_shows_fewer(run: Run) -> None:
    assert len(deflate(run_scene(run, 500).data())) < len(deflate(run_scene(run, MOST).data())) / 4


def test_another_file_is_not_written_over(manutec: Robot, tmp_path: Path) -> None:
    path = tmp_path / "notes.html"
    path.write_text("<p>Mine</p>")
    with pytest.raises(FileError, match="not a page of hil view"):
        page.write_page(path, lambda _: robot_scene(manutec))
    assert path.read_text() == "<p>Mine</p>"


def test_a_page_is_written_anew(manutec: Robot, tmp_path: Path) -> None:
    for _ in range(2):
        page.write_page(tmp_path / "robot.html", lambda _: robot_scene(manutec))


def test_packed_numbers_are_off_by_half_a_step_at_most() -> None:
    values = np.random.default_rng(1).normal(size=500)
    np.testing.assert_allclose(unpacked(packed(values, 1e-3)), values, atol=0.5001e-3)


def test_assumed_capsules_are_said_to_be_so(manutec: Robot) -> None:
    first = manutec.file.joints[0].model_copy(update={"capsule": None})
    file = manutec.file.model_copy(update={"joints": (first, *manutec.file.joints[1:])})
    assert not robot_scene(manutec).notes
    assert "for: link 1." in robot_scene(replace(manutec, file=file)).notes[0]


def test_limits_are_those_of_the_workspace(manutec: Robot) -> None:
    scene = robot_scene(manutec, Workspace(ranges={1: (-0.5, 0.5)}))
    joint = json.loads(json.dumps(scene.data()))["robot"]["joints"][0]
    assert (joint["lower"], joint["upper"]) == (-0.5, 0.5)
