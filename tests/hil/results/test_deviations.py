"""Machines that deviate from their past or their fleet are found, with few false alarms."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from hil.results.fleet_index import FLEET, Fleet, deviations, runs_in_ten_years
from hil.results.quantities import Quantity

MONTH = 365.25 / 12 * 86400.0
RATE = 0.5


def fleet(n: int = 40, months: int = 24, seed: int = 0) -> Fleet:
    """Return machines with one inertia and friction of four axes, varied by temperature."""
    random = np.random.default_rng(seed)
    friction = [
        Quantity(f"friction of axis {axis}", "friction level", "N m", axis=axis, speed=1.0)
        for axis in range(1, 5)
    ]
    machine, month = np.repeat(np.arange(n), months), np.tile(np.arange(months), n)
    own = np.array([1.0, *4 * [20.0]]) * (1.0 + 0.1 * random.standard_normal((n, 5)))
    warm = 0.08 * np.sin(2 * np.pi * month / 12) + 0.05 * random.standard_normal(n * months)
    value = own[machine] * (1.0 + 0.005 * random.standard_normal((n * months, 5)))
    value[:, 1:] *= 1.0 - (warm * (1.0 + 0.25 * random.standard_normal((n, 4))[machine]).T).T
    return Fleet(
        machines=tuple(f"m{k}" for k in range(n)),
        quantities=(Quantity("p1", "inertia parameter", "kg m^2"), *friction),
        machine=machine,
        time=month * MONTH,
        runs=np.array([f"m{k}/{m}" for k, m in zip(machine, month, strict=True)]),
        value=value,
        error=0.005 * np.abs(value),
        degrees=np.full(value.shape, 10.0),
        allowance=np.zeros_like(value),
    )


def changed(found: Fleet, machine: int, quantity: int, factors: np.ndarray) -> Fleet:
    """Return the fleet with one quantity of a machine multiplied, run by run."""
    value = found.value.copy()
    value[found.machine == machine, quantity] *= factors
    return replace(found, value=value)


def test_an_unchanged_fleet_keeps_the_stated_rate_of_false_alarms() -> None:
    # 480 machines, one run of each tested: 120 runs in ten years, so 2 alarms are expected
    alarms = sum(len({e.run for e in deviations(fleet(seed=s), RATE).changes}) for s in range(12))
    assert alarms <= 6  # Poisson distribution with mean 2; exceeded with a chance of 0.5 %


def test_the_level_of_a_run_follows_from_rate_and_number_of_runs() -> None:
    found = fleet(n=3)
    assert runs_in_ten_years(found) == pytest.approx(120.0)
    assert deviations(found, RATE).level == pytest.approx(RATE / 120.0)


def test_runs_at_the_same_time_count_once() -> None:
    found = fleet(n=3)
    at_once = replace(found, time=np.zeros_like(found.time))
    assert runs_in_ten_years(at_once) == 1.0


def test_wear_of_one_axis_is_found_against_the_machine_s_own_past() -> None:
    growth = 1.0 + 0.1 * np.clip((np.arange(24) - 12) / 6.0, 0.0, 1.0)
    (first, *_) = deviations(changed(fleet(), 7, 3, growth), RATE).changes
    assert (first.run, first.quantity.axis, first.against) == ("m7", 3, "m7/0")
    assert first.relative == pytest.approx(0.1, abs=0.03)
    assert "bearing" in first.meaning


def test_what_all_machines_change_by_is_no_deviation() -> None:
    found = fleet()
    later = found.time[:, np.newaxis] > 18 * MONTH
    shifted = replace(found, value=found.value + 0.2 * later * np.array([1.0, 0, 0, 0, 0]))
    assert {e.run for e in deviations(shifted, RATE).changes} == {
        e.run for e in deviations(found, RATE).changes
    }


def test_a_machine_unlike_its_fleet_is_found_though_it_never_changed() -> None:
    found = deviations(changed(fleet(), 5, 0, np.full(24, 2.0)), RATE).changes
    assert [(e.run, e.against, e.quantity.name) for e in found] == [("m5", FLEET, "p1")]


def test_two_machines_with_two_runs_each_are_tested_by_stated_errors() -> None:
    found = fleet(n=2, months=2)
    assert deviations(found, RATE).changes == ()
    moved = changed(found, 0, 0, np.array([1.0, 1.1]))
    assert [e.run for e in deviations(moved, RATE).changes] == ["m0"]


def test_runs_that_lack_a_quantity_are_left_out_of_its_means() -> None:
    found = fleet()
    value = found.value.copy()
    value[::3, 2] = np.nan
    value[found.machine == 4, 1] = np.nan
    assert len(deviations(replace(found, value=value), RATE).changes) <= 1
