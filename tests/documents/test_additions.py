"""CONTRIBUTING's table of additions: its files exist and contain the listed registries.

Each row names a registry: the present entries of this registry are at the place that the row states
for new entries.
"""

from __future__ import annotations

import inspect
import re
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import pytest
from fault_table.cases import CASES

from benchmarks.rivals import RIVALS
from drivers import rate_units
from drivers.commissioning import requirements
from hil.estimation import nuisances
from hil.estimation.consistent import conditions
from hil.estimation.drive_train import DriveTrain
from hil.estimation.free_motion.motion import Processing
from hil.estimation.free_motion.nuisances import find_nuisances
from hil.estimation.free_motion.result import FreeMotionFit
from hil.estimation.identify import METHODS
from hil.estimation.import_methods import fit_free_motions
from hil.estimation.local_fits import LOCAL_FITS
from hil.export import formats
from hil.measuring.sequencer import MANNERS
from hil.planning.design.measurable_elements import ELEMENTS
from hil.planning.measurement import ELEMENT_KINDS
from hil.report.sections import OF_FRICTION, OF_IDENTIFIED
from sim_plant import personality
from sim_plant.faults import faulty_network, faulty_segment
from sim_plant.faults.fault_plan import What

if TYPE_CHECKING:
    from collections.abc import Iterable

ROOT = Path(__file__).parents[2]
TABLE = re.compile(r"(?ms)^\| what is added \| files \|\n\|---\|---\|\n(.*?)\n\n")
PLACE = re.compile(r"`((?:hil|drivers|sim_plant|benchmarks|tests)/[\w./]+)`")
NAMED_IN = re.compile(r"`([A-Z_]+)` of `([\w./]+)`")


class Registry(NamedTuple):
    """Registry of a kind of addition: file of the module, and present entries."""

    file: str
    members: Iterable[Any]


REGISTRIES = {
    "a kind of measurement": (
        Registry("hil/planning/measurement.py", [kind.model for kind in ELEMENT_KINDS.values()]),
        *(
            Registry(file, [registry[name] for name in ELEMENT_KINDS])
            for file, registry in (
                ("hil/planning/design/measurable_elements.py", ELEMENTS),
                ("hil/measuring/sequencer.py", MANNERS),
                ("hil/estimation/local_fits.py", LOCAL_FITS),
            )
        ),
    ),
    "a report section": (
        Registry("hil/report/sections/__init__.py", (*OF_IDENTIFIED, *OF_FRICTION)),
    ),
    "a format of exported models": (
        Registry("hil/export/formats.py", (formats.FORMATS | formats.SIMULATORS).values()),
    ),
    "a format of exported recordings": (
        Registry("hil/export/formats.py", formats.RECORDINGS.values()),
    ),
    "a condition on bodies": (
        Registry("hil/estimation/consistent/conditions.py", [conditions.conditions]),
    ),
    "an estimator": (Registry("hil/estimation/identify.py", METHODS.values()),),
    "a nuisance": (
        Registry("hil/estimation/nuisances.py", [nuisances.Search, nuisances.State]),
        Registry("hil/estimation/free_motion/nuisances.py", [find_nuisances]),
        Registry("hil/estimation/free_motion/motion.py", [Processing]),
        Registry("hil/estimation/free_motion/result.py", [FreeMotionFit]),
        Registry("hil/estimation/import_methods.py", [fit_free_motions]),
        Registry("hil/estimation/drive_train.py", [DriveTrain]),
    ),
    "a method to be compared with": (
        Registry("benchmarks/rivals/__init__.py", RIVALS.values()),
    ),
    "a drive's deviation": (
        Registry(
            "drivers/commissioning/requirements.py", [requirements.add_rows, requirements.Kept]
        ),
        Registry("sim_plant/personality.py", [personality.Personality]),
    ),
    "a drive's unit of velocities": (Registry("drivers/rate_units.py", [rate_units.NamedRate]),),
    "a fault of the plant": (
        Registry("sim_plant/faults/fault_plan.py", [What]),
        Registry("sim_plant/faults/faulty_network.py", faulty_network.KINDS.values()),
    ),
}  # fmt: skip
"""Registries by the first cell of the row."""


@cache
def rows() -> dict[str, str]:
    """Return the cells of the table: addition and files."""
    (found,) = TABLE.findall((ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8"))
    return dict(line.strip("| ").split(" | ", 1) for line in found.splitlines())


def test_every_row_is_followed() -> None:
    assert set(rows()) == set(REGISTRIES)


@pytest.mark.parametrize("added", REGISTRIES)
def test_its_files_exist_and_its_registries_are_defined_where_it_says(added: str) -> None:
    assert [place for place in PLACE.findall(rows()[added]) if not (ROOT / place).exists()] == []
    for name, file in NAMED_IN.findall(rows()[added]):
        assert re.search(rf"(?m)^{name}\b", (ROOT / file).read_text(encoding="utf-8")), name


@pytest.mark.parametrize("added", REGISTRIES)
def test_what_is_listed_in_a_registry_lives_where_its_row_says(added: str) -> None:
    places = PLACE.findall(rows()[added])
    # "beside it" and "an injection beside it" refer to the folder of a file in the row
    homes = [ROOT / place for place in places]
    homes += [home.parent for home in homes if "beside it" in rows()[added]]
    for file, members in REGISTRIES[added]:
        assert file in places
        for member in members:
            source = Path(inspect.getsourcefile(inspect.unwrap(member)) or "")
            assert any(source.is_relative_to(home) for home in homes), (source, homes)


def test_every_personality_and_every_unit_is_a_row_that_is_read() -> None:
    names = personality.packaged_personalities()
    assert all(personality.load_personality(name).name == name for name in names)
    assert all(rate.velocity in rate_units.VELOCITIES for rate in rate_units.RATES)


def test_every_fault_has_its_injection_and_its_row() -> None:
    injected = set(faulty_network.KINDS) | set(faulty_segment.KINDS)
    assert injected == set(What)
    tried = {fault.what for case in CASES for fault in case.faults}
    assert set(faulty_network.KINDS) - tried == set()
