"""Drafted maps: known values are filled in, unknown ones are marked and refused."""

import numpy as np
import pytest
import yaml
from small_recording import ROBOT, a_map, table, write_csv, write_map

from checked_files.yaml_file import FileError
from hil.imports.draft import draft_map
from hil.imports.importing import import_recordings
from hil.imports.map_file import MappedRobot, load_map
from hil.model.robot import Robot


class _Marks(yaml.SafeLoader):
    """Loader that keeps marks as text."""


_Marks.add_constructor("!state", lambda loader, node: f"? {loader.construct_scalar(node)}")


def drafted(path):
    return yaml.load(draft_map(path, path.name), _Marks)  # noqa: S506 - a safe loader


@pytest.mark.parametrize(
    "names",
    [
        ("time", "q1", "q2", "qd1", "qd2", "tau1", "tau2"),
        ("timestamp", "actual_q_0", "actual_q_1", "actual_qd_0", "actual_qd_1",
         "actual_current_0", "actual_current_1"),
        ("t [s]", "joint1/pos", "joint2/pos", "joint1/vel", "joint2/vel",
         "joint1/effort", "joint2/effort"),
        ("stamp", "position.shoulder", "position.elbow", "velocity.shoulder", "velocity.elbow",
         "torque.shoulder", "torque.elbow"),
        ("time", "qpos/1", "qpos/2", "qvel/1", "qvel/2", "qfrc_actuator/1", "qfrc_actuator/2"),
        ("t", "axis0.pos_vel_mapper.pos_rel", "axis1.pos_vel_mapper.pos_rel",
         "axis0.pos_vel_mapper.vel", "axis1.pos_vel_mapper.vel",
         "axis0.motor.foc.Iq_measured", "axis1.motor.foc.Iq_measured"),
    ],
)  # fmt: skip
def test_columns_are_matched_to_joints_by_their_names(tmp_path, names):
    columns = dict(zip(names, table().values(), strict=True))
    columns["target_q_0"] = columns[names[1]]
    for other in ("qfrc_bias", "qfrc_passive", "qfrc_applied", "ctrl"):  # of MuJoCo
        columns |= {f"{other}/{joint}": columns[names[4 + joint]] for joint in (1, 2)}
    write_csv(tmp_path / "a.csv", columns)
    found = drafted(tmp_path / "a.csv")
    assert found["time"]["column"] == names[0]
    assert [[part["column"] for part in joint.values()] for joint in found["joints"]] == [
        [names[1], names[3], names[5]], [names[2], names[4], names[6]],
    ]  # fmt: skip


@pytest.mark.parametrize("names", ["m1 m2", "M1 M2", "Ia_1 Ia_2", "Last1 Last2", "load[1] load[2]"])
def test_the_only_other_columns_with_the_joints_numbers_are_drafted_as_torques(tmp_path, names):
    columns = dict(
        zip(["t", "q1", "q2", "v1", "v2", *names.split()], table().values(), strict=True)
    )
    write_csv(tmp_path / "a.csv", columns | {"mode": 0 * columns["t"]})
    found = drafted(tmp_path / "a.csv")
    assert [joint["torque"]["column"] for joint in found["joints"]] == names.split()
    assert "guessed: numbered like" in found["joints"][0]["torque"]["unit"]


def test_columns_of_no_joint_are_left_out_with_the_reason(tmp_path):
    names = ["t", "q1", "q2", "a1", "a2", "b1", "b2"]
    columns = dict(zip(names, table().values(), strict=True))
    write_csv(tmp_path / "a.csv", columns | {"q_ref1": columns["q1"], "qd7": columns["a1"]})
    text = draft_map(tmp_path / "a.csv", "a.csv")
    for line in ("a1, a2, b1, b2: meaning of the name unknown; if measured", "q_ref1: set point or",
                 "qd7: velocity by the name, without a position of equal number"):  # fmt: skip
        assert f"#   {line}" in text


