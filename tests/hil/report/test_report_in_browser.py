"""Report in a real browser: targets of its links, and accessibility."""

from __future__ import annotations

import re
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from browser import colour_scheme, opened_browser, require_browser, resize
from selenium.webdriver.common.action_chains import ActionChains
from selenium.webdriver.common.by import By
from selenium.webdriver.common.keys import Keys
from selenium.webdriver.support.ui import WebDriverWait
from small_run import identified_run

from hil.report.page import report
from hil.runs.run import Run

if TYPE_CHECKING:
    from collections.abc import Iterator

    from selenium.webdriver import Chrome
    from selenium.webdriver.remote.webelement import WebElement


AXE = (Path(__file__).parents[2] / "support" / "axe.min.js").read_text(encoding="utf-8")
FAULTS = """
const done = arguments[arguments.length - 1];
const grave = ({ impact }) => ['serious', 'critical'].includes(impact);
const found = ({ id, nodes }) => [id, nodes.slice(0, 3).map(({ html }) => html.slice(0, 300))];
axe.run().then(({ violations }) => done(violations.filter(grave).map(found)));
"""
DRAWN = """
const curves = report.curves.flatMap(({ drawn }) => drawn);
return Math.min(...curves.map(({ y }) => y.filter(Number.isFinite).length));
"""
"""Least number of points of a curve."""
POINT = '#plot-inertia [data-m="i05"]'
LARGEST = 1_250_000
"""Size of a page with 39 recordings; a fifth of it is the drawn robot [bytes]."""
LETTERS = """
return Math.min(...[...document.querySelectorAll('.chart svg text, .chart svg tspan')]
  .filter((each) => each.getClientRects().length && each.textContent.trim())
  .map((each) => {
    const { viewBox, clientWidth } = each.closest('svg');
    return parseFloat(getComputedStyle(each).fontSize) * clientWidth / viewBox.baseVal.width;
  }));
"""


@pytest.fixture(scope="module")
def browser(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Chrome]:
    require_browser()
    with opened_browser(tmp_path_factory.mktemp("profile")) as opened:
        opened.set_script_timeout(120)
        yield opened


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Run:
    return Run.open(identified_run(tmp_path_factory.mktemp("browsed") / "run"))


@pytest.fixture(scope="module")
def page(run: Run) -> Path:
    return report(run)


def show(browser: Chrome, page: Path, width: int = 1440, scheme: str = "light") -> None:
    resize(browser, width, 900)
    colour_scheme(browser, scheme)
    browser.get(page.as_uri())


def faults(browser: Chrome) -> Any:
    browser.execute_script(AXE)
    return browser.execute_async_script(FAULTS)


def opened(browser: Chrome) -> WebElement:
    dialog = browser.find_element(By.TAG_NAME, "dialog")
    WebDriverWait(browser, 20).until(lambda _: dialog.is_displayed())
    return dialog


@pytest.mark.parametrize("scheme", ["light", "dark"])
@pytest.mark.parametrize("width", [1440, 420])
def test_axe_finds_no_serious_fault_with_or_without_a_recording(
    browser: Chrome, page: Path, width: int, scheme: str
) -> None:
    show(browser, page, width, scheme)
    assert faults(browser) == []
    browser.execute_script(
        "document.querySelector(arguments[0]).dispatchEvent("
        "new KeyboardEvent('keydown', { key: 'Enter', bubbles: true }))",
        POINT,
    )
    opened(browser)
    assert faults(browser) == []


@pytest.mark.parametrize("width", [1440, 420])
def test_nothing_makes_the_page_wider_than_the_screen(
    browser: Chrome, page: Path, width: int
) -> None:
    show(browser, page, width)
    wide = "return document.documentElement.scrollWidth - document.documentElement.clientWidth"
    assert browser.execute_script(wide) == 0


