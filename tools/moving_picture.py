"""Write docs/img/try.gif: the page of `hil try` while it measures, identifies and is pushed.

::

    python tools/moving_picture.py

Takes four minutes, Chromium and Pillow (which Matplotlib brings).
"""

from __future__ import annotations

import io
import re
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from PIL import Image

ROOT = Path(__file__).parents[1]
sys.path.insert(0, str(ROOT / "tests" / "support"))
from browser import opened_browser, resize  # noqa: E402 - it stands among the tests

SIZE = 960, 720
SHRUNK = 720, 540
EVERY = 2.0
"""From one picture to the next [s]; the film shows five of them a second."""
COLOURS = 64
"""Enough for a page without photographs."""
PUSHED = "Push the arm"
"""How the page's headline begins where it may be pushed."""
PUSH = "document.querySelector('[aria-label=\"Push axis 2\"]').click()"


def main() -> None:
    """Film the page from its opening until after the push."""
    with tempfile.TemporaryDirectory() as place:
        command = [sys.executable, "-m", "hil", "try", "--no-browser", "-o", f"{place}/try"]
        tried = subprocess.Popen([*command, "--push", "20"], stdout=subprocess.PIPE, text=True)
        (address,) = re.findall(r"http://\S+", next(iter(tried.stdout or ())))
        with opened_browser(Path(place) / "profile") as browser:
            resize(browser, *SIZE)
            browser.get(address)
            film, pushes = [], 0
            while tried.poll() is None:
                begun = time.monotonic()
                film.append(Image.open(io.BytesIO(browser.get_screenshot_as_png())))
                said = browser.find_element("tag name", "body").text
                if PUSHED in said and pushes < 3:
                    browser.execute_script(PUSH)
                    pushes += 1
                time.sleep(max(0.0, EVERY - (time.monotonic() - begun)))
        shown = [each.convert("RGB").resize(SHRUNK).quantize(COLOURS) for each in film]
        first, *others = shown
        first.save(
            ROOT / "docs" / "img" / "try.gif", save_all=True, append_images=others, duration=200,
            loop=0, optimize=True,
        )  # fmt: skip


if __name__ == "__main__":
    main()
