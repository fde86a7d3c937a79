"""Exported watches raise the alarms of `hil watch` at the same samples, in every language."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from compiled_code import COMPILER, STRICT, needs_compiler, needs_iec2c
from exported_watch import (
    alarms_by_constants,
    alarms_by_matiec,
    alarms_in_c,
    alarms_in_python,
    alarms_in_structured_text,
)
from stated_model import stated_model

from hil.errors import InvalidValue, Mismatch, NotEnoughData
from hil.export.source_code import identifier
from hil.export.watch_code import write_watch
from hil.model.dynamics import inverse_dynamics, regressor
from hil.model.robot import Robot
from hil.results.watch import NAME, load_thresholds
from hil.tasks.exporting import exported_model
from hil.watching.friction import FrictionTables
from hil.watching.watcher import Watcher

if TYPE_CHECKING:
    from exported_watch import Alarms, Samples

    from hil.results.model import Model
    from hil.results.watch import Watched

ROOT = Path(__file__).parents[3]
ROBOTS = {
    "two turns": str(ROOT / "tests/robots/pan-tilt.yaml"),
    "a slide among turns": str(ROOT / "tests/robots/scara.yaml"),
    "three slides": str(ROOT / "tests/robots/cartesian.yaml"),
}
PERIOD, LEARNED = 0.004, 3.0
CPPCHECK, NM, CPP = shutil.which("cppcheck"), shutil.which("nm"), shutil.which("c++")
ADVICE = ("2.5", "8.9", "12.1", "12.3", "20.5", "20.10")
"""Advisory rules of MISRA C:2012 not followed: those of the model's header, and tables outside of
the only function that uses them.
"""
each_robot = pytest.mark.parametrize("kind", ROBOTS)
each_start = pytest.mark.parametrize("learned", [False, True])


def model_of(kind: str) -> Model:
    """Return a model whose friction reverses over a presliding distance."""
    model = stated_model(Robot.load(ROBOTS[kind]), friction=("offset", "Coulomb", "load"))
    law = model.friction_law
    axes = tuple(axis and axis.model_copy(update={"presliding": 0.002}) for axis in law.axes)
    return replace(model, friction_law=law.model_copy(update={"axes": axes}))


def recorded(model: Model, seconds: float = 10.0, push: float = 0.0) -> Samples:
    """Return a motion with reversals of all axes and noise, gaps, and a push on each axis."""
    robot, rng = model.robot, np.random.default_rng(3)
    time = PERIOD * np.arange(round(seconds / PERIOD))
    rates = 3.0 + 0.7 * np.arange(robot.n_joints)
    swing = 0.3 * robot.velocity_limit / rates
    q = swing * np.sin(np.outer(time, rates))
    qd, qdd = swing * rates * np.cos(np.outer(time, rates)), -(rates**2) * q
    tau = model.torque(q, qd, qdd) + 0.003 * robot.torque_limit * rng.normal(size=q.shape)
    for axis in range(robot.n_joints):
        begin = 6.0 + 0.5 * axis
        during = (time > begin) & (time < begin + 0.2)
        tau[during, axis] -= push * robot.torque_limit[axis]
    q[1400:1403] = np.nan
    return tuple(np.delete(each, slice(1300, 1340), axis=0) for each in (time, q, tau))  # type: ignore[return-value]


def watch(model: Model, samples: Samples, found: Watched | None = None) -> Watcher:
    """Watch the samples; start with the thresholds of an earlier watch, if given."""
    watcher = Watcher(model, PERIOD, LEARNED, found.axes if found else ())
    watcher.take_all(*samples)
    return watcher


def alarms(watcher: Watcher) -> Alarms:
    return [(each.axis, each.time) for each in watcher.alarms]


def earlier(model: Model, seconds: float = 10.0) -> Watched:
    return watch(model, recorded(model, seconds)).found("", "model.yaml")


@needs_compiler
@each_start
@each_robot
def test_c_raises_the_alarms_of_the_watch(kind: str, learned: bool, tmp_path: Path) -> None:
    model = model_of(kind)
    found, pushed = earlier(model), recorded(model, push=0.5)
    wanted = alarms(watch(model, pushed, found if learned else None))
    assert {axis for axis, _ in wanted} == set(range(1, model.robot.n_joints + 1))
    assert alarms_in_c(model, found, pushed, tmp_path, learned=learned) == wanted
    assert alarms_in_c(model, found, recorded(model), tmp_path, learned=learned) == []


def run(folder: Path, *command: str) -> subprocess.CompletedProcess[str]:
    """Run a compiler or its tool in a folder."""
    return subprocess.run(command, cwd=folder, capture_output=True, text=True, check=True)  # noqa: S603


@needs_compiler
@pytest.mark.skipif(NM is None, reason="there is no nm")
def test_the_c_of_the_watch_calls_five_functions_and_allocates_nothing(tmp_path: Path) -> None:
    model = model_of("two turns")
    alarms_in_c(model, earlier(model, 4.0), recorded(model, 4.0), tmp_path, learned=True)
    (tmp_path / "library.c").write_text(
        '#include "pan_tilt_watch.h"\n'
        "void start(pan_tilt_watch *s);\n"
        "void start(pan_tilt_watch *s) { pan_tilt_start_watch(s, true); }\n"
        "void sample(pan_tilt_watch *s, const double *q);\n"
        "void sample(pan_tilt_watch *s, const double *q)\n"
        "{ pan_tilt_watch_sample(s, 0.004, q, q); }\n"
    )
    run(tmp_path, str(COMPILER), *STRICT, "-c", "library.c")
    listed = run(tmp_path, str(NM), "-u", "library.o").stdout
    names = {word.lstrip("_") for word in listed.split()} - {"U", "GLOBAL_OFFSET_TABLE_"}
    # compilers compute sine and cosine together, and copy structures by memcpy or memset
    both = {"sincos", "memcpy", "memset", "stack_chk_fail"}
    assert {"sin", "cos", "atan", "exp", "sqrt", *both} >= names >= {"exp"}


@needs_compiler
@pytest.mark.skipif(CPP is None, reason="there is no compiler of C++")
def test_nodes_in_cpp_take_the_headers_without_a_warning(tmp_path: Path) -> None:
    model = model_of("two turns")
    alarms_in_c(model, earlier(model, 4.0), recorded(model, 4.0), tmp_path, learned=True)
    (tmp_path / "node.cpp").write_text(
        '#include "pan_tilt_watch.h"\n'
        "void start(pan_tilt_watch &s);\n"
        "void start(pan_tilt_watch &s) { pan_tilt_start_watch(&s, true); }\n"
    )
    options = "-Wall", "-Wextra", "-Wpedantic", "-fsyntax-only"
    assert not run(tmp_path, str(CPP), *options, "node.cpp").stderr


@pytest.mark.parametrize("language", ["c", "python", "st"])
def test_the_period_of_the_calls_is_stated(language: str) -> None:
    model = model_of("two turns")
    (text,) = write_watch(model, language, ("origin",), earlier(model, 4.0)).values()
    assert "Call it every 4 ms" in text


@pytest.mark.skipif(CPPCHECK is None, reason="there is no cppcheck")
@each_robot
def test_cppcheck_finds_nothing_in_the_watch_but_advice_of_misra(kind: str, tmp_path: Path) -> None:
    model = model_of(kind)
    alarms_in_c(model, earlier(model, 4.0), recorded(model, 4.0), tmp_path, learned=True)
    name = identifier(model.robot.name)
    command = [
        str(CPPCHECK), "--std=c99", "--enable=warning,style,performance,portability", "--quiet",
        f"-U{name.upper()}_SINGLE", "--addon=misra", "--template={file} {id}", "main.c",
    ]  # fmt: skip
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)  # noqa: S603
    lines = done.stderr.splitlines()
    found = {line.split()[1] for line in lines if line.startswith(f"{name}_watch.h")}
    assert found <= {f"misra-c2012-{rule}" for rule in ADVICE}


@needs_compiler
def test_c_in_single_precision_raises_the_same_alarms(tmp_path: Path) -> None:
    model = model_of("two turns")
    found, pushed = earlier(model), recorded(model, push=0.5)
    single = ("-DPAN_TILT_SINGLE", "-Wdouble-promotion")
    wanted = alarms(watch(model, pushed, found))
    assert alarms_in_c(model, found, pushed, tmp_path, *single, learned=True) == wanted


@each_start
def test_python_raises_the_alarms_of_the_watch(learned: bool) -> None:
    model = model_of("two turns")
    found, pushed = earlier(model), recorded(model, 7.0, push=0.5)
    wanted = alarms(watch(model, pushed, found if learned else None))
    assert wanted
    assert alarms_in_python(model, found, pushed, learned=learned) == wanted
    assert alarms_in_python(model, found, recorded(model, 4.0), learned=learned) == []


@pytest.mark.long
@each_start
def test_structured_text_raises_the_alarms_of_the_watch(learned: bool) -> None:
    model = model_of("two turns")
    found, pushed = earlier(model), recorded(model, 7.0, push=0.5)
    wanted = alarms(watch(model, pushed, found if learned else None))
    assert wanted
    assert alarms_in_structured_text(model, found, pushed, learned=learned) == wanted


@needs_iec2c
@each_start
@each_robot
def test_matiec_compiles_the_text_to_the_same_alarms(
    kind: str, learned: bool, tmp_path: Path
) -> None:
    model = model_of(kind)
    found, pushed = earlier(model), recorded(model, push=0.5)
    wanted = alarms(watch(model, pushed, found if learned else None))
    assert alarms_by_matiec(model, found, pushed, tmp_path, learned=learned) == wanted
    assert alarms_by_matiec(model, found, recorded(model), tmp_path, learned=learned) == []


def test_json_has_the_thresholds_with_units_and_constants_that_give_the_same_alarms() -> None:
    model = model_of("two turns")
    found, pushed = earlier(model), recorded(model, 7.0, push=0.5)
    stated = json.loads(write_watch(model, "json", (), found)["pan_tilt_watch.json"])
    assert (stated["model_digest"], stated["robot_digest"]) == (model.digest, model.robot.digest)
    assert [axis["torque_unit"] for axis in stated["axes"]] == ["N m", "N m"]
    for axis, seen in zip(stated["axes"], found.axes, strict=True):
        assert axis["scatter"] == list(seen.scatter)
        assert axis["threshold_within_20_ms"] == seen.soon
        assert len(axis["scatter"]) == len(stated["windows_s"])
    constants = {name: each["value"] for name, each in stated["constants"].items()}

    def rigid_bodies(q: Any, qd: Any, qdd: Any, out: Any) -> None:
        out[:] = inverse_dynamics(model.robot, model.values, *map(np.array, (q, qd, qdd))).tolist()

    def columns(q: Any, qd: Any, out: Any) -> None:
        at_rest = np.zeros(len(q))
        out[:] = regressor(model.robot, np.array(q), np.array(qd), at_rest).ravel().tolist()

    calls = {"rigid_bodies": rigid_bodies, "regressor": columns}
    assert alarms_by_constants(constants, calls, pushed, learned=True) == alarms(
        watch(model, pushed, found)
    )


@each_robot
def test_friction_of_the_load_is_proportional_at_every_speed(kind: str) -> None:
    model = stated_model(Robot.load(ROBOTS[kind]))  # every term of friction
    by_load = FrictionTables(model).values[2:]
    assert np.ptp(by_load, axis=1) == pytest.approx(0.0, abs=1e-12)
    assert by_load[1].max() > 0.1


def test_thresholds_of_another_model_period_or_version_are_refused(tmp_path: Path) -> None:
    model = model_of("two turns")
    found = earlier(model, 4.0)
    (tmp_path / NAME).write_bytes(found.encode_yaml())
    assert load_thresholds(tmp_path, model, PERIOD) == found
    other = replace(model, values=model.values * 1.01)
    with pytest.raises(Mismatch, match="watch with this model"):
        exported_model(other, "c", tmp_path, watch=tmp_path)
    with pytest.raises(Mismatch, match=re.escape("every 0.004 s, not 0.002 s")):
        load_thresholds(tmp_path, model, 0.002)
    with pytest.raises(InvalidValue, match="friction has no alarms"):
        exported_model(model, "friction", tmp_path, watch=tmp_path)
    bare = tuple(axis.model_copy(update={"scatter": ()}) for axis in found.axes)
    (tmp_path / NAME).write_bytes(found.model_copy(update={"axes": bare}).encode_yaml())
    with pytest.raises(NotEnoughData, match="watch again"):
        exported_model(model, "c", tmp_path, watch=tmp_path)
