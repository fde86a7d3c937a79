"""A model evaluates its equations with intervals, and refuses invalid input."""

from dataclasses import replace

import numpy as np
import pytest
import yaml
from scipy import stats
from small_run import identified_model, write_run
from trajectory_run import write_trajectory_run

import hil
from hil import cli
from hil.errors import (
    FileError,
    FrictionUnknown,
    InvalidArray,
    NotEnoughData,
    NotIdentifiable,
    UnknownName,
)
from hil.estimation.intervals import combined_degrees, degrees_behind, half_width
from hil.friction.law import FrictionLaw
from hil.model import dynamics
from hil.results.identification import identify
from hil.results.identified_robot import PARTS
from hil.results.model import Model
from hil.results.model_file import NAME
from hil.show.html import symbols


@pytest.fixture(scope="module")
def run(manutec, tmp_path_factory):
    return write_run(tmp_path_factory.mktemp("model") / "run", manutec)


@pytest.fixture(scope="module")
def model():
    return identified_model()


@pytest.fixture(scope="module")
def uncertain(model):
    """Model with torque constants known to about a percent."""
    effect = np.random.default_rng(3).normal(size=(14, 3)) * 0.01
    return replace(model, drive_covariance=effect @ effect.T)


@pytest.fixture(scope="module")
def motion():
    return np.random.default_rng(1).uniform(-1, 1, (3, 20, 6))


class TestTorques:
    def test_the_rigid_bodies_part_is_that_of_the_base_parameters(self, model, manutec, motion):
        q, qd, qdd = motion
        expected = dynamics.inverse_dynamics(manutec, model.values, q, qd, qdd)
        assert np.array_equal(model.predict(q, qd, qdd, parts=["rigid bodies"]), expected)
        M = model.mass_matrix(q, parts=["rigid bodies"])
        assert M.shape == (20, 6, 6)
        difference = model.predict(q, 0.0, qdd, parts=["rigid bodies"]) - model.gravity(q)
        assert np.einsum("nij,nj->ni", M, qdd) == pytest.approx(difference, abs=1e-9)

    def test_numbers_and_single_configurations_broadcast(self, model, motion):
        q, qd, _ = motion
        each = model.predict(q, qd[0], 0.5)
        assert each[3] == pytest.approx(model.predict(q[3], qd[0], np.full(6, 0.5)), rel=1e-12)
        assert model.predict(q[3], qd, 0.5).shape == (20, 6)
        assert model.predict(0.0, 0.0, 0.0).shape == (6,)

    def test_they_are_all_parts_together_unless_some_are_named(self, model, manutec, motion):
        parts = {part: model.predict(*motion, parts=[part]) for part in PARTS}
        assert np.array_equal(parts["motors"], hil.motor_torque(manutec, *motion))
        assert model.predict(*motion) == pytest.approx(sum(parts.values()), rel=1e-12)
        assert (np.abs(parts["friction"]).mean(axis=0) > 0).all()

    def test_the_summary_states_the_law_of_friction_of_each_axis(self, model):
        text = str(model.summary())
        assert "Friction over the campaign" in text
        for axis in model.friction_law.axes:
            assert axis.law.split()[0] in text  # first word of the folded text
        assert "Friction over" not in str(
            replace(model, friction_law=FrictionLaw.absent(6)).summary()
        )

    def test_an_unknown_part_is_refused_and_all_are_named(self, model):
        with pytest.raises(UnknownName, match=r"'gear': .* rigid bodies, motors, friction"):
            model.predict(0.0, 0.0, 0.0, parts=["gear"])

    def test_a_model_without_friction_gives_the_other_parts_and_states_the_remedy(
        self, model, motion
    ):
        bare = replace(model, friction_law=FrictionLaw.absent(6))
        with pytest.raises(NotEnoughData, match=r"no law of friction: use parts=.* hil identify"):
            bare.predict(*motion)
        rest = PARTS[:2]
        assert np.array_equal(bare.predict(*motion, parts=rest), model.predict(*motion, parts=rest))

    def test_an_axis_without_a_law_is_named_and_the_others_keep_theirs(self, model, motion):
        axes = (*model.friction_law.axes[:5], None)
        blind = replace(model, friction_law=FrictionLaw(axes=axes))
        assert blind.axes_without_friction == (6,)
        assert model.axes_without_friction == ()
        with pytest.warns(FrictionUnknown, match="no law of friction of axis 6 .* --with") as seen:
            found = blind.predict(*motion)
        assert seen[0].filename == __file__
        assert np.array_equal(found[..., :5], model.predict(*motion)[..., :5])
        rest = model.predict(*motion, parts=PARTS[:2])
        assert np.array_equal(found[..., 5], rest[..., 5])
        assert "no law of friction of axis 6" in str(blind.summary())

    def test_it_has_no_interval_there(self, model, motion):
        axes = (*model.friction_law.axes[:5], None)
        blind = replace(model, friction_law=FrictionLaw(axes=axes))
        with pytest.warns(FrictionUnknown):
            interval = blind.torque_interval(*motion)
        assert np.isnan(interval[..., 5, :]).all()
        assert np.isfinite(interval[..., :5, :]).all()
        assert np.isfinite(blind.torque_interval(*motion, parts=PARTS[:2])).all()

    def test_a_law_of_no_axis_is_none(self, model):
        blind = replace(model, friction_law=model.friction_law.restricted(()))
        with pytest.raises(NotEnoughData, match=r"no law of friction: .* measure each"):
            blind.predict(0.0, 0.0, 0.0)

    @pytest.mark.parametrize(
        ("q", "message"),
        [
            (np.zeros(5), r"q has shape \(5,\); .* shape \(6,\) or \(n_samples, 6\)"),
            (np.zeros((2, 3, 6)), r"q has shape \(2, 3, 6\)"),
            (np.zeros((19, 6)), "the same number of samples"),
            (np.full(6, np.nan), "q has 6 values that are NaN"),
            (["a"] * 6, "could not convert"),
        ],
    )
    def test_other_shapes_and_nan_are_refused_with_the_shape_wanted(
        self, model, motion, q, message
    ):
        with pytest.raises(InvalidArray, match=message):
            model.predict(q, motion[1], 0.0)

    def test_a_robot_of_one_joint_takes_samples_as_they_come(self, chains):
        from hil.results.samples import samples

        q, qd = samples(1, q=np.arange(5.0), qd=0.0)
        assert q.shape == qd.shape == (5, 1)


