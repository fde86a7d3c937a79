"""Live page in a real browser: content and accessibility."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from browser import colour_scheme, opened_browser, require_browser, resize
from live_page import Served, hand, served
from selenium.webdriver import ActionChains
from selenium.webdriver.common.by import By
from selenium.webdriver.support.ui import WebDriverWait

from drivers.drive_bus import Sample
from hil.live import lines
from hil.measuring.sequencer import GaveUp, Travelled
from hil.runs.recording import Finding

if TYPE_CHECKING:
    from collections.abc import Iterator

    from conftest import IdealBus
    from selenium.webdriver import Chrome

    from hil.model.robot import Robot
    from hil.planning.plan import Plan

AXE = (Path(__file__).parents[2] / "support" / "axe.min.js").read_text(encoding="utf-8")
FAULTS = """
const done = arguments[arguments.length - 1];
const found = ({ id, nodes }) => [id, nodes.map(({ html }) => html)];
axe.run().then(({ violations }) => done(violations.map(found)));
"""
ENDS = """
const every = [...document.querySelectorAll('body *')];
return Math.max(...every.map((each) => each.getBoundingClientRect().right));
"""
HOSTILE = "<img src=x onerror=alert(1)>"
SEEN = "Axis 2 goes back and forth at constant speed (1 of 3)"
Q = (0.5, -0.3, 0.2, 0.1, 0.4, -1.0)
TAU = (10.0, -500.0, 3.0, 0.5, 70.0, -0.2)


@pytest.fixture(scope="module")
def browser(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Chrome]:
    require_browser()
    with opened_browser(tmp_path_factory.mktemp("profile")) as opened:
        yield opened


@pytest.fixture
def page(
    browser: Chrome, manutec: Robot, small_plan: Plan, ideal_bus: IdealBus
) -> Iterator[Served]:
    """Run that measures g1, open in the browser."""
    with served() as found:
        found.begin(manutec, small_plan, ideal_bus.axes)
        event = Travelled(3.0, 20.0, small_plan.measurements[0])
        found.publish("event", **lines.event(event, 65.0, {"g1": 1}))
        found.sample(Sample(4.0, Q, TAU, (0,) * 6, False))
        complaints(browser)  # of the page before
        browser.get(found.url)
        wait_until(browser, lambda: "rad" in "".join(row[1] for row in cells(browser)))
        yield found


def wait_until(browser: Chrome, condition: Any) -> None:
    WebDriverWait(browser, 30, 0.05).until(lambda _: condition())


def give(browser: Chrome, page: Served, samples: list[Sample]) -> None:
    """Publish samples at the page's pace, since a slow page skips some."""
    for begin in range(0, len(samples), 20):
        *before, last = samples[begin : begin + 20]
        for each in before:
            page.sample(each)

        def taken(last: Sample = last) -> bool:
            page.sample(last)
            shown = browser.execute_script("return window.live.scene.q[0]")
            return bool(shown == pytest.approx(last.q[0], abs=1e-4))

        wait_until(browser, taken)


def text(browser: Chrome, name: str) -> str:
    return browser.find_element(By.ID, name).text


def cells(browser: Chrome) -> list[list[str]]:
    """Return the content of the table of axes, row by row."""
    return browser.execute_script(  # type: ignore[no-any-return]
        "return [...document.querySelectorAll('#axes tbody tr')]"
        ".map((row) => [...row.children].map((cell) => cell.innerText));"
    )


def complaints(browser: Chrome) -> list[str]:
    return [each["message"] for each in browser.get_log("browser") if each["level"] == "SEVERE"]


def test_state_progress_and_axes_are_shown(browser: Chrome, page: Served) -> None:
    assert text(browser, "state") == "armed: the axes are under power"
    assert text(browser, "doing") == SEEN
    assert text(browser, "left") == ""  # a virtual plant is accelerated later
    browser.execute_script("window.live.rate = 20.0")
    wait_until(browser, lambda: text(browser, "left").endswith(" left, 20 times real time"))
    assert text(browser, "left")[:4] in {"1:05", "1:04", "1:03", "1:02"}
    progress = browser.execute_script("return document.getElementById('progress').value")
    assert progress == pytest.approx(4 / 23, abs=0.01)
    second = cells(browser)[1]
    assert second[1].startswith("−0.30 rad")
    assert second[2].startswith("−500 N m")
    assert "limit" in second[2]
    measured = browser.execute_script(
        "return [...document.querySelectorAll('#axes tr.measured th')].map((e) => e.textContent)"
    )
    assert measured == ["2"]
    assert complaints(browser) == []


