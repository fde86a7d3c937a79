"""Impossible parameters fail; impossible links and edges of a search lower the verdict."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest
from free_run import TRUTH, arm, recorded, write_free_run
from possible_models import model_of, possible

from hil.errors import InvalidValue
from hil.estimation.free_motion.result import FreeMotionFit
from hil.estimation.intervals import Edge
from hil.model.base_parameters import base_parameters
from hil.model.robot import Robot
from hil.results.identification import identify
from hil.results.model import Model
from hil.results.possible import impossible_inertias, impossible_links
from hil.results.verdict import verdict
from hil.tasks.exporting import export

if TYPE_CHECKING:
    from pathlib import Path


HEADS = base_parameters(arm()).heads


def arm_model(inertia: float = 1.2, error: float = 0.01) -> Model:
    """Return a model of an arm whose second link has this inertia, and hardly any weight."""
    p = TRUTH.copy()
    p[[HEADS.index(name) for name in ("Izz2", "sx2", "sy2")]] = inertia, 0.02, 0.01
    found: Model = model_of(arm(), p, np.full(len(p), error))
    return found


def words(model: Model) -> list[tuple[str, str]]:
    return [(each.word, each.reason) for each in verdict(model).reasons]


def test_torques_that_are_all_reversed_have_failed_and_are_not_exported(tmp_path: Path) -> None:
    data = recorded(arm(), TRUTH)
    for _, recording in data:
        recording.tau[:] *= -1.0
    model = identify(write_free_run(tmp_path / "run", arm(), data))
    assert model.verdict is not None
    assert model.verdict.word == "failed"
    assert model.verdict.reason == "torques of all joints have the wrong sign"
    with pytest.raises(InvalidValue, match="wrong sign; correct the sign of all torques"):
        export(model, "c", tmp_path / "model")
    assert export(model, "c", tmp_path / "model", force=True)


@pytest.mark.parametrize("name", ["manutec-r15", "staubli-tx40"])
@pytest.mark.parametrize("seed", range(3))
def test_nothing_is_said_of_bodies(name: str, seed: int) -> None:
    robot = Robot.load(name).free_links()
    model = model_of(robot, *possible(robot, seed))
    assert not [*impossible_inertias(model), *impossible_links(model)]


def test_a_mass_matrix_that_noise_may_have_made_indefinite_is_a_doubt() -> None:
    # the rotor has 0.25 kg m2 on the joint side
    assert verdict(arm_model(-0.26, 0.02)).word == "doubtful"
    assert any("within its uncertainty" in reason for _, reason in words(arm_model(-0.26, 0.02)))
    assert verdict(arm_model(-0.26, 0.0002)).word == "failed"


def test_an_axis_at_rest_is_judged_where_it_was(tmp_path: Path) -> None:
    """Its torque is also that of static friction; off its position, the model does not hold."""
    model = identify(write_free_run(tmp_path / "run", arm(), recorded(arm(), TRUTH)))
    values = model.values.copy()
    values[HEADS.index("sx2")] = 20.0  # negative kinetic energy for a stretched arm
    wrong = replace(model, values=values)
    assert any("mass matrix" in each.what for each in impossible_inertias(wrong))
    at_rest = wrong.details.model_copy(update={"rest": {2: np.pi / 2}, "still": (2,)})
    assert not [*impossible_inertias(replace(wrong, details=at_rest))]


def test_negative_inertia_behind_a_rotor_is_named_though_the_mass_matrix_is_positive() -> None:
    model = arm_model(-0.03, 0.003)
    assert not [*impossible_inertias(model)]
    first, *_ = impossible_links(model)
    assert first.what == base_parameters(arm()).titles[HEADS.index("Izz2")]
    assert first.certain
    assert any(
        word == "doubtful" and "impossible for rigid links" in reason
        for word, reason in words(model)
    )
    assert not any(each.certain for each in impossible_links(arm_model(-0.003, 0.003)))


def test_a_rotor_inertia_that_is_negative_beyond_its_error_has_failed() -> None:
    robot = Robot.load("staubli-tx40")
    p, error = possible(robot)
    rotor = base_parameters(robot).heads.index("Ia3")
    p[rotor] = -0.05
    error[rotor] = 0.002
    found = [each for each in impossible_inertias(model_of(robot, p, error)) if each.unit]
    assert [each.what for each in found] == [base_parameters(robot).titles[rotor]]
    assert verdict(model_of(robot, p, error)).word == "failed"


def test_a_rotor_less_a_link_may_be_negative() -> None:
    """Strokes of single axes estimate sums in place of single parameters."""
    robot = Robot.load("staubli-tx40")
    p, error = possible(robot)
    rotor, link = (base_parameters(robot).heads.index(name) for name in ("Ia3", "Izz2"))
    p[rotor], error[rotor] = -0.05, 0.002
    C = np.eye(len(p))
    C[rotor, link], C[link, link] = -1.0, 0.0
    of_sums = replace(model_of(robot, p, error), combination=C)
    assert not [each for each in impossible_inertias(of_sums) if each.unit]
    C[rotor, link] = 1.0
    of_sums = replace(model_of(robot, p, error), combination=C)
    assert [each.value for each in impossible_inertias(of_sums) if each.unit] == []
    assert any(each.value == -0.05 for each in impossible_links(of_sums))


def test_sums_determine_no_mass_matrix() -> None:
    """With 0 in place of one part, it looked indefinite beyond its error."""
    robot = Robot.load("staubli-tx40")
    p, error = possible(robot)
    C, (of, part) = (
        np.eye(len(p)),
        (base_parameters(robot).heads.index(n) for n in ("Izz1", "Izz2")),
    )
    C[of, part], C[part, part] = -9.0, 0.0
    partial = replace(model_of(robot, C @ p, error), combination=C)
    lost = FreeMotionFit.model_construct(not_identified=(partial.names[part],), rest={})
    assert [*impossible_inertias(replace(partial, combination=None))]
    assert not [*impossible_inertias(replace(partial, details=lost))]


def test_an_estimate_at_the_edge_of_its_search_is_named_with_value_and_bound(
    tmp_path: Path,
) -> None:
    edge = Edge(axis=2, what="lag of the torque", value=12.0, bound=12.0, unit="ms")
    model = replace(arm_model(error=1e-4), edges=(edge,))
    both = replace(model, edges=(edge.model_copy(update={"axis": 1}), edge))
    assert words(both)[0][1].startswith("axes 1, 2: lag of the torque 12.0 ms, at the limit")
    assert (
        "doubtful",
        "axis 2: lag of the torque 12.0 ms, at the limit of the search range",
    ) in words(model)
    model.save(tmp_path / "model.yaml")
    assert Model.load(tmp_path / "model.yaml").edges == (edge,)


def test_an_edge_of_an_axis_that_the_recordings_do_not_excite_is_stated_after_that() -> None:
    edge = Edge(axis=2, what="lag of the torque", value=30.0, bound=30.0, unit="ms")
    for error, first in ((1e-4, True), (0.3, False)):
        said = [reason for _, reason in words(replace(arm_model(error=error), edges=(edge,)))]
        assert ("lag of the torque" in said[0]) == first
        assert any("lag of the torque" in reason for reason in said)
