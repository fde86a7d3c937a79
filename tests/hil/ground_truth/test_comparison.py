"""True parameters of a plant file, compared with an estimate; on the virtual plant only."""

import re
import shutil
from dataclasses import replace
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest
from small_run import identified_model, state_hardware, write_run
from synthetic import TABLE_3_A

from checked_files.yaml_file import FileError
from hil.errors import Mismatch, NotIdentifiable, UnknownName
from hil.estimation.identify import estimate
from hil.ground_truth.comparison import Comparison, truth_comparison
from hil.ground_truth.true_parameters import refuse_other_plant, true_parameters
from hil.model.base_parameters import base_parameters
from hil.results.prediction import free_motion
from hil.runs.pooling import recorded
from hil.runs.run import Run

PLANT = "manutec-r15"
L1, L2, MASS, DISTANCE, I_RADIAL, I_AXIAL = 0.5, 0.73, 10.86, 0.14, 0.0259, 0.047


def plant_text():
    folder = find_spec("sim_plant").submodule_search_locations[0]
    return (Path(folder) / "plants" / f"{PLANT}.yaml").read_text()


def plant_file(tmp_path, old="", new=""):
    """Return the packaged plant's file with a change."""
    assert old in plant_text()
    path = tmp_path / "plant.yaml"
    path.write_text(plant_text().replace(old, new, 1))
    return path


@pytest.fixture(scope="module")
def run(manutec, tmp_path_factory):
    return write_run(tmp_path_factory.mktemp("compare") / "run", manutec).path


@pytest.fixture(scope="module")
def found(run):
    opened = Run.open(run)
    return estimate(opened.robot, recorded(opened))