def test_a_run_of_the_virtual_plant_says_so_and_no_other_does(
    browser: Chrome, page: Served, manutec: Robot, small_plan: Plan
) -> None:
    assert text(browser, "simulated") == "SIMULATED"
    assert browser.title == "SIMULATED: Run of manutec-r15, live"
    page.publish("start", **lines.start(manutec, small_plan, None, simulated=False))
    wait_until(browser, lambda: not browser.find_element(By.ID, "simulated").is_displayed())


def test_the_robot_stands_as_it_was_sampled(browser: Chrome, page: Served) -> None:
    assert browser.execute_script("return window.live.scene.q") == pytest.approx(Q)
    moved = tuple(q + 0.1 for q in Q)
    page.sample(Sample(4.1, moved, TAU, (0,) * 6, False))
    wait_until(
        browser,
        lambda: browser.execute_script("return window.live.scene.q") == pytest.approx(moved),
    )


def test_friction_so_far_stands_beside_its_axis(browser: Chrome, page: Served) -> None:
    level = {"axis": 1, "speed": 0.4, "measurement": "g1"}
    page.publish("level", **level, level=51.2, count=1, least=51.2, most=51.2)
    wait_until(browser, lambda: cells(browser)[1][3] == "51.2 N m at 0.40 rad/s")
    page.publish("level", **level, level=53.2, count=2, least=51.2, most=53.2)
    wanted = "53.2 N m at 0.40 rad/s (2 so far: 51.2 to 53.2)"
    wait_until(browser, lambda: cells(browser)[1][3] == wanted)


PARAMETERS = [
    {"name": "p1", "meaning": "inertia of axis 1", "expression": "Izz1 + m3", "unit": "kg m2"},
    {
        "name": "p13",
        "meaning": "product of inertia xz of link 2",
        "expression": "sx2",
        "unit": "kg m2",
    },
]


def estimate(*halves: float | None) -> dict[str, Any]:
    known = [
        {"value": None if half is None else 32.0184, "half": half, "share": half and half / 100}
        for half in halves
    ]
    rows = [each | more for each, more in zip(PARAMETERS, known, strict=True)]
    return {"recordings": 12, "parameters": rows}


def torques(begin: float, number: int = 50) -> dict[str, Any]:
    """Return torques of all axes over this number of fortieths of a second."""
    t = begin + 0.04 * np.arange(number)
    measured = 100 * np.sin(t)[:, np.newaxis] * np.ones(6)
    return lines.torque(range(6), t, measured, measured + 2.0, np.full((number, 6), 5.0))


@pytest.fixture
def watched(
    browser: Chrome, manutec: Robot, small_plan: Plan, ideal_bus: IdealBus, tmp_path: Path
) -> Iterator[tuple[Served, Any]]:
    """Watched run that accepts pushes, with the plant that executes them."""
    path = str(tmp_path / "hand")
    with hand(tmp_path / "hand") as plant, served("127.0.0.1", 0, "--hand", path) as found:
        found.begin(manutec, small_plan, ideal_bus.axes, pushed=True)
        for k in range(50):
            q = (0.5 + 0.01 * k, *Q[1:])
            found.sample(Sample(4.0 + 0.04 * k, q, TAU, (0,) * 6, False))
        found.publish("headline", text="Push the arm: drag a link")
        complaints(browser)  # of the page before
        browser.get(found.url)
        # the headline is in the page before the robot is drawn
        wait_until(browser, lambda: browser.execute_script("return !!window.live?.scene?.q"))
        assert text(browser, "headline").startswith("Push the arm")
        yield found, plant


def test_intervals_shrink_as_recordings_come(
    browser: Chrome, page: Served, small_plan: Plan
) -> None:
    assert text(browser, "headline") == "Measuring: 1 of 3"
    page.publish("estimate", **estimate(0.5, None))
    wait_until(browser, lambda: "32.02 kg m²" in text(browser, "intervals"))
    assert "12 recordings: 1 of 2 parameters known" in text(browser, "intervals")
    event = Travelled(5.0, 20.0, small_plan.measurements[1])
    page.publish("event", **lines.event(event, 65.0, {"i1": 2}))
    wait_until(
        browser, lambda: text(browser, "headline") == "Measuring: 2 of 3, 1 of 2 parameters known"
    )
    assert "open" in text(browser, "intervals")
    wide = browser.execute_script("return document.querySelector('.interval').style.width")
    page.publish("estimate", **estimate(0.0052, 0.1))
    wait_until(browser, lambda: "0.0052" in text(browser, "intervals"))
    assert "32.0184 kg m²" in text(browser, "intervals")
    assert "open" not in text(browser, "intervals")
    narrow = browser.execute_script("return document.querySelector('.interval').style.width")
    assert float(narrow.rstrip("%")) < float(wide.rstrip("%"))


