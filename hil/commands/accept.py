"""`hil accept`: results of a run against stated limits; page and JUnit XML.

A check is a value with limits. Values come from the model of the run (parameters, friction,
residual torque, verdict) and from its journal and recordings (missing measurements, flagged
samples, recordings with findings). A value that was not identified fails. Limits are a YAML file.
"""

from __future__ import annotations

import math
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal, Self, cast
from xml.etree import ElementTree as ET

import numpy as np
import yaml
from pydantic import Field, model_validator

from checked_files.yaml_file import FileModel, load_yaml
from hil.commands.torques import played
from hil.errors import Mismatch
from hil.model.base_parameters import base_parameters
from hil.results.judgement import WORDS, Judgement, Reservation, Word, failed, good
from hil.results.model import Model
from hil.results.quantities import Quantity, quantities, reading
from hil.runs.atomic_file import file_errors, write_file
from hil.runs.journal import SyncTiming
from hil.runs.run import opened
from hil.show.outcome import Outcome
from hil.show.rounding import signed, unit, when
from hil.show.table import Column, Marked, Table, figures, table

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from hil.results.quantities import Kind
    from hil.runs.run import Run

PAGE, JUNIT = "acceptance.html", "acceptance.xml"
NOT_KNOWN = "not stated"
Axis = Annotated[int, Field(ge=1)]
Count = Annotated[int, Field(ge=0)]
Amount = Annotated[float, Field(ge=0)]


class QuantityLimits(FileModel):
    """Limits of a base parameter, of friction at `axis` and `speed`, or of an offset at `axis`."""

    name: str
    unit: str
    axis: Axis | None = None
    speed: Annotated[float, Field(gt=0)] | None = None
    least: float
    most: float

    @model_validator(mode="after")
    def _ordered(self) -> Self:
        if self.least > self.most:
            raise ValueError(f"least {self.least:g} must not exceed most {self.most:g}")
        return self


class Limits(FileModel):
    """Content of a file of limits.

    Attributes
    ----------
    robot : str
        Name of the robot.
    drafted_from : str
        Run of the drafted limits, its intervals widened by `factor`; empty for stated limits.
    outcome : {"good", "doubtful", "failed"}
        Worst accepted verdict.
    missing, with_findings : int
        Largest number of measurements missing or left out, and of recordings with findings.
    flagged : float
        Largest share of flagged samples.
    residual : dict
        Largest residual torque, rms, by axis [N m or N].
    """

    format: Literal[1] = 1
    robot: str
    drafted_from: str = ""
    factor: Annotated[float, Field(gt=0)] | None = None
    outcome: Word = "good"
    missing: Count = 0
    with_findings: Count = 0
    flagged: Annotated[float, Field(ge=0, le=1)] = 0.001
    residual: dict[Axis, Amount] = Field(default_factory=dict)
    quantities: tuple[QuantityLimits, ...] = ()


class Check(Reservation):
    """Check of a value against limits; `subject` names the value.

    Attributes
    ----------
    value : float, str or None
        None if the run does not identify the value.
    least, most : float, str or None
        None without such a limit.
    """

    unit: str
    value: float | str | None
    least: float | str | None
    most: float | None


class Acceptance(Judgement):
    """Judgement of a machine by limits: failed if any check failed."""

    checks: tuple[Check, ...]


def accept(run: Run | Path | str, limits: Limits | Path | str) -> Acceptance:
    """Judge an identified run by limits; nothing is written.

    Parameters
    ----------
    run : Run or path
        Identified run.
    limits : Limits or path
        Limits, or a file of limits; see `draft_limits`.

    Returns
    -------
    Acceptance
        `word` is good or failed; `checks` lists each value with limits.

    Raises
    ------
    FileError
        No model, or a damaged file.
    Mismatch
        Limits of another robot, or a model of another state of the run.

    Examples
    --------
    >>> judged = hil.accept("runs/first", hil.draft_limits("runs/first"))
    >>> judged.word, len(judged.checks)
    ('good', 43)
    """
    run = opened(run)
    model = Model.load(run.path)
    limits = limits if isinstance(limits, Limits) else load_yaml(Path(limits), Limits)
    _refuse_foreign(run, model, limits)
    checks = tuple(_checks(run, model, limits))
    lost = [check.subject for check in checks if check.word == "failed"]
    many = "are outside their limits" if len(lost) > 1 else "is outside its limits"
    which = ", ".join(lost[:3]) + (f" and {len(lost) - 3} more" if lost[3:] else "")
    found = [failed(f"{len(lost)} of {len(checks)} checks {many}: {which}")] if lost else []
    within = f"all {len(checks)} checks are within their limits"
    return Acceptance.judge(found, lambda: good(within), checks=checks)