class TestTruth:
    def test_the_packaged_plant_carries_table_3_a(self, manutec):
        assert true_parameters(manutec, PLANT) == pytest.approx(TABLE_3_A)

    def test_a_path_says_the_same_as_the_name(self, manutec, tmp_path):
        assert np.array_equal(
            true_parameters(manutec, plant_file(tmp_path)), true_parameters(manutec, PLANT)
        )

    def test_a_payload_changes_the_parameters_as_eq_22_says(self, manutec, tmp_path):
        load = (
            f"drift: true\npayload: {{mass: {MASS}, centre: [0, 0, {DISTANCE}],"
            f" Ixx: {I_RADIAL}, Iyy: {I_RADIAL}, Izz: {I_AXIAL}}}"
        )
        loaded = true_parameters(manutec, plant_file(tmp_path, "drift: true", load))
        about_wrist = I_RADIAL + MASS * DISTANCE**2
        far, near = MASS * L1**2, MASS * L2**2
        expected = [far, -far, 0, far, MASS * L1, near, near, -MASS * L2, 0, 0,
                    about_wrist, about_wrist, -MASS * DISTANCE, I_AXIAL]  # fmt: skip
        assert loaded - TABLE_3_A == pytest.approx(expected)

    def test_a_link_that_the_robot_file_calls_absent_is_refused_by_name(self, manutec, tmp_path):
        plant = plant_file(tmp_path, "{Ixx: 0.0, Izz: 0.0443}", "{sx: 0.3, Izz: 0.0443}")
        with pytest.raises(FileError, match="lacks parameters of the plant: sx4; add them and"):
            true_parameters(manutec, plant)

    def test_parameters_that_show_in_no_torque_do_not_matter(self, manutec, tmp_path):
        plant = plant_file(tmp_path, "{Izz: 32.015}", "{Izz: 32.015, m: 100, sz: 7}")
        assert true_parameters(manutec, plant) == pytest.approx(TABLE_3_A)

    def test_other_frames_are_refused(self, manutec, tmp_path):
        plant = plant_file(tmp_path, "d: 0.5", "d: 0.6")
        with pytest.raises(FileError, match=r"axes.2.frame: .* 0, 0.6, 0, 0 must be 0, 0.5, 0, 0"):
            true_parameters(manutec, plant)

    @pytest.mark.parametrize(
        ("old", "new", "words"),
        [
            ("frame: {}", "frame: {theta_deg: 90}", r":14: axes.0.frame: .* 0, 0, 1.571, 0 must"),
            ("drift: true", "gravity: [0, 9.81, 0]", ":10: gravity: 0, 9.81, 0 m/s2 must be 0, 0,"),
            ("gear_ratio: 105", "gear_ratio: 106", "axes.0.drive.gear_ratio: 106 must be 105, as"),
        ],
    )
    def test_whatever_makes_another_machine_is_refused_with_its_line(
        self, manutec, tmp_path, old, new, words
    ):
        plant = plant_file(tmp_path, old, new)
        with pytest.raises(FileError, match=words):
            true_parameters(manutec, plant)

    def test_a_joint_that_slides_instead_of_turning_is_refused(self, manutec, tmp_path):
        plant = plant_file(tmp_path, "name: joint 1", "name: joint 1\n    joint: prismatic")
        with pytest.raises(FileError, match=r"axes.0.joint: prismatic must be revolute"):
            true_parameters(manutec, plant)

    def test_all_that_differs_is_stated_at_once(self, manutec, tmp_path):
        path = plant_file(tmp_path, "gear_ratio: 105", "gear_ratio: 106")
        path.write_text(path.read_text().replace("alpha_deg: 90, r: 0.73", "r: 0.73"))
        with pytest.raises(FileError) as caught:
            true_parameters(manutec, path)
        assert len(str(caught.value).splitlines()) == 2

    def test_another_number_of_axes_is_refused(self, manutec, tmp_path):
        path = tmp_path / "plant.yaml"
        path.write_text(plant_text()[: plant_text().index("  - name: joint 6")])
        with pytest.raises(FileError, match="5 axes must be 6, as manutec-r15 has"):
            true_parameters(manutec, path)

    def test_an_unknown_plant_is_refused(self, manutec):
        with pytest.raises(
            UnknownName, match=r"puma: neither a plant file .*; available: manutec-r15"
        ):
            true_parameters(manutec, "puma")

    def test_a_mistyped_plant_brings_the_one_that_is_near(self, manutec):
        with pytest.raises(UnknownName, match=r"manutec-r14: .*; did you mean manutec-r15\?"):
            true_parameters(manutec, "manutec-r14")


class TestComparison:
    def test_a_perfect_estimate_has_no_error(self, manutec, found):
        result = Comparison(replace(found, values=TABLE_3_A), TABLE_3_A)
        assert set(result.group_error.values()) == {0.0}
        assert result.mean_torque_error == 0.0
        assert result.inside.all()

    def test_groups_are_judged_by_their_norm(self, manutec, found):
        p = TABLE_3_A.copy()
        gravity = list(base_parameters(manutec).groups["gravity"])
        p[gravity] *= 1.01
        result = Comparison(replace(found, values=p), TABLE_3_A)
        assert result.group_error["gravity"] == pytest.approx(0.01)
        assert result.group_error["diagonal"] == 0.0

    def test_torque_errors_are_relative_and_linear(self, manutec, found):
        result = Comparison(replace(found, values=1.02 * TABLE_3_A), TABLE_3_A)
        assert result.torque == pytest.approx(np.full(6, 0.02))

    def test_z_and_intervals_judge_each_parameter(self, manutec, found):
        p = TABLE_3_A.copy()
        p[0] += 30 * found.standard_errors[0]
        result = Comparison(replace(found, values=p), TABLE_3_A)
        assert result.z[0] == pytest.approx(30)
        assert result.inside.tolist() == [False] + [True] * 13

    def test_the_truth_behind_a_run_is_found(self, manutec, found):
        result = Comparison(found, TABLE_3_A)
        assert max(result.group_error.values()) < 0.01
        assert result.inside.sum() >= 11


