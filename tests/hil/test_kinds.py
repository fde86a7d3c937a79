"""A kind of measurement has one home: a row of the table, and an entry in each stage's registry.

Adding a kind touches the five files of `HOMES` and no other: nowhere else is a kind named.
"""

from __future__ import annotations

import ast
import re
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, get_args

import pytest
from synthetic import TABLE_3_A, Friction, record

import hil
from hil.estimation.identify import estimate
from hil.estimation.local_fits import ELSEWHERE, LOCAL_FITS
from hil.measuring.checks.recording_checks import CHECKS, check
from hil.measuring.motion import MANNERS
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

ROOT = Path(hil.__file__).parent
HOMES = {
    "planning/measurement.py",
    "planning/design/measurable_elements.py",
    "measuring/motion.py",
    "measuring/checks/recording_checks.py",
    "estimation/local_fits.py",
}
"""The files that a further kind touches."""
OWN = {
    "friction": (
        "planning/design/friction.py",
        "estimation/friction/points.py",
        "commands/friction.py",
        "estimation/identify.py",
    ),
    "trajectory": (
        "planning/trajectory.py",
        "planning/lag.py",
        "planning/design/trajectories.py",
        "measuring/streaming.py",
        "measuring/feeding.py",
        "commands/track.py",
        "cli/beside_model.py",
    ),
}
"""Files about one kind alone, which may name it."""
OTHERWISE = {
    ("gravity", "results/quantities.py"): "a group of base parameters",
    ("gravity", "model/dependencies.py"): "a group of base parameters",
    ("gravity", "model/robot.py"): "the acceleration of gravity",
    ("gravity", "model/robot_file.py"): "the same",
    ("gravity", "model/readers/mjcf_text.py"): "the same",
    ("friction", "report/page.py"): "a title",
    ("friction", "report/figure.py"): "a part of the torque",
    ("friction", "results/model.py"): "a part of a torque",
    ("friction", "results/findings.py"): "a package of the program",
    ("friction", "report/sections/friction.py"): "a plot of levels in all kinds",
    ("friction", "report/reported_run.py"): "what a run says about friction",
    ("gravity", "results/recorded_torque.py"): "a part of the torque",
    ("inertia", "results/recorded_torque.py"): "the same",
    ("friction", "results/recorded_torque.py"): "the same",
    ("friction", "results/model_file.py"): "a key of model.yaml",
    ("friction", "results/identified_robot.py"): "a part of the torque",
    ("friction", "export/source_code.py"): "an exported function",
    ("friction", "export/functions.py"): "the same",
    ("gravity", "export/functions.py"): "the same",
    ("friction", "export/formats.py"): "a format of exported models",
    ("friction", "export/patch.py"): "a key of a joint",
    ("inertia", "export/patch.py"): "an attribute of URDF",
    ("friction", "simulation/arm.py"): "a part of the torque",
    ("friction", "simulation/replay.py"): "the same",
    ("friction", "export/data_files.py"): "a key of model.json",
    ("gravity", "export/data_files.py"): "a parameter of a node",
    ("friction", "cli/__init__.py"): "a command",
    ("friction", "cli/examples.py"): "the same",
    ("friction", "cli/completion.py"): "a format of exported models",
    ("friction", "cli/planning.py"): "a kind of plan",
    ("friction", "tasks/plans.py"): "the same",
    ("trajectory", "cli/planning.py"): "the same",
    ("trajectory", "tasks/plans.py"): "the same",
    ("friction", "imports/map_file.py"): "a check of a recording's plausibility",
    ("friction", "estimation/excluded/causes.py"): "a cause of a change",
    ("friction", "estimation/excluded/friction_change.py"): "the same",
    ("trajectory", "estimation/friction/history.py"): "recordings in which axes move all the time",
    ("gravity", "cli/try_plans.py"): "the option for its count",
    ("inertia", "cli/try_plans.py"): "the option for its count",
    **{
        ("gravity", f"estimation/excluded/{name}.py"): "the acceleration of gravity"
        for name in ("alternatives", "causes", "columns", "words")
    },
    ("gravity", "imports/mechanics.py"): "the acceleration of gravity",
    ("gravity", "ground_truth/true_parameters.py"): "a key of a plant's file",
    ("friction", "export/urdf_file.py"): "an attribute of a URDF",
    ("inertia", "export/urdf_file.py"): "an element of a URDF",
    ("gravity", "tasks/plans.py"): "the option for its count",
    ("inertia", "tasks/plans.py"): "the option for its count",
    ("coupling", "tasks/plans.py"): "the option for its count",
}
"""Where a kind's name means something else."""
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
    """A sixth kind: gravity under another name."""

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
    assert found.p == pytest.approx(TABLE_3_A, rel=1e-2, abs=1e-2)


def test_every_group_of_base_parameters_is_served_and_ids_distinguish_kinds() -> None:
    assert {kind.group for kind in ELEMENT_KINDS.values()} == set(GROUPS)
    letters = [kind.letter for kind in ELEMENT_KINDS.values()]
    assert len(set(letters)) == len(letters)


def test_every_key_of_every_kind_has_its_place_in_a_plan_s_file() -> None:
    keys = {key for kind in KINDS.values() for key in kind.model.model_fields}
    assert keys == set(KEYS)
    assert len(keys) == len(KEYS)


def named_in(tree: ast.AST) -> set[str]:
    """Names of kinds that a module has as a class's name or as a string of its own."""
    models = {kind.model.__name__: name for name, kind in KINDS.items()}
    found = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Constant) and node.value in KINDS:
            found.add(str(node.value))
        if isinstance(node, ast.alias | ast.Name | ast.Attribute):
            name = {ast.alias: "name", ast.Name: "id", ast.Attribute: "attr"}[type(node)]
            found.update({models[word] for word in [getattr(node, name)] if word in models})
    return found


def test_a_kind_is_named_in_no_other_file() -> None:
    strangers = {
        (kind, path)
        for file in ROOT.rglob("*.py")
        if (path := file.relative_to(ROOT).as_posix()) not in HOMES
        for kind in named_in(ast.parse(file.read_text(encoding="utf-8")))
        if path not in OWN.get(kind, ())
    }
    assert strangers == set(OTHERWISE)


def test_the_home_of_a_kind_is_five_files_that_name_every_kind_they_serve() -> None:
    for path in HOMES:
        found = named_in(ast.parse((ROOT / path).read_text(encoding="utf-8")))
        assert found >= set(ELEMENT_KINDS), path


def test_templates_name_no_kind_that_is_drawn() -> None:
    for template in (ROOT / "report").rglob("*.html"):
        quoted = set(re.findall(r"\"([a-z]+)\"", template.read_text(encoding="utf-8")))
        assert not quoted & set(ELEMENT_KINDS), template.name