def test_a_recording_stands_beside_its_prediction(browser: Chrome, page: Served) -> None:
    assert not browser.find_element(By.ID, "torques").is_displayed()
    t = 3.0 + 0.1 * np.arange(40)
    one = np.sin(t)[:, np.newaxis]
    page.publish("torque", **lines.torque([1], t, 40 * one, 41 * one, np.full((40, 1), np.inf)))
    wait_until(browser, lambda: "at its end" in label(browser, 1))
    assert label(browser, 1).startswith("axis 2: torque, N m, over time; at its end measured")
    assert "measured" in label(browser, 1)
    assert "none yet" in label(browser, 0)
    assert complaints(browser) == []


def test_torques_pass_by_until_there_is_a_recording(browser: Chrome, page: Served) -> None:
    passed = [(4.1 + 0.04 * k, (0.5 + 0.001 * k, *Q[1:])) for k in range(40)]
    give(browser, page, [Sample(t, q, TAU, (0,) * 6, False) for t, q in passed])
    # samples may arrive in several parts
    span = "return window.live.curves.span"
    wait_until(browser, lambda: browser.execute_script(span)[1] > 4.1 + 0.04 * 38.5)
    wait_until(browser, lambda: "at its end measured −500" in label(browser, 1))
    assert "predicted" not in label(browser, 1)
    shown = "return [...document.querySelectorAll('#torques figure')].map((e) => !e.hidden)"
    assert browser.execute_script(shown) == [True, False] * 6
    assert browser.execute_script(span) == pytest.approx([4.0, 4.1 + 0.04 * 39])
    t = 4.0 + 0.1 * np.arange(15)
    one = np.sin(t)[:, np.newaxis]
    page.publish("torque", **lines.torque([1], t, 40 * one, 41 * one, one, measurement="g1"))
    wait_until(browser, lambda: "none yet" in label(browser, 0))
    assert "at its end measured" in label(browser, 1)
    assert browser.execute_script(shown) == [True] * 12


def test_values_are_read_under_the_pointer(browser: Chrome, watched: tuple[Served, Any]) -> None:
    page, _ = watched
    page.publish("torque", **torques(4.0))
    wait_until(browser, lambda: "at its end" in label(browser, 0))
    point = (
        "const canvas = document.querySelector('#torques canvas');"
        "const {left, width} = canvas.getBoundingClientRect();"
        "canvas.dispatchEvent(new PointerEvent(arguments[0], {clientX: left + width - 16}));"
        "return document.querySelector('#torques .values').textContent;"
    )
    said = browser.execute_script(point, "pointermove")
    measured = 100 * np.sin(browser.execute_script("return window.live.curves.span[1]"))
    assert re.fullmatch(r"0\.0+ s, measured \S+, predicted \S+ ± 5\.0+", said.replace("−", "-"))
    values = re.findall(r"(?:measured|predicted) ([^ ,]+)", said.replace("−", "-"))
    assert [float(each) for each in values] == pytest.approx([measured, measured + 2], abs=0.6)
    assert browser.execute_script(point, "pointerleave") == ""


def test_a_result_is_stated_until_the_next_sentence(
    browser: Chrome, page: Served, manutec: Robot, small_plan: Plan
) -> None:
    page.publish("headline", text="Identified: residual 5.8 %", more="The next motion tests it.")
    kind = {"simulated": False, "watched": True}
    page.publish("start", **lines.start(manutec, small_plan, None, **kind))
    wait_until(browser, lambda: not browser.find_element(By.ID, "simulated").is_displayed())
    assert text(browser, "headline") == "Identified: residual 5.8 %"
    page.publish("headline", text="Learning", more="")
    wait_until(browser, lambda: text(browser, "headline") == "Learning")


