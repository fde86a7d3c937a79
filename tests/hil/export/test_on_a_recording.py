"""Each export format, used by its tool, gives the model's torques of a recording.

Friction outside a format is stated, and the torques differ by exactly this amount.
"""

from __future__ import annotations

import json
import re
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import mujoco
import numpy as np
import pytest
import yaml
from compiled_code import called, compiled, module, needs_compiler
from possible_models import model_of, possible

from hil.export.formats import FORMATS, SIMULATORS, export
from hil.friction.direction import are_successive
from hil.friction.law import AxisLaw, FrictionLaw, TermValue, friction_torque
from hil.model.dynamics import inverse_dynamics
from hil.model.robot import Robot
from hil.results.consistency import find_consistent_robot

pinocchio = pytest.importorskip("pinocchio", minversion="3.0")  # earlier versions omit rotors

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from hil.export.exported import Exported
    from hil.results.model import Model

    Array = NDArray[np.float64]

PERIOD = 1e-3
SPEED = np.array([1.0, 1.5, 0.2, 1.2])
"""Speeds of the SCARA's axes, the third of which is prismatic [rad/s, m/s]."""
SLOWEST = 0.05 * SPEED
TERMS: tuple[dict[str, float], ...] = (
    {"offset": 0.2, "Coulomb": 3.0, "viscous": 1.0},
    {"offset": 0.1, "Coulomb": 2.0, "viscous": 0.5, "arc tangent": 0.8},
    {"offset": -1.0, "Coulomb": 9.0, "viscous": 2.0, "asymmetric": 0.5},
    {"offset": 0.0, "Coulomb": 0.4, "viscous": 0.2, "cube root": 0.3},
)
PRESLIDING = (0.0, 2e-4, 0.0, 1e-4)
"""Presliding distances of the axes [rad, m]; two axes have presliding."""
CODE = ("c", "python")
SIMPLE = ("ros2", "urdf", "mjcf")


@pytest.fixture(scope="module")
def model() -> Model:
    """Model of a robot with a prismatic axis, which states masses and inertias of the links. Each
    axis has another friction law.
    """
    robot = Robot.load("tests/robots/scara.yaml")
    laws = [
        AxisLaw(
            law="stated",
            speed=float(speed),
            terms={name: _value(value) for name, value in terms.items()},
            plain={"viscous": _value(terms["viscous"])},
            held_out={},
            speeds=(float(slowest), float(speed)),
            presliding=distance,
            bend=_value(0.0),
        )
        for speed, slowest, terms, distance in zip(SPEED, SLOWEST, TERMS, PRESLIDING, strict=True)
    ]
    bare = model_of(robot, *possible(robot), friction=False)
    return find_consistent_robot(replace(bare, friction_law=FrictionLaw(axes=tuple(laws))))


def _value(value: float) -> TermValue:
    return TermValue(value=value, standard_error=0.01)


def recording() -> tuple[Array, Array, Array]:
    """Return positions, velocities and accelerations of 12 s; all speeds occur equally often."""
    t, turns = PERIOD * np.arange(12000), np.array([4, 5, 6, 7]) / 12
    phase = (t[:, np.newaxis] * turns + 0.1) % 1.0
    rising = phase < 0.5
    qd = SPEED * np.where(rising, 4 * phase - 1, 3 - 4 * phase)
    qdd = SPEED * np.where(rising, 4 * turns, -4 * turns)
    q = np.cumsum(qd, axis=0) * PERIOD + [0.1, 0.1, 0.1, 0.1]
    return q, qd, qdd


def sliding(q: Array, qd: Array) -> NDArray[np.bool_]:
    """Return the mask of samples with fully reversed friction, at speeds within the law's range.

    Friction of a recording has no direction before the first motion.
    """
    moved = np.abs(q - q[0]) > 20 * np.max(PRESLIDING)
    return (np.abs(qd) > SLOWEST) & np.logical_or.accumulate(moved)


def exported(model: Model, name: str) -> Exported:
    if name in SIMULATORS:
        return export(model, name, ("origin",))
    return export(model, name, ("origin",))


def test_the_recording_is_one_along_which_friction_follows(model: Model) -> None:
    q, qd, qdd = recording()
    assert are_successive(q, qd)
    assert (q[:, 2] > 0).all()
    along = model.predict(q, qd, qdd, parts=["friction"])
    assert ((np.abs(along) > 0.3) == sliding(q, qd)).mean() > 0.95
    assert {*CODE, *SIMPLE, "st", "json", "friction", "ranges"} == {*FORMATS, *SIMULATORS}


def test_model_json_gives_the_model_s_torques(model: Model) -> None:
    content = json.loads(exported(model, "json").files["model.json"])
    q, qd, qdd = recording()
    p = np.array([each["value"] for each in content["base_parameters"]])
    rotors = np.array([each["reflected_inertia"] for each in content["joints"]])
    load = inverse_dynamics(model.robot, p, q, qd, qdd)
    law = FrictionLaw.model_validate(content["friction"])
    found = load + rotors * qdd + friction_torque(model.robot, law, q, qd, load)
    np.testing.assert_allclose(found, model.predict(q, qd, qdd), atol=1e-9)


