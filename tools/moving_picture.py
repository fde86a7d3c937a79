"""Write docs/img/try.gif: the page of `hil try` while it measures, identifies and is pushed.

::

    python tools/moving_picture.py

Takes five minutes, Chromium and Pillow (which Matplotlib brings).
"""

from __future__ import annotations

import io
import re
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import TYPE_CHECKING

from PIL import Image

if TYPE_CHECKING:
    from selenium.webdriver import Chrome

ROOT = Path(__file__).parents[1]
sys.path.insert(0, str(ROOT / "tests" / "support"))
from browser import opened_browser, resize  # noqa: E402 - it stands among the tests

SIZE = 960, 860
"""Of the page, in which three charts have room beside each other; not shrunk, to stay readable."""
SHOWN = "#torques > div:nth-child(n + 4) { display: none }"
"""Style of the film: the axes of the wrist are left out."""
SLOWLY, QUICKLY = 5.0, 1.0
"""From one picture to the next before the arm may be pushed, and then [s]."""
LASTS, LAST = 250, 3000
"""Time for which a picture, and the last one, is shown [ms]."""
COLOURS = 96
"""Enough for a page without photographs."""
BEGUN, PUSHED, DONE = "Measuring", "Push the arm", "Done"
"""How the page's headline begins once the robot moves, where it may be pushed, and at the end."""
ELBOW = """
const { scene } = window.live;
const at = scene.camera.position.clone().setFromMatrixPosition(scene.chain.frames[3]);
const { x, y } = at.project(scene.camera);
const { left, top, width, height } = scene.renderer.domElement.getBoundingClientRect();
return [left + ((x + 1) / 2) * width, top + ((1 - y) / 2) * height];
"""


def main() -> None:
    """Film the page from the first motion until after the push."""
    with tempfile.TemporaryDirectory() as place:
        command = [sys.executable, "-m", "hil", "try", "--no-browser", "-o", f"{place}/try"]
        tried = subprocess.Popen([*command, "--push", "20"], stdout=subprocess.PIPE, text=True)
        (address,) = re.findall(r"http://\S+", next(iter(tried.stdout or ())))
        with opened_browser(Path(place) / "profile") as browser:
            resize(browser, *SIZE)
            browser.get(address)
            browser.execute_script(
                "const style = new CSSStyleSheet(); style.replaceSync(arguments[0]);"
                "document.adoptedStyleSheets.push(style)",
                SHOWN,
            )
            film = _film(browser, tried)
    _write(film, ROOT / "docs" / "img" / "try.gif")


def _film(browser: Chrome, tried: subprocess.Popen[str]) -> list[Image.Image]:
    film, pushed = [], 0
    while tried.poll() is None:
        begun = time.monotonic()
        headline = browser.find_element("id", "headline").text
        if film or headline.startswith(BEGUN):
            film.append(Image.open(io.BytesIO(browser.get_screenshot_as_png())).convert("RGB"))
        if headline.startswith(PUSHED) or (pushed and not headline.startswith(DONE)):
            _drag(browser, pushed)
            pushed += 1
        time.sleep(max(0.0, begun + (QUICKLY if pushed else SLOWLY) - time.monotonic()))
    return film


def _drag(browser: Chrome, step: int) -> None:
    """Pull the elbow downwards with the mouse for some steps, then let it go, and again."""
    kind = {1: "mousePressed", 2: "mouseMoved", 4: "mouseReleased"}.get(step % 12)
    if kind is None:
        return
    x, y = browser.execute_script(ELBOW)
    if kind != "mousePressed":
        x, y = x + 40, y + 70
    at = {"type": kind, "x": x, "y": y, "button": "left", "buttons": 1, "clickCount": 1}
    browser.execute_cdp_cmd("Input.dispatchMouseEvent", at)


def _write(film: list[Image.Image], path: Path) -> None:
    """Write pictures with the colours of one of them, so that only what changes takes room."""
    # with the ground's own, which the widest range of colours leaves out
    colours = film[-3].quantize(COLOURS, Image.Quantize.MEDIANCUT, kmeans=1)
    first, *others = [each.quantize(palette=colours, dither=Image.Dither.NONE) for each in film]
    lasts = [*[LASTS] * len(others), LAST]
    first.save(path, save_all=True, append_images=others, duration=lasts, loop=0, optimize=True)


if __name__ == "__main__":
    main()
