"""Plant files and drives files for drives with a personality, as written by a user."""

from __future__ import annotations

from fractions import Fraction
from pathlib import Path
from typing import TYPE_CHECKING, Any

import yaml

from drivers.drives_file import DrivesFile
from sim_plant.personality import PLAIN, load_personality, packaged_personalities

if TYPE_CHECKING:
    from sim_plant.personality import Personality

ROOT = Path(__file__).parents[2]
DRIVES = ROOT / "hil" / "robots" / "manutec-r15.drives.yaml"
PLANT = ROOT / "sim_plant" / "plants" / "manutec-r15.yaml"

UNFIT = ("no-current", "no-watchdog", "wrong-pdos")
"""Personalities unfit for measuring."""
FIT = tuple(name for name in packaged_personalities() if name not in UNFIT)


def drives_for(name: str, **changes: Any) -> DrivesFile:
    """Return a drives file that describes drives of a personality."""
    personality = PLAIN if name == PLAIN.name else load_personality(name)
    data = yaml.safe_load(DRIVES.read_text())
    for axis in data["axes"]:
        axis["current"] = _current(personality)
        if personality.counts_per_turn is not None:
            counts = personality.counts_per_turn / Fraction(str(axis["gear_ratio"]))
            axis["zero"] = round(axis["zero"] * counts / axis["increments_per_revolution"])
            axis["increments_per_revolution"] = str(counts)
        axis["velocity_unit"] = personality.velocity_unit
        axis["acceleration_unit"] = personality.acceleration_unit
        if personality.acknowledge_until_reached:
            axis["acknowledge"] = "reached"
        axis.update(changes)
    return DrivesFile.model_validate(data)


def _current(personality: Personality) -> dict[str, Any]:
    current = personality.current
    if current is None and 0x6077 not in personality.missing:
        return {"index": 0x6077, "type": "i16", "basis": "per mille of rated torque"}
    stated = {"index": 0x6078, "type": "i16"} if current is None else current.model_dump()
    unit = stated.pop("unit", "mA")
    counts = {"0.01 A": 10.0, "A": 1000.0}
    counted = {"basis": "mA", "per_count": counts[unit]} if unit in counts else {"basis": unit}
    return {**stated, **counted, "amplitude": "peak"}


def plant_file(folder: Path, name: str, **changes: Any) -> str:
    """Write a plant file whose drives all have a personality; return its path."""
    data = {**yaml.safe_load(PLANT.read_text()), **changes}
    for axis in data["axes"]:
        if name != PLAIN.name:
            axis["drive"]["personality"] = name
    path = folder / f"{name}.yaml"
    path.write_text(yaml.safe_dump(data))
    return str(path)