def test_units_that_names_state_are_filled_in_and_guesses_are_marks(tmp_path):
    columns = table()
    write_csv(tmp_path / "a.csv", {
        "Time (ms)": columns["t"] * 1e3, "Angle [Grad] (Axis1)": np.degrees(columns["q1"]),
        "Current [A] (Axis1)": columns["m1"], "q2": 1e4 * columns["q2"], "tau2_a": columns["m2"],
        "Position [cnt] (Axis3)": 1e4 * columns["q2"], "Torque [N·m] (Axis3)": columns["m1"],
    })  # fmt: skip
    found = drafted(tmp_path / "a.csv")
    first, last, second = found["joints"]
    assert found["time"]["unit"] == "ms"
    assert [first["position"]["unit"], first["torque"]["unit"]] == ["deg", "A"]
    assert first["torque"]["column"] == "Current [A] (Axis1)"
    assert first["torque"]["gain"].startswith("? N m, or N, for one unit")
    assert "looks like counts or mm" in last["position"]["unit"]
    assert "its name says a" in last["torque"]["unit"]
    assert second["position"]["unit"] == "counts"
    assert second["position"]["per_unit"] == "? rad (m) for one count"
    assert second["torque"] == {"column": "Torque [N·m] (Axis3)", "unit": "N m"}


def test_units_at_the_end_of_a_name_are_filled_in(tmp_path):
    columns = table()
    write_csv(tmp_path / "a.csv", {
        "time_s": columns["t"], "pan_deg": np.degrees(columns["q1"]), "pan_rpm": columns["v1"],
        "pan_Nm": columns["m1"],
    })  # fmt: skip
    found = drafted(tmp_path / "a.csv")
    units = [part["unit"] for part in found["joints"][0].values()]
    assert [found["time"]["unit"], *units] == ["s", "deg", "rpm", "N m"]


@pytest.mark.parametrize(
    ("form", "unit"),
    [
        (lambda t: f"2024-05-01 12:00:{t:09.6f}", "ns"),
        (lambda t: f"{1714564800 + t:.3f}", "s"),
        (lambda t: f"{1714564800000 + round(1e3 * t)}", "ms"),
        (lambda t: f"{t:.3f}", "? s if 200 Hz"),
        (lambda t: f"{1714564800 + int(t)}", "? s, ms, us or ns; most stamps repeat: "
                                             "add the column of their fractions"),
    ],
)  # fmt: skip
def test_stamps_since_1970_have_a_unit_and_others_a_mark(tmp_path, form, unit):
    columns = table(4.0)
    rows = zip(map(form, columns["t"]), columns["q1"].tolist(), columns["m1"].tolist(), strict=True)
    text = "".join(f"{t},{q!r},{tau!r}\n" for t, q, tau in rows)
    (tmp_path / "a.csv").write_text("stamp,q,tau\n" + text)
    assert drafted(tmp_path / "a.csv")["time"]["unit"] == unit


@pytest.mark.parametrize("begin", [0.0, 1.77e9])
def test_stamps_are_found_by_short_names_and_by_dates(tmp_path, begin):
    columns = table()
    name = "recorded" if begin else "ts"
    write_csv(tmp_path / "data.csv", {name: columns.pop("t") + begin, **columns})
    assert drafted(tmp_path / "data.csv")["time"]["column"] == name


def test_per_cent_is_a_unit_of_torque_with_a_gain(tmp_path):
    columns = table()
    write_csv(
        tmp_path / "data.csv",
        {n.replace("m", "torque") + "[%]" * (n[0] == "m"): x for n, x in columns.items()},
    )
    the_map = drafted(tmp_path / "data.csv")
    assert [each["torque"]["unit"] for each in the_map["joints"]] == ["%", "%"]
    for number, joint in enumerate(the_map["joints"], start=1):
        joint["torque"]["column"] = f"torque{number}"  # names of columns may omit the unit
        joint["torque"]["gain"], joint["position"]["unit"] = 0.5, "rad"
        joint.pop("velocity", None)
    content = a_map(joints=the_map["joints"])
    run = import_recordings([write_map(tmp_path, content)], tmp_path / "run")
    assert run["map-01"].recording.tau[0, 0] == pytest.approx(columns["m1"][0] / 2)