def draft_limits(run: Run | Path | str, factor: float = 3.0) -> Limits:
    """Draft limits from a good run: its 95 % intervals, widened by a factor.

    Raises
    ------
    FileError
        No model, or a damaged recording.
    Mismatch
        A model of another state of the run.

    Examples
    --------
    >>> limits = hil.draft_limits("runs/first", factor=5)
    >>> limits.robot, limits.factor, limits.quantities[0].name
    ('manutec-r15', 5.0, 'p1')
    """
    run = opened(run)
    model = Model.load(run.path)
    limits = Limits(robot=model.robot.name, drafted_from=run.path.name, factor=factor)
    _refuse_foreign(run, model, limits)
    left = dict(enumerate(model.residual.tolist(), start=1))
    residual = {axis: float(f"{factor * r:.4g}") for axis, r in left.items() if np.isfinite(r)}
    drafted, intervals = [], model.interval()
    for each in quantities([model]):
        if (found := reading(model, each)) is None:
            continue
        half = found.half_width + found.allowance
        if each.axis is None:
            low, high = intervals[model.names.index(each.name)]
            half = (high - low) / 2
        digits = _decimals(2 * factor * half)
        least, most = (round(found.value + k * factor * half, digits) for k in (-1, 1))
        limits_of = QuantityLimits(
            name=each.name, unit=each.unit, axis=each.axis, speed=each.speed, least=least, most=most
        )
        drafted.append(limits_of)
    return limits.model_copy(update={"residual": residual, "quantities": tuple(drafted)})


def _refuse_foreign(run: Run, model: Model, limits: Limits) -> None:
    sessions, made_from = run.journal.sessions, model.provenance
    now_there = run.plan.digest, sessions[-1].started if sessions else ""
    if (made_from.plan_digest, made_from.measured) != now_there or made_from.together_with:
        raise Mismatch(
            f"{run.path}: the model does not match the run's present recordings; identify the "
            f"run anew with: hil identify {run.path}"
        )
    if limits.robot != run.robot.name:
        raise Mismatch(
            f"{run.path}: is a run of {run.robot.name}, and the limits are for {limits.robot};"
            " name the limits of this robot with --limits"
        )


def _checks(run: Run, model: Model, limits: Limits) -> Iterator[Check]:
    word = "doubtful" if model.verdict is None else model.verdict.word
    yield _check("identification", "", word, least=limits.outcome)
    # counted in the recordings: the journal of a killed session may lack the count
    timing = SyncTiming()
    for measured in run:
        timing = timing.add_recording(measured.recording)
    flagged = timing.flagged / max(1, timing.samples)
    kept = sum(bool(each.findings) for each in run.exclude(model.provenance.without))
    yield _check("measurements missing", "", len(run.missing), limits.missing)
    yield _check("measurements left out", "", len(model.provenance.without), limits.missing)
    yield _check("recordings with findings", "", kept, limits.with_findings)
    yield _check("samples flagged", "%", 100 * flagged, 100 * limits.flagged)
    for axis, most in sorted(limits.residual.items()):
        known = axis <= model.robot.n_joints
        unit = model.robot.torque_unit(axis - 1) if known else "N m"
        left = float(model.residual[axis - 1]) if known else None
        yield _check(f"residual torque of axis {axis}", unit, left, most)
    titles = dict(zip(model.names, base_parameters(model.robot).titles, strict=True))
    for each in limits.quantities:
        kind: Kind = "inertia parameter" if each.axis is None else "friction level"
        known = each.name in titles if each.axis is None else each.axis <= model.robot.n_joints
        wanted = Quantity(each.name, kind, each.unit, axis=each.axis, speed=each.speed)
        found = reading(model, wanted) if known else None
        value, name = None if found is None else found.value, titles.get(each.name, each.name)
        yield _check(name, each.unit, value, each.most, each.least)


