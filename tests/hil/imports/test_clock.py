"""Recorded velocities serve as clocks: they reveal rates, instants and held rows."""

import re

import numpy as np
import pytest
from scipy.signal import lfilter
from small_recording import a_map, motion, table, write_csv, write_map

from checked_files.yaml_file import FileError
from hil.imports.importing import import_recordings

RATE = 200.0


def stated(folder, columns, **changes):
    write_csv(folder / "data.csv", columns)
    found = []
    import_recordings([write_map(folder, a_map(velocity=True, **changes))], folder / "run",
                      found.append)  # fmt: skip
    return found[0]


@pytest.mark.parametrize(("wrong", "seen"), [(208.0, "200"), (190.0, "200"), (210.0, "200")])
def test_a_rate_that_all_velocities_contradict_is_named(tmp_path, wrong, seen):
    (one,) = stated(tmp_path, table(20.0, rate=RATE), time={"rate": wrong}).suspicions
    assert one.location == ("time",)
    assert f"at {seen} Hz all of them fit; correct the rate" in one.message
    assert not one.certain


@pytest.mark.parametrize("delay", [0.0, 0.004, 0.01])
def test_filtered_velocities_contradict_no_rate(tmp_path, delay):
    columns = table(20.0, rate=RATE)
    share = 1.0 if not delay else 1.0 - np.exp(-1.0 / RATE / delay)
    for name in ("v1", "v2"):
        x = columns[name]
        for k in range(1, len(x)):
            x[k] = x[k - 1] + share * (x[k] - x[k - 1])
    assert stated(tmp_path, columns, time={"rate": RATE}).suspicions == ()