LINKS = """
const { scene } = window.live;
const at = scene.camera.position.clone();
return scene.robot.joints.flatMap(({ capsule: { ends } }, j) => ends.map((end) => {
  const { x, y } = at.set(...end).applyMatrix4(scene.chain.frames[j]).project(scene.camera);
  return Math.max(Math.abs(x), Math.abs(y));
}));
"""


@pytest.mark.parametrize("width", [1440, 420])
def test_the_arm_stays_in_the_picture_until_the_user_moves_the_camera(
    browser: Chrome, page: Served, width: int
) -> None:
    resize(browser, width, 900)
    for k, q in enumerate([(0.0,) * 6, (-0.8, 1.5, 0.0, 0.0, 0.0, 0.0), (0.8, -1.5, *(0.0,) * 4)]):
        page.sample(Sample(4.1 + k, q, TAU, (0,) * 6, False))
        wait_until(
            browser,
            lambda q=q: browser.execute_script("return window.live.scene.q") == pytest.approx(q),
        )
        assert max(browser.execute_script(LINKS)) < 1.0
    resize(browser, 1000, 3000)  # a high picture
    wait_until(
        browser, lambda: browser.execute_script("return window.live.scene.camera.aspect") < 1.0
    )
    assert max(browser.execute_script(LINKS)) < 1.0
    resize(browser, width, 900)
    browser.execute_script("window.live.scene.orbit(0, 0, 3); window.live.scene.moved = true")
    near = browser.execute_script("return window.live.scene.camera.position.length()")
    page.sample(Sample(9.0, Q, TAU, (0,) * 6, False))
    wait_until(
        browser,
        lambda: browser.execute_script("return window.live.scene.q") == pytest.approx(Q),
    )
    assert browser.execute_script("return window.live.scene.camera.position.length()") == near


def label(browser: Chrome, axis: int) -> str:
    name = browser.execute_script(
        "return document.querySelectorAll('#torques figure:first-child canvas')[arguments[0]]"
        "?.ariaLabel ?? ''",
        axis,
    )
    return str(name)


def force(browser: Chrome) -> str:
    return browser.find_element(By.CSS_SELECTOR, "#scene .force").text


def test_one_cursor_goes_through_curves_and_robot(
    browser: Chrome, watched: tuple[Served, Any]
) -> None:
    page, _ = watched
    for k in range(10):
        page.publish("torque", **torques(4.0 + 2.0 * k))
    at_once = [
        Sample(4.0 + 0.04 * k, (0.5 + 0.001 * k, *Q[1:]), TAU, (0,) * 6, False) for k in range(500)
    ]
    give(browser, page, at_once)
    wait_until(browser, lambda: "at its end" in label(browser, 0))
    wait_until(
        browser, lambda: browser.execute_script("return window.live.recorded.duration > 23.9")
    )
    look_back(browser, 19.0)
    shown = browser.execute_script("return window.live.scene.q[0]")
    assert shown == pytest.approx(0.5 + 0.001 * (19.0 - 4.0) / 0.04, abs=0.002)
    wait_until(browser, lambda: cursors(browser) == [True] * 12)
    begin, end = browser.execute_script("return window.live.curves.span")
    assert begin <= 19.0 <= end <= begin + 10.0 + 1e-9
    browser.find_element(By.CSS_SELECTOR, ".time button").click()  # the recent past is replayed
    wait_until(
        browser, lambda: browser.execute_script("return window.live.curves.player.time") > 19.1
    )
    page.sample(Sample(24.1, Q, TAU, (0,) * 6, False))
    browser.find_element(By.CSS_SELECTOR, ".time button:last-child").click()
    wait_until(browser, lambda: cursors(browser) == [False] * 12)
    page.sample(Sample(24.2, (2.0, *Q[1:]), TAU, (0,) * 6, False))
    wait_until(browser, lambda: browser.execute_script("return window.live.scene.q[0]") == 2.0)
    assert complaints(browser) == []


def look_back(browser: Chrome, t: float) -> None:
    set_to = "const s = document.querySelector('.time input'); s.value = arguments[0];"
    browser.execute_script(f"{set_to} s.dispatchEvent(new Event('input'));", t)


def cursors(browser: Chrome) -> list[bool]:
    """Return the curves with a cursor."""
    return browser.execute_script(  # type: ignore[no-any-return]
        "return [...document.querySelectorAll('#torques .cursor')].map((each) => !each.hidden);"
    )


