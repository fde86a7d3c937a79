"""Interpretation of the names of columns: kind of signal, unit, numbers."""

from __future__ import annotations

import re

from hil.imports.tables import SPELLINGS

_LAST_UNIT = re.compile(
    r"[\[(]\s*([^\])\d\s][^\])]*?)\s*[\])]\s*$|_(rad|deg|mm|m|nm|a|v|rpm)$", re.I
)
_IN_BRACKETS = re.compile(r"[\[(]([^\[\]()]*)[\])]")
_SUFFIX = re.compile(r"[ _.](deg|rad|rpm|nm|mm|sec|ms|us|ns|(?<=time.)s)$", re.I)
"""Units at the end of a name; without `a` and `m`, which may also be a phase and a motor."""
_WORDS = {
    "position": {"position", "positions", "pos", "q", "qpos", "theta", "angle", "x", "winkel"},
    "velocity": {
        *("velocity", "velocities", "vel", "velo", "qd", "dq", "qdot", "dtheta", "speed", "omega"),
        *("v", "qvel", "geschwindigkeit", "drehzahl"),
    },
    "torque": {
        *("torque", "torques", "tau", "effort", "eff", "current", "currents", "curr", "cur"),
        *("force", "i", "iq", "u", "f", "tq", "voltage", "moment", "drehmoment", "strom", "qfrc"),
    },
}
"""Words in the names of columns, by kind."""
_STATE = {"1": "position", "2": "velocity"}
"""Kinds by the last number of a state in three dimensions, as of simulators."""
OTHER = "other"
"""Kind of columns that are not measurements of a joint."""
_JOINTS = {"joint", "axis", "motor", "j"}
_TIMES = {"t", "time", "times", "timestamp", "timestamps", "stamp", "secs", "seconds", "ipoc"}
_TIMES |= {"tout", "duration", "zeit", "zeitstempel"}
_TIME_AXES = {"x_value", "ts"}
"""Names of a time axis, in small letters: in measurement files of LabVIEW, and short for stamps."""
SECOND_WORDS = {"sec", "secs", "second", "seconds", "s"}
NANOSECOND_WORDS = {"nanosec", "nanosecs", "nanosecond", "nanoseconds", "nsec", "nsecs", "ns"}
_SET_POINTS = {"ref", "reference", "des", "desired", "cmd", "command", "target", "set", "goal"}
_SET_POINTS |= {"ctrl", "action", "actions", "setpoint", "setpoints", "sp", "soll", "input", "d"}
_PARTS_OF_TORQUE = {"applied", "bias", "constraint", "gravcomp", "inverse", "passive"}
"""Parts of the torque of a joint in MuJoCo, `qfrc_bias`, beside that of its actuator."""
COMPUTED = {"computed", "calculated", "calc", "estimated", "est", "modelled", "predicted", "ideal"}
"""Words for values of a model, taken where no measured value has the same number."""
_FILLERS = {"actual", "measured", "meas", "act", "ist"}


def words_of(name: str) -> list[str]:
    """Split a name into lower-case words and numbers; a capital begins a word."""
    name = re.sub("(?i)nano_?s", "Nanos", name)
    return [word.lower() for word in re.findall(r"[A-Z]+(?![a-z])|[A-Z]?[a-z]+|\d+", name)]


def is_time(name: str) -> bool:
    """Return True for a name of time stamps."""
    return name.lower() in _TIME_AXES or bool(_TIMES.intersection(words_of(name)))


def meaning_of(name: str, *, rises: bool) -> tuple[str, list[str]]:
    """Return the kind of a column (empty if unknown) and the remaining words of its name."""
    unit, rest = unit_in(name)
    words = words_of(rest)
    if "state" in words and words[-1] in _STATE and words[-2].isdigit():
        return _STATE[words[-1]], words[:-1]
    kind, word = _kind(rest, unit, rises=rises)
    kind = OTHER if (_SET_POINTS | _TIMES).intersection(words) else kind
    if word == "qfrc" and _PARTS_OF_TORQUE.intersection(words):
        kind = ""
    return kind, [each for each in words if each not in {word, *_FILLERS}]


def _kind(rest: str, unit: str, *, rises: bool) -> tuple[str, str]:
    """Return the kind of a column by a word of the name, the unit, or a plain joint name."""
    words = words_of(rest)
    for part in (words_of(rest.rpartition(".")[2]), words):  # of nested names the last part
        for key, known in _WORDS.items():
            for word in part:
                if word in known:
                    return key, word
    if unit:
        return next((key for key in _WORDS if _plain(unit) in SPELLINGS[key]), ""), ""
    if "state" in words:  # of observations in data sets for learning
        return "position", "state"
    alone = bool(words) and all(word.isdigit() or word in _JOINTS for word in words)
    return ("position" if alone and not rises else ""), ""


def unit_in(name: str) -> tuple[str, str]:
    """Return the unit in a name as spelled, if possible a known unit, and the remaining name."""
    known = {spelling for spellings in SPELLINGS.values() for spelling in spellings}
    brackets = (each for each in _IN_BRACKETS.finditer(name) if _plain(each[1]) in known)
    found = next(brackets, None) or _LAST_UNIT.search(name)
    if found is None:
        return "", name
    unit = next(group for group in found.groups() if group is not None)
    return unit.strip(), name[: found.start()] + name[found.end() :]


def stated_unit(key: str, name: str) -> str:
    """Return the map's spelling of the unit in a column's name; empty without a known unit."""
    stated = map(_plain, [*_IN_BRACKETS.findall(name), *_SUFFIX.findall(name)])
    return next((SPELLINGS[key][unit] for unit in stated if unit in SPELLINGS[key]), "")


def _plain(unit: str) -> str:
    return unit.lower().replace(" ", "")
