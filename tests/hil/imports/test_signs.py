"""Unsigned torques get their signs where mechanics allows one interpretation only."""

import numpy as np
import pytest
from small_recording import a_map, table, write_csv, write_map

from hil.imports.importing import import_recordings
from hil.imports.signs import coding_of, turn_of


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
    coding = coding_of(coded)
    assert coding.name == words
    np.testing.assert_array_equal(np.delete(coding.decode(coded), 7), np.delete(right, 7))


@pytest.mark.parametrize("right", [
    np.round(600 + 500 * np.sin(np.arange(3000) / 40)),  # positive signal that crosses 512 and 1024
    np.round(np.abs(700 * np.sin(np.arange(3000) / 40))),  # absolute values, whose signs are lost
    np.round(700 * np.sin(np.arange(3000) / 40)),
    np.random.default_rng(1).integers(0, 2000, 3000).astype(float),
    np.where(np.arange(3000) % 500 < 250, 0.0, 1500.0),
    0.5 + np.round(900 + 800 * np.sin(np.arange(3000) / 40)),
])  # fmt: skip
def test_other_numbers_stay_as_they_are(right):
    assert coding_of(right) is None


def wrapped(angle, turn, counts):
    """Return the counts of an encoder of one turn."""
    return np.round(angle / turn * counts) % counts


def turns_of_motors(columns):
    """Return angles of the motors of `small_recording.ROBOT`, faster than its joints."""
    return [50 * columns["q1"], 20 * columns["q2"]]


@pytest.mark.parametrize("side", ["motor", "joint"])
@pytest.mark.parametrize("counts", [16384, 20000, 360])
def test_an_encoder_of_one_turn_on_the_motor_is_unwrapped(tmp_path, side, counts):
    columns = table(rate=1000.0)
    motors = turns_of_motors(columns)
    raw = [wrapped(angle, 2 * np.pi, counts) for angle in motors]
    write_csv(tmp_path / "data.csv", columns | {"q1": raw[0], "q2": raw[1]})
    content = a_map(position_side=side)
    for joint, gear in zip(content["joints"], (50, 20), strict=True):
        size = 2 * np.pi / counts / (1 if side == "motor" else gear)
        joint["position"] |= {"unit": "counts", "per_unit": float(size)}
    found = []
    run = import_recordings([write_map(tmp_path, content)], tmp_path / "run", found.append)
    q = run["map-01"].recording.q
    for joint, (gear, name) in enumerate(zip((50, 20), ("q1", "q2"), strict=True)):
        # the first turn is unknown
        turns = (q[:, joint] - columns[name]) * gear / (2 * np.pi)
        np.testing.assert_allclose(turns, round(turns[0]), atol=0.51 / counts)
        said = f"positions of joint {joint + 1} are unwrapped by {counts} of their unit"
        assert said in "\n".join(found[0].lines())
    assert not found[0].doubts


def test_noise_of_a_joint_at_rest_is_no_register_that_overflows(tmp_path):
    columns, rng = table(rate=1000.0), np.random.default_rng(3)
    noise = rng.standard_normal(len(columns["q2"])).clip(-3.5, 3.5)
    columns["q2"] = 0.5 + (1e-5 * noise).round(6)
    write_csv(tmp_path / "data.csv", columns)
    found = []
    content = a_map(accept=["still"])
    import_recordings([write_map(tmp_path, content)], tmp_path / "run", found.append)
    assert "unwrapped" not in "\n".join(found[0].lines())


TIME = np.arange(3000) / 100


@pytest.mark.parametrize("other", [
    np.round(2000 * np.sin(TIME)),  # no jump
    np.where(np.arange(3000) % 400 == 9, 0.0, 4095.0 + 0 * TIME),  # outliers
    np.where(np.arange(3000) % 500 < 250, 0.0, 4095.0),  # steps between two positions at rest
    np.concatenate([4095 * (1 - np.cos(np.pi * np.arange(300) / 300)) / 2] * 10),  # repeated motion
    np.concatenate([3000 + 500 * np.sin(TIME[:700] * k) for k in range(1, 6)]),  # other recordings
    np.where(TIME % 5 < 2.5, 40.0, 0.0) * TIME % 300,  # jumps by less than a turn of the encoder
    np.full(3000, np.nan),
    np.zeros(3000),
])  # fmt: skip
def test_positions_that_pass_no_end_of_a_turn_stay_as_they_are(other):
    assert turn_of(other, [4096.0, 8192.0]) is None