def test_recordings_that_have_passed_can_be_looked_back_at(browser: Chrome, page: Served) -> None:
    for begin in (4.0, 8.0):
        t = begin + 0.1 * np.arange(20)
        one = np.sin(t)[:, np.newaxis] * np.ones(2)
        columns = (40 * one, 41 * one, np.full((20, 2), 9.0))
        page.publish("torque", **lines.torque([1, 3], t, *columns, measurement=f"g{begin:.0f}"))
    passed = [Sample(4.0 + 0.1 * k, (0.01 * k, *Q[1:]), TAU, (0,) * 6, False) for k in range(100)]
    give(browser, page, passed)
    wait_until(
        browser, lambda: browser.execute_script("return window.live.recorded.duration > 13.8")
    )
    wait_until(browser, lambda: "at its end" in label(browser, 3))
    wait_until(browser, lambda: spans(browser, 1) == pytest.approx([8.0, 9.9]))
    look_back(browser, 5.0)
    wait_until(browser, lambda: spans(browser, 1) == pytest.approx([4.0, 5.9]))
    wait_until(
        browser,
        lambda: cursors(browser) == [axis in (1, 3) for axis in range(6) for _ in range(2)],
    )
    wait_until(
        browser,
        lambda: browser.execute_script("return window.live.scene.q[0]") == pytest.approx(0.1),
    )
    assert "back and forth" in text(browser, "doing")  # the run continues


def spans(browser: Chrome, axis: int) -> list[float]:
    return browser.execute_script(  # type: ignore[no-any-return]
        "return window.live.curves.curves[arguments[0]][0].span", axis
    )


def test_an_event_is_looked_back_at(browser: Chrome, watched: tuple[Served, Any]) -> None:
    page, _ = watched
    for k in range(3):
        give(browser, page, [Sample(6.1 + k, (1.0 + 0.1 * k, *Q[1:]), TAU, (0,) * 6, False)])
    page.publish("alarm", push=1, axis=1, torque=-31.2, threshold=9.0, unit="N m", t=6.6)
    wait_until(browser, lambda: "from outside" in text(browser, "notices"))
    browser.find_element(By.CSS_SELECTOR, "#notices .then").click()
    wait_until(
        browser,
        lambda: browser.execute_script("return window.live.scene.q[0]") == pytest.approx(1.05),
    )


def test_a_link_that_is_dragged_pushes_the_plant_and_is_let_go(
    browser: Chrome, watched: tuple[Served, Any], manutec: Robot
) -> None:
    page, plant = watched
    place = browser.execute_script(
        "const {scene} = window.live, {x, y} = scene.project(2);"
        "const {left, top} = scene.renderer.domElement.getBoundingClientRect();"
        "return [Math.round(x + left), Math.round(y + top)];"
    )
    drag = ActionChains(browser, duration=20)
    drag.w3c_actions.pointer_action.move_to_location(*place)
    drag.click_and_hold().move_by_offset(50, -60).perform()
    said = json.loads(plant.recv(4096))
    share = np.abs(said["torque"]) / manutec.torque_limit
    assert 0.0 < share.max() <= 0.2 + 1e-9
    assert share[0] > 0
    assert said["torque"][3:] == [0, 0, 0] or share[3:].any()
    wait_until(browser, lambda: "pulling with" in force(browser))
    ActionChains(browser).release().perform()
    while any(json.loads(plant.recv(4096))["torque"]):
        continue
    page.publish("alarm", push=1, axis=1, torque=-31.2, threshold=9.0, unit="N m", t=4.5)
    page.publish("alarm", push=1, axis=2, torque=12.0, threshold=5.0, unit="N m", t=4.6)
    page.publish("headline", text="Push found: axis 2, 31.2 N m", more="By currents alone.")
    wait_until(browser, lambda: text(browser, "headline") == "Push found: axis 2, 31.2 N m")
    assert text(browser, "more") == "By currents alone."
    assert "push 1, axis 2: -31.2 N m from outside" in text(browser, "notices")
    assert "axis 3" not in text(browser, "notices")  # one push affects several axes
    page.publish("end", how="finished", text="")
    wait_until(browser, lambda: not browser.find_element(By.ID, "hand").text)
    assert complaints(browser) == []