def test_rows_with_text_and_without_names_are_rows(tmp_path):
    """As printed by ros2 topic echo --csv: seconds, nanoseconds, frame, names, values."""
    columns = table(4.0)
    rows = zip(*(columns[name].tolist() for name in ("t", "q1", "q2", "m1", "m2")), strict=True)
    text = "".join(
        f"{1714564800 + int(t)},{round(t % 1 * 1e9)},,j1,j2,{q1!r},{q2!r},{m1!r},{m2!r}\n"
        for t, q1, q2, m1, m2 in rows
    )
    (tmp_path / "echo.csv").write_text(text)
    found = drafted(tmp_path / "echo.csv")
    plus = {"column": 2, "unit": "ns"}
    assert found["time"] == {"column": 1, "unit": "s", "plus": plus}
    assert "# Columns and what they hold:\n#   1: " in draft_map(tmp_path / "echo.csv", "echo.csv")
    joints = [
        {"position": {"column": 6 + j, "unit": "rad"}, "torque": {"column": 8 + j, "unit": "N m"}}
        for j in (0, 1)
    ]
    stated = {"robot": "pair.yaml", "files": ["echo.csv"], "time": found["time"], "joints": joints}
    run = import_recordings([write_map(tmp_path, stated)], tmp_path / "run")
    np.testing.assert_array_equal(run["map-01"].recording.tau[:, 1], columns["m2"])


def test_a_draft_is_refused_until_it_is_filled_in(tmp_path):
    write_csv(tmp_path / "a.csv", table())
    (tmp_path / "draft.yaml").write_text(draft_map(tmp_path / "a.csv", "a.csv"))
    with pytest.raises(FileError, match=r"draft.yaml:\d+: robot: must be stated: a robot file"):
        load_map(tmp_path / "draft.yaml")


def test_a_draft_that_is_filled_in_is_a_map(tmp_path):
    names = ("t", "q1", "q2", "qd1", "qd2", "tau1", "tau2")
    write_csv(tmp_path / "a.csv", dict(zip(names, table().values(), strict=True)))
    text = draft_map(tmp_path / "a.csv", "a.csv")
    for mark, value in (
        ("!state a robot file, a URDF, or the name of a robot", "pair.yaml"),
        ("!state s if 200 Hz", "s"),
        ("!state rad, deg, m", "rad # "),
        ("!state rad/s", "rad/s # "),
        ("!state N m, N, A", "N m # "),
    ):
        assert mark in text
        text = text.replace(mark, value)
    run = import_recordings([write_map(tmp_path, text)], tmp_path / "run")
    np.testing.assert_array_equal(run["map-01"].recording.tau[:, 1], table()["m2"])


def test_measured_torques_are_taken_before_computed_ones(tmp_path):
    columns, parts = table(), ("computed", "measured")
    named = {f"state/joint_q/{k}": columns[f"q{k}"] for k in (1, 2)}
    named |= {f"state/joint_torques_{p}/{k}" if p == "computed" else f"motor_torques_{p}/{k}":
              columns[f"m{k}"] for p in parts for k in (1, 2)}  # fmt: skip
    write_csv(tmp_path / "a.csv", {"t": columns["t"], **named})
    joints = drafted(tmp_path / "a.csv")["joints"]
    assert [j["torque"]["column"] for j in joints] == [
        f"motor_torques_measured/{k}" for k in (1, 2)
    ]
    assert "state/joint_torques_computed/2: torque by the name" in draft_map(tmp_path / "a.csv", "")


def test_a_rising_column_with_a_unit_of_time_is_time(tmp_path):
    columns = table()
    renamed = {"nr": np.arange(len(columns["t"])), "Messpunkt [us]": 1e6 * columns["t"]}
    write_csv(tmp_path / "a.csv", {**renamed, "q1": columns["q1"], "m1": columns["m1"]})
    assert drafted(tmp_path / "a.csv")["time"] == {"column": "Messpunkt [us]", "unit": "us"}


