"""A torque hidden by a dead band or a low resolution is named as such, not as a wrong column."""

import numpy as np
import pytest
from small_recording import ROBOT, a_map, table, write_csv, write_map

import hil
from hil.imports.importing import import_recordings


def verdict(folder, hide, *, accept=("shape", "still", "range")):
    """Return the verdict on a recording with the torque of joint 2 changed by `hide`."""
    columns = table(40.0)
    columns["m2"] = hide(columns["m2"])
    write_csv(folder / "data.csv", columns)
    the_map = write_map(folder, a_map(accept=list(accept)))
    (folder / "pair.yaml").write_text(ROBOT)
    return str(hil.identify(import_recordings([the_map], folder / "run")).verdict)


def dead_band(torque):
    """Return noise in 12 % of the samples, and zero elsewhere."""
    rng = np.random.default_rng(2)
    return 0.05 * rng.standard_normal(len(torque)) * (rng.random(len(torque)) < 0.12)


def test_a_dead_band_is_the_reason_given(tmp_path):
    found = verdict(tmp_path, dead_band)
    assert "axis 2: the model leaves" in found
    assert "88% of its torques in fast motion are equal: a dead band" in found
    assert "check columns" not in found


def test_noise_in_place_of_a_torque_remains_a_matter_of_columns(tmp_path):
    found = verdict(tmp_path, lambda x: np.random.default_rng(2).standard_normal(len(x)))
    assert "check columns, signs and units" in found
    assert "dead band" not in found


def test_a_column_that_the_import_warned_of_is_the_reason(tmp_path):
    def hold_noise(torque):
        every = np.random.default_rng(2).standard_normal(len(torque) // 10 + 1)
        return np.repeat(every, 10)[: len(torque)]

    found = verdict(tmp_path, hold_noise, accept=("shape", "range"))
    assert "axis 2: the model leaves" in found
    assert "import warned" in found.partition("\n")[0]
    assert "joints.1.torque: repeats the value of the previous row" in found
    assert "check columns, signs and units" not in found


@pytest.mark.parametrize("step", [0.5, 2.0])
def test_a_coarse_torque_that_shows_the_motion_is_not_doubted_for_it(tmp_path, step):
    assert "dead band" not in verdict(tmp_path, lambda x: step * np.round(x / step))