def test_an_axis_is_pushed_without_a_mouse_too(
    browser: Chrome, watched: tuple[Served, Any], manutec: Robot
) -> None:
    _, plant = watched
    browser.find_element(By.CSS_SELECTOR, "[aria-label='Push axis 4']").send_keys("\n")
    torque = json.loads(plant.recv(4096))["torque"]
    assert torque == pytest.approx([0, 0, 0, 0.2 * manutec.torque_limit[3], 0, 0])
    wait_until(browser, lambda: force(browser) == "pushed axis 4 with 42 N m")


def test_a_near_miss_takes_the_link_and_does_not_turn_the_camera(
    browser: Chrome, watched: tuple[Served, Any]
) -> None:
    _, plant = watched
    held = browser.execute_script(
        "const {scene, hand} = window.live, {x, y} = scene.project(2);"
        "const {left, top, width} = scene.renderer.domElement.getBoundingClientRect();"
        "const at = (dx) => ({clientX: x + left + dx, clientY: y + top});"
        "let edge = 0; while (hand._under(at(edge + 1)) && edge < width) edge++;"
        "scene.renderer.domElement.dispatchEvent(new PointerEvent('pointerdown',"
        " {...at(edge), pointerId: 1, bubbles: true, cancelable: true}));"
        "const held = Boolean(hand.held);"
        "scene.renderer.domElement.dispatchEvent(new PointerEvent('pointerup', {pointerId: 1}));"
        "return held;"
    )
    assert held
    assert not any(json.loads(plant.recv(4096))["torque"])  # released: no more push


def drag(browser: Chrome, link: int = 2) -> list[float]:
    """Drag a link's joint; return the camera's displacement during the drag."""
    begin, end = browser.execute_script(
        "const {scene} = window.live, element = scene.renderer.domElement;"
        "const {x, y} = scene.project(arguments[0]), {left, top} = element.getBoundingClientRect();"
        "const go = (kind, by) => element.dispatchEvent(new PointerEvent(kind, {pointerId: 1,"
        " clientX: x + left + by, clientY: y + top, button: 0, bubbles: true, cancelable: true}));"
        "const begin = scene.camera.position.toArray();"
        "element.setPointerCapture = () => {}; element.releasePointerCapture = () => {};"
        "go('pointerdown', 0); go('pointermove', 30); scene.controls.update();"
        "return [begin, scene.camera.position.toArray()];",
        link,
    )
    return [float(b - a) for a, b in zip(begin, end, strict=True)]


def let_go(browser: Chrome) -> None:
    browser.execute_script(
        "window.live.scene.renderer.domElement.dispatchEvent(new PointerEvent('pointerup',"
        " {pointerId: 1, bubbles: true}));"
    )


def test_an_arm_that_cannot_be_pushed_yet_says_so_and_the_camera_stays(
    browser: Chrome, watched: tuple[Served, Any]
) -> None:
    page, plant = watched
    assert force(browser) == "Drag a link of the arm"
    page.publish("hand", closed="Not before it is identified")
    wait_until(browser, lambda: not browser.find_element(By.ID, "hand").text)
    assert drag(browser) == pytest.approx([0.0] * 3)
    assert force(browser) == "Not before it is identified"
    let_go(browser)
    assert force(browser) == ""
    page.publish("hand", closed="")
    wait_until(browser, lambda: "axis 6" in text(browser, "hand"))
    plant.setblocking(False)
    with pytest.raises(BlockingIOError):
        plant.recv(4096)
    plant.settimeout(30)
    assert drag(browser) == pytest.approx([0.0] * 3)
    assert any(json.loads(plant.recv(4096))["torque"])
    let_go(browser)
    while any(json.loads(plant.recv(4096))["torque"]):
        continue


def test_a_page_without_an_arm_to_push_is_turned_by_dragging(browser: Chrome, page: Served) -> None:
    del page
    assert drag(browser) != pytest.approx([0.0] * 3)
    let_go(browser)


def test_axes_that_are_switched_off_are_pushed_no_more(
    browser: Chrome, watched: tuple[Served, Any]
) -> None:
    page, plant = watched
    drag(browser)
    assert any(json.loads(plant.recv(4096))["torque"])
    page.publish("off")
    wait_until(browser, lambda: not browser.find_element(By.ID, "hand").text)
    assert browser.execute_script("return window.live.hand.held === undefined")
    while any(json.loads(plant.recv(4096))["torque"]):
        continue
    assert force(browser) == ""
    assert text(browser, "notices") == ""