def test_states_in_three_dimensions_are_positions_and_velocities_of_joints(tmp_path):
    columns = table()
    state = np.stack([[columns[f"q{k}"], columns[f"v{k}"]] for k in (1, 2)], axis=0)
    forces = np.stack([columns["m1"], columns["m2"]], axis=1)
    np.savez(
        tmp_path / "a.npz", t=columns["t"], dof_state=state.transpose(2, 0, 1), dof_force=forces
    )
    joints = drafted(tmp_path / "a.npz")["joints"]
    columns_of = [{key: part["column"] for key, part in joint.items()} for joint in joints]
    assert columns_of == [
        {"position": f"dof_state/{k}/1", "velocity": f"dof_state/{k}/2", "torque": f"dof_force/{k}"}
        for k in (1, 2)
    ]


def test_a_file_without_names_or_stamps(tmp_path):
    columns = [table()[name] for name in ("q1", "m1")]
    np.savetxt(tmp_path / "a.csv", np.stack(columns, axis=1), delimiter=",")
    found = drafted(tmp_path / "a.csv")
    assert found["time"] == {"rate": "? samples per second [Hz]"}
    assert len(found["joints"]) == 1
    text = draft_map(tmp_path / "a.csv", "a.csv")
    assert "#   columns 1, 2: the file has no names of columns; write the numbers of" in text
    np.savetxt(tmp_path / "b.csv", np.random.default_rng(1).normal(size=(90, 9)), delimiter=",")
    assert "#   columns 1 to 9: the file has no" in draft_map(tmp_path / "b.csv", "b.csv")


@pytest.mark.parametrize("torques", [6, 3])
def test_numbers_of_torques_that_no_names_of_joints_have_are_no_joints(tmp_path, torques):
    names = ["wheel", "shoulder", "elbow", "wrist_1", "wrist_2", "wrist_3"]
    t = np.arange(400) / 100
    columns = {"t": t, **{f"position/{name}": np.sin(k + t) for k, name in enumerate(names)}}
    columns |= {f"effort/{k + 1}": np.cos(k + t) for k in range(torques)}
    write_csv(tmp_path / "a.csv", columns)
    joints = drafted(tmp_path / "a.csv")["joints"]
    assert len(joints) == 6 if torques == 6 else 3
    paired = [joint["torque"]["column"] for joint in joints]
    if torques == 6:
        assert not any(each.startswith("effort") for each in paired)
    else:
        assert paired == ["effort/1", "effort/2", "effort/3"]


@pytest.mark.parametrize("name", ["q: [a: b]", 'q # "1"', "q\x01é [grad # : x]", "- !x", "@q {"])
def test_whatever_columns_are_called_the_draft_is_yaml(tmp_path, name):
    np.savez(tmp_path / "a.npz", **{"t": np.arange(9.0), name: np.ones(9)})
    found = drafted(tmp_path / "a.npz")
    assert found["time"]["column"] == "t"


def test_text_in_a_column_is_no_column_of_numbers(tmp_path):
    (tmp_path / "a.csv").write_text("t,mode,q\n" + "".join(f"{k},run,{k}\n" for k in range(50)))
    text = draft_map(tmp_path / "a.csv", "a.csv")
    assert "#   3 q: 0 to 49, rising" in text
    assert "# Left out:\n#   mode: 'run' in column 2 (mode), row 1, is not a number\n" in text
    assert text.count("mode") == 2


def test_columns_without_a_number_are_left_out_by_name(tmp_path):
    columns = table(2.0)
    write_csv(tmp_path / "a.csv", {**columns, "m2": np.full(len(columns["t"]), np.nan)})
    text = draft_map(tmp_path / "a.csv", "a.csv")
    assert "#   m2: no number in any of its first 401 rows" in text


def test_episodes_whose_stamps_begin_anew_are_segments(tmp_path):
    columns = {name: np.tile(x, 3) for name, x in table(2.0).items()}
    write_csv(tmp_path / "a.csv", {"episode": np.repeat(np.arange(3.0), 401), **columns})
    found = drafted(tmp_path / "a.csv")
    assert found["time"] == {"column": "t", "unit": "? s if 200 Hz"}
    assert found["rows"] == [[1, 401], [402, 802], [803, 1203]]


