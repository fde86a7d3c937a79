"""Condition over time: marked changes, unmarked ones, and incomparable runs."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest
from free_run import arm
from hypothesis import given
from hypothesis import strategies as st
from stated_model import stated_model

from hil.commands.history import history_of, monitoring_data, read_history
from hil.errors import FileError, InvalidValue, Mismatch
from hil.estimation.intervals import SIGNIFICANT
from hil.friction.law import TermValue, level_at
from hil.model.robot import Robot
from hil.results.changes import Change, adjusted, change
from hil.results.quantities import Quantity, Reading

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from hil.results.model import Model

QUANTITY = Quantity("p1", "inertia parameter", "kg m2")
N_TESTS = 30


def measured(model: Model, day: int, seed: int, **changes: object) -> Model:
    """Return the model of another run, with errors drawn from its covariance."""
    rng = np.random.default_rng(seed)
    error = rng.multivariate_normal(np.zeros(len(model.values)), model.scatter_covariance)
    instant = f"2026-03-{day:02}T08:00:00+00:00"
    return replace(
        model,
        **{"values": model.values + error} | changes,
        provenance=model.provenance.model_copy(update={"measured": instant}),
    )  # type: ignore[arg-type]


def machine() -> Model:
    """Return a model with Coulomb and viscous friction, whose level drifts by 3 %."""
    return stated_model(arm(), friction=("offset", "Coulomb", "viscous"))


def set_coulomb(model: Model, axis: int, factor: float) -> Model:
    """Return the model with another Coulomb friction of an axis, from 1."""
    laws = list(model.friction_law.axes)
    own = laws[axis - 1]
    assert own is not None
    old = own.terms["Coulomb"]
    more = TermValue(value=factor * old.value, standard_error=old.standard_error)
    laws[axis - 1] = own.model_copy(
        update={"terms": own.terms | {"Coulomb": more}, "measurements": 30}
    )
    law = model.friction_law.model_copy(update={"axes": tuple(laws)})
    return replace(model, friction_law=law)


@pytest.mark.long
def test_an_unchanged_machine_is_marked_in_at_most_one_new_run_of_a_hundred() -> None:
    rng, runs, degrees = np.random.default_rng(1), 4000, 4
    shape = (runs, N_TESTS, 2)
    values = rng.standard_normal(shape)
    errors = np.sqrt(rng.chisquare(degrees, shape) / degrees)

    def tested(run: int, k: int) -> Change:
        old, new = (
            Reading(value, error, degrees)
            for value, error in zip(values[run, k], errors[run, k], strict=True)
        )
        return change(QUANTITY, ("new", new), ("old", old))

    alarms = sum(
        any(each.marked for each in adjusted([tested(run, k) for k in range(N_TESTS)]))
        for run in range(runs)
    )
    # Welch's degrees of freedom keep the mean level; 0.5 % is the chance of 4000 draws
    assert 0 < alarms <= (SIGNIFICANT + 0.005) * runs


def test_a_changed_parameter_is_named_first() -> None:
    model = machine()
    lighter = model.values * np.where(np.arange(len(model.values)) == 2, 0.9, 1.0)
    found = history_of([
        ("march", measured(model, 1, seed=1)),
        ("april", measured(model, 2, seed=2)),
        ("may", measured(replace(model, values=lighter), 3, seed=3)),
    ])  # fmt: skip
    assert {each.quantity.name for each in found.marked} == {"p3"}
    assert [each.against for each in found.marked].count("march") == 1
    assert "(p3) changed by" in found.marked[0].sentence
    assert {each.run for each in found.marked} == {"may"}


@pytest.mark.parametrize(("factor", "marked"), [(1.02, False), (1.3, True)])
def test_friction_is_marked_beyond_what_it_wandered_within_a_campaign(
    factor: float, marked: bool
) -> None:
    before = set_coulomb(machine(), 2, 1.0)
    found = history_of([
        ("old", measured(before, 1, seed=1)),
        ("new", measured(set_coulomb(before, 2, factor), 2, seed=2)),
    ])  # fmt: skip
    names = {each.quantity.name for each in found.marked}
    assert bool(names) == marked
    assert all(name.startswith("friction of axis 2 at") for name in names)


def test_an_offset_is_compared_whatever_law_was_chosen() -> None:
    before = set_coulomb(machine(), 2, 1.0)
    own = before.friction_law.axes[1]
    assert own is not None
    # another law with the same friction in both directions at half the speed
    offset = own.terms["offset"]
    terms = own.terms | {
        "offset": offset.model_copy(update={"value": offset.value - 1.0}),
        "asymmetric": TermValue(value=2.0, standard_error=offset.standard_error),
    }
    laws = (before.friction_law.axes[0], own.model_copy(update={"terms": terms}))
    other = before.friction_law.model_copy(update={"axes": laws})
    after = replace(before, friction_law=other)
    found = history_of([("old", measured(before, 1, seed=1)), ("new", measured(after, 2, seed=2))])
    assert not found.marked


def scale_friction(
    model: Model, factors: Sequence[float], measurements: int = 30, *, offsets: bool = False
) -> Model:
    """Return the model with each axis's friction scaled, optionally with its offset."""

    def scaled(terms: dict[str, TermValue], factor: float) -> dict[str, TermValue]:
        return {
            name: term.model_copy(update={"value": factor * term.value})
            if offsets or name != "offset"
            else term
            for name, term in terms.items()
        }

    laws = [
        own and own.model_copy(
            update={
                "terms": scaled(own.terms, factor),
                "plain": scaled(own.plain, factor),
                "measurements": measurements,
            }
        )
        for own, factor in zip(model.friction_law.axes, factors, strict=True)
    ]  # fmt: skip
    return replace(model, friction_law=model.friction_law.model_copy(update={"axes": tuple(laws)}))


