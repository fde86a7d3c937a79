"""Exports of controllers, drives and their libraries, in their own formats."""

import csv
import io
import json

import numpy as np
import pytest
import yaml
from small_recording import table, write_map

from hil.imports.draft import draft_map
from hil.imports.importing import import_recordings

COLUMNS = table(4.0)
T = COLUMNS["t"]
PARTS = ("q1", "q2", "v1", "v2", "m1", "m2")
Q1, Q2, V1, V2, M1, M2 = (COLUMNS[name] for name in PARTS)
ROWS = list(zip(T.tolist(), *(COLUMNS[name].tolist() for name in PARTS), strict=True))


def delimited(names, columns, delimiter=",", decimal=".", before="", units=None, quoted=False):
    """Return rows of numbers below a header, as in a table."""
    out = io.StringIO()
    writer = csv.writer(out, delimiter=delimiter, lineterminator="\r\n",
                        quoting=csv.QUOTE_ALL if quoted else csv.QUOTE_MINIMAL)  # fmt: skip
    writer.writerow(names)
    if units:
        writer.writerow(units)
    for row in zip(*columns, strict=True):
        writer.writerow([str(float(x)).replace(".", decimal) for x in row])
    return before + out.getvalue()


def twincat():
    head = "Name\tCell\r\nFile\tcell.csv\r\nStarttime of export\t133000000000000000\r\n\r\n\r\n"
    names = ["Axis1.ActPos", "Axis2.ActPos", "Axis1.ActVelo", "Axis2.ActVelo", "Axis1.ActTorque",
             "Axis2.ActTorque"]  # fmt: skip
    settings = [("SymbolComment", ""), ("Data-Type", "REAL64"), ("SampleTime[ms]", "5"),
                ("SymbolName", "Main.x"), ("Port", "501"), ("Offset", "0"), ("Unit", "deg (Angle)"),
                ("Unit Offset", "0")]  # fmt: skip
    settings = [(key, [value] * len(names)) for key, value in settings]
    settings[-2] = ("Unit", ["deg (Angle)"] * 2 + ["deg/s (Speed)"] * 2 + ["%", ""])
    pairs = "".join("\t".join(f"{key}\t{value}" for value in values) + "\r\n"
                    for key, values in settings)  # fmt: skip
    columns = [x for name in PARTS for x in (T * 1e3, COLUMNS[name])]
    body = delimited([c for n in names for c in ("Name", n)], columns, "\t", ",")
    header, rows = body.split("\r\n", 1)
    return f"{head}{header}\r\n{pairs}\r\n{rows}EOF\r\n"


def codesys():
    names = ["Axis1.fActPosition", "Axis2.fActPosition", "Axis1.fActVelocity", "Axis2.fActVelocity",
             "Axis1.fActTorque", "Axis2.fActTorque"]  # fmt: skip
    text = "[key]; [value]\nVersion; 0x03050000\nName; Application.Trace\nEveryNCycles; 1\n"
    for k, (name, part) in enumerate(zip(names, PARTS, strict=True)):
        text += f"{k}.Variable; {name}\n{k}.Class; 14\n{k}.Data; \n"
        text += "".join(
            f"; {t:.0f}; {x!r}\n" for t, x in zip(T * 1e6, COLUMNS[part].tolist(), strict=True)
        )
    return text


def siemens():
    """Return a trace: settings, names, units below them, semicolons, decimal commas, quotation
    marks.
    """
    before = '"Trace";"Axes"\r\n"Date";"31.01.2026 12:00:00"\r\n"Cycle";"0,005";"s"\r\n\r\n'
    names = ["Timestamp", "Axis_1.ActualPosition", "Axis_2.ActualPosition", "Axis_1.ActualVelocity",
             "Axis_2.ActualVelocity", "Axis_1.ActualTorque", "Axis_2.ActualTorque"]  # fmt: skip
    units = ["ms", "°", "°", "°/s", "°/s", "Nm", "Nm"]
    return delimited(names, [T * 1e3, Q1, Q2, V1, V2, M1, M2], ";", ",", before, units, quoted=True)


def sinumerik():
    names = ("actPos_1", "actPos_2", "actVelo_1", "actVelo_2", "torque_1", "torque_2")
    signals = "".join(f'<dataSignal id="f{k}" name="{n}"/>' for k, n in enumerate(names, 1))
    rows = "".join(
        f"<rec time='{t!r}' {' '.join(f'f{k}={str(x)!r}' for k, x in enumerate(row, 1))}/>"
        for t, *row in ROWS
    )
    return f"<trace><traceData><dataFrame>{signals}{rows}</dataFrame></traceData></trace>"


def kuka_rsi():
    values = zip(*(np.degrees(x).tolist() for x in (Q1, Q2)), M1.tolist(), M2.tolist(), strict=True)
    return "".join(
        f'<Rob Type="KUKA"><RIst X="445.0" Y="0.0" Z="790.0" A="180.0" B="0.0" C="180.0"/>'
        f'<AIPos A1="{a!r}" A2="{b!r}"/><ASPos A1="{a!r}" A2="{b!r}"/>'
        f'<MACur A1="{c!r}" A2="{d!r}"/><Delay D="0"/><IPOC>{5 * k}</IPOC></Rob>\n'
        for k, (a, b, c, d) in enumerate(values)
    )


