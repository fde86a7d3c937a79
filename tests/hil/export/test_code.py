"""Exported C, Python and structured text reproduce the model's values, for robots of all kinds."""

from __future__ import annotations

import ctypes
import re
import shutil
import subprocess
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from compiled_code import COMPILER, STRICT, called, compiled, module, needs_compiler
from stated_model import stated_model

from hil.export.expressions import count
from hil.export.functions import count_whole_links, rigid
from hil.export.languages import write_c, write_python
from hil.export.source_code import identifier
from hil.model.robot import Robot, parse_robot
from hil.results.samples import known_warmth

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from hil.results.model import Model

    Array = NDArray[np.float64]

ROOT = Path(__file__).parents[3]
ROBOTS = {
    "six axes": "manutec-r15",
    "coupled wrist, rotors identified": "staubli-tx40",
    "three slides": str(ROOT / "tests/robots/cartesian.yaml"),
    "a slide among turns": str(ROOT / "tests/robots/scara.yaml"),
    "two arms": str(ROOT / "tests/robots/two-arms.yaml"),
    "base on a wall": str(ROOT / "tests/robots/ur10e-on-a-wall.yaml"),
    "URDF": str(ROOT / "examples/pan_tilt/head.urdf"),
}
CPPCHECK, NM = shutil.which("cppcheck"), shutil.which("nm")
ADVICE = ("2.5", "12.1", "12.3", "20.5", "20.10")
"""Advisory rules of MISRA C:2012 not followed by the header: unused macros for its user, brackets
that repeat the precedence of * and +, declarations in one line, #undef and ##.
"""
EXACT = {"warmth_rate": 1e-7}
"""Tolerance of comparisons with a difference quotient."""


def motion(robot: Robot, n: int = 20) -> tuple[Array, Array, Array]:
    q, qd, qdd = np.random.default_rng(5).uniform(-3.0, 3.0, (3, n, robot.n_joints))
    qd[:3] *= np.array([[0.0], [1e-4], [1e-3]])  # at rest, and at speeds with doubtful direction
    return q, qd, qdd


def expected(model: Model) -> dict[str, tuple[tuple[Array, ...], Array]]:
    """Return arguments and results of each function, by the model itself."""
    q, qd, qdd = motion(model.robot)
    tau, load = model.predict(q, qd, qdd), model.predict(q, qd, qdd, parts=["rigid bodies"])
    friction = model.predict(q, qd, qdd, parts=["friction"])
    found: dict[str, tuple[tuple[Array, ...], Array]] = {
        "gravity": ((q,), model.gravity(q)),
        "rigid_bodies": ((q, qd, qdd), load),
        "mass_matrix": ((q,), model.mass_matrix(q, ["rigid bodies"])),
        "friction": ((q, qd, load), friction),
        "torque": ((q, qd, qdd), tau),
    }
    if np.isfinite([model.robot.torque_constant, model.robot.gear_ratio]).all():
        motors = np.linalg.solve(model.robot.motor_matrix.T, tau.T).T
        found["current"] = (tau,), motors / model.robot.torque_constant
    if any(known_warmth(model)):
        warmth = np.random.default_rng(6).uniform(0.0, 1.0, q.shape)
        at_warmth = model.predict(q, qd, qdd, parts=["friction"], warmth=warmth)
        found["friction_at_warmth"] = (q, qd, load, warmth), at_warmth
        found["warmth_rate"] = (qd, warmth), rates(model, qd, warmth)
    return found


def rates(model: Model, qd: Array, warmth: Array) -> Array:
    """Return the rate of warmth from its change in a microsecond; 0 for no warmth."""
    step = 1e-6
    return np.array([
        np.nan_to_num((model.warmth([0.0, step], [v, v], w)[1] - w) / step)
        for v, w in zip(qd, warmth, strict=True)
    ])  # fmt: skip


def close(found: Array, wanted: Array, share: float) -> bool:
    return bool(np.abs(found - wanted).max() <= share * max(np.abs(wanted).max(), 1.0))


@pytest.mark.parametrize("kind", ROBOTS)
def test_python_functions_give_the_model_s_numbers(kind: str) -> None:
    model = stated_model(Robot.load(ROBOTS[kind]), warm=True)
    names = module(model)
    for name, (arguments, wanted) in expected(model).items():
        assert close(names[name](*arguments), wanted, EXACT.get(name, 1e-10)), name
        one = names[name](*(each[3] for each in arguments))
        assert close(one, wanted[3], EXACT.get(name, 1e-10)), name


