"""Names of robots as identifiers of C and Python."""

from __future__ import annotations

import re


def identifier(name: str) -> str:
    """Return a robot's name in small letters, figures and underscores, a letter first.

    A robot file admits letters, figures, dots, hyphens and underscores only. What is made of the
    name always has something behind it, such as ``_gravity``, so that no keyword comes about.
    """
    plain = re.sub(r"[^a-z0-9]+", "_", name.lower()).strip("_")
    return plain if plain[:1].isalpha() else f"robot_{plain}"