def test_list_columns_of_a_data_set_for_learning_are_joints(tmp_path):
    pa, parquet = pytest.importorskip("pyarrow"), pytest.importorskip("pyarrow.parquet")
    q = pa.array([[k * 0.1, -k * 0.2] for k in range(300)], pa.list_(pa.float32(), 2))
    columns = {"observation.state": q, "observation.effort": q, "action": q, "task": ["lift"] * 300}
    parquet.write_table(pa.table({**columns, "timestamp": np.arange(300) / 30}), tmp_path / "a.pq")
    found = drafted(tmp_path / "a.pq")
    assert [[part["column"] for part in joint.values()] for joint in found["joints"]] == [
        [f"observation.state/{j}", f"observation.effort/{j}"] for j in (1, 2)
    ]
    text = draft_map(tmp_path / "a.pq", "a.pq")
    assert "#   task: a column of string, not of numbers" in text
    assert "action/2: " in text


@pytest.mark.parametrize(
    ("names", "position", "torque"),
    [
        (("pan_deg", "pan_A"), "pan_deg", "pan_A"),
        (("Joint_1", "Joint_1 [Nm]"), "Joint_1", "Joint_1 [Nm]"),
    ],
)
def test_units_and_bare_joints_say_what_columns_are(tmp_path, names, position, torque):
    q, tau = np.sin(np.arange(60.0)), np.cos(np.arange(60.0))
    np.savez(tmp_path / "a.npz", t=np.arange(60.0), **dict(zip(names, (q, tau), strict=True)))
    (joint,) = drafted(tmp_path / "a.npz")["joints"]
    assert joint["position"]["column"] == position
    assert joint["torque"]["column"] == torque


def drafted_for(path, robot):
    text = draft_map(path, path.name, robot, MappedRobot(name="arm.urdf"))
    return yaml.load(text, _Marks), text  # noqa: S506 - a safe loader


def test_a_robot_gives_the_order_of_the_joints_by_their_names(tmp_path):
    (tmp_path / "pair.yaml").write_text(
        ROBOT.replace("- {frame", "- {name: upper arm, frame", 1).replace(
            "- {frame", "- {name: forearm, frame", 1
        )
    )
    robot = Robot.load(tmp_path / "pair.yaml")
    assert robot.joint_names == ("upper arm", "forearm")
    names = ("t", "forearm_pos", "upper_arm_pos", "forearm_tau", "upper_arm_tau", "gripper_pos")
    write_csv(tmp_path / "a.csv", dict(zip(names, table().values(), strict=False)))
    found, text = drafted_for(tmp_path / "a.csv", robot)
    assert found["robot"] == "arm.urdf"
    assert [[part["column"] for part in joint.values()] for joint in found["joints"]] == [
        ["upper_arm_pos", "upper_arm_tau"], ["forearm_pos", "forearm_tau"],
    ]  # fmt: skip
    assert "  - position: # upper arm\n" in text
    assert "#   gripper_pos: position by the name, without a torque of equal number or" in text


def test_without_common_names_the_joints_of_a_robot_follow_the_file(tmp_path):
    (tmp_path / "pair.yaml").write_text(ROBOT)
    write_csv(tmp_path / "a.csv", {name: table()[name] for name in ("t", "q1", "m1")})
    found, _ = drafted_for(tmp_path / "a.csv", Robot.load(tmp_path / "pair.yaml"))
    first, second = found["joints"]
    assert (first["position"]["column"], first["torque"]["column"]) == ("q1", "m1")
    assert second["position"]["column"] == "? number or name of the column of its positions"


def test_days_of_matlab_are_a_unit_of_time(tmp_path):
    columns = table(3.0)
    columns["t"] = 739_900.0 + columns["t"] / 86400.0
    write_csv(tmp_path / "data.csv", columns)
    assert "unit: days # since 0: 200 Hz" in draft_map(tmp_path / "data.csv", "data.csv")
    the_map = write_map(tmp_path, a_map(time={"column": "t", "unit": "days"}))
    run = import_recordings([the_map], tmp_path / "run")
    np.testing.assert_allclose(np.diff(run["map-01"].recording.time), 0.005, atol=2e-5)


FILETIME, NET = 134_405_096_191_230_000, 639_000_000_000_000_000