class TestCommand:
    def test_it_prints_every_parameter_and_what_it_took(self, run, manutec):
        result = truth_comparison(Run.open(run), PLANT)
        text = str(result.summary())
        for name in base_parameters(manutec).names:
            assert re.search(rf"^ ?{name} ", text, re.MULTILINE)
        assert f"{100 * result.group_error['gravity']:.3f} %" in text
        assert f"hold the truth for {result.inside.sum()} of 14 parameters" in text
        assert "39 measurements in " in text

    def test_a_run_on_hardware_is_refused_with_the_reason(self, run, tmp_path):
        shutil.copytree(run, tmp_path / "run")
        journal = tmp_path / "run" / "run.json"
        state_hardware(journal, "socketcan can0")
        with pytest.raises(Mismatch, match=r"measured on socketcan can0; only on the virtual"):
            truth_comparison(Run.open(tmp_path / "run"), PLANT)

    def test_a_run_of_another_plant_than_its_journal_names_is_refused(self, run, tmp_path):
        other = plant_file(tmp_path, "sx: 48.491", "sx: 50.0")
        with pytest.raises(Mismatch, match=r"on the plant manutec-r15, .*--truth manutec-r15"):
            truth_comparison(Run.open(run), other)

    def test_a_copy_of_the_plant_file_is_the_same_plant(self, run, tmp_path):
        refuse_other_plant(Run.open(run), plant_file(tmp_path))

    def test_a_model_of_two_runs_is_not_judged_by_one(self, run, tmp_path, manutec):
        shutil.copytree(run, tmp_path / "run")
        model = identified_model()
        of_two = model.provenance.model_copy(update={"together_with": ("second",)})
        replace(model, provenance=of_two).save(tmp_path / "run" / "model.yaml")
        with pytest.raises(Mismatch, match=r"identified from 2 runs, .* --with second"):
            truth_comparison(Run.open(tmp_path / "run"), PLANT)

    def test_a_model_that_was_cut_off_is_refused(self, run, tmp_path):
        shutil.copytree(run, tmp_path / "run")
        (tmp_path / "run" / "model.yaml").write_text("provenance:\n")
        with pytest.raises(FileError, match="write the file anew with: hil identify"):
            truth_comparison(Run.open(tmp_path / "run"), PLANT)

    def test_a_run_that_cannot_be_identified_is_refused(self, run, tmp_path):
        shutil.copytree(run, tmp_path / "run")
        for path in (tmp_path / "run" / "recordings").glob("g*.h5"):
            path.unlink()
        with pytest.raises(NotIdentifiable, match="0 usable gravity measurements"):
            truth_comparison(Run.open(tmp_path / "run"), PLANT)


class TestFreeMotion:
    def test_it_keeps_the_limits_and_uses_one_of_each_joint(self, manutec):
        q, qd, qdd = free_motion(manutec)
        middle, reach = (manutec.q_max + manutec.q_min) / 2, (manutec.q_max - manutec.q_min) / 2
        used = np.array([
            np.abs(q - middle).max(axis=0) / reach,
            np.abs(qd).max(axis=0) / manutec.velocity_limit,
            np.abs(qdd).max(axis=0) / manutec.acceleration_limit,
        ])  # fmt: skip
        assert used.max(axis=0) == pytest.approx(np.full(6, 0.9))

    def test_velocity_and_acceleration_are_those_of_the_position(self, manutec):
        q, qd, qdd = free_motion(manutec)
        dt = 10.0 / len(q)
        for rate, value in ((qd, q), (qdd, qd)):
            slope = (np.roll(value, -1, axis=0) - np.roll(value, 1, axis=0)) / (2 * dt)
            assert slope == pytest.approx(rate, abs=1e-3 * np.abs(rate).max())

    def test_the_seed_decides(self, manutec):
        assert np.array_equal(free_motion(manutec, 3)[0], free_motion(manutec, 3)[0])
        assert not np.array_equal(free_motion(manutec, 3)[0], free_motion(manutec, 4)[0])
