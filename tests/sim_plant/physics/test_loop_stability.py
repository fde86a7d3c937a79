"""Gains that cannot hold the arm are refused, with the violated bound."""

from __future__ import annotations

import re
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from checked_files.yaml_file import FileError
from sim_plant import build
from sim_plant.physics import loop_stability
from sim_plant.physics import state as st
from sim_plant.physics.loop_stability import Unstable, is_stable, refuse_unstable
from sim_plant.physics.reflected_inertia import ReflectedInertia, reflected_inertia
from sim_plant.plant import Plant, load_plant
from sim_plant.plant_file import PlantFile, load_plant_file, plant_path

if TYPE_CHECKING:
    from pathlib import Path


def set_drive(axis: int, **changes: Any) -> PlantFile:
    """Return the manutec-r15 with another drive on an axis (from 0)."""
    file = load_plant_file("manutec-r15")
    axes = list(file.axes)
    drive = axes[axis].drive.model_copy(update=changes)
    axes[axis] = axes[axis].model_copy(update={"drive": drive})
    return file.model_copy(update={"axes": tuple(axes)})


def inertia_of(file: PlantFile) -> ReflectedInertia:
    motors = np.array([axis.drive.motor_inertia for axis in file.axes])
    return reflected_inertia(build.arm(file), motors, build.reach(file))


def swing(file: PlantFile, axis: int, monkeypatch: pytest.MonkeyPatch) -> float:
    """Return the speed of an axis half a second after a push, as a share of its limit."""
    monkeypatch.setattr("sim_plant.plant.refuse_unstable", lambda *_: None)
    plant = Plant(file)
    for servo in plant.axes:
        servo.enable()
    plant.state[axis, st.QD] = 0.05
    plant.advance(0.5)
    return float(abs(plant.state[axis, st.QD]) / plant.const[axis, st.VELOCITY_MAX])


def bound_in(message: str) -> float:
    found = re.search(r"must be at (?:most|least) ([\d.e+-]+),", message)
    assert found
    return float(found[1])


@pytest.mark.parametrize("axis", [0, 5])
def test_a_load_inertia_that_is_far_too_large_is_refused_with_the_largest_that_holds(
    axis: int,
) -> None:
    file = set_drive(axis, load_inertia=1e4)
    with pytest.raises(Unstable, match="makes the velocity loop unstable") as caught:
        Plant(file)
    assert caught.value.place == ("axes", axis, "drive", "load_inertia")
    most = bound_in(str(caught.value))
    Plant(set_drive(axis, load_inertia=most))
    with pytest.raises(Unstable):
        Plant(set_drive(axis, load_inertia=1.1 * most))


def test_the_bound_is_where_the_simulated_axis_begins_to_oscillate(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Joint 6, whose inertia hardly depends on the arm's configuration."""
    with pytest.raises(Unstable) as caught:
        Plant(set_drive(5, load_inertia=1e4))
    most = bound_in(str(caught.value))
    assert swing(set_drive(5, load_inertia=0.9 * most), 5, monkeypatch) < 3e-4
    assert swing(set_drive(5, load_inertia=1.6 * most), 5, monkeypatch) > 3e-3


def test_a_load_inertia_for_which_the_position_loop_is_too_fast_is_refused() -> None:
    heavy = set_drive(5, rotor_inertia=1e-7, load_inertia=1e-3)
    with pytest.raises(Unstable, match=r"0.001 makes the .* must be at least") as caught:
        Plant(heavy)
    Plant(set_drive(5, rotor_inertia=1e-7, load_inertia=bound_in(str(caught.value))))


def test_bandwidths_that_no_load_inertia_mends_are_refused_with_one_that_holds() -> None:
    file = load_plant_file("manutec-r15")
    fast = file.model_copy(update={"loops": file.loops.model_copy(update={"velocity": 5000.0})})
    with pytest.raises(Unstable, match="for any load_inertia") as caught:
        Plant(fast)
    assert caught.value.place == ("loops", "velocity")
    slower = re.search(r"; ([\d.]+) 1/s is stable", str(caught.value))
    assert slower
    loops = replace(build.loops(fast).tune(inertia_of(file)), velocity=float(slower[1]))
    assert is_stable(loops, inertia_of(file))


def test_the_file_and_the_line_are_stated(tmp_path: Path) -> None:
    text = plant_path("manutec-r15").read_text().replace("load_inertia: 15}", "load_inertia: 9e9}")
    path = tmp_path / "plant.yaml"
    path.write_text(text)
    line = text[: text.index("load_inertia: 9e9")].count("\n") + 1
    with pytest.raises(FileError, match=rf"plant.yaml:{line}: axes.2.drive.load_inertia: 9e\+09"):
        load_plant(str(path))


def test_links_that_no_motor_lends_inertia_are_refused() -> None:
    file = set_drive(0, rotor_inertia=0.0, load_inertia=1.0)
    axes = list(file.axes)
    axes[0] = axes[0].model_copy(update={"link": axes[0].link.model_copy(update={"Izz": -60.0})})
    with pytest.raises(FileError, match=r"M\(q\) of links and motors is not positive definite"):
        Plant(file.model_copy(update={"axes": tuple(axes)}))


def test_a_brake_that_is_too_stiff_for_the_steps_is_refused_with_a_way_that_is_not() -> None:
    file = load_plant_file("manutec-r15")
    axes = list(file.axes)

    def sliding(way: float) -> PlantFile:
        friction = axes[5].friction.model_copy(update={"presliding": way})
        axes[5] = axes[5].model_copy(update={"friction": friction})
        return file.model_copy(update={"axes": tuple(axes)})

    with pytest.raises(Unstable, match="closed brake too stiff") as caught:
        Plant(sliding(2e-5))
    assert caught.value.place == ("axes", 5, "friction", "presliding")
    least = re.search(r"must be at least ([\d.e-]+)$", str(caught.value))
    assert least
    Plant(sliding(1.05 * float(least[1])))


def test_the_loops_of_the_plants_that_come_along_are_stable() -> None:
    for name in ("manutec-r15", "manutec-r15-bodies"):
        file = load_plant_file(name)
        refuse_unstable(build.loops(file), inertia_of(file))


def test_inertias_are_those_of_one_axis_among_others_that_hold_or_give_way() -> None:
    masses = np.array([[[4.0, 1.0], [1.0, 2.0]], [[6.0, 0.0], [0.0, 2.0]]])
    motors = np.ones(2)
    arm_inertia = ReflectedInertia(masses, np.array([3.5, 1.75]), np.array([6.0, 2.0]))
    best = loop_stability.best_loads(arm_inertia, motors)
    assert best == pytest.approx(np.sqrt([3.5 * 6.0, 1.75 * 2.0]) - 1)
