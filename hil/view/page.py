"""Stand-alone HTML page of a scene, at most 3 MB, without server and network.

The scripts are bundled from `web/` in advance (`make view-bundle`); this module adds the data.
Pages too large are written with fewer instants.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from markupsafe import Markup

from checked_files.yaml_file import FileError
from hil.errors import InvalidValue
from hil.runs.atomic_file import write_file
from hil.runs.journal import versions
from hil.show.html import TEMPLATES, deflate, environment

if TYPE_CHECKING:
    from collections.abc import Callable

    from hil.view.scene import Scene

ASSETS = Path(__file__).parent / "assets"
MOST = (100_000, 50_000, 25_000, 12_000, 6_000)
"""Maximum numbers of instants, tried in turn."""
MARK = '<meta name="generator" content="hil view">'
"""Marker of a page that may be overwritten."""


def write_page(path: Path, make: Callable[[int], Scene], largest: int = 3_000_000) -> int:
    """Write the page of a scene; return its size in bytes.

    Parameters
    ----------
    make : callable
        Function from a number of instants to the scene.
    largest : int
        Largest size of a page [bytes].

    Raises
    ------
    FileError
        The file exists and is not a page of `hil view`, or cannot be written.
    InvalidValue
        The page is too large even with the fewest instants.
    """
    refuse_other_file(path)
    size = 0
    for most in MOST:
        content = html(make(most)).encode()
        size = len(content)
        if size < largest:
            write_file(path, content)
            return size
    raise InvalidValue(
        f"{path}: the page has {size / 1e6:.1f} MB, at most {largest / 1e6:.0f} MB; show fewer "
        "measurements, or omit --urdf"
    )


def html(scene: Scene) -> str:
    """Render the page of a scene."""
    return (
        environment(ASSETS)
        .get_template("page.html")
        .render(
            scene=scene,
            data=deflate(scene.data()),
            style=_asset("curves.css", TEMPLATES) + _asset("view.css"),
            script=_asset("view.js"),
            mark=Markup(MARK),  # noqa: S704 - our own
            version=versions()["canopen-robot-identification"],
        )
    )


def refuse_other_file(path: Path) -> None:
    """Refuse to overwrite a file other than a page of `hil view`.

    Raises
    ------
    FileError
        The file exists and is not such a page.
    """
    if not path.exists():
        return
    if path.is_file():
        with path.open("rb") as file:
            if MARK.encode() in file.read(1000):
                return
    raise FileError(
        f"{path}: already exists and is not a page of hil view; remove it or choose another name"
    )


def view_script() -> str:
    """Return the script bundle of the pages."""
    return str(_asset("view.js"))


def _asset(name: str, folder: Path = ASSETS) -> Markup:
    return Markup((folder / name).read_text(encoding="utf-8"))  # noqa: S704 - our own
