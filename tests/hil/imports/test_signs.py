"""Unsigned torques get their signs where mechanics allows one interpretation only."""

import numpy as np
import pytest
from small_recording import a_map, table, write_csv, write_map

from hil.imports.importing import import_recordings
from hil.imports.signs import signed


def magnitude(x, half):
    return np.where(x < 0, half - x, x)


def complement(x, half):
    return np.where(x < 0, 2 * half + x, x)


CODES = {"sign and magnitude": magnitude, "two's complement": complement}


@pytest.mark.parametrize("words", CODES)
@pytest.mark.parametrize(("half", "gain"), [(1024, 0.1), (32768, 0.01), (2**31, 1e-6)])
def test_coded_torques_become_those_of_the_joint_and_are_stated(tmp_path, words, half, gain):
    columns = table()
    right = np.round(columns["m2"] / gain)
    assert (np.diff(np.sign(right)) != 0).sum() > 5
    content = a_map()
    content["joints"][1]["torque"] |= {"unit": "per mille", "gain": gain, "sign": -1}
    write_csv(tmp_path / "data.csv", columns | {"m2": CODES[words](-right, half)})
    found = []
    run = import_recordings([write_map(tmp_path, content)], tmp_path / "run", found.append)
    np.testing.assert_allclose(run["map-01"].recording.tau[:, 1], gain * right, atol=1e-9)
    np.testing.assert_allclose(run["map-01"].recording.tau[:, 0], columns["m1"], atol=1e-9)
    said = f"torques of joint 2 are read as {words}: values from {half} on are negative"
    assert said in "\n".join(found[0].lines())


@pytest.mark.parametrize("words", CODES)
def test_noise_and_friction_about_zero_hide_no_code(words):
    rng, t = np.random.default_rng(5), np.arange(4000) / 100
    noise, friction = 30 * rng.standard_normal(4000), 200 * np.sign(np.cos(3 * t))
    right = np.round(400 * np.sin(3 * t) + friction + noise)
    coded = CODES[words](right, 1024)
    coded[7] = np.nan
    values, said = signed(coded)
    assert said.startswith(words)
    np.testing.assert_array_equal(np.delete(values, 7), np.delete(right, 7))


@pytest.mark.parametrize("right", [
    np.round(600 + 500 * np.sin(np.arange(3000) / 40)),  # positive signal that crosses 512 and 1024
    np.round(np.abs(700 * np.sin(np.arange(3000) / 40))),  # absolute values, whose signs are lost
    np.round(700 * np.sin(np.arange(3000) / 40)),
    np.random.default_rng(1).integers(0, 2000, 3000).astype(float),
    np.where(np.arange(3000) % 500 < 250, 0.0, 1500.0),
    0.5 + np.round(900 + 800 * np.sin(np.arange(3000) / 40)),
])  # fmt: skip
def test_other_numbers_stay_as_they_are(right):
    assert signed(right) is None