def test_a_push_has_one_mark_in_the_curves_of_an_axis(
    browser: Chrome, watched: tuple[Served, Any]
) -> None:
    page, _ = watched
    page.publish("torque", **torques(4.0))
    marks = "return window.live.curves.curves.map(([curve]) => curve.marks ?? [])"
    for t, push, axis in ((4.5, 1, 1), (4.6, 1, 2), (5.0, 1, 1), (5.5, 2, 1)):
        page.publish("alarm", push=push, axis=axis, torque=-9.0, threshold=5.0, unit="N m", t=t)
    wait_until(browser, lambda: browser.execute_script(marks)[1:3] == [[4.5, 5.5], [4.6]])


@pytest.mark.parametrize("width", [1440, 420])
def test_the_legend_takes_one_line(
    browser: Chrome, watched: tuple[Served, Any], width: int
) -> None:
    page, _ = watched
    resize(browser, width, 900)
    page.publish("torque", **torques(4.0))
    tops = "return [...document.querySelectorAll('.legend .key')].map((e) => e.offsetTop)"
    wait_until(browser, lambda: browser.find_element(By.CSS_SELECTOR, ".legend").is_displayed())
    assert len(set(browser.execute_script(tops))) == 1


def test_marks_wait_for_data(
    browser: Chrome, manutec: Robot, small_plan: Plan, ideal_bus: IdealBus
) -> None:
    marks = "return [...document.querySelectorAll('#axes .fill')].map((e) => e.checkVisibility())"
    with served() as page:
        page.begin(manutec, small_plan, ideal_bus.axes)
        browser.get(page.url)
        wait_until(browser, lambda: browser.execute_script(marks) == [False] * 6)
        page.sample(Sample(4.1, Q, TAU, (0,) * 6, False))
        wait_until(browser, lambda: browser.execute_script(marks) == [True] * 6)


def test_a_motion_is_explained_and_the_end_leads_to_the_report(
    browser: Chrome, page: Served
) -> None:
    assert text(browser, "doing") == SEEN
    assert "gravity" in text(browser, "shows")
    page.publish("report", folder="runs/try", commands=["hil view runs/try/pushed/run"])
    wait_until(browser, lambda: "hil view" in text(browser, "ended"))
    link = browser.find_element(By.LINK_TEXT, "Open the report")
    assert link.get_attribute("href") == f"{page.url}report"
    wait_until(browser, lambda: not browser.find_element(By.ID, "stop").is_enabled())  # all is over
    assert text(browser, "left") == ""
    assert complaints(browser) == []


def test_where_nothing_can_be_pushed_there_is_no_hand(browser: Chrome, page: Served) -> None:
    del page
    assert text(browser, "hand") == ""


@pytest.mark.parametrize("width", [1440, 420])
@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_everybody_can_use_a_page_that_is_watched_and_pushed(
    browser: Chrome, watched: tuple[Served, Any], width: int, scheme: str
) -> None:
    page, _ = watched
    resize(browser, width, 900)
    colour_scheme(browser, scheme)
    page.publish("estimate", **estimate(0.0052, None))
    page.publish("torque", **torques(4.0))
    page.publish("alarm", push=1, axis=1, torque=-31.2, threshold=9.0, unit="N m", t=4.5)
    wait_until(browser, lambda: "kg m²" in text(browser, "intervals"))
    wait_until(browser, lambda: "at its end" in label(browser, 5))
    browser.execute_script(AXE)
    assert browser.execute_async_script(FAULTS) == []
    assert browser.execute_script(ENDS) <= width
    assert complaints(browser) == []


def test_a_sample_that_is_missing_is_said_to_be(browser: Chrome, page: Served) -> None:
    nan = float("nan")
    page.sample(Sample(4.1, (nan, *Q[1:]), (nan, *TAU[1:]), (1, 0, 0, 0, 0, 0), False))
    wait_until(browser, lambda: cells(browser)[0][1].startswith("missing"))
    assert cells(browser)[1][1].startswith("−0.30 rad")


def test_findings_and_faults_are_shown_with_their_remedy(
    browser: Chrome, page: Served, small_plan: Plan
) -> None:
    finding = Finding("gaps", "12 samples are missing, at most 3 may; check the cable", 12, 3)
    event = GaveUp(9.0, 10.0, small_plan.measurements[0], 3, (finding,))
    page.publish("event", **lines.event(event, 30.0, {"g1": 1}))
    wait_until(browser, lambda: "check the cable" in text(browser, "notices"))
    page.publish("fault", text="joint 2: following error; check the brake")
    page.publish("off")
    page.publish("end", how="failed", text="joint 2: following error; check the brake")
    wait_until(
        browser,
        lambda: text(browser, "state") == "the run has ended with a fault, the axes are off",
    )
    assert text(browser, "fault") == "joint 2: following error; check the brake"
    assert text(browser, "notices").count("check the brake") == 1
    assert not browser.find_element(By.ID, "stop").is_enabled()


