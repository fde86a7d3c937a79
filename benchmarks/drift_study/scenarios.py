"""Friction of the plants in a study: plant files with changed keys.

Two effects may spoil an identification: friction drifts during the measurement, and friction does
not have the assumed form (misfit). Scenario "off" has only the misfit; "on" and "strong" add drift;
"asymmetric" also breaks the assumption of the two-step method; under "load" friction grows with the
torque that the gear transmits, which no function of speed describes.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import yaml

from checked_files.yaml_file import FileError
from hil.ground_truth.true_parameters import find_plant
from hil.runs.atomic_file import file_errors, write_file

if TYPE_CHECKING:
    from pathlib import Path


@dataclass(frozen=True, slots=True)
class Scenario:
    """Changes to a plant file.

    Attributes
    ----------
    says : str
        Description of the difference, for tables.
    plant : dict
        Keys of the plant.
    friction : dict
        Keys of every axis's friction.
    asymmetry : float
        Factor of every axis's asymmetry.
    gears : float
        Natural frequency of every gear, its motor held; 0 for rigid ones [Hz].
    offset : float
        First moment of link 4 across the forearm [kg m].
    """

    says: str
    plant: dict[str, Any] = field(default_factory=dict)
    friction: dict[str, Any] = field(default_factory=dict)
    asymmetry: float = 1.0
    gears: float = 0.0
    offset: float = 0.0


SCENARIOS: dict[str, Scenario] = {
    "off": Scenario("no drift, symmetric", {"drift": False, "symmetric": True}),
    "on": Scenario("drift, symmetric", {"drift": True, "symmetric": True}),
    "strong": Scenario(
        "threefold drift, symmetric",
        {"drift": True, "symmetric": True, "drift_strength": 3.0},
    ),
    "asymmetric": Scenario("drift, asymmetric", {"drift": True}),
    "load": Scenario("drift, asymmetric, 5 % of load as friction", {"drift": True}, {"load": 0.05}),
}


def write_plant(scenario: Scenario, plant: str, path: Path) -> None:
    """Write the plant file of a scenario, unless the file exists.

    Parameters
    ----------
    plant : str
        Plant file, or the name of a built-in plant.

    Raises
    ------
    FileError
        The plant file does not exist, or has changed since the study began.
    """
    source = find_plant(plant)
    with file_errors(source, "read"):
        content = yaml.safe_load(source.read_text(encoding="utf-8"))
    if not isinstance(content, dict) or not isinstance(content.get("axes"), list):
        raise FileError(f"{source}: is no plant file: it has no list of axes")
    content |= scenario.plant
    for axis in content["axes"]:
        axis["friction"] = axis.get("friction", {}) | scenario.friction
        if scenario.asymmetry != 1.0:
            axis["friction"]["asymmetry"] *= scenario.asymmetry
        if scenario.gears:
            content["step"], wave = 0.0005, math.tau * scenario.gears
            axis["drive"]["stiffness"] = axis["drive"]["load_inertia"] * wave**2
    if scenario.offset:
        content["axes"][3]["link"]["sy"] = scenario.offset
    text = yaml.safe_dump(content, sort_keys=False).encode()
    if not path.exists():
        write_file(path, text)
    elif path.read_bytes() != text:
        raise FileError(
            f"{path}: is another plant than {source} gives now; measured is the former, so give the"
            " study a folder of its own"
        )
