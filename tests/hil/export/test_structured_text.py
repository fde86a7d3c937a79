"""Exported structured text: grammar, values, memory, and the block for SoftMotion."""

from __future__ import annotations

import re
import shutil
import subprocess
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pytest
from compiled_code import called, compiled_text, needs_iec2c
from stated_model import stated_model
from structured_text import Parser

from hil.export.functions import PARTS
from hil.export.languages import write_st
from hil.export.source_code import identifier
from hil.friction.direction import are_successive
from hil.friction.law import FrictionLaw, TermValue
from hil.model.robot import Robot

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from hil.results.model import Model

    Array = NDArray[np.float64]

ROOT = Path(__file__).parents[3]
ROBOTS = {
    "six axes": "manutec-r15",
    "coupled wrist": "staubli-tx40",
    "SCARA": str(ROOT / "tests/robots/scara.yaml"),
    "two arms": str(ROOT / "tests/robots/two-arms.yaml"),
}
STATES = 10_000
STRUCPP = shutil.which("strucpp")
STAND_INS = """\
TYPE AXISPOS_REF : STRUCT
    a0 : LREAL; a1 : LREAL; a2 : LREAL; a3 : LREAL; a4 : LREAL; a5 : LREAL;
END_STRUCT; END_TYPE
TYPE DynamicsParams : STRUCT unused : LREAL; END_STRUCT; END_TYPE
TYPE SMC_ERROR : (SMC_NO_ERROR := 0, SMC_OTHER := 1); END_TYPE
INTERFACE ISMDynamics
METHOD AxesStateToTorque : SMC_ERROR
VAR_IN_OUT CONSTANT
    position : AXISPOS_REF; velocity : AXISPOS_REF; acceleration : AXISPOS_REF;
    params : DynamicsParams;
END_VAR
VAR_IN_OUT
    torque : AXISPOS_REF;
END_VAR
END_METHOD
END_INTERFACE
"""
"""Substitutes for declarations of CODESYS's own libraries; the
method has the wrapper's arguments.
"""
each_robot = pytest.mark.parametrize("kind", ROBOTS)


def model_of(kind: str) -> Model:
    """Return a model with every friction term and presliding on two axes."""
    model = stated_model(Robot.load(ROBOTS[kind]), warm=True)
    law = model.friction_law
    assert law is not None
    first, second, *others = law.axes
    assert first is not None
    assert second is not None
    first = first.model_copy(
        update={"presliding": 0.05, "bend": TermValue(value=0.4, standard_error=0.1)}
    )
    second = second.model_copy(update={"presliding": 0.1, "speeds": None})
    return replace(
        model, friction_law=FrictionLaw(axes=(first, second, *others), coupled=law.coupled)
    )


