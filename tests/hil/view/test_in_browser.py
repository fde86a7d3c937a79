"""Page in a real browser: position of the drawn robot, and accessibility."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from browser import colour_scheme, opened_browser, require_browser, resize

from hil.model.readers.axes_to_frames import Frames
from hil.model.robot import Robot
from hil.planning.design.by_counts import design
from hil.planning.trajectory import Trajectory
from hil.planning.workspace import Box, Workspace
from hil.view.page import write_page
from hil.view.scene import plan_scene, planned, robot_scene

if TYPE_CHECKING:
    from collections.abc import Iterator

    from selenium.webdriver import Chrome


SUPPORT = Path(__file__).parents[2] / "support"
ROBOTS = Path(__file__).parents[2] / "robots"
AXE = (SUPPORT / "axe.min.js").read_text(encoding="utf-8")
FAULTS = """
const done = arguments[arguments.length - 1];
const found = ({ id, nodes }) => [id, nodes.map(({ html }) => html)];
axe.run().then(({ violations }) => done(violations.map(found)));
"""
SEEN = """
const { scene } = window.view;
const links = scene.robot.joints.map((_, link) => scene.project(link));
return { ...scene.seen(), links: links.map(({ x, y }) => [x, y]) };
"""
ENDS = """
const every = [...document.querySelectorAll('body *')];
return every.map((each) => each.getBoundingClientRect().right);
"""
COUNTS = {"gravity": 3, "inertia": 10, "coupling": 1}
WORKSPACE = Workspace(boxes=(Box(name="cabinet", low=(0.9, 0.6, -0.8), high=(1.4, 1.2, 0.2)),))


@pytest.fixture(scope="module")
def browser(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Chrome]:
    require_browser()
    with opened_browser(tmp_path_factory.mktemp("profile")) as opened:
        yield opened


@pytest.fixture(scope="module")
def plan_page(manutec: Robot, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("pages") / "plan.html"
    plan = design(manutec, COUNTS, 0.0, WORKSPACE)
    write_page(path, lambda most: plan_scene(plan, manutec, most))
    return path


def show(
    browser: Chrome, page: Path, width: int = 1000, height: int = 600, scheme: str = "light"
) -> None:
    resize(browser, width, height)
    colour_scheme(browser, scheme)
    browser.get(page.as_uri())
    browser.set_script_timeout(60)
    browser.execute_async_script("""
        const done = arguments[0];
        const ready = () => requestAnimationFrame(() => done());
        const wait = () => (window.view ? ready() : setTimeout(wait, 20));
        wait();
    """)


def projected(robot: Robot, q: np.ndarray, seen: dict[str, Any]) -> np.ndarray:
    """Return image positions of all links' frame origins (n_joints, 2) [pixels]."""
    lengths = robot.alpha, robot.d, robot.theta, robot.r, robot.gamma, robot.b
    frames = Frames(*lengths, robot.parents, np.eye(4))
    origins = frames.poses(q, robot.revolute)[:, :, 3]
    clip = origins @ np.reshape(seen["matrix"], (4, 4)).T
    across, up = clip[:, 0] / clip[:, 3], clip[:, 1] / clip[:, 3]
    return np.column_stack([(across + 1) / 2 * seen["width"], (1 - up) / 2 * seen["height"]])


def complaints(browser: Chrome) -> list[str]:
    return [each["message"] for each in browser.get_log("browser") if each["level"] == "SEVERE"]


@pytest.mark.parametrize("name", ["manutec-r15", "cartesian", "scara", "panda", "ur10e-on-a-wall"])
def test_links_are_drawn_where_forward_kinematics_has_them(
    name: str, browser: Chrome, tmp_path: Path
) -> None:
    file = ROBOTS / f"{name}.yaml"
    robot = Robot.load(file if file.exists() else name)
    write_page(tmp_path / "robot.html", lambda _: robot_scene(robot))
    show(browser, tmp_path / "robot.html")
    rng = np.random.default_rng(4)
    for view in ("oblique", "top"):
        q = rng.uniform(robot.q_min, robot.q_max)
        browser.execute_script("window.view.scene.look(arguments[0])", view)
        browser.execute_script("window.view.show(arguments[0])", q.tolist())
        seen = browser.execute_script(SEEN)
        np.testing.assert_allclose(seen["links"], projected(robot, q, seen), atol=0.5)
    assert complaints(browser) == []