@pytest.mark.parametrize(("begin", "year"), [(FILETIME, 1601), (NET, 1)])
def test_dates_in_100_ns_are_drafted_read_and_not_taken_for_another_unit(tmp_path, begin, year):
    columns = table(3.0)
    ticks = [begin + round(1e7 * t) for t in columns["t"]]
    rest = {name: columns[name] for name in ("q1", "q2", "m1", "m2")}
    write_csv(tmp_path / "data.csv", {"t": ticks} | rest)
    assert f"unit: 100 ns # since {year}: 200 Hz" in draft_map(tmp_path / "data.csv", "data.csv")
    right = a_map(time={"column": "t", "unit": "100 ns"})
    run = import_recordings([write_map(tmp_path, right)], tmp_path / "run")
    np.testing.assert_allclose(np.diff(run["map-01"].recording.time), 0.005, atol=1e-5)
    for unit in ("us", "ns"):
        wrong = a_map(time={"column": "t", "unit": unit})
        with pytest.raises(FileError, match=f"{unit} makes the first stamp .* write unit: 100 ns"):
            import_recordings([write_map(tmp_path, wrong)], tmp_path / unit)


@pytest.mark.parametrize("form", ["array", "structure with time"])
def test_signals_of_simulink_with_their_time_each_are_drafted(tmp_path, form):
    from scipy.io import savemat

    columns = table(2.0)
    t, names = columns["t"][:, None], ("q", "tau")
    own = {name: np.column_stack([columns[f"{name[0]}{k}"] for k in (1, 2)]) for name in ("q", "m")}
    values = dict(zip(names, own.values(), strict=True))
    if form == "array":
        saved = {name: np.hstack([t, x]) for name, x in values.items()}
    else:
        saved = {name: {"time": t, "signals": {"values": x}} for name, x in values.items()}
    savemat(tmp_path / "a.mat", saved)
    joints = [
        [joint[key]["column"] for key in ("position", "torque")]
        for joint in drafted(tmp_path / "a.mat")["joints"]
    ]
    first, end = (2, "") if form == "array" else (1, ".signals.values")
    assert joints == [[f"{name}{end}/{k}" for name in names] for k in (first, first + 1)]


FINGERS = """
  <joint name="finger{side}" type="prismatic">
    <parent link="hand"/><child link="finger{side}"/><axis xyz="0 1 0"/>
    <limit lower="0" upper="0.04" effort="20" velocity="0.2"/>{mimic}
  </joint>
  <link name="finger{side}"/>"""


def test_a_draft_ends_the_chain_before_fingers_without_columns(tmp_path):
    """The finger of the other side mimics the first, which a recording of the arm lacks."""
    robot = "".join(
        f'<link name="{link}"><inertial><mass value="2"/><inertia ixx="1" iyy="1" izz="1" ixy="0"'
        f' ixz="0" iyz="0"/></inertial></link><joint name="j{k}" type="revolute"><parent link='
        f'"{parent}"/><child link="{link}"/><axis xyz="0 1 0"/>'
        '<limit lower="-2" upper="2" effort="90" velocity="3"/></joint>'
        for k, (parent, link) in enumerate([("base", "arm"), ("arm", "hand")], start=1)
    )
    one = FINGERS.format(side=1, mimic="")
    two = FINGERS.format(side=2, mimic='<mimic joint="finger1"/>')
    (tmp_path / "a.urdf").write_text(
        f'<robot name="a"><link name="base"/>{robot}{one}{two}</robot>'
    )
    write_csv(tmp_path / "a.csv", table())
    robot = Robot.load(tmp_path / "a.urdf", tip="finger1")
    chain = MappedRobot(urdf="a.urdf", to="finger1")
    text = draft_map(tmp_path / "a.csv", "a.csv", robot, chain)
    assert 'robot: {urdf: "a.urdf", to: "hand"}' in text
    for mark, value in (("s if 200 Hz", "s"), ("rad, deg, m", "rad # "), ("rad/s", "rad/s # "),
                        ("N m, N, A", "N m # ")):  # fmt: skip
        text = text.replace(f"!state {mark}", value).replace(f'!state "{mark}', value)
    assert load_map(write_map(tmp_path, text)).content.robot.tip == "hand"