class TestIntervals:
    def test_those_of_parameters_widen_with_the_level(self, uncertain):
        widths = [np.diff(uncertain.interval(level))[:, 0] for level in (0.5, 0.95, 0.99)]
        assert (widths[0] < widths[1]).all()
        assert (widths[1] < widths[2]).all()
        with pytest.raises(InvalidArray, match="95 must be between 0 and 1"):
            uncertain.interval(95)

    def test_that_of_a_torque_of_one_parameter_is_the_parameter_s(self, uncertain):
        k = 13
        rows = np.eye(14)[k]
        degrees = combined_degrees(
            rows, np.diag(uncertain.scatter_covariance), uncertain.degrees_of_freedom
        )
        assert degrees == pytest.approx(uncertain.degrees_of_freedom[k])

    def test_that_of_a_torque_holds_it_and_has_its_variance(self, uncertain, manutec, motion):
        parts = ["rigid bodies"]
        tau = uncertain.predict(*motion, parts=parts)
        interval = uncertain.torque_interval(*motion, level=0.9, parts=parts)
        assert interval.mean(axis=-1) == pytest.approx(tau)
        A = dynamics.regressor(manutec, *motion)
        error = np.sqrt(np.einsum("...k,kl,...l->...", A, uncertain.covariance, A))
        half = np.diff(interval)[..., 0] / 2
        assert (half >= stats.norm.ppf(0.95) * error * (1 - 1e-9)).all()
        assert (half <= stats.t.ppf(0.95, uncertain.degrees_of_freedom.min()) * error + 1e-9).all()

    def test_friction_and_the_scatter_of_samples_widen_them(self, uncertain, motion):
        def width(**what):
            return np.diff(uncertain.torque_interval(*motion, **what))[..., 0]

        assert (width(parts=PARTS[:2]) < width()).all()
        assert (width() < width(of_samples=True)).all()
        samples = width(of_samples=True) / 2 / stats.norm.ppf(0.975)
        assert (samples > uncertain.residual).all()

    def test_degrees_of_freedom_are_found_from_an_interval(self):
        wide = half_width(np.array(4.0), np.array(0.0), np.array(3.7), 0.95)
        assert degrees_behind(float(wide) / 2.0) == pytest.approx(3.7)


