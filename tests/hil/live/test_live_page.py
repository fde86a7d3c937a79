"""The live page in a real browser: what it shows, and whether everybody can use it."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest
from browser import colour_scheme, opened_browser, require_browser, resize
from live_page import Served, served
from selenium.webdriver.common.by import By
from selenium.webdriver.support.ui import WebDriverWait

from drivers.drive_bus import Sample
from hil.live import lines
from hil.measuring.events import GaveUp, Travelled
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
    """A run that measures g1, open in the browser."""
    with served() as found:
        found.begin(manutec, small_plan, ideal_bus.axes)
        event = Travelled(3.0, 20.0, small_plan.measurements[0])
        found.publish("event", **lines.event(event, 65.0, {"g1": 1}))
        found.sample(Sample(4.0, Q, TAU, (0,) * 6, False))
        browser.get(found.url)
        until(browser, lambda: "rad" in "".join(row[1] for row in cells(browser)))
        yield found


def until(browser: Chrome, condition: Any) -> None:
    WebDriverWait(browser, 30, 0.05).until(lambda _: condition())


def text(browser: Chrome, name: str) -> str:
    return browser.find_element(By.ID, name).text


def cells(browser: Chrome) -> list[list[str]]:
    """Return what the table of axes shows, row by row."""
    return browser.execute_script(  # type: ignore[no-any-return]
        "return [...document.querySelectorAll('#axes tbody tr')]"
        ".map((row) => [...row.children].map((cell) => cell.innerText));"
    )


def complaints(browser: Chrome) -> list[str]:
    return [each["message"] for each in browser.get_log("browser") if each["level"] == "SEVERE"]


def test_state_progress_and_axes_are_shown(browser: Chrome, page: Served) -> None:
    assert text(browser, "state") == "armed: the axes are under power"
    assert text(browser, "doing") == "measuring g1 (gravity), 1 of 3"
    assert text(browser, "left") in {"1:05 left", "1:04 left", "1:03 left"}
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
    until(browser, lambda: not browser.find_element(By.ID, "simulated").is_displayed())


def test_the_robot_stands_as_it_was_sampled(browser: Chrome, page: Served) -> None:
    assert browser.execute_script("return window.live.scene.q") == pytest.approx(Q)
    moved = tuple(q + 0.1 for q in Q)
    page.sample(Sample(4.1, moved, TAU, (0,) * 6, False))
    until(
        browser,
        lambda: browser.execute_script("return window.live.scene.q") == pytest.approx(moved),
    )


def test_friction_so_far_stands_beside_its_axis(browser: Chrome, page: Served) -> None:
    level = {"axis": 1, "speed": 0.4, "measurement": "g1"}
    page.publish("level", **level, level=51.2, count=1, least=51.2, most=51.2)
    until(browser, lambda: cells(browser)[1][3] == "51.2 N m at 0.40 rad/s")
    page.publish("level", **level, level=53.2, count=2, least=51.2, most=53.2)
    wanted = "53.2 N m at 0.40 rad/s (2 so far: 51.2 to 53.2)"
    until(browser, lambda: cells(browser)[1][3] == wanted)


def test_a_sample_that_is_missing_is_said_to_be(browser: Chrome, page: Served) -> None:
    nan = float("nan")
    page.sample(Sample(4.1, (nan, *Q[1:]), (nan, *TAU[1:]), (1, 0, 0, 0, 0, 0), False))
    until(browser, lambda: cells(browser)[0][1].startswith("missing"))
    assert cells(browser)[1][1].startswith("−0.30 rad")


def test_findings_and_faults_are_shown_with_their_remedy(
    browser: Chrome, page: Served, small_plan: Plan
) -> None:
    finding = Finding("gaps", "12 samples are missing, at most 3 may; check the cable", 12, 3)
    event = GaveUp(9.0, 10.0, small_plan.measurements[0], 3, (finding,))
    page.publish("event", **lines.event(event, 30.0, {"g1": 1}))
    until(browser, lambda: "check the cable" in text(browser, "notices"))
    page.publish("fault", text="joint 2: following error; check the brake")
    page.publish("off")
    page.publish("end", how="failed", text="joint 2: following error; check the brake")
    until(
        browser,
        lambda: text(browser, "state") == "the run has ended with a fault, the axes are off",
    )
    assert text(browser, "fault") == "joint 2: following error; check the brake"
    assert text(browser, "notices").count("check the brake") == 1
    assert not browser.find_element(By.ID, "stop").is_enabled()


def test_text_of_files_and_drives_stays_text(
    browser: Chrome, page: Served, ideal_bus: IdealBus
) -> None:
    page.publish("note", text=HOSTILE)
    page.publish("fault", text=HOSTILE)
    until(browser, lambda: HOSTILE in text(browser, "notices"))
    assert text(browser, "fault") == HOSTILE
    assert browser.find_elements(By.CSS_SELECTOR, "main img, header img") == []


def test_the_button_stops_once(browser: Chrome, page: Served) -> None:
    browser.find_element(By.ID, "stop").click()
    until(browser, lambda: page.stops == [1])
    until(browser, lambda: text(browser, "state") == "stopping all axes")
    page.publish("off")
    page.publish("end", how="stopped", text="")
    until(browser, lambda: text(browser, "state") == "stopped, the axes are off")
    assert complaints(browser) == []


def test_a_stop_that_cannot_be_delivered_says_what_to_do(browser: Chrome, page: Served) -> None:
    page.listener._process.kill()  # type: ignore[union-attr]
    until(browser, lambda: text(browser, "state").startswith("no connection to the run"))
    browser.find_element(By.ID, "stop").click()
    until(browser, lambda: "was not delivered" in text(browser, "fault"))
    assert "Ctrl-C" in text(browser, "fault")
    complaints(browser)


def test_samples_that_stay_away_are_missed(browser: Chrome, page: Served) -> None:
    until(browser, lambda: text(browser, "state").startswith("armed, but no sample for"))


def test_a_page_that_is_opened_late_knows_all(browser: Chrome, page: Served) -> None:
    page.publish("note", text="joint 3 warms up")
    until(browser, lambda: "joint 3 warms up" in text(browser, "notices"))
    browser.refresh()
    until(browser, lambda: "joint 3 warms up" in text(browser, "notices"))
    until(browser, lambda: any(row[1].startswith("−0.30 rad") for row in cells(browser)))
    assert text(browser, "doing") == "measuring g1 (gravity), 1 of 3"


def test_the_button_of_another_address_works_too(
    browser: Chrome, manutec: Robot, small_plan: Plan, ideal_bus: IdealBus
) -> None:
    with served("0.0.0.0") as page:  # noqa: S104 - on purpose
        page.begin(manutec, small_plan, ideal_bus.axes)
        browser.get(f"http://127.0.0.1:{page.port}{page.path}")
        until(browser, lambda: text(browser, "state").startswith("armed"))
        browser.find_element(By.ID, "stop").click()
        until(browser, lambda: page.stops == [1])
    complaints(browser)


@pytest.mark.parametrize("width", [1440, 420])
@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_everybody_can_use_it(browser: Chrome, page: Served, width: int, scheme: str) -> None:
    resize(browser, width, 900)
    colour_scheme(browser, scheme)
    page.publish("note", text="joint 3 warms up")
    page.publish("fault", text="joint 2: following error; check the brake")
    page.publish("level", axis=1, level=51.2, speed=0.4, count=2, least=49.0, most=51.2)
    until(browser, lambda: text(browser, "fault"))
    browser.execute_script(AXE)
    assert browser.execute_async_script(FAULTS) == []
    assert browser.execute_script(ENDS) <= width
    stop = browser.find_element(By.ID, "stop")
    browser.execute_script("window.scrollTo(0, document.body.scrollHeight)")
    top = browser.execute_script("return arguments[0].getBoundingClientRect().top", stop)
    assert 0 <= top < 200  # always within reach
    assert complaints(browser) == []
