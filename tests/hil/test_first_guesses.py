"""Names known from statsmodels, pinocchio and roboticstoolbox work, compared with pinocchio."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pytest
from possible_models import model_of
from scipy import stats
from stated_model import stated_model
from urdf_robots import ROBOTS, urdf

import hil
from hil.errors import FileError, InvalidArray, InvalidValue, NotEnoughData, UnknownName

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

pin = pytest.importorskip("pinocchio", minversion="3.0")  # earlier versions omit rotors
COULOMB, VISCOUS, ROTORS = np.array([2.0, 1.0]), np.array([1.5, 0.8]), np.array([0.6, 0.3])
PERIOD = 0.004
OF_MAPS = re.compile(r"joints\.|accept: \[|\bmap\b|arrays:|back_and_forth|_side|gain")
"""Keys that only map files have."""


def pinocchio_of(text: str, rotors: Array) -> pin.Model:
    theirs = pin.buildModelFromXML(text)
    theirs.armature = np.asarray(rotors)
    return theirs


def call_pinocchio(function: object, theirs: pin.Model, *motion: Array) -> Array:
    """Call a function of pinocchio sample by sample."""
    data = theirs.createData()
    found = [np.array(function(theirs, data, *each)) for each in zip(*motion, strict=True)]
    return np.array(found)


def load(name: str, folder: Path) -> tuple[hil.Robot, str]:
    text = urdf(name, ROBOTS[name])
    (folder / f"{name}.urdf").write_text(text)
    return hil.Robot.load(folder / f"{name}.urdf"), text


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> tuple[hil.Robot, pin.Model, list[Array]]:
    """Robot from a URDF, and t, q, qd and tau of its motion by pinocchio, with friction."""
    robot, text = load("pan-tilt", tmp_path_factory.mktemp("recorded"))
    theirs, rng = pinocchio_of(text, ROTORS), np.random.default_rng(3)
    t = np.arange(0.0, 60.0, PERIOD)
    w = 2 * np.pi * np.array([[0.11, 0.13], [0.31, 0.29], [0.53, 0.47]])
    phase, size = rng.uniform(0, 2 * np.pi, w.shape), 0.18 / (w / w[1])
    turns = w * t[:, None, None] + phase
    q, qd = (size * np.sin(turns)).sum(axis=1) + 0.5, (size * w * np.cos(turns)).sum(axis=1)
    tau = call_pinocchio(pin.rnea, theirs, q, qd, -(size * w**2 * np.sin(turns)).sum(axis=1))
    tau += COULOMB * np.sign(qd) + VISCOUS * qd + rng.normal(0.0, 0.2, q.shape)
    return robot, theirs, [t, q, qd, tau]


@pytest.fixture(scope="module")
def model(recorded: tuple[hil.Robot, pin.Model, list[Array]]) -> hil.Model:
    robot, _, (t, q, _, tau) = recorded
    return hil.identify(robot, t=t, q=q, tau=tau)


class TestRobot:
    def test_a_urdf_a_robot_file_and_a_name_are_loaded(self, tmp_path: Path) -> None:
        robot, _ = load("UR10e", tmp_path)
        assert (robot.n_joints, hil.Robot.load("manutec-r15").n_joints) == (6, 6)
        robot.save(tmp_path / "arm.yaml")
        assert hil.Robot.load(str(tmp_path / "arm.yaml")) == robot
        part = hil.Robot.load(tmp_path / "UR10e.urdf", tip="link3", gravity=(0, 9.81, 0))
        assert part.joint_names == ("joint1", "joint2", "joint3")
        assert hil.Robot.load("emps").joint_names == ("joint 1",)

    @pytest.mark.parametrize(
        ("name", "text", "why"),
        [
            ("a.xml", "<sdf/>", r"a\.xml:1: .* this is an SDF; robots are read from a URDF"),
            ("a.mjcf", "<mujoco/>", r"a\.mjcf: has no joints from the world to any body"),
            ("a.sdf", "<sdf/>", r"a\.sdf:1: .* this is an SDF"),
            ("a.urdf", None, r"a\.urdf: cannot be read: No such file"),
        ],
    )
    def test_other_files_are_refused_with_what_is_read(
        self, name: str, text: str | None, why: str, tmp_path: Path
    ) -> None:
        if text:
            (tmp_path / name).write_text(text)
        with pytest.raises(FileError, match=why):
            hil.Robot.load(tmp_path / name)

    def test_what_is_of_a_urdf_alone_is_refused_elsewhere(self) -> None:
        with pytest.raises(InvalidValue, match="omit base, tip and gravity"):
            hil.Robot.load("emps", tip="link2")
        with pytest.raises(UnknownName, match=r"ending in \.urdf"):
            hil.Robot.load("enps")


class TestIdentify:
    def test_arrays_give_the_model_that_their_run_gives(self, recorded, model) -> None:
        robot, _, (t, q, _, tau) = recorded
        run = hil.Run.import_arrays(robot, t, q, tau)
        assert hil.identify(run).params == model.params
        assert "1 of 1 measurements" in repr(run)

    def test_lists_are_recordings_and_velocities_are_taken(self, recorded, model) -> None:
        robot, _, columns = recorded
        halves = [np.array_split(each, 2) for each in columns]
        t, q, qd, tau = halves
        both = hil.identify(robot, t=t, q=q, tau=tau, qd=qd)
        assert both.provenance.measurements >= 2
        for name, value in both.params.items():
            assert abs(value - model.params[name]) < 5 * np.hypot(both.bse[name], model.bse[name])

    def test_arrays_without_a_robot_or_without_one_of_them_are_refused(self, recorded) -> None:
        robot, _, (t, q, _, tau) = recorded
        with pytest.raises(InvalidArray, match="missing: tau"):
            hil.identify(robot, t=t, q=q)
        with pytest.raises(InvalidArray, match="tau has 1 arrays, t has 2"):
            hil.identify(robot, t=[t, t], q=[q, q], tau=[tau])
        with pytest.raises(InvalidArray, match=r"recording 2: q has shape \(14999, 2\)"):
            hil.identify(robot, t=[t, t], q=[q, q[1:]], tau=[tau, tau])
        with pytest.raises(InvalidArray, match="missing: t, q, tau"):
            hil.identify(robot)
        with pytest.raises(InvalidArray, match="missing: a robot"):
            hil.identify(hil.Run.import_arrays(robot, t, q, tau), t=t, q=q, tau=tau)

    @pytest.mark.parametrize(
        ("change", "why"),
        [
            (
                lambda a: {"q": np.rad2deg(a["q"])},
                r"q\[:, 0\]: .* in deg.* pass accept=\['range'\]",
            ),
            (lambda a: {"tau": 0 * a["tau"]}, r"tau\[:, 0\]: is 0 throughout; pass its torque"),
            (lambda a: {"tau": a["tau"] * [np.nan, 1]}, r"tau\[:, 0\]: .* no number in any of"),
            (lambda a: {"t": a["t"][::-1]}, "recording 1: t: time runs backwards"),
            (
                lambda a: {"qd": np.gradient(a["q"][:, ::-1], PERIOD, axis=0)},
                r"qd\[:, 0\]: follows",
            ),
            (
                lambda _: {"alone": 1},
                "alone: joint 1 should move alone, .*; omit alone=",
            ),
            (lambda _: {"alone": 3}, "alone 3 must be a joint of pan-tilt, 1 to 2"),
            (lambda _: {"cut_off": -1.0}, "cut_off: .*must be greater than 0"),
            (lambda _: {"accept": "all"}, r"accept\.0: 'all': must be 'range', "),
        ],
    )
    def test_messages_name_arguments_and_no_keys_of_a_map(self, recorded, change, why) -> None:
        robot, _, (t, q, _, tau) = recorded
        arrays = {"t": t, "q": q, "tau": tau}
        with pytest.raises((InvalidArray, InvalidValue), match=why) as refused:
            hil.identify(robot, **arrays | change(arrays))
        assert not OF_MAPS.search(str(refused.value))

    def test_doubts_name_arguments_too(self, recorded) -> None:
        robot, _, (t, q, _, tau) = recorded
        (session,) = hil.Run.import_arrays(robot, t, q, 1e-3 * tau).journal.sessions
        assert "in SI, on the joint side; if this is correct, pass" in session.warnings[0]
        assert not OF_MAPS.search("\n".join(session.warnings))
        assert not OF_MAPS.search("\n".join(session.notes[1:]))


class TestAsStatsmodels:
    """Parameters by name, with errors and intervals."""

    def test_errors_are_those_of_the_covariance(self, model) -> None:
        bse = np.array(list(model.bse.values()))
        assert bse == pytest.approx(np.sqrt(np.diag(model.cov_params())))
        assert list(model.tvalues.values()) == pytest.approx(list(model.params.values()) / bse)

    @pytest.mark.parametrize("alpha", [0.05, 0.5])
    def test_alpha_is_the_share_of_intervals_that_miss(self, model, alpha) -> None:
        t = stats.t.ppf(1 - alpha / 2, model.degrees_of_freedom)
        for (name, (low, high)), factor in zip(model.conf_int(alpha).items(), t, strict=True):
            assert (low + high) / 2 == pytest.approx(model.params[name])
            assert (high - low) / 2 == pytest.approx(factor * model.bse[name], rel=1e-6)

    def test_a_level_for_alpha_is_refused(self, model) -> None:
        with pytest.raises(InvalidArray, match=r"alpha 0\.95 must be above 0 and at most 0\.5"):
            model.conf_int(0.95)

    def test_intervals_hold_what_pinocchio_s_bodies_have(self, recorded, model) -> None:
        robot, theirs, (_, q, qd, _) = recorded
        wanted = parameters_of(robot, theirs, q[::50], qd[::50])
        for value, (low, high) in zip(wanted, model.conf_int(1e-4).values(), strict=True):
            assert low < value < high

    def test_the_summary_and_the_verdict_say_how_good_it_is(self, model) -> None:
        assert str(model.verdict).startswith("good: ")
        assert all(name in str(model.summary()) for name in model.params)

    def test_a_model_is_saved_and_loaded(self, model, tmp_path: Path) -> None:
        model.save(tmp_path / "model.yaml")
        kept = hil.Model.load(tmp_path / "model.yaml")
        assert (kept.params, kept.bse, kept.verdict) == (model.params, model.bse, model.verdict)


def parameters_of(robot: hil.Robot, theirs: pin.Model, q: Array, qd: Array) -> Array:
    """Return base parameters that reproduce pinocchio's torques exactly."""
    qdd = np.random.default_rng(1).normal(size=q.shape)
    A = hil.regressor(robot, q, qd, qdd).reshape(q.size, -1)
    tau = call_pinocchio(pin.rnea, theirs, q, qd, qdd).ravel()
    p = np.linalg.lstsq(A, tau, rcond=None)[0]
    assert A @ p == pytest.approx(tau, abs=1e-9 * np.abs(tau).max())
    return p