@pytest.mark.parametrize("tree", [False, True])
@pytest.mark.parametrize("seed", range(12))
def test_so_they_do_for_random_robots(chains: Any, seed: int, tree: bool) -> None:
    model = stated_model(chains.random(seed, tree), seed)
    names = module(model)
    for name, (arguments, wanted) in expected(model).items():
        assert close(names[name](*arguments), wanted, 1e-10), name


def test_springs_and_counterbalances_are_in_gravity() -> None:
    text = (
        "name: sprung\ngravity: [0, -9.81, 0]\njoints:\n"
        "  - {frame: {alpha: 0}, parameters: [Izz], q_min: -1, q_max: 1, velocity_limit: 1,"
        " acceleration_limit: 1, torque_limit: 1}\n"
        "springs: [{joint: 1, shape: linear}, {joint: 1, shape: cosine}, {joint: 1, shape: sine}]\n"
    )
    model = stated_model(parse_robot(text, "sprung.yaml"))
    q, _, _ = motion(model.robot)
    assert close(module(model)["gravity"](q), model.gravity(q), 1e-12)
    assert np.ptp(model.gravity(q)) > 0.1


@needs_compiler
@pytest.mark.parametrize("kind", ROBOTS)
def test_c_functions_give_the_model_s_numbers(kind: str, tmp_path: Path) -> None:
    model = stated_model(Robot.load(ROBOTS[kind]), warm=True)
    library = compiled(model, tmp_path)
    for name, (arguments, wanted) in expected(model).items():
        found = called(getattr(library, name), arguments, wanted.shape, np.float64)
        assert close(found, wanted, EXACT.get(name, 1e-10)), name


@needs_compiler
def test_in_single_precision_nothing_is_computed_in_double(tmp_path: Path) -> None:
    model = stated_model(Robot.load("manutec-r15"))
    library = compiled(
        model, tmp_path, "-DMANUTEC_R15_SINGLE", "-Wdouble-promotion", "-Wconversion"
    )
    for name, (arguments, wanted) in expected(model).items():
        found = called(getattr(library, name), arguments, wanted.shape, np.float32)
        # digits are lost in ripple over motor angles of 100 and more turns
        assert close(found, wanted, 1e-3), name


@needs_compiler
def test_the_example_compiles_and_runs(tmp_path: Path) -> None:
    model = stated_model(Robot.load("manutec-r15"))
    compiled(model, tmp_path)
    assert COMPILER is not None
    command = [COMPILER, *STRICT, "example.c", "-o", "example", "-lm"]
    subprocess.run(command, cwd=tmp_path, check=True)  # noqa: S603
    done = subprocess.run([tmp_path / "example"], capture_output=True, text=True, check=True)  # noqa: S603
    at_rest = model.gravity(np.zeros(6))
    assert f"joint 2: gravity {at_rest[1]:g}" in done.stdout


@pytest.mark.parametrize("kind", ROBOTS)
def test_the_header_includes_and_calls_nothing_but_sines_cosines_and_arc_tangents(
    kind: str,
) -> None:
    model = stated_model(Robot.load(ROBOTS[kind]), warm=True)
    name = identifier(model.robot.name)
    text = write_c(model, ()).files[f"{name}_dynamics.h"]
    code = re.sub(r"(?s)/\*.*?\*/", "", text)
    assert re.findall(r"#include (.*)", code) == ["<math.h>"]
    assert {"sin", "cos", "atan", "fabs"} >= set(re.findall(r"HIL_F\((?!function)(\w+)\)", code))
    called = set(re.findall(r"\b(\w+)\(", code)) - {"HIL_F", "HIL_R", "for"}
    assert all(each.startswith(f"{name}_") for each in called)
    assert f"{name}_cbrt(" in code