def six_axes() -> Model:
    model = stated_model(Robot.load("manutec-r15"), friction=("Coulomb", "viscous"))
    return scale_friction(model, [1.0] * 6)


WARM = [0.82, 0.79, 0.84, 0.80, 0.78, 0.81]


def test_a_warm_machine_is_no_changed_one() -> None:
    found = history_of([
        ("cold", measured(six_axes(), 1, seed=1)),
        ("warm", measured(scale_friction(six_axes(), WARM), 2, seed=2)),
    ])  # fmt: skip
    assert not found.marked
    assert found.common["warm", "cold"] == pytest.approx(-0.2, abs=0.02)


def test_an_axis_that_changed_is_marked_though_the_machine_is_warm() -> None:
    loose = [*WARM[:3], 1.3 * WARM[3], *WARM[4:]]
    found = history_of([
        ("cold", measured(six_axes(), 1, seed=1)),
        ("warm", measured(scale_friction(six_axes(), loose), 2, seed=2)),
    ])  # fmt: skip
    assert {each.quantity.axis for each in found.marked} == {4}


def test_friction_of_two_axes_is_put_down_to_no_temperature() -> None:
    model = set_coulomb(set_coulomb(machine(), 1, 1.0), 2, 1.0)
    changed = set_coulomb(set_coulomb(model, 1, 1.5), 2, 1.5)
    found = history_of([("a", measured(model, 1, 1)), ("b", measured(changed, 2, 2))])
    assert found.common["b", "a"] == 0.0
    assert {each.quantity.axis for each in found.marked} == {1, 2}


def other_torque_constant(model: Model, axis: int, share: float) -> Model:
    """Return the model identified with all torques of an axis scaled by a share."""
    assert model.torque_effect is not None
    factors = [1.0 + share * (k + 1 == axis) for k in range(model.robot.n_joints)]
    scaled = scale_friction(model, factors, offsets=True)
    return replace(scaled, values=model.values + share * model.torque_effect[:, axis - 1])


def add_torque_effect() -> Model:
    model = six_axes()
    effect = np.zeros((len(model.values), 6))
    effect[[9, 10, 12], 4] = model.values[[9, 10, 12]] * 10  # an effect on three parameters
    return replace(model, effect=effect)


def test_an_exchanged_drive_is_named_in_place_of_all_that_it_changed() -> None:
    before = add_torque_effect()
    found = history_of([
        ("old", measured(before, 1, seed=1)),
        ("new", measured(other_torque_constant(before, 5, 0.1), 2, seed=2)),
    ])  # fmt: skip
    (exchanged,) = found.rescaled
    assert exchanged.axis == 5
    assert abs(exchanged.share - 0.1) < exchanged.half_width
    assert exchanged.explained == len(found.marked) > 1
    (sentence,) = found.sentences(found.runs[1])
    assert "torque constant or drive of axis 5 exchanged or rescaled" in sentence
    assert monitoring_data(found)["rescaled_torques"][0]["axis"] == 5


def test_a_parameter_beside_friction_that_do_not_change_alike_are_no_exchanged_drive() -> None:
    before = add_torque_effect()
    heavier = replace(before, values=before.values + 0.5 * np.eye(len(before.values))[12])
    heavier = scale_friction(heavier, [1, 1, 1, 1, 0.7, 1])
    found = history_of([("old", measured(before, 1, 1)), ("new", measured(heavier, 2, 2))])
    assert len(found.marked) > 1
    assert not found.rescaled


def test_a_drive_that_says_it_is_another_one_is_stated() -> None:
    def set_drives(model: Model, *drives: str) -> Model:
        provenance = model.provenance.model_copy(update={"drives": drives})
        return replace(model, provenance=provenance)

    model = machine()
    found = history_of([
        ("a", set_drives(measured(model, 1, 1), "serial 1", "serial 2")),
        ("b", set_drives(measured(model, 2, 2), "serial 1", "serial 7")),
    ])  # fmt: skip
    note = "b: the drive of axis 2 differs from that in a: serial 7, before serial 2"
    assert found.notes == (note,)


