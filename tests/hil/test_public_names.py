"""Use from Python by public names alone: arrays, subsets, friction, noise, models."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from small_run import identified_model, write_run

import hil

EXAMPLES = Path(__file__).parents[2] / "examples" / "pan_tilt"
JOINT = {
    "frame": {"alpha": "pi/2"},
    "parameters": ["sx", "sy", "Izz"],
    "drive": {"gear_ratio": 100, "rotor_inertia": 1e-4, "torque_constant": 0.1},
    "q_min": -1.5, "q_max": 1.5, "velocity_limit": 4, "acceleration_limit": 40, "torque_limit": 80,
}  # fmt: skip


@pytest.fixture(scope="module")
def campaign(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_run(
        tmp_path_factory.mktemp("campaign") / "run", hil.Robot.load("manutec-r15")
    ).path


def swung(seed: int = 0, duration: float = 20.0) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return time, position and torque of a pendulum with Coulomb and viscous friction."""
    rng, t = np.random.default_rng(seed), np.arange(0.0, duration, 0.002)
    rates = np.array([0.31, 0.83, 1.7])
    phase = t[:, None] * rates * 2 * np.pi + rng.uniform(0, 6, 3)
    q = (0.35 * np.sin(phase)).sum(axis=1)
    qd = (0.35 * rates * 2 * np.pi * np.cos(phase)).sum(axis=1)
    qdd = -(0.35 * (rates * 2 * np.pi) ** 2 * np.sin(phase)).sum(axis=1)
    robot = hil.Robot.create("pendulum", [JOINT])
    base = hil.base_parameters(robot)
    values = np.array([{"Izz1": 2.0, "sx1": 1.5, "sy1": -0.4}[e] for e in base.expressions])
    columns = [each[:, None] for each in (q, qd, qdd)]
    rigid = hil.inverse_dynamics(robot, values, *columns) + hil.motor_torque(robot, *columns)
    tau = rigid[:, 0] + 3.0 * np.sign(qd) + 0.8 * qd + rng.normal(0, 0.2, len(t))
    return t, q, tau


def test_a_robot_of_one_s_own_is_identified_from_arrays(tmp_path: Path) -> None:
    robot = hil.Robot.create("pendulum", [JOINT])
    t, q, tau = swung()
    run = hil.Run.import_arrays(robot, t, q, tau)
    model = hil.identify(run)
    found = dict(zip(model.expressions, model.values, strict=True))
    assert found == pytest.approx({"Izz1": 2.0, "sx1": 1.5, "sy1": -0.4}, abs=0.03)
    assert set(model.params) == set(model.conf_int()) == set(model.names)
    low, high = model.conf_int(0.1)["p1"]
    assert low < model.params["p1"] < high
    robot.save(tmp_path / "pendulum.yaml")
    assert hil.Robot.load(tmp_path / "pendulum.yaml") == robot
    with pytest.raises(hil.errors.FileError, match="already exists"):
        robot.save(tmp_path / "pendulum.yaml")
    kept = run.save(tmp_path / "run")
    assert np.array_equal(hil.identify(tmp_path / "run").values, model.values)
    assert kept.ids == run.ids


@pytest.mark.parametrize(
    ("change", "why"),
    [
        (lambda t, q, tau: (t[:, None], q, tau), r"t has shape \(10000, 1\)"),
        (lambda t, q, tau: (t, q[:-1], tau), r"q has shape \(9999, 1\)"),
        (lambda t, q, tau: (t[:100], q[:100], tau[:100]), "recording 1: .*lasts 0.198 s"),
    ],
)
def test_arrays_that_cannot_be_used_are_refused(change, why: str) -> None:
    robot = hil.Robot.create("pendulum", [JOINT])
    with pytest.raises(hil.errors.InvalidArray, match=why):
        hil.Run.import_arrays(robot, *change(*swung()))


def test_a_subset_of_measurements_is_identified(campaign: Path) -> None:
    run = hil.Run.open(campaign)
    gravity = run.only(kind="gravity")
    assert {each.measurement.kind for each in gravity} == {"gravity"}
    assert run.only(run.ids[:3]).ids == run.ids[:3]
    fewer = run.exclude([gravity.ids[0]])
    model = hil.identify(fewer, "published")
    assert model.provenance.without == (gravity.ids[0],)
    with pytest.raises(hil.errors.UnknownName, match="no measurement of kind walk"):
        run.only(kind="walk")