def test_text_of_files_and_drives_stays_text(
    browser: Chrome, page: Served, ideal_bus: IdealBus
) -> None:
    axes = [replace(axis, name=HOSTILE, identity=HOSTILE) for axis in ideal_bus.axes]
    page.publish("armed", **lines.armed(axes))
    page.publish("note", text=HOSTILE)
    page.publish("fault", text=HOSTILE)
    wait_until(browser, lambda: HOSTILE in text(browser, "notices"))
    assert text(browser, "fault") == HOSTILE
    assert browser.find_element(By.CSS_SELECTOR, "#axes tbody tr").get_attribute("title") == HOSTILE
    assert browser.find_elements(By.CSS_SELECTOR, "main img, header img") == []


def test_the_button_stops_once(browser: Chrome, page: Served) -> None:
    browser.find_element(By.ID, "stop").click()
    wait_until(browser, lambda: page.stops == [1])
    wait_until(browser, lambda: text(browser, "state") == "stopping all axes")
    page.publish("off")
    page.publish("end", how="stopped", text="")
    wait_until(browser, lambda: text(browser, "state") == "stopped, the axes are off")
    assert complaints(browser) == []


def test_a_stop_that_cannot_be_delivered_says_what_to_do(browser: Chrome, page: Served) -> None:
    page.listener._process.kill()  # type: ignore[union-attr]
    wait_until(browser, lambda: text(browser, "state").startswith("no connection to the run"))
    browser.find_element(By.ID, "stop").click()
    wait_until(browser, lambda: "was not delivered" in text(browser, "fault"))
    assert "Ctrl-C" in text(browser, "fault")
    complaints(browser)


def test_samples_that_stay_away_are_missed(browser: Chrome, page: Served) -> None:
    wait_until(browser, lambda: text(browser, "state").startswith("armed, but no sample for"))


def test_a_page_that_is_opened_late_knows_all(browser: Chrome, page: Served) -> None:
    page.publish("note", text="joint 3 warms up")
    wait_until(browser, lambda: "joint 3 warms up" in text(browser, "notices"))
    browser.refresh()
    wait_until(browser, lambda: "joint 3 warms up" in text(browser, "notices"))
    wait_until(browser, lambda: any(row[1].startswith("−0.30 rad") for row in cells(browser)))
    assert text(browser, "doing") == SEEN


def test_the_button_of_another_address_works_too(
    browser: Chrome, manutec: Robot, small_plan: Plan, ideal_bus: IdealBus
) -> None:
    with served("0.0.0.0") as page:  # noqa: S104 - on purpose
        page.begin(manutec, small_plan, ideal_bus.axes)
        browser.get(f"http://127.0.0.1:{page.port}{page.path}")
        wait_until(browser, lambda: text(browser, "state").startswith("armed"))
        browser.find_element(By.ID, "stop").click()
        wait_until(browser, lambda: page.stops == [1])
    complaints(browser)


@pytest.mark.parametrize("width", [1440, 420])
@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_everybody_can_use_it(browser: Chrome, page: Served, width: int, scheme: str) -> None:
    resize(browser, width, 900)
    colour_scheme(browser, scheme)
    page.publish("note", text="joint 3 warms up")
    page.publish("fault", text="joint 2: following error; check the brake")
    page.publish("level", axis=1, level=51.2, speed=0.4, count=2, least=49.0, most=51.2)
    page.publish("estimate", **estimate(0.00052, None))
    wait_until(browser, lambda: text(browser, "fault"))
    wait_until(browser, lambda: "product of inertia" in text(browser, "intervals"))
    browser.execute_script(AXE)
    assert browser.execute_async_script(FAULTS) == []
    assert browser.execute_script(ENDS) <= width
    stop = browser.find_element(By.ID, "stop")
    browser.execute_script("window.scrollTo(0, document.body.scrollHeight)")
    top = browser.execute_script("return arguments[0].getBoundingClientRect().top", stop)
    assert 0 <= top < 200  # always visible
    assert complaints(browser) == []