def test_a_greater_wander_accounts_for_more() -> None:
    before = set_coulomb(machine(), 2, 1.0)
    runs = [("old", measured(before, 1, seed=1)),
            ("new", measured(set_coulomb(before, 2, 1.3), 2, seed=2))]  # fmt: skip
    assert history_of(runs).marked
    assert not history_of(runs, least_wander=0.4).marked


def test_the_level_of_friction_is_what_changes_its_sign() -> None:
    law = set_coulomb(machine(), 1, 1.0).friction_law
    assert law is not None
    own = law.axes[0]
    assert own is not None
    level, error = level_at(own, 1.0)
    coulomb, viscous = own.terms["Coulomb"].value, own.terms["viscous"].value
    assert level == pytest.approx(coulomb + viscous / own.speed)
    assert error == pytest.approx(0.01 * np.hypot(1.0, 1.0 / own.speed))


def test_errors_that_all_runs_share_do_not_hide_a_change() -> None:
    model = machine()
    unsure = replace(model, drive_covariance=100.0 * np.eye(len(model.values)))
    shifted = replace(unsure, values=unsure.values + 0.5 * np.eye(len(model.values))[0])
    found = history_of([("a", measured(unsure, 1, 1)), ("b", measured(shifted, 2, 2))])
    assert [each.quantity.name for each in found.marked] == ["p1"]


def test_runs_stand_in_the_order_in_which_they_were_measured() -> None:
    model = machine()
    runs = [(str(day), measured(model, day, seed=day)) for day in (3, 1, 2)]
    found = history_of(runs)
    assert [run.label for run in found.runs] == ["1", "2", "3"]
    assert found.reference == "1"
    assert {each.against for each in found.tests(found.runs[2])} == {"1", "2"}


def test_one_run_alone_is_stated_as_such() -> None:
    found = history_of([("only", measured(machine(), 1, 1))])
    assert not found.changes
    assert any("cannot be compared" in note for note in found.notes)


def test_different_methods_are_stated() -> None:
    model = machine()
    other = measured(model, 2, 2)
    other = replace(other, method="other")
    found = history_of([("a", measured(model, 1, 1)), ("b", other)])
    assert any("different methods (improved, other)" in note for note in found.notes)


def saved(model: Model, folder: Path) -> Path:
    """Return a folder with the model's file."""
    folder.mkdir()
    model.save(folder / "model.yaml")
    return folder


def test_another_robot_is_refused_with_what_differs(tmp_path: Path) -> None:
    one = saved(machine(), tmp_path / "one")
    other = saved(stated_model(arm(gear_ratio=80.0)), tmp_path / "other")
    with pytest.raises(Mismatch, match=r"other: is not a run of the machine of .*one: .* joints"):
        read_history([one, other])


def test_limits_may_differ(tmp_path: Path) -> None:
    model = machine()
    slower = Robot.load(_slower(model.robot, tmp_path / "slower.yaml"))
    provenance = model.provenance.model_copy(update={"robot_digest": slower.digest})
    second = replace(measured(model, 2, 2), robot=slower, provenance=provenance)
    folders = [saved(model, tmp_path / "one"), saved(second, tmp_path / "two")]
    assert slower.digest != model.robot.digest
    assert len(read_history(folders).runs) == 2


def _slower(robot: Robot, path: Path) -> Path:
    path.write_text(robot.text.replace("velocity_limit: 3.0", "velocity_limit: 2.0"))
    return path


def test_one_run_twice_is_refused(tmp_path: Path) -> None:
    one = saved(machine(), tmp_path / "one")
    copy = saved(machine(), tmp_path / "copy")
    with pytest.raises(Mismatch, match="is the same run as"):
        read_history([one, copy])


def test_a_run_without_a_model_is_refused_with_the_remedy(tmp_path: Path) -> None:
    with pytest.raises(FileError, match="hil identify"):
        read_history([tmp_path])


def test_a_wander_in_percent_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InvalidValue, match="stands for 5 %"):
        read_history([saved(machine(), tmp_path / "one")], least_wander=5.0)


def test_the_reference_need_not_be_among_the_runs(tmp_path: Path) -> None:
    model = machine()
    runs = [saved(measured(model, day, seed=day), tmp_path / str(day)) for day in (1, 2, 3)]
    found = read_history(runs[::2], reference=runs[1])
    assert found.reference == str(runs[1])
    assert {each.against for each in found.tests(found.runs[0])} == {str(runs[1])}


@given(st.lists(st.floats(0.0, 1.0), min_size=1, max_size=20))
def test_adjusted_p_values_keep_the_order_and_are_no_smaller(p_values: list[float]) -> None:
    tests = adjusted([Change("b", "a", QUANTITY, 1.0, 0.1, 0.1, p) for p in p_values])
    assert [each.p_value for each in tests] == sorted(p_values)
    assert all(each.adjusted >= each.p_value for each in tests)
    assert [each.adjusted for each in tests] == sorted(each.adjusted for each in tests)
    assert tests[0].adjusted == min(len(p_values) * min(p_values), 1.0)
