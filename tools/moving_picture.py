"""Write docs/img/try.gif: the page of `hil try` during measurement, identification and push.

::

    python tools/moving_picture.py

Takes five minutes; needs Chromium and Pillow (a dependency of Matplotlib).
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
from browser import opened_browser, resize  # noqa: E402 - modules of the tests
from first_minutes import PUSHED, pull_elbow, tried  # noqa: E402

SIZE = 960, 860
"""Size of the page [pixels], with room for three charts side by side."""
SHOWN = "#torques > div:nth-child(n + 4) { display: none }"
"""Style of the film: the axes of the wrist are left out."""
SLOWLY, QUICKLY = 5.0, 1.0
"""Intervals between pictures, before and after the arm can be pushed [s]."""
LASTS, LAST = 250, 3000
"""Display time of a picture, and of the last picture [ms]."""
COLOURS = 96
"""Number of colours, sufficient for a page without photographs."""
BEGUN, DONE = "Measuring", "Done"
"""First words of the page's headline once the robot moves, and at the end."""


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
    """Write pictures with one common palette, so that unchanged areas need no storage."""
    # median cut keeps the colour of the background, unlike maximum coverage
    colours = film[-3].quantize(COLOURS, Image.Quantize.MEDIANCUT, kmeans=1)
    first, *others = [each.quantize(palette=colours, dither=Image.Dither.NONE) for each in film]
    lasts = [*[LASTS] * len(others), LAST]
    first.save(path, save_all=True, append_images=others, duration=lasts, loop=0, optimize=True)


if __name__ == "__main__":
    main()