@pytest.mark.parametrize("name", ["pan-tilt", "askew", "UR10e", "Panda"])
class TestAsPinocchio:
    """Dynamics of the bodies and rotors of a URDF, compared with pinocchio."""

    @pytest.fixture
    def bodies(self, name: str, tmp_path: Path) -> tuple[hil.Model, pin.Model, Array]:
        robot, text = load(name, tmp_path)
        rng = np.random.default_rng(2)
        theirs = pinocchio_of(text, rng.uniform(0.1, 0.5, robot.n_joints))
        motion = rng.uniform(-1.5, 1.5, (3, 100, robot.n_joints))
        p = parameters_of(robot, theirs, *motion[:2])
        return model_of(robot, p, 0.01 * np.abs(p)), theirs, motion

    def test_torques_and_gravity(self, bodies) -> None:
        model, theirs, motion = bodies
        parts = ["rigid bodies", "motors"]
        close(model.predict(*motion, parts=parts), call_pinocchio(pin.rnea, theirs, *motion))
        gravity = call_pinocchio(pin.computeGeneralizedGravity, theirs, motion[0])
        close(model.gravity(motion[0]), gravity)

    def test_mass_matrix(self, bodies) -> None:
        model, theirs, (q, *_) = bodies
        upper = np.triu(call_pinocchio(pin.crba, theirs, q))
        close(model.mass_matrix(q), upper + np.transpose(np.triu(upper, 1), (0, 2, 1)))

    def test_coriolis_matrix(self, bodies) -> None:
        model, theirs, (q, qd, _) = bodies
        C = model.coriolis(q, qd)
        velocity_product = model.predict(q, qd, 0.0, ["rigid bodies"]) - model.gravity(q)
        close(np.einsum("nij,nj->ni", C, qd), velocity_product)
        close(C, call_pinocchio(pin.computeCoriolisMatrix, theirs, q, qd))
        h = 1e-5
        rate = (model.mass_matrix(q + h * qd) - model.mass_matrix(q - h * qd)) / (2 * h)
        skew = rate - 2 * C
        close(skew, -np.transpose(skew, (0, 2, 1)), share=1e-7)

    def test_forward_dynamics(self, bodies) -> None:
        model, theirs, (q, qd, tau) = bodies
        close(
            model.forward_dynamics(q, qd, tau, parts=["rigid bodies", "motors"]),
            call_pinocchio(pin.aba, theirs, q, qd, tau),
        )