def states(model: Model, n: int = STATES) -> tuple[Array, Array, Array]:
    q, qd, qdd = np.random.default_rng(7).uniform(-3.0, 3.0, (3, n, model.robot.n_joints))
    qd[: n // 10] *= 1e-3  # at rest, and at speeds with doubtful direction
    return q, qd, qdd


def motion(model: Model, n: int = 600) -> tuple[Array, Array, Array]:
    """Return samples of a motion in which every axis reverses and stops."""
    t, period = 0.004 * np.arange(n)[:, np.newaxis], 2.0 + np.arange(model.robot.n_joints)
    t = np.minimum(t, 1.9)
    q, moving = np.sin(period * t), t < 1.9
    return q, period * np.cos(period * t) * moving, -(period**2) * q * moving


def files(model: Model) -> dict[str, str]:
    return write_st(model, ("origin *) of (* a \\", "run")).files


def interpreted(model: Model, block: str, arguments: Sequence[Array], *outputs: str) -> Array:
    """Return outputs of a block of the exported text, all samples at once."""
    name = identifier(model.robot.name)
    unit = Parser(files(model)[f"{name}_dynamics.st"]).units[f"{name}_{block}".upper()]
    values = unit.call(unit.start(), *(list(each.T) for each in arguments))
    n = len(arguments[0])
    rows = [np.broadcast_to(v, n) for each in outputs for v in values[each.upper()]]
    return np.stack(rows, axis=-1)


def close(found: Array, wanted: Array) -> bool:
    return bool(np.abs(found - wanted).max() <= 1e-10 * max(np.abs(wanted).max(), 1.0))


def one_by_one(model: Model, q: Array, qd: Array, qdd: Array) -> Array:
    """Return torques of states without history: friction reverses at once."""
    assert not are_successive(q, qd)
    return model.torque(q, qd, qdd)


@each_robot
def test_the_text_is_structured_text_and_gives_the_torques_of_ten_thousand_states(
    kind: str,
) -> None:
    model = model_of(kind)
    found = interpreted(model, "torque", states(model), "out")
    assert close(found, one_by_one(model, *states(model)))


@needs_iec2c
@each_robot
def test_matiec_compiles_the_text_to_the_same_torques(kind: str, tmp_path: Path) -> None:
    model = model_of(kind)
    library, (q, qd, qdd) = compiled_text(model, tmp_path), states(model)
    found = called(library.torque, (q, qd, qdd), q.shape, np.float64)
    assert close(found, one_by_one(model, q, qd, qdd))
    assert close(called(library.gravity, (q,), q.shape, np.float64), model.gravity(q))
    along = motion(model)
    shape = (len(along[0]), len(PARTS) * model.robot.n_joints)
    torque = called(library.dynamics, along, shape, np.float64)[:, -model.robot.n_joints :]
    assert close(torque, model.torque(*along))


def outputs_along(model: Model, *samples: Array) -> Array:
    """Return the outputs of the block with memory, sample by sample, for each of `PARTS`."""
    name = identifier(model.robot.name)
    unit = Parser(files(model)[f"{name}_dynamics.st"]).units[f"{name}_dynamics".upper()]
    values, rows = unit.start(), []
    for sample in zip(*samples, strict=True):
        kept = unit.call(values, *map(list, sample))
        rows.append([list(kept[each.upper()]) for each in PARTS])
    return np.moveaxis(np.array(rows, dtype=float), 1, 0)


@pytest.mark.parametrize("lost", [0, 100])
def test_a_sample_without_a_position_leaves_the_memory_of_the_block_alone(lost: int) -> None:
    model = model_of("SCARA")
    q, qd, qdd = motion(model, 200)
    wanted = outputs_along(model, *(np.delete(each, lost, axis=0) for each in (q, qd, qdd)))
    q[lost] = np.nan
    found = outputs_along(model, q, qd, qdd)
    assert np.isnan(found[-1, lost]).all()
    assert close(np.delete(found, lost, axis=1), wanted)


@each_robot
def test_along_a_motion_the_block_remembers_the_direction_of_friction(kind: str) -> None:
    model = model_of(kind)
    q, qd, qdd = motion(model)
    assert are_successive(q, qd)
    gravity, rigid, friction, torque = outputs_along(model, q, qd, qdd)
    assert close(torque, model.torque(q, qd, qdd))
    assert close(friction, model.predict(q, qd, qdd, parts=["friction"]))
    assert close(rigid, model.predict(q, qd, qdd, parts=["rigid bodies"]))
    assert close(gravity, model.gravity(q))
    at_once = interpreted(model, "torque", (q, qd, qdd), "out")
    assert not close(at_once, torque)  # torques differ by the kept directions


def test_what_is_not_structured_text_is_refused() -> None:
    text = files(model_of("SCARA"))["scara_dynamics.st"]
    assert Parser(text).units
    for old, new in (
        ("LREAL#", ""),
        ("SIN(", "sine("),
        ("[3]", "[4]"),
        (" := q;", " := first;"),
        ("out[0] := ", "q[0] := "),
        ("t0, t1", "t0, t0"),
        ("END_IF;", ""),
    ):
        assert old in text
        with pytest.raises((AssertionError, KeyError)):
            Parser(text.replace(old, new))


@each_robot
def test_the_block_for_softmotion_takes_units_of_the_axes_and_says_what_is_not_verified(
    kind: str,
) -> None:
    model = model_of(kind)
    name, n = identifier(model.robot.name), model.robot.n_joints
    text = files(model)[f"{name}_softmotion.st"]
    assert f"{name}_softmotion IMPLEMENTS SMDYN.ISMDynamics" in text
    assert "NOT VERIFIED" in text
    units = re.search(r"unit : .* := \[(.*)\];", text)
    assert units is not None
    factors = [float(each.removeprefix("LREAL#")) for each in units[1].split(", ")]
    assert factors == np.where(model.robot.revolute, np.pi / 180, 1.0).tolist()
    body = text[text.index("METHOD") : text.index("END_METHOD")]
    for array, given in (("q", "position"), ("qd", "velocity"), ("qdd", "acceleration")):
        for k in range(n):
            assert f"    {array}[{k}] := {given}.a{k} * unit[{k}];\n" in body
    assert "    arm(q := q, qd := qd, qdd := qdd);\n" in body
    assert all(f"    torque.a{k} := arm.out[{k}];\n" in body for k in range(n))


@pytest.mark.skipif(STRUCPP is None, reason="there is no STruC++ (strucpp)")
@pytest.mark.parametrize("kind", ["SCARA", "six axes"])
def test_strucpp_compiles_both_files_beside_stand_ins_for_the_types_of_codesys(
    kind: str, tmp_path: Path
) -> None:
    dynamics, wrapper = files(model_of(kind)).values()
    text = STAND_INS + dynamics + wrapper.replace("SMDYN.", "")
    # STruC++ lacks VAR_IN_OUT CONSTANT, which CODESYS has for read-only structures
    (tmp_path / "all.st").write_text(text.replace("VAR_IN_OUT CONSTANT", "VAR_IN_OUT"))
    command = [str(STRUCPP), "all.st", "-o", "all.cpp"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)  # noqa: S603
    assert done.returncode == 0, done.stdout + done.stderr
    assert "AXESSTATETOTORQUE" in (tmp_path / "all.cpp").read_text().upper()


def test_a_robot_of_seven_axes_has_no_block_for_softmotion_and_the_remarks_say_so() -> None:
    model = stated_model(Robot.load(str(ROOT / "tests/robots/panda.yaml")))
    exported = write_st(model, ())
    assert len(exported.files) == 1
    assert exported.remarks[-1] == "no block for SoftMotion, whose groups have 6 axes at most"


def test_presliding_is_stated_where_it_is_left_out() -> None:
    said = " ".join(write_st(model_of("SCARA"), ()).remarks)
    assert (
        "presliding is left out of all functions except dynamics: axis 1 over 0.050 rad, axis 2"
        in said
    )