@pytest.mark.parametrize("width", [1440, 420])
def test_every_chart_is_whole_on_the_screen_without_scrolling(
    browser: Chrome, page: Path, width: int
) -> None:
    show(browser, page, width)
    boxes = """return [...document.querySelectorAll('.panels > div')]
        .filter((each) => each.clientWidth)
        .map((each) => each.scrollWidth - each.clientWidth)"""
    beyond = browser.execute_script(boxes)
    assert len(beyond) > 10
    assert max(beyond) <= 0


def test_a_click_on_a_point_opens_the_recording_behind_it(
    browser: Chrome, page: Path, run: Run
) -> None:
    show(browser, page)
    point = browser.find_element(By.CSS_SELECTOR, POINT)
    browser.execute_script("arguments[0].scrollIntoView({ block: 'center' })", point)
    ActionChains(browser).move_to_element(point).perform()
    tip = browser.find_element(By.ID, "tip")
    assert (tip.is_displayed(), tip.text) == (True, "i05")
    ActionChains(browser).click().perform()
    dialog = opened(browser)
    measurement = run["i05"].measurement
    assert dialog.find_element(By.TAG_NAME, "h2").text == f"i05: inertia, axis {measurement.axis}"
    curves = dialog.find_elements(By.CSS_SELECTOR, ".curve canvas")
    labels = [each.get_attribute("aria-label") or "" for each in curves]
    assert [each.split("; at its end")[0] for each in labels] == [
        f"axis {measurement.axis}: {of}, over time"
        for of in (
            "torque, N m",
            "measured − predicted, N m",
            "position, rad",
            "velocity, rad/s",
        )
    ]
    assert browser.execute_script(DRAWN) > 50
    dialog.find_element(By.TAG_NAME, "button").click()
    assert not dialog.is_displayed()
    assert [each for each in browser.get_log("browser") if each["level"] == "SEVERE"] == []


@pytest.mark.parametrize("width", [1440, 420])
def test_letters_of_charts_are_of_12_pixels_at_least_on_phones_too(
    browser: Chrome, page: Path, width: int
) -> None:
    show(browser, page, width)
    assert browser.execute_script(LETTERS) >= 12.0


def test_a_click_on_a_parameter_shows_the_recordings_that_carry_it(
    browser: Chrome, page: Path
) -> None:
    show(browser, page)
    name = (By.CSS_SELECTOR, '[title^="product of inertia xz of link 2 (p3)"]')
    button = WebDriverWait(browser, 20).until(lambda opened: opened.find_element(*name))
    browser.execute_script("arguments[0].click()", button)
    dialog = opened(browser)
    assert dialog.find_element(By.TAG_NAME, "h2").text == "product of inertia xz of link 2 (p3)"
    first = dialog.find_element(By.CSS_SELECTOR, ".carriers button")
    wanted = first.text
    first.click()
    WebDriverWait(browser, 20).until(
        lambda _: dialog.find_element(By.TAG_NAME, "h2").text.startswith(f"{wanted}: coupling")
    )


PANEL = "#plot-torque svg[data-r]"
"""Selector of the panels of torque."""


def show_panel(browser: Chrome, page: Path) -> str | None:
    """Show the page, and return the recording of its first panel of torque."""
    show(browser, page)
    WebDriverWait(browser, 60).until(
        lambda _: browser.execute_script("return Boolean(window.report)")
    )
    return browser.find_element(By.CSS_SELECTOR, PANEL).get_attribute("data-r")


def test_one_instant_moves_the_robot_and_the_cursor_of_its_recording(
    browser: Chrome, page: Path
) -> None:
    name = show_panel(browser, page)
    pose = "report.seek(arguments[0], arguments[1]); return Array.from(report.view.q)"
    before, after = (browser.execute_script(pose, name, t) for t in (0.0, 1.0))
    assert before != after
    cursor = browser.find_element(By.CSS_SELECTOR, f"{PANEL} .cursor")
    assert (cursor.get_attribute("d") or "").startswith("M")


