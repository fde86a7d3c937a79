"""A kind of measurement has one row in the table, and an entry in the registry of each stage."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any, Literal, get_args

import pytest
from synthetic import TABLE_3_A, Friction, record

from hil.estimation.identify import estimate
from hil.estimation.local_fits import ELSEWHERE, LOCAL_FITS
from hil.measuring.checks.recording_checks import CHECKS, check
from hil.measuring.sequencer import MANNERS
from hil.model.dependencies import GROUPS
from hil.planning.design.by_counts import design
from hil.planning.design.measurable_elements import ELEMENTS
from hil.planning.dry_run import dry_run
from hil.planning.free_motion import FreeMotion
from hil.planning.measurement import ELEMENT_KINDS, KEYS, KINDS, Measurement, RecordedMotion
from hil.planning.strokes import Strokes

if TYPE_CHECKING:
    from collections.abc import Mapping

    from hil.model.robot import Robot

REGISTRIES: dict[str, tuple[Mapping[str, Any], Mapping[str, Any]]] = {
    "how it moves": (MANNERS, KINDS),
    "what its recordings must show": (CHECKS, KINDS),
    "what an estimate makes of it": (LOCAL_FITS | ELSEWHERE, KINDS | {"free": FreeMotion}),
    "what is estimated from it alone": (LOCAL_FITS, ELEMENT_KINDS),
    "where it can be measured": (ELEMENTS, ELEMENT_KINDS),
}


@pytest.mark.parametrize("stage", REGISTRIES)
def test_every_kind_has_its_entry_in_every_stage(stage: str) -> None:
    registry, kinds = REGISTRIES[stage]
    assert set(registry) == set(kinds)


def test_the_table_holds_every_model_that_a_plan_may_state() -> None:
    union, _ = get_args(Measurement)
    assert {kind.model for kind in KINDS.values()} == set(get_args(union))


def test_a_recording_is_of_a_measurement_or_of_a_motion_that_no_plan_states() -> None:
    (recorded, _), (planned, _) = get_args(RecordedMotion), get_args(Measurement)
    assert set(get_args(recorded)) == {*get_args(planned), FreeMotion}


class Probe(Strokes):
    """Sixth kind: gravity under another name."""

    kind: Literal["probe"] = "probe"


def test_a_further_kind_passes_dry_run_checks_and_estimate_by_its_entries_alone(
    manutec: Robot, monkeypatch: pytest.MonkeyPatch
) -> None:
    plan = design(manutec, {"gravity": 12, "inertia": 24, "coupling": 3})
    row = replace(ELEMENT_KINDS["gravity"], model=Probe, letter="p")
    for table, entry in (
        (KINDS, row),
        (ELEMENT_KINDS, row),
        (CHECKS, CHECKS["gravity"]),
        (LOCAL_FITS, LOCAL_FITS["gravity"]),
    ):
        monkeypatch.setitem(table, "probe", entry)
    probes = [
        Probe(**m.model_dump(exclude={"kind"})) if m.kind == "gravity" else m
        for m in plan.measurements
    ]
    probed = plan.model_copy(update={"measurements": tuple(probes)})
    assert dry_run(probed, manutec).groups == dry_run(plan, manutec).groups
    recorded = [(m, record(manutec, m, TABLE_3_A, Friction())) for m in probes]
    for m, (probe, recording) in zip(plan.measurements, recorded, strict=True):
        assert check(recording, probe, manutec) == check(recording, m, manutec)
    found = estimate(manutec, recorded)
    assert {value.kind for value in found.local} == {"probe", "inertia", "coupling"}
    assert found.values == pytest.approx(TABLE_3_A, rel=1e-2, abs=1e-2)


def test_every_group_of_base_parameters_is_served_and_ids_distinguish_kinds() -> None:
    assert {kind.group for kind in ELEMENT_KINDS.values()} == set(GROUPS)
    letters = [kind.letter for kind in ELEMENT_KINDS.values()]
    assert len(set(letters)) == len(letters)


def test_every_key_of_every_kind_has_its_place_in_a_plan_s_file() -> None:
    keys = {key for kind in KINDS.values() for key in kind.model.model_fields}
    assert keys == set(KEYS)
    assert len(keys) == len(KEYS)