def kuka_csv():
    names = ["Timestamp", "Receive.RIst.X", *(f"Receive.AIPos.A{j}" for j in (1, 2)),
             *(f"Receive.MACur.A{j}" for j in (1, 2)), "Send.RKorr.X"]  # fmt: skip
    return delimited(names, [T, 0 * T, np.degrees(Q1), np.degrees(Q2), M1, M2, 0 * T])


def ur_rtde(delimiter):
    kinds = ("target_q", "actual_q", "target_qd", "actual_qd", "target_current", "actual_current")
    names = ["timestamp", *(f"{kind}_{j}" for kind in kinds for j in (0, 1)), "robot_mode"]
    columns = [T, Q1, Q2, Q1, Q2, V1, V2, V1, V2, M1, M2, M1, M2, 0 * T + 7]
    return delimited(names, columns, delimiter)


def odrive():
    names = ["time", *(f"odrv0.axis{j}.{part}" for part in
             ("encoder.pos_estimate", "controller.pos_setpoint", "encoder.vel_estimate",
              "motor.current_control.Iq_measured", "motor.current_control.Iq_setpoint")
             for j in (0, 1))]  # fmt: skip
    return delimited(names, [T, Q1, Q2, Q1, Q2, V1, V2, M1, M2, M1, M2])


def odrive_columns():
    names = ["time", *(f"ODrive{j}{part}" for part in ("Position", "Velocity", "Current")
                       for j in (0, 1))]  # fmt: skip
    return delimited(names, [T, Q1, Q2, V1, V2, M1, M2])


def moteus():
    lines = [
        {"timestamp": t, "servos": [{"id": k + 1, "position": row[k], "velocity": row[2 + k],
                                     "torque": row[4 + k]} for k in (0, 1)]}
        for t, *row in ROWS
    ]  # fmt: skip
    return "\n".join(map(json.dumps, lines))


def moteus_csv():
    names = ["t", *(f"servo{j}.servo_stats.{part}" for part in ("position", "velocity", "torque_Nm")
                    for j in (1, 2)), "servo1.servo_stats.fault"]  # fmt: skip
    return delimited(names, [T, Q1, Q2, V1, V2, M1, M2, 0 * T])


def libfranka():
    parts = ("q", "q_d", "dq", "dq_d", "tau_J", "tau_J_d", "dtau_J")
    names = ["time", "success rate", *(f"state.{part}[{j}]" for part in parts for j in (0, 1)),
             *(f"cmd.q_d[{j}]" for j in (0, 1))]  # fmt: skip
    columns = [Q1, Q2, Q1, Q2, V1, V2, V1, V2, M1, M2, M1, M2, 0 * T, 0 * T, Q1, Q2]
    return delimited(names, [T * 1e3, 0 * T + 1, *columns])


FILES = {
    "twincat.csv": twincat, "codesys.csv": codesys, "siemens.csv": siemens,
    "sinumerik.xml": sinumerik, "rsi.xml": kuka_rsi, "rsi.csv": kuka_csv,
    "rtde.csv": lambda: ur_rtde(" "), "ur_rtde.csv": lambda: ur_rtde(","),
    "odrive.csv": odrive, "odrive_columns.csv": odrive_columns,
    "moteus.jsonl": moteus, "moteus.csv": moteus_csv, "libfranka.csv": libfranka,
}  # fmt: skip
UNITS = {
    "twincat.csv": [["deg", "deg/s", "%"], ["deg", "deg/s", None]],
    "siemens.csv": [["deg", "deg/s", "N m"]] * 2,
}
"""Units in the file, by name and joint; the twincat file has a torque in percent."""


class _Marks(yaml.SafeLoader):
    """Loader that drops marks."""


_Marks.add_constructor("!state", lambda *_: None)


@pytest.mark.parametrize("name", FILES)
def test_exports_are_drafted_and_a_draft_that_is_filled_in_imports(tmp_path, name):
    if name.endswith("jsonl"):
        pytest.importorskip("pyarrow")
    (tmp_path / name).write_text(FILES[name]())
    content = yaml.load(draft_map(tmp_path / name, name), _Marks)  # noqa: S506 - a safe loader
    times = {"twincat": "ms", "codesys": "us", "siemens": "ms", "rsi.xml": "ms", "libfranka": "ms"}
    unit = next((unit for begin, unit in times.items() if name.startswith(begin)), "s")
    assert len(content["joints"]) == 2
    if name in UNITS:
        units = [[part["unit"] for part in joint.values()] for joint in content["joints"]]
        assert units == UNITS[name]
    for joint in content["joints"]:
        joint["position"]["unit"] = "deg" if name.startswith("rsi") else "rad"
        if "velocity" in joint:
            joint["velocity"]["unit"] = "rad/s"
        joint["torque"] |= {"unit": "N m", "gain": 1}
    content = {**content, "robot": "pair.yaml", "time": content["time"] | {"unit": unit},
               "torque_side": "joint", "position_side": "joint", "kind": "free"}  # fmt: skip
    run = import_recordings([write_map(tmp_path, content)], tmp_path / "run")
    recording = run["map-01"].recording
    np.testing.assert_allclose(recording.q, np.stack([Q1, Q2], axis=1), atol=1e-9)
    np.testing.assert_allclose(recording.tau, np.stack([M1, M2], axis=1), atol=1e-9)
    if not name.startswith("rsi"):
        np.testing.assert_allclose(recording.qd, np.stack([V1, V2], axis=1), atol=1e-9)