def close(found: Array, wanted: Array, share: float = 1e-8) -> None:
    np.testing.assert_allclose(found, wanted, rtol=0, atol=share * np.abs(wanted).max())


class TestMachine:
    """Dynamics with friction and rotor inertias."""

    def test_torque_is_the_sum_of_its_terms(self, model, recorded) -> None:
        _, _, (_, q, qd, _) = recorded
        qdd = np.gradient(qd, PERIOD, axis=0)
        inertial = np.einsum("nij,nj->ni", model.mass_matrix(q), qdd)
        centrifugal = np.einsum("nij,nj->ni", model.coriolis(q, qd), qd)
        rest = model.gravity(q) + model.friction_torque(qd, q, qdd)
        close(inertial + centrifugal + rest, model.predict(q, qd, qdd))

    def test_the_mass_matrix_has_the_stated_rotors(self) -> None:
        robot = hil.Robot.load("manutec-r15")
        every = stated_model(robot).mass_matrix(np.zeros(6))
        bodies = stated_model(robot).mass_matrix(np.zeros(6), parts=["rigid bodies"])
        assert every - bodies == pytest.approx(np.diag(robot.reflected_inertia))

    @pytest.mark.parametrize("speed", [0.3, 0.8])
    def test_friction_is_that_of_the_recording(self, model, speed) -> None:
        for side in (1.0, -1.0):
            found = model.friction_torque(side * speed)
            assert found == pytest.approx(side * (COULOMB + VISCOUS * speed), abs=0.1)

    def test_torques_predict_what_pinocchio_s_robot_needs(self, model, recorded) -> None:
        _, theirs, (_, q, qd, tau) = recorded
        at = np.random.default_rng(9).integers(0, len(q), 200)
        qdd = call_pinocchio(pin.aba, theirs, q[at], qd[at], tau[at] - friction(qd[at]))
        left = model.predict(q[at], qd[at], qdd) - tau[at]
        assert (np.abs(left).max(axis=0) < 0.02 * np.abs(tau).max(axis=0)).all()

    @pytest.mark.parametrize("law", [("Coulomb", "viscous"), ("Coulomb", "load")])
    def test_forward_dynamics_undoes_predict_also_where_friction_grows_with_load(self, law) -> None:
        model = friction_model(dict.fromkeys(law, 0.4))
        q, qd, qdd = np.random.default_rng(4).uniform(-1, 1, (3, 50, 2))
        close(model.forward_dynamics(q, qd, model.predict(q, qd, qdd)), qdd, share=1e-6)
        one = model.forward_dynamics(q[0], qd[0], model.predict(q[0], qd[0], qdd[0]))
        assert one.shape == (2,)

    def test_friction_as_large_as_its_load_and_masses_that_no_robot_has_are_refused(self) -> None:
        with pytest.raises(NotEnoughData, match="load-dependent friction"):
            friction_model({"load": 3.0}).forward_dynamics(0.5, 0.5, 1.0)
        with pytest.raises(NotEnoughData, match=r"the mass matrix of .* is not positive definite"):
            friction_model({}).forward_dynamics(0.5, 0.5, 1.0, parts=["friction"])