@pytest.mark.parametrize("lag", [0.002, 0.008])
@pytest.mark.parametrize("filtered", [True, False])
def test_late_velocities_of_joints_that_start_together_make_no_row_uneven(tmp_path, lag, filtered):
    """Joints in point-to-point motion accelerate together, so that a lag looks like time."""
    fine, rate = 20, 1000.0
    t = np.arange(int(20.0 * rate) * fine) / (rate * fine)
    # steps of 1 s between rests, the joints by different distances
    share = (t % 1.25 / 1.0).clip(max=1.0)
    way = share - np.sin(2 * np.pi * share) / (2 * np.pi)
    ends = np.random.default_rng(4).uniform(-1.2, 1.2, (int(t[-1] / 1.25) + 2, 2))
    at = (t // 1.25).astype(int)
    q = ends[at] + way[:, None] * (ends[at + 1] - ends[at])
    v = np.gradient(q, t, axis=0)
    if filtered:
        a = np.exp(-1.0 / (rate * fine * lag))
        v = lfilter([1.0 - a], [1.0, -a], v, axis=0)
    else:
        v = np.roll(v, round(lag * rate * fine), axis=0)
    columns = table(time=t[::fine])
    for name, x in zip(["q1", "q2", "v1", "v2"], [*q[::fine].T, *v[::fine].T], strict=True):
        columns[name] = x + 1e-6 * np.random.default_rng(5).standard_normal(len(x))
    found = stated(tmp_path, columns).suspicions
    assert [s.message for s in found if s.location == ("time",)] == []


def test_rows_that_are_uneven_by_all_velocities_are_named(tmp_path):
    steps = np.random.default_rng(3).choice([0.004, 0.008], 4000, p=[0.75, 0.25])
    columns = table(time=np.concatenate([[0.0], np.cumsum(steps)]))
    (one,) = stated(tmp_path, columns, time={"rate": 200}).suspicions
    assert "samples are not equidistant: by the recorded velocities of joints 1, 2" in one.message
    assert "record a time stamp with each row" in one.message


def test_remedies_for_stamps_are_not_those_for_a_rate(tmp_path):
    steps = np.random.default_rng(3).choice([0.004, 0.008], 4000, p=[0.75, 0.25])
    columns = table(time=np.concatenate([[0.0], np.cumsum(steps)]))
    columns["t"] = 0.005 * np.arange(4001)
    (one,) = stated(tmp_path, columns).suspicions
    assert re.search(r"periods reach from 3.9\d to 7.9\d ms, mean 5 ms; the stamps", one.message)
    assert "in place of the rate" not in one.message


def test_stamps_that_all_velocities_contradict_are_no_rate_of_the_map(tmp_path):
    columns = table(20.0, rate=RATE)
    (one,) = stated(tmp_path, columns | {"t": columns["t"] / 1.05}).suspicions
    assert one.message.startswith("samples are stamped at 210 Hz, but")
    assert "at 200 Hz all of them fit; correct the stamps" in one.message


def test_the_rate_of_held_rows_is_that_of_the_map(tmp_path):
    columns = table(20.0, rate=50.0)
    held = {name: np.repeat(x, 4) for name, x in columns.items()}
    (one,) = stated(tmp_path, held, time={"rate": 210.0}).suspicions
    assert "the map states 210 Hz, but" in one.message
    assert re.search(r"at (199\.\d+|200) Hz all of them fit", one.message)


@pytest.mark.parametrize("late", [1, 5])
def test_few_late_samples_do_not_make_all_of_them_uneven(tmp_path, late):
    columns = table(20.0, rate=RATE)
    at = np.arange(400, 3600, 400)[:late]
    for name in ("q1", "q2", "v1", "v2"):
        columns[name][at] = (columns[name][at] + 3 * columns[name][at - 1]) / 4
    assert stated(tmp_path, columns).suspicions == ()


def test_a_factor_that_all_velocities_have_in_common_makes_no_row_uneven(tmp_path):
    columns = table(20.0, rate=RATE)
    columns |= {name: 0.993 * columns[name] for name in ("v1", "v2")}
    assert stated(tmp_path, columns, time={"rate": RATE}).suspicions == ()


def test_noise_of_one_encoder_is_no_uneven_clock(tmp_path):
    columns = table(20.0, rate=RATE)
    columns["q1"] += 2e-3 * np.random.default_rng(1).standard_normal(len(columns["t"]))
    found = stated(tmp_path, columns, time={"rate": RATE}).suspicions
    assert not any(s.location == ("time",) for s in found)


@pytest.mark.parametrize("time", [{"rate": RATE}, {"column": "t"}])
def test_rows_that_were_recorded_twice_are_named_and_count_as_missing(tmp_path, time):
    columns = table(20.0, rate=RATE)
    twice = np.random.default_rng(2).random(len(columns["t"])) < 0.1
    twice[0] = False
    twice[1:] &= ~twice[:-1]
    for name, x in columns.items():
        if name != "t":
            x[twice] = x[np.flatnonzero(twice) - 1]
    found = stated(tmp_path, columns, time=time)
    counts, lines = found.timing.counts, "\n".join(found.lines())
    assert counts.repeating == twice.sum()
    assert f"{counts.repeating} rows repeat the row before in all columns, from row" in lines
    assert counts.gaps == 0
    assert found.suspicions == ()


def test_rows_that_hold_values_give_way_to_the_rate_at_which_these_change(tmp_path):
    columns = table(20.0, rate=50.0)
    held = {name: np.repeat(x, 4) for name, x in columns.items()}
    held["t"] = np.arange(len(held["t"])) / RATE
    found = stated(tmp_path, held)
    assert found.timing.period == pytest.approx(0.02)
    assert " over 4 rows;" in "\n".join(found.lines())


def test_a_robot_that_rests_repeats_no_rows(tmp_path):
    columns = table(20.0, rate=RATE)
    q, qd, tau = motion(columns["t"].clip(max=12.0))
    resting = columns["t"] > 12.0
    names = ["q1", "q2", "v1", "v2", "m1", "m2"]
    for name, x in zip(names, [*q.T, *np.where(resting[:, None], 0, qd).T, *tau.T], strict=True):
        columns[name] = x
    assert stated(tmp_path, columns, time={"rate": RATE}).timing.counts.repeating == 0


@pytest.mark.parametrize(
    ("name", "key"), [("m2", "torque"), ("q1", "position"), ("v1", "velocity")]
)
def test_a_column_that_is_held_is_named(tmp_path, name, key):
    columns = table(20.0, rate=RATE)
    columns[name] = np.repeat(columns[name][::4], 4)[: len(columns["t"])]
    found = [s for s in stated(tmp_path, columns).suspicions if "a held signal" in s.message]
    assert [s.location for s in found] == [("joints", int(name[1]) - 1, key)]
    assert re.search("(75|69) % of the rows", found[0].message)


def test_a_coarse_column_is_not_held(tmp_path):
    columns = table(20.0, rate=RATE)
    columns["m2"] = np.round(columns["m2"])
    columns["q1"] = 2e-3 * np.round(columns["q1"] / 2e-3)
    assert not any("are held" in s.message for s in stated(tmp_path, columns).suspicions)


def test_what_was_understood_is_explained_joint_by_joint(tmp_path):
    lines = stated(tmp_path, table(20.0, rate=RATE)).explanation
    assert lines[0].startswith("joint 1: position q1 [rad], velocity v1 [rad/s], torque m1 [N m]")
    for check in ("range", "still", "velocity", "time"):
        assert any(line.startswith(f"check {check}: ") for line in lines)


def test_a_counter_that_begins_anew_is_named_with_its_bits(tmp_path):
    columns = table(20.0, rate=RATE)
    columns["t"] = np.round((1e6 * columns["t"] + 2**32 - 8e6) % 2**32)
    words = r"row 1601: a counter of 32 bits in us overflowed, add 4294967296 from there on; choose"
    with pytest.raises(FileError, match=words):
        stated(tmp_path, columns, time={"column": "t", "unit": "us"})


def test_local_time_that_is_set_back_in_autumn_is_named(tmp_path):
    columns = table(20.0, rate=RATE)
    columns["t"] += 1.79e9 - 3600.0 * (columns["t"] >= 8.0)
    words = "row 1601: local time was set back by an hour, as in autumn; add 3600 s from there on"
    with pytest.raises(FileError, match=words):
        stated(tmp_path, columns)


def test_a_clock_of_the_day_that_passes_midnight_is_named(tmp_path):
    columns = table(20.0, rate=RATE)
    columns["t"] = (columns["t"] + 86392.0) % 86400.0
    words = "row 1601: the clock of the day passed midnight, add 24 h from there on; choose"
    with pytest.raises(FileError, match=words):
        stated(tmp_path, columns)


@pytest.mark.parametrize("unit", ["s", "ms"])
def test_midnight_in_times_as_text_is_named_with_the_unit_that_they_have(tmp_path, unit):
    columns = table(20.0, rate=RATE)
    write_csv(tmp_path / "data.csv", columns)
    stamps = np.datetime64("2026-01-31T23:59:52") + (1e3 * columns["t"]).astype("timedelta64[ms]")
    lines = (tmp_path / "data.csv").read_text().splitlines()
    rows = zip(lines[1:], stamps.astype(str), strict=True)
    text = [f"{stamp[11:]},{line.partition(',')[2]}" for line, stamp in rows]
    (tmp_path / "data.csv").write_text("\n".join([lines[0], *text]) + "\n")
    content = a_map(time={"column": "t", "unit": unit})
    words = (
        r"midnight \(of times as text, in ns: write unit: ns\), add 24 h .* segment there with rows"
    )
    with pytest.raises(FileError, match=words):
        import_recordings([write_map(tmp_path, content)], tmp_path / "run")
    content = a_map(time={"column": "t", "unit": "ns"}, rows=[[1, 1600], [1601, 4001]])
    run = import_recordings([write_map(tmp_path, content)], tmp_path / "run")
    assert [len(each.recording.time) for each in run] == [1600, 2401]


def test_velocities_in_rpm_of_the_motor_are_named_by_unit_and_side(tmp_path):
    columns = table(20.0, rate=RATE)
    columns["v1"] *= 50 * 30 / np.pi
    with pytest.raises(FileError, match="velocity is in rpm on the motor's side at a gear ratio"):
        stated(tmp_path, columns)


@pytest.mark.parametrize(("every", "omega"), [(40, [35.0, 20.0]), (60, [35.0, 14.0])])
def test_servos_that_follow_held_set_points_contradict_no_rate(tmp_path, every, omega):
    """Set-points of a policy, new every 40 or 60 ms, let the speed ripple between the samples."""
    t = np.arange(40_000) * 1e-3
    q, v = np.zeros((2, len(t), 2))
    wanted, omega = motion(t)[0], np.array(omega)
    for k in range(1, len(t)):
        held = wanted[(k - 1) // every * every]
        pull = 1e-3 * (omega**2 * (held - q[k - 1]) - 1.6 * omega * v[k - 1])
        v[k] = v[k - 1] + pull
        q[k] = q[k - 1] + 1e-3 * v[k]
    columns = table(time=t[::20])
    for name, x in zip(["q1", "q2", "v1", "v2"], [*q[::20].T, *v[::20].T], strict=True):
        columns[name] = x
    found = stated(tmp_path, columns, accept=["shape"]).suspicions
    assert [s.message for s in found if s.location == ("time",)] == []