class TestFile:
    def test_a_file_of_an_earlier_version_has_the_same_model(self, run, model, tmp_path):
        """The old file lacks the robot, degrees of freedom and
        the drives' part of the covariance.
        """
        model.save(tmp_path / NAME)
        kept = yaml.safe_load((tmp_path / NAME).read_text())
        for key in ("robot_file", "degrees_of_freedom", "drive_covariance"):
            del kept[key]
        del kept["friction_law"]
        (run.path / NAME).write_text(yaml.safe_dump(kept))
        old = Model.load(run.path)
        assert not old.friction_law.known
        assert np.array_equal(old.values, model.values)
        assert old.interval() == pytest.approx(model.interval(), rel=1e-9)
        assert old.interval(0.8) == pytest.approx(model.interval(0.8), rel=1e-6)
        assert old.robot == model.robot

    def test_it_stands_alone(self, uncertain, tmp_path, motion):
        uncertain.save(tmp_path / "elsewhere.yaml")
        kept = Model.load(tmp_path / "elsewhere.yaml")
        assert np.array_equal(kept.predict(*motion), uncertain.predict(*motion))
        assert kept.torque_interval(*motion) == pytest.approx(uncertain.torque_interval(*motion))
        assert "robot_file: |" in (tmp_path / "elsewhere.yaml").read_text()

    def test_a_file_without_any_robot_is_refused(self, model, tmp_path):
        model.save(tmp_path / NAME)
        kept = yaml.safe_load((tmp_path / NAME).read_text())
        del kept["robot_file"]
        (tmp_path / NAME).write_text(yaml.safe_dump(kept))
        with pytest.raises(FileError, match=r"robot\.yaml: cannot be read"):
            Model.load(tmp_path)

    def test_parameters_of_another_robot_are_refused(self, model, tmp_path):
        model.save(tmp_path / NAME)
        text = (tmp_path / NAME).read_text().replace("torque_limit: 75", "torque_limit: 76")
        (tmp_path / NAME).write_text(text)
        with pytest.raises(FileError, match="not those of the robot that it holds"):
            Model.load(tmp_path)

    def test_a_covariance_of_another_size_is_refused(self, model, tmp_path):
        model.save(tmp_path / NAME)
        kept = yaml.safe_load((tmp_path / NAME).read_text())
        kept["covariance"][3].pop()
        (tmp_path / NAME).write_text(yaml.safe_dump(kept))
        with pytest.raises(FileError, match="covariance must have 14 rows of 14 values"):
            Model.load(tmp_path)


class TestView:
    def test_its_repr_is_one_line(self, model):
        assert len(repr(model)) < 100
        assert "\n" not in repr(model)

    def test_summary_and_html_have_every_parameter_and_residual(self, model):
        text, html = str(model.summary()), model._repr_html_()
        for name, expression in zip(model.names, model.expressions, strict=True):
            assert f" {name} " in f" {text} "
            assert f">{symbols(name)}</th>" in html
            assert expression[:12] in text
        assert html.count("<table") == html.count("</table>") == 4

    def test_what_was_left_out_is_remarked_without_markup(self, model):
        origin = model.provenance.model_copy(update={"left_out": ("g02: <no> [red]sample",)})
        summary = replace(model, provenance=origin).summary()
        assert "left out: g02: <no> [red]sample" in str(summary)
        assert "&lt;no&gt; [red]sample" in summary._repr_html_()


def test_an_unknown_method_lists_all(run):
    listed = r"'best' must be one of: improved; published; .*free motion;.* -m benchmarks.rivals"
    with pytest.raises(UnknownName, match=listed):
        identify(run, "best")


@pytest.fixture(scope="module")
def driven(manutec, tmp_path_factory):
    """Return a run of one trajectory."""
    return write_trajectory_run(tmp_path_factory.mktemp("trajectory") / "run", manutec)


class TestTrajectories:
    def test_an_unknown_method_is_wrong_usage_and_lists_all(self, driven, capsys):
        with pytest.raises(SystemExit) as ended:
            cli.main(["identify", str(driven.path), "--method", "best"])
        assert ended.value.code == 2
        assert "published" in capsys.readouterr().err

    def test_the_printed_method_refuses_it_with_the_reason(self, driven):
        with pytest.raises(NotIdentifiable, match="0 usable gravity measurements"):
            identify(driven, "published")

    def test_the_improved_method_takes_it_period_by_period(self, driven):
        found = identify(driven)
        assert found.provenance.measurements == driven.plan.measurements[0].cycles
        assert np.isfinite(found.standard_errors).all()
