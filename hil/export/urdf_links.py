"""Links of a URDF that move as one: those that fixed joints attach to one another.

Identified is what moves with a joint, whatever it is bolted together from. So the body of a link
of the chain is that of all links attached to it, and the others of them have none left.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from hil.model.frames import parameter_map
from hil.model.readers.urdf import UrdfReader

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import NDArray

    Array = NDArray[np.float64]

_INERTIA = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")


class UrdfLinks:
    """Links of a URDF, by what is attached to what.

    Raises
    ------
    FileError
        No URDF.
    """

    def __init__(self, path: Path | str) -> None:
        self._reader = UrdfReader(Path(path))

    def attached(self, link: str) -> Iterator[tuple[str, Array]]:
        """Yield the links that are fixed to one, itself first, with their poses in it, (4, 4)."""
        yield from self._below(link, np.eye(4))

    def moving(self, link: str) -> list[str]:
        """Names of joints that move something beyond the links attached to `link`."""
        return [
            str(edge.element.get("name"))
            for name, _ in self.attached(link)
            for edge in self._reader.below.get(name, ())
            if edge.element.get("type") != "fixed"
        ]

    def body(self, link: str) -> Array | None:
        """Standard parameters of all attached links in a link's frame; None where none has any.

        Raises
        ------
        FileError
            An inertial without numbers.
        """
        parts = [(self._inertial(name), pose) for name, pose in self.attached(link)]
        known = [parameter_map(pose) @ body for body, pose in parts if body is not None]
        return np.sum(known, axis=0) if known else None

    def _below(self, link: str, pose: Array) -> Iterator[tuple[str, Array]]:
        yield link, pose
        for edge in self._reader.below.get(link, ()):
            if edge.element.get("type") == "fixed":
                yield from self._below(edge.child, pose @ self._reader.origin(edge.element))

    def _inertial(self, link: str) -> Array | None:
        element = self._reader.links[link].find("inertial")
        mass, inertia = (
            None if element is None else element.find(tag) for tag in ("mass", "inertia")
        )
        if element is None or mass is None or inertia is None:
            return None
        (m,) = self._reader.file.numbers(mass, "value", 1) or [0.0]
        own = [(self._reader.file.numbers(inertia, key, 1) or [0.0])[0] for key in _INERTIA]
        about_centre = np.array([*own, 0.0, 0.0, 0.0, m])
        return np.asarray(parameter_map(self._reader.origin(element)) @ about_centre)