def _check(
    name: str,
    unit: str,
    value: float | str | None,
    most: float | None = None,
    least: float | str | None = None,
) -> Check:
    """Judge a number or a verdict by limits; NaN counts as not identified."""
    if isinstance(value, float) and not np.isfinite(value):
        value = None
    ends = -np.inf if least is None else _rank(least), np.inf if most is None else most
    passed = value is not None and ends[0] <= _rank(value) <= ends[1]
    limits = {"at least": least, "at most": most}
    bounds = (f"{which} {_text(each)}" for which, each in limits.items() if each is not None)
    reason = f"{_rounded(value, least, most)} {unit}".strip() + f" must be {' and '.join(bounds)}"
    return Check(
        word="good" if passed else "failed",
        reason="was not identified" if value is None else reason,
        subject=name, unit=unit, value=value, least=least, most=most,
    )  # fmt: skip


def _rank(value: float | str) -> float:
    return value if isinstance(value, int | float) else -WORDS.index(cast("Word", value))


def _rounded(value: float | str | None, least: float | str | None, most: float | None) -> str:
    """Write a value with a decimal place more than the limits need."""
    if not isinstance(value, float) or value.is_integer() or isinstance(least, str) or most is None:
        return _text(value)
    return f"{value:.{_decimals(most - (least or 0.0)) + 1}f}"


def _decimals(width: float) -> int:
    """Return the decimal places that resolve an interval of this width to three digits."""
    return max(0, 2 - math.floor(math.log10(width))) if width > 0.0 else 6


def _text(value: float | str | None) -> str:
    """Write a value or a limit; empty for None."""
    return f"{value:.6g}" if isinstance(value, int | float) else value or ""


def write_limits(path: Path, limits: Limits) -> None:
    """Write limits as YAML, whole or not at all."""
    content = limits.model_dump(mode="json", exclude_none=True)
    content["residual"] = limits.residual  # JSON has no numbers as keys
    write_file(path, yaml.safe_dump(content, sort_keys=False, allow_unicode=True).encode())


def outcome(run: Run, limits: Limits, folder: Path, stated: Mapping[str, str]) -> Outcome:
    """Judge a run by limits, and write the checks as JUnit XML into a folder.

    Parameters
    ----------
    stated : mapping of str to str
        Facts for the page from outside the run, by name.
    """
    with file_errors(folder, "made"):
        folder.mkdir(parents=True, exist_ok=True)
    found, sessions = accept(run, limits), run.journal.sessions
    # write the checks as JUnit XML, a test case per check
    lost = sum(check.word == "failed" for check in found.checks)
    counts = {"tests": str(len(found.checks)), "failures": str(lost), "errors": "0"}
    measured = sessions[-1].started if sessions else ""
    suite = ET.Element("testsuite", name=run.robot.name, timestamp=measured, attrib=counts)
    for check in found.checks:
        case = ET.SubElement(suite, "testcase", classname=run.robot.name, name=check.subject)
        if check.word == "failed":
            ET.SubElement(case, "failure", message=check.reason)
    ET.indent(suite)
    write_file(folder / JUNIT, ET.tostring(suite, encoding="utf-8", xml_declaration=True) + b"\n")
    axes = next((session.axes for session in sessions if session.axes), ())
    rows = ((axis.name, axis.identity) for axis in axes)
    drives = table("Drives", ("axis", Column("identity", folds=True)), rows)
    return Outcome(
        (checked(found), drives),
        verdicts=(found.verdicts[0],),
        title=f"{run.robot.name}: acceptance",
        facts={
            **{name: text or NOT_KNOWN for name, text in stated.items()},
            "Measured": when(sessions[-1].started) if sessions else NOT_KNOWN,
            "Bus": sessions[-1].bus if sessions else NOT_KNOWN,
        },
        simulated=run.journal.simulated,
        played=partial(played, Model.load(run.path), [run]),
    )


def checked(found: Acceptance) -> Table:
    """Return the table of checks with values and limits."""
    return table(
        "Checks",
        ("check", "result", *figures("value", "at least", "at most"), "unit"),
        (
            (
                check.subject,
                check.word if check.word == "good" else Marked(check.word),
                signed(_rounded(check.value, check.least, check.most)),
                *(signed(_text(each)) for each in (check.least, check.most)),
                unit(check.unit),
            )
            for check in sorted(found.checks, key=lambda each: each.word == "good")
        ),
    )