def test_three_instants_of_a_plan_are_drawn_as_planned(
    browser: Chrome, plan_page: Path, manutec: Robot
) -> None:
    plan = design(manutec, COUNTS, 0.0, WORKSPACE)
    motion = planned(plan, manutec)
    segments = motion.segments
    show(browser, plan_page)
    for segment in (segments[1], segments[8], segments[-1]):
        t = segment.begin + 0.4 * (segment.end - segment.begin)
        browser.execute_script("window.view.seek(arguments[0])", t)
        seen = browser.execute_script(SEEN)
        wanted = projected(manutec, motion.evaluate(np.array([t]))[0][0], seen)
        np.testing.assert_allclose(seen["links"], wanted, atol=1.0)
        now = browser.execute_script("return document.getElementById('now').textContent")
        assert now == segment.words
    assert complaints(browser) == []


def test_a_plan_opens_on_the_axis_that_moves_most(
    browser: Chrome, plan_page: Path, manutec: Robot
) -> None:
    motion = planned(design(manutec, COUNTS, 0.0, WORKSPACE), manutec)
    begin, end = motion.evaluate(np.array([motion.segments[0].begin, motion.segments[0].end]))[0]
    show(browser, plan_page)
    steps = np.array(browser.execute_script("return window.view.steps"))
    most = int(np.argmax(np.abs(end - begin) / steps))
    titles = browser.execute_script("return document.getElementById('curves').textContent")
    assert titles.startswith(f"axis {most + 1}: position")
    assert np.abs(end - begin)[most] > 0.01


def test_a_robot_is_really_drawn(browser: Chrome, plan_page: Path) -> None:
    """The mark of the measured axis is visible at one of its points."""
    show(browser, plan_page)
    found = browser.execute_script("""
        const { scene } = window.view;
        window.view.seek(window.view.segments[1].begin);
        scene.renderer.render(scene.scene, scene.camera);
        const gl = scene.renderer.getContext();
        const { width, height } = scene.renderer.domElement;
        const pixels = new Uint8Array(4 * width * height);
        gl.readPixels(0, 0, width, height, gl.RGBA, gl.UNSIGNED_BYTE, pixels);
        const seen = new Set();
        for (let i = 0; i < pixels.length; i += 4) {
            seen.add([...pixels.subarray(i, i + 3)].map((each) => each >> 4).join());
        }
        return seen.size;
    """)
    assert found > 20  # shades of capsules, box, grid and volume; an empty picture has one


def test_time_runs_and_stops(browser: Chrome, plan_page: Path) -> None:
    show(browser, plan_page)
    elapsed, passed, later = browser.execute_async_script("""
        const done = arguments[0];
        const { player } = window.view;
        const pressed = () => new KeyboardEvent('keydown', { key: ' ', bubbles: true });
        const press = () => document.body.dispatchEvent(pressed());
        player.setSpeed(5);
        const begun = performance.now();
        press();
        setTimeout(() => {
            press();
            const passed = [(performance.now() - begun) / 1000, player.time];
            setTimeout(() => done([...passed, player.time]), 100);
        }, 400);
    """)
    assert 0.0 < passed <= 5 * elapsed + 1e-6
    assert later == passed


@pytest.mark.parametrize("width", [1440, 420])
@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_everybody_can_use_it(browser: Chrome, plan_page: Path, width: int, scheme: str) -> None:
    show(browser, plan_page, width, 900, scheme)
    browser.execute_script(AXE)
    assert browser.execute_async_script(FAULTS) == []
    ends = browser.execute_script(ENDS)
    assert max(ends) <= width
    assert complaints(browser) == []


def test_sliders_of_a_robot_are_usable_too(browser: Chrome, manutec: Robot, tmp_path: Path) -> None:
    write_page(tmp_path / "robot.html", lambda _: robot_scene(manutec, WORKSPACE))
    show(browser, tmp_path / "robot.html", 420, 900)
    browser.execute_script(AXE)
    assert browser.execute_async_script(FAULTS) == []
    assert complaints(browser) == []


def test_a_swept_volume_reaches_from_end_to_end(
    browser: Chrome, manutec: Robot, tmp_path: Path
) -> None:
    """Fewer configurations are drawn than a trajectory passes; they
    still cover its whole extent.
    """
    sine = tuple((0.5, -0.25) for _ in range(6))
    cosine = ((0.0, 0.0),) * 6
    long = Trajectory(id="t", q=(0.0,) * 6, period=20.0, sine=sine, cosine=cosine)
    plan = design(manutec, COUNTS).model_copy(update={"measurements": (long,)})
    write_page(tmp_path / "plan.html", lambda most: plan_scene(plan, manutec, most))
    show(browser, tmp_path / "plan.html")
    passed = browser.execute_script("return window.view.passed(1)")
    assert 30 < len(passed) <= 96
    q = long.motion(np.linspace(0.0, 20.0, 400))[0]
    np.testing.assert_allclose(np.max(passed, axis=0), q.max(axis=0), atol=0.12)
    np.testing.assert_allclose(np.min(passed, axis=0), q.min(axis=0), atol=0.12)
