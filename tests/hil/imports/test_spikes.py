"""Outlying samples are refused if they dominate, and reported otherwise."""

import numpy as np
import pytest
from small_recording import a_map, table, write_csv, write_map

from checked_files.yaml_file import FileError
from hil.imports.importing import import_recordings

COLUMNS = table(20.0, rate=100.0)
AT = [211, 702, 1100, 1555, 1801]


def add_spikes(column, value, at=AT):
    """Return the recording with some samples of a column replaced, or increased if relative."""
    changed = COLUMNS[column].copy()
    changed[at] = value
    return COLUMNS | {column: changed}


def statement(folder, columns, **changes):
    write_csv(folder / "data.csv", columns)
    stated = []
    the_map = write_map(folder, a_map(velocity=True, **changes))
    import_recordings([the_map], folder / "run", stated.append)
    return stated[0]


@pytest.mark.parametrize(("column", "key", "value"), [
    ("q1", "position", 1e9), ("q1", "position", 2 * np.pi * 1e4), ("q2", "position", -2.6),
    ("m2", "torque", -3e3), ("v1", "velocity", 1e3),
])  # fmt: skip
def test_five_samples_of_no_joint_are_refused(tmp_path, column, key, value):
    with pytest.raises(FileError) as refused:
        statement(tmp_path, add_spikes(column, value))
    (message,) = str(refused.value).splitlines()
    assert f"joints.{int(column[1]) - 1}.{key}: 5 samples differ from neighbouring" in message
    assert "in row 212 of its file" in message
    assert "remove these rows, or choose others" in message


def test_spikes_of_three_samples_are_spikes_too(tmp_path):
    at = [k + j for k in AT for j in range(3)]
    with pytest.raises(FileError, match="15 samples differ"):
        statement(tmp_path, add_spikes("m1", 5e3, at))


def test_short_pulses_of_torque_are_no_spikes(tmp_path):
    # as of axis 4 of a KUKA KR300 at 250 Hz, which rings for some ten samples when it reverses
    pulse = [0, -66, -200, -463, -693, -663, -65, 538, 866, 714, 410, 138, -30]
    m1 = COLUMNS["m1"].copy()
    for at in AT:
        m1[at : at + len(pulse)] += pulse
    found = statement(tmp_path, COLUMNS | {"m1": m1}, accept=["range", "shape"]).suspicions
    assert not [each for each in found if each.check == "spikes"]


def test_a_few_small_ones_are_stated_and_do_no_harm(tmp_path):
    (suspicion,) = statement(tmp_path, add_spikes("m1", 150.0, AT[:2])).suspicions
    assert suspicion.message.startswith("2 samples differ")
    assert not suspicion.certain


def test_spikes_that_the_map_accepts_are_stated(tmp_path):
    suspicions = statement(tmp_path, add_spikes("m2", -3e3), accept=["spikes", "range"]).suspicions
    assert "spikes" in [each.check for each in suspicions]


def test_steps_that_stay_and_noise_are_no_spikes(tmp_path):
    rng, n = np.random.default_rng(3), len(COLUMNS["t"])
    steps = 5.0 * (np.arange(n) // 37 % 2)
    noisy = {"m1": COLUMNS["m1"] + steps, "m2": COLUMNS["m2"] + 2 * rng.standard_normal(n)}
    assert statement(tmp_path, COLUMNS | noisy).suspicions == ()


def test_an_angle_that_hesitates_at_the_end_of_its_turn_has_no_spikes(tmp_path):
    end = COLUMNS["q1"][500]
    around = (COLUMNS["q1"] - end + 2 * np.pi) % (2 * np.pi)
    noise = 1e-4 * np.random.default_rng(4).standard_normal(len(around))
    columns = COLUMNS | {"q1": (around + noise) % (2 * np.pi)}
    content = a_map(velocity=True)
    content["joints"][0]["position"]["offset"] = float(end)
    found = statement(tmp_path, columns, joints=content["joints"])
    assert found.wraps > 3
    assert not [each for each in found.suspicions if each.check == "spikes"]


def test_what_an_encoder_at_rest_trembles_by_is_no_spike(tmp_path):
    still = np.zeros(len(COLUMNS["t"]))
    still[AT] = 2e-5
    columns = COLUMNS | {"q2": still, "v2": 0 * still}
    found = statement(tmp_path, columns, accept=["velocity", "shape", "friction"])
    assert not [each for each in found.suspicions if each.check == "spikes"]


@pytest.mark.parametrize("late", [False, True], ids=["even", "late"])
def test_a_jump_of_one_joint_is_named_with_its_row(tmp_path, late):
    n = len(COLUMNS["t"])
    columns = COLUMNS
    if late:
        columns = table(time=COLUMNS["t"] + np.random.default_rng(2).uniform(0, 0.004, n))
    jumped = columns | {"q2": columns["q2"] - 0.8 * (np.arange(n) >= 1200)}
    with pytest.raises(FileError) as refused:
        statement(tmp_path, jumped)
    (message,) = str(refused.value).splitlines()
    assert "joints.1.position: jumps by -0." in message
    assert "from row 1200 to 1201 of its file, by more than 10" in message
    assert "accept: [spikes]" in message


@pytest.mark.parametrize("gone", [0, 3])
def test_steps_of_coarse_held_or_missing_rows_are_no_jumps(tmp_path, gone):
    rows = np.arange(len(COLUMNS["t"]))
    kept = np.delete(rows, 500 + np.arange(gone))
    held = kept // 4 * 4
    columns = {name: x[kept] for name, x in COLUMNS.items()}
    columns |= {"q1": columns["q1"].round(1), "q2": COLUMNS["q2"][held]}
    found = statement(tmp_path, columns, accept=["velocity", "shape", "still"])
    assert not [each for each in found.suspicions if each.check == "spikes"]


def counted(x, bits, increment):
    """Return values in a register of whole counts, which overflows."""
    half = 2 ** (bits - 1)
    return ((np.round(x / increment) + half) % (2 * half) - half) * increment


@pytest.mark.parametrize(("bits", "increment"), [(16, 0.0008), (12, 0.0125)])
def test_a_torque_that_overflows_its_register_is_named(tmp_path, bits, increment):
    noisy = COLUMNS["m1"] + np.random.default_rng(1).standard_normal(len(COLUMNS["t"]))
    columns = COLUMNS | {"m1": counted(noisy, bits, increment)}
    found = statement(tmp_path, columns, accept=["shape"]).suspicions
    assert [s.check for s in found].count("spikes") == 1
    assert f"jumps by some {2**bits * increment:.6g} N m and goes on" in found[0].message
    assert found[0].first


@pytest.mark.parametrize("noise", [0.0, 0.03])
def test_a_torque_that_switches_between_limits_overflows_no_register(tmp_path, noise):
    n = len(COLUMNS["t"])
    switched = np.clip(40.0 * COLUMNS["m1"], -26.0, 26.0)
    switched += noise * np.random.default_rng(1).standard_normal(n)
    columns = COLUMNS | {"m1": counted(switched, 16, 0.0008)}
    found = statement(tmp_path, columns, accept=["shape", "still", "velocity"]).suspicions
    assert not [s for s in found if "overflows" in s.message]