def test_friction_over_time_is_known_of_a_loaded_model_too(tmp_path: Path) -> None:
    model = identified_model()
    model.save(tmp_path / "model.yaml")
    loaded = hil.Model.load(tmp_path / "model.yaml")
    time, level = model.friction_over_time(2)
    assert len(time) == sum(each.axis == 1 for each in model.local) > 3
    assert all(map(np.array_equal, (time, level), loaded.friction_over_time(2)))
    assert "axis 2" in repr(hil.plot_friction_over_time(loaded))


def test_a_monte_carlo_study_needs_no_folders(campaign: Path, tmp_path: Path) -> None:
    robot = hil.Robot.create("pendulum", [JOINT])
    run = hil.Run.import_arrays(robot, *swung(duration=10.0))
    found = [hil.identify(run.add_noise(torque=0.5, seed=seed)).values for seed in range(3)]
    again = hil.identify(run.add_noise(torque=0.5, seed=0)).values
    assert np.array_equal(again, found[0])
    assert (np.std(found, axis=0) > 0).all()
    noisy = hil.Run.open(campaign).add_noise(torque=0.1)
    first = noisy.ids[0]
    added = noisy[first].recording.tau - hil.Run.open(campaign)[first].recording.tau
    assert np.nanstd(added) == pytest.approx(0.1, rel=0.05)
    assert not list(tmp_path.iterdir())


def test_two_models_are_compared(campaign: Path) -> None:
    run = hil.Run.open(campaign)
    one, two = identified_model(), hil.identify(run, "published")
    found = hil.compare(one, two)
    assert np.allclose(found.difference, one.values - two.values)
    assert "difference" in str(found)
    assert found.torque.shape == (6,)
    true = hil.compare(one, "manutec-r15")
    assert true.z.shape == (14,)


def test_a_plan_is_made_checked_and_refused() -> None:
    plan = hil.plan("manutec-r15", gravity=8, inertia=12)
    assert hil.dry_run(plan).problems == ()
    with pytest.raises(ValueError, match="period does not apply to kind strokes: it is for traj"):
        hil.plan("manutec-r15", period=20.0)


def test_figures_are_those_of_a_page(campaign: Path, tmp_path: Path) -> None:
    model = identified_model()
    for figure in (
        hil.plot_torque(model, campaign), hil.plot_friction(model), hil.plot_parameters(model),
    ):  # fmt: skip
        assert figure._repr_svg_().startswith("<svg")
        assert figure.svg in figure._repr_html_()
    assert figure.savefig(tmp_path / "p.svg").read_text() == figure.svg
    with pytest.raises(hil.errors.FileError, match=r"p\.png: figures are SVG; choose p\.svg"):
        figure.savefig(tmp_path / "p.png")


def test_a_run_is_accepted_by_limits_that_it_drafted(campaign: Path) -> None:
    model = identified_model()
    model.save(campaign / "model.yaml")
    limits = hil.draft_limits(campaign).model_copy(update={"outcome": "failed"})  # a small run
    found = hil.accept(campaign, limits)
    assert (found.word, len(found.checks) > 30) == ("good", True)
    narrow = limits.quantities[0].model_copy(update={"most": limits.quantities[0].least})
    assert (
        hil.accept(campaign, limits.model_copy(update={"quantities": (narrow,)})).word == "failed"
    )
    with pytest.raises(hil.errors.NotEnoughData, match="friction"):
        hil.fit_friction(campaign)


def test_a_model_is_a_table() -> None:
    table = identified_model().dataframe()
    assert list(table.columns) == [
        "value", "standard_error", "low", "high", "unit", "meaning", "expression",
    ]  # fmt: skip
    assert table.loc["p5", "unit"] == "kg m"


def test_every_public_name_is_there_and_importing_hil_loads_none_of_it() -> None:
    for name in hil.__all__:
        assert callable(getattr(hil, name)) or name in {"__version__", "errors"}
    program = "import sys, hil; print(sorted(m for m in sys.modules if m.startswith('hil')))"
    done = subprocess.run(  # noqa: S603 - our own program
        [sys.executable, "-c", program], capture_output=True, text=True, check=True
    )
    assert done.stdout.strip() == "['hil']"