def test_the_torques_at_an_instant_are_read_in_the_panels_of_its_recording(
    browser: Chrome, page: Path
) -> None:
    name = show_panel(browser, page)
    read = """return arguments[2].map((t) => {
        report.seek(arguments[0], t);
        return [...document.querySelectorAll(`${arguments[1]} .read`)].map((e) => e.textContent);
    })"""
    instants = [0.1 * k for k in range(10, 40)]
    found = browser.execute_script(read, name, PANEL, instants)
    assert [each[1] for each in found] == [f"{t:.2f} s" for t in instants]
    # at rest there is no prediction
    both = [pair for pair in (re.findall(r"[−\d.]+", each[0]) for each in found) if len(pair) == 3]
    torques = np.array([[float(each.replace("−", "-")) for each in pair] for pair in both])
    assert len(torques) > 10
    assert np.corrcoef(torques[:, 0], torques[:, 1])[0, 1] > 0.98


def test_a_click_on_torques_opens_their_recording_and_a_drag_zooms_all_its_curves(
    browser: Chrome, page: Path
) -> None:
    show(browser, page)
    panel = browser.find_element(By.CSS_SELECTOR, "#plot-torque svg[data-axis]")
    WebDriverWait(browser, 60).until(lambda _: panel.find_elements(By.CLASS_NAME, "cursor"))
    browser.execute_script("arguments[0].scrollIntoView({ block: 'center' })", panel)
    ActionChains(browser).click(panel).perform()
    dialog = opened(browser)
    name = panel.get_attribute("data-r")
    assert dialog.find_element(By.TAG_NAME, "h2").text.startswith(f"{name}: ")
    spans = "return report.curves.map(({ span }) => span)"
    whole = browser.execute_script(spans)
    canvas = dialog.find_element(By.CSS_SELECTOR, ".curve canvas")
    drag = ActionChains(browser).move_to_element(canvas).click_and_hold().move_by_offset(80, 2)
    drag.release().perform()
    begins, ends = np.array(browser.execute_script(spans)).T
    assert (np.ptp(begins), np.ptp(ends)) == (0, 0)
    assert whole[0][0] < begins[0] < ends[0] < whole[0][1]
    ActionChains(browser).double_click(canvas).perform()
    assert browser.execute_script(spans) == whole
    dialog.find_element(By.TAG_NAME, "button").click()
    title = panel.find_element(By.CLASS_NAME, "title")
    browser.execute_script("arguments[0].focus()", title)
    browser.switch_to.active_element.send_keys(Keys.ENTER)
    assert dialog.is_displayed()


def test_the_arrow_keys_go_from_point_to_point_and_enter_opens(browser: Chrome, page: Path) -> None:
    show(browser, page)
    tip = browser.find_element(By.ID, "tip")
    first = browser.find_element(By.CSS_SELECTOR, '#plot-inertia svg [tabindex="0"]')
    browser.execute_script("arguments[0].focus()", first)
    began = tip.text
    browser.switch_to.active_element.send_keys(Keys.ARROW_RIGHT)
    assert tip.text not in ("", began)
    now = tip.text
    browser.switch_to.active_element.send_keys(Keys.ENTER)
    assert opened(browser).find_element(By.TAG_NAME, "h2").text.startswith(f"{now}: ")


def test_without_scripts_the_page_shows_its_figures_and_offers_no_points(
    browser: Chrome, page: Path
) -> None:
    browser.execute_cdp_cmd("Emulation.setScriptExecutionDisabled", {"value": True})
    try:
        show(browser, page)
        assert browser.find_element(By.CSS_SELECTOR, "#plot-torque svg").is_displayed()
        assert browser.find_element(By.CSS_SELECTOR, ".robot svg").is_displayed()
        assert not browser.find_element(By.CLASS_NAME, "hint").is_displayed()
    finally:
        browser.execute_cdp_cmd("Emulation.setScriptExecutionDisabled", {"value": False})


def test_the_page_is_of_a_modest_size(page: Path) -> None:
    assert page.stat().st_size < LARGEST