@needs_compiler
@pytest.mark.skipif(NM is None, reason="there is no nm")
def test_of_the_library_of_mathematics_the_compiled_code_calls_three_functions(
    tmp_path: Path,
) -> None:
    compiled(stated_model(Robot.load("manutec-r15"), warm=True), tmp_path)
    command = [str(COMPILER), *STRICT, "-c", "library.c", "-o", "library.o"]
    subprocess.run(command, cwd=tmp_path, check=True)  # noqa: S603
    listed = [str(NM), "-u", "library.o"]
    done = subprocess.run(listed, cwd=tmp_path, capture_output=True, text=True, check=True)  # noqa: S603
    names = {word.lstrip("_") for word in done.stdout.split()} - {"U"}
    # the compiler may compute sine and cosine of one angle together
    assert {"sin", "cos", "atan", "sincos", "GLOBAL_OFFSET_TABLE_"} >= names >= {"atan"}


@needs_compiler
def test_the_cube_root_of_the_header_is_exact_for_every_size(tmp_path: Path) -> None:
    model = stated_model(Robot.load("manutec-r15"))
    compiled(model, tmp_path)
    source = (
        '#include "manutec_r15_dynamics.h"\nvoid root(const double *x, double *out);\n'
        "void root(const double *x, double *out) { *out = manutec_r15_cbrt(*x); }\n"
    )
    (tmp_path / "root.c").write_text(source)
    assert COMPILER is not None
    command = [COMPILER, *STRICT, "-shared", "-fPIC", "root.c", "-o", "root.so", "-lm"]
    subprocess.run(command, cwd=tmp_path, check=True)  # noqa: S603
    root = ctypes.CDLL(str(tmp_path / "root.so")).root
    sizes = np.concatenate([np.geomspace(1e-300, 1e300, 2001), np.linspace(0.0, 2.0, 2001)])
    x = np.concatenate([sizes, -sizes])[:, np.newaxis]
    np.testing.assert_allclose(called(root, (x,), x.shape, np.float64), np.cbrt(x), rtol=1e-14)
    beyond = called(root, (np.array([[np.inf], [np.nan]]),), (2, 1), np.float64)
    assert not np.isfinite(beyond).any()  # the loop ends even for these


@pytest.mark.skipif(CPPCHECK is None, reason="there is no cppcheck")
@pytest.mark.parametrize("kind", ROBOTS)
@pytest.mark.parametrize("precision", ["-U", "-D"])
def test_cppcheck_finds_nothing_in_the_header_but_advice_of_misra(
    kind: str, precision: str, tmp_path: Path
) -> None:
    model = stated_model(Robot.load(ROBOTS[kind]), warm=True)
    for file, text in write_c(model, ("origin",)).files.items():
        (tmp_path / file).write_text(text)
    name = identifier(model.robot.name)
    command = [
        str(CPPCHECK), "--std=c99", "--enable=warning,style,performance,portability", "--quiet",
        f"{precision}{name.upper()}_SINGLE", "--addon=misra", "--template={file} {id}", "example.c",
    ]  # fmt: skip
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)  # noqa: S603
    found = {line.split()[1] for line in done.stderr.splitlines() if line.startswith(name)}
    assert found <= {f"misra-c2012-{rule}" for rule in ADVICE}


@pytest.mark.parametrize("kind", ROBOTS)
def test_fewer_operations_than_the_recursion_on_whole_links(kind: str) -> None:
    robot = Robot.load(ROBOTS[kind])
    own, general = count(rigid(stated_model(robot)).results), count_whole_links(robot)
    assert own.multiplications + own.additions < 0.7 * (general.multiplications + general.additions)
    stated = write_c(stated_model(robot), ()).remarks
    assert f"rigid_bodies: {own}; {general} for whole links" in stated


def test_without_friction_the_torque_says_so() -> None:
    model = stated_model(Robot.load("manutec-r15"), friction=())
    exported = write_python(model, ())
    (text,) = exported.files.values()
    assert "def friction" not in text
    assert "rigid bodies, motors; no friction" in text
    assert any("identify the run anew" in each for each in exported.remarks)


def test_without_torque_constants_there_is_no_current() -> None:
    exported = write_c(stated_model(Robot.load("staubli-tx40")), ())
    assert "_current(" not in exported.files["staubli_tx40_dynamics.h"]
    assert any("torque constant" in each for each in exported.remarks)


@pytest.mark.parametrize(
    ("name", "wanted"),
    [("manutec-r15", "manutec_r15"), ("7dof.arm", "robot_7dof_arm"), ("A--B_c", "a_b_c")],
)
def test_names_of_robots_become_identifiers(name: str, wanted: str) -> None:
    assert identifier(name) == wanted
    assert identifier(name).isidentifier()