def test_friction_json_gives_the_model_s_friction_by_the_formulas_that_it_states(
    model: Model,
) -> None:
    content = json.loads(exported(model, "friction").files["friction.json"])
    q, qd, qdd = recording()
    wanted = model.predict(q, qd, qdd, parts=["friction"])
    for axis, own in enumerate(content["axes"]):
        found = evaluate_formulas(content["formulas"], own, qd[:, axis])
        turned = sliding(q, qd)[:, axis]
        if own["presliding_distance"] == 0:
            turned[:] = True
        np.testing.assert_allclose(found[turned], wanted[turned, axis], atol=0.02)
        assert own["presliding_distance"] == PRESLIDING[axis]


def evaluate_formulas(formulas: dict[str, str], own: dict[str, Any], v: Array) -> Array:
    """Return friction of an axis as in `friction.json`, without load."""
    slowest, fastest = own["speeds"]
    sign = np.where(np.abs(v) < 1e-3 * own["speed"], 0.0, np.sign(v))
    clipped = np.clip(np.abs(v), slowest, fastest)
    u = sign * clipped / own["speed"]
    by_formula = {
        "1": np.ones_like(u), "sgn(v)": sign, "u": u, "|u|": np.abs(u), "cbrt(u)": np.cbrt(u),
        "atan(u / 0.08)": np.arctan(u / 0.08), "u |u|": u * np.abs(u),
    }  # fmt: skip
    terms = own["terms"].items()
    known = sum(value["value"] * by_formula[formulas[name]] for name, value in terms)
    return np.asarray(known + sign * own["slope_beyond"] * (np.abs(v) - clipped))


@pytest.mark.parametrize("name", [pytest.param("c", marks=needs_compiler), "python"])
def test_code_gives_the_model_s_torques_but_for_presliding_which_it_states(
    model: Model, name: str, tmp_path: Any
) -> None:
    q, qd, qdd = recording()
    wanted = model.predict(q, qd, qdd)
    if name == "c":
        library = compiled(model, tmp_path)
        found = called(library.torque, (q, qd, qdd), q.shape, np.float64)
    else:
        found = module(model)["torque"](q, qd, qdd)
    off = np.abs(found - wanted)
    assert off[:, np.equal(PRESLIDING, 0)].max() < 1e-9
    assert off[sliding(q, qd)].max() < 0.02
    rows = [model.predict(*each) for each in zip(q[::50], qd[::50], qdd[::50], strict=True)]
    np.testing.assert_allclose(found[::50], rows, atol=1e-9)
    said = " ".join(exported(model, name).remarks)
    assert "presliding is left out: axis 2 over 0.00020 rad, axis 4 over 0.00010 rad" in said


@pytest.mark.parametrize("name", SIMPLE)
def test_simple_friction_is_off_on_the_recording_by_what_is_stated(model: Model, name: str) -> None:
    q, qd, qdd = recording()
    made = exported(model, name)
    (text,) = made.files.values()
    wanted = model.predict(q, qd, qdd)
    off = {"ros2": ros2_torques, "mjcf": mujoco_torques, "urdf": pinocchio_torques}[name](
        model, text
    ) - wanted
    turned = sliding(q, qd)
    for axis in range(model.robot.n_joints):
        *_, stated = re.findall(rf"axis {axis + 1}: .* (?:differ from|miss) the law by (\S+)", text)
        true = np.sqrt(np.mean(off[turned[:, axis], axis] ** 2))
        assert true == pytest.approx(float(stated), rel=0.1), axis
    assert [each in text for each in made.remarks] == [True] * len(made.remarks)


def ros2_torques(model: Model, text: str) -> Array:
    """Return torques of rigid bodies, armature and friction as added by a controller."""
    q, qd, qdd = recording()
    content = yaml.safe_load(text)["joint_dynamics"]["ros__parameters"]
    joints = [content[name] for name in content["joints"]]
    armature = np.array([each["armature"] for each in joints])
    coulomb, viscous = (
        np.array([each["friction"][key] for each in joints]) for key in ("coulomb", "viscous")
    )
    rigid = model.predict(q, qd, qdd, parts=["rigid bodies"])
    return np.asarray(rigid + armature * qdd + coulomb * np.sign(qd) + viscous * qd)


def mujoco_torques(model: Model, text: str) -> Array:
    """Return inverse dynamics of MuJoCo, which includes damping and friction loss."""
    loaded = mujoco.MjModel.from_xml_string(text)
    data, found = mujoco.MjData(loaded), []
    for q, qd, qdd in zip(*recording(), strict=True):
        data.qpos[:], data.qvel[:], data.qacc[:] = q, qd, qdd
        mujoco.mj_inverse(loaded, data)
        found.append(data.qfrc_inverse.copy())
    return np.array(found)


def pinocchio_torques(model: Model, text: str) -> Array:
    """Return `rnea` of Pinocchio plus friction and damping, which it reads but does not apply."""
    loaded = pinocchio.buildModelFromXML(text)
    loaded.armature = model.robot.reflected_inertia
    data, motion = loaded.createData(), recording()
    rigid = [pinocchio.rnea(loaded, data, *each) for each in zip(*motion, strict=True)]
    return np.asarray(rigid + loaded.friction * np.sign(motion[1]) + loaded.damping * motion[1])


def test_friction_of_the_load_is_stated_as_left_out(model: Model) -> None:
    first, *others = model.friction_law.axes
    assert first is not None
    loaded = first.model_copy(update={"terms": first.terms | {"load": _value(0.034)}})
    law = FrictionLaw(axes=(loaded, *others))
    said = exported(replace(model, friction_law=law), "mjcf").remarks
    assert "load-dependent friction, 0.034 of the load, is left out" in said[0]
    assert not any("of the load" in each for each in said[1:])