def friction(qd: Array) -> Array:
    return COULOMB * np.sign(qd) + VISCOUS * qd


def friction_model(terms: dict[str, float]) -> hil.Model:
    from free_run import TRUTH, arm

    from hil.friction.law import AxisLaw, FrictionLaw, TermValue

    values = {name: TermValue(value=each, standard_error=0.0) for name, each in terms.items()}
    zero = TermValue(value=0.0, standard_error=0.0)
    law = AxisLaw(law="stated", speed=2.0, terms=values, plain={"viscous": zero}, held_out={})
    found = model_of(arm(), TRUTH, np.abs(TRUTH), friction=False)
    return hil.Model(**vars(found) | {"friction_law": FrictionLaw(axes=(law, law))})


def test_the_version_is_that_of_pyproject() -> None:
    stated = tomllib.loads((Path(__file__).parents[2] / "pyproject.toml").read_text())
    assert hil.__version__ == stated["project"]["version"]


def test_arrays_come_in_and_tables_go_out_by_the_names_of_pandas(recorded) -> None:
    robot, _, (t, q, _, tau) = recorded
    run = hil.Run.from_arrays(robot, t[:4000], q[:4000], tau[:4000])
    recording = next(iter(run)).recording
    assert recording.to_dataframe().equals(recording.dataframe())