def test_flicker_and_outliers_hide_no_turn_of_an_encoder():
    coded = wrapped(40 * np.sin(TIME), 2 * np.pi, 4096)
    coded[300:320:2], coded[301:320:2], coded[1500] = 0.0, 4095.0, np.nan
    assert turn_of(coded, [4096.0]) == 4096.0


@pytest.mark.parametrize("words", CODES)
@pytest.mark.parametrize("half", [1024, 32768])
def test_a_torque_that_never_changes_sign_is_read_as_those_of_other_joints(tmp_path, words, half):
    """Gravity holds an axis to one side: no jump shows that its torques are negative."""
    columns = table()
    right = [-np.round(columns["m1"] / 0.2) - 300, np.round(columns["m2"] / 0.2)]
    assert right[0].max() < 0
    coded = [CODES[words](x, half) for x in right]
    content = a_map()
    for joint in content["joints"]:
        joint["torque"] |= {"unit": "A", "gain": 0.2}
    content["joints"][0]["torque"]["sign"] = -1
    found = []
    write_csv(tmp_path / "data.csv", columns | {"m1": coded[0], "m2": coded[1]})
    run = import_recordings([write_map(tmp_path, content)], tmp_path / "run", found.append)
    signs = np.array([-0.2, 0.2])
    np.testing.assert_allclose(run["map-01"].recording.tau, signs * np.stack(right, axis=1))
    said = f"torques of joint 1 are read as {words}: values from {half} on are negative: as of"
    assert said in "\n".join(found[0].lines())


@pytest.mark.parametrize("words", CODES)
@pytest.mark.parametrize("half", [32768, 2**31])
def test_positions_and_velocities_without_signs_get_theirs(tmp_path, words, half):
    columns, size = table(), 0.0015
    names = [f"{key}{joint}" for joint in (1, 2) for key in "qv"]
    right = {name: np.round(columns[name] / size) for name in names}
    content = a_map(velocity=True)
    for joint in content["joints"]:
        joint["position"] |= {"unit": "counts", "per_unit": size, "offset": 0.1, "sign": -1}
        joint["velocity"] |= {"unit": "counts/s", "per_unit": size, "sign": -1}
    coded = {name: CODES[words](-x, half) for name, x in right.items()}
    write_csv(tmp_path / "data.csv", columns | coded)
    found = []
    run = import_recordings([write_map(tmp_path, content)], tmp_path / "run", found.append)
    q = run["map-01"].recording.q
    np.testing.assert_allclose(q, 0.1 + size * np.stack([right["q1"], right["q2"]], axis=1))
    for kind in ("positions", "velocities"):
        for joint in (1, 2):
            assert f"{kind} of joint {joint} are read as {words}" in "\n".join(found[0].lines())


@pytest.mark.parametrize("counts", [1024, 4096])
def test_an_encoder_of_one_turn_lacks_no_sign(counts):
    assert coding_of(wrapped(40 * np.sin(TIME), 2 * np.pi, counts), jumps=False) is None


@pytest.mark.parametrize("half", [2048, 32768])
@pytest.mark.parametrize("n_turns", [1, 16])
def test_the_position_of_another_joint_is_negative_in_a_register_of_several_turns_alone(
    tmp_path, half, n_turns
):
    """Joint 1 passes the zero of its encoder, joint 2 stays at 0.7 of its greatest count."""
    columns, size = table(), n_turns * 2 * np.pi / (2 * half)
    first = complement(np.round(columns["q1"] / size), half)
    middle = 0.7 * n_turns * 2 * np.pi
    second = np.round((columns["q2"] / 2 + middle) / size)
    content = a_map()
    for joint in content["joints"]:
        joint["position"] |= {"unit": "counts", "per_unit": size}
    content["joints"][1]["position"]["offset"] = -middle
    write_csv(tmp_path / "data.csv", columns | {"q1": first, "q2": second})
    content["accept"] = ["range", "shape", "velocity"]
    run = import_recordings([write_map(tmp_path, content)], tmp_path / "run")
    q = run["map-01"].recording.q
    np.testing.assert_allclose(q[:, 0], columns["q1"], atol=size)
    # a register of several turns holds negative values
    less = 0.0 if n_turns == 1 else n_turns * 2 * np.pi
    np.testing.assert_allclose(q[:, 1], columns["q2"] / 2 - less, atol=size)
