"""Write docs/img/try.gif: the page of `hil try` while it measures, identifies and is pushed.

::

    python tools/moving_picture.py

Takes five minutes, Chromium and Pillow (which Matplotlib brings).
"""

from __future__ import annotations

import io
import sys
import tempfile
import time
from pathlib import Path
from typing import TYPE_CHECKING

from PIL import Image

if TYPE_CHECKING:
    from subprocess import Popen

    from selenium.webdriver import Chrome

ROOT = Path(__file__).parents[1]
sys.path[:0] = [str(ROOT / "benchmarks"), str(ROOT / "tests" / "support")]
from browser import opened_browser, resize  # noqa: E402 - it stands among the tests
from first_minutes import PUSHED, pull_elbow, tried  # noqa: E402

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
BEGUN, DONE = "Measuring", "Done"
"""How the page's headline begins once the robot moves, and at the end."""


def main() -> None:
    """Film the page from the first motion until after the push."""
    with (
        tempfile.TemporaryDirectory() as place,
        opened_browser(Path(place) / "profile") as browser,
        tried("-o", f"{place}/try", "--push", "20") as shown,
    ):
        resize(browser, *SIZE)
        browser.get(shown.address)
        browser.execute_script(
            "const style = new CSSStyleSheet(); style.replaceSync(arguments[0]);"
            "document.adoptedStyleSheets.push(style)",
            SHOWN,
        )
        film = _film(browser, shown.process)
    _write(film, ROOT / "docs" / "img" / "try.gif")


def _film(browser: Chrome, process: Popen[str]) -> list[Image.Image]:
    film, pushed = [], 0
    while process.poll() is None:
        begun = time.monotonic()
        headline = browser.find_element("id", "headline").text
        if film or headline.startswith(BEGUN):
            film.append(Image.open(io.BytesIO(browser.get_screenshot_as_png())).convert("RGB"))
        if headline.startswith(PUSHED) or (pushed and not headline.startswith(DONE)):
            pull_elbow(browser, pushed)
            pushed += 1
        time.sleep(max(0.0, begun + (QUICKLY if pushed else SLOWLY) - time.monotonic()))
    return film


def _write(film: list[Image.Image], path: Path) -> None:
    """Write pictures with the colours of one of them, so that only what changes takes room."""
    # with the ground's own, which the widest range of colours leaves out
    colours = film[-3].quantize(COLOURS, Image.Quantize.MEDIANCUT, kmeans=1)
    first, *others = [each.quantize(palette=colours, dither=Image.Dither.NONE) for each in film]
    lasts = [*[LASTS] * len(others), LAST]
    first.save(path, save_all=True, append_images=others, duration=lasts, loop=0, optimize=True)


if __name__ == "__main__":
    main()
