"""`hil accept`: an identified run judged by limits; a page to sign, JUnit XML for CI systems."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING
from xml.etree import ElementTree as ET

from hil.commands.torques import played
from hil.results.acceptance import accept as judge
from hil.results.acceptance import text_of
from hil.results.model import Model
from hil.runs.atomic_file import file_errors, write_file
from hil.show.outcome import Outcome
from hil.show.rounding import signed, unit, when
from hil.show.table import Column, Marked, Table, figures, table

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

    from hil.results.acceptance import Acceptance, Limits
    from hil.runs.run import Run

PAGE, JUNIT = "acceptance.html", "acceptance.xml"
NOT_KNOWN = "not stated"


def accept(run: Run, limits: Limits, folder: Path, stated: Mapping[str, str]) -> Outcome:
    """Judge a run by limits, and write the checks as JUnit XML into a folder.

    Parameters
    ----------
    stated : mapping of str to str
        Facts for the page that the run does not hold, by name.
    """
    with file_errors(folder, "made"):
        folder.mkdir(parents=True, exist_ok=True)
    found, sessions = judge(run, limits), run.journal.sessions
    write_junit(folder / JUNIT, run.robot.name, sessions[-1].started if sessions else "", found)
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


def write_junit(path: Path, robot: str, measured: str, found: Acceptance) -> None:
    """Write the checks as JUnit XML, a test case each."""
    lost = sum(check.word == "failed" for check in found.checks)
    counts = {"tests": str(len(found.checks)), "failures": str(lost), "errors": "0"}
    suite = ET.Element("testsuite", name=robot, timestamp=measured, attrib=counts)
    for check in found.checks:
        case = ET.SubElement(suite, "testcase", classname=robot, name=check.subject)
        if check.word == "failed":
            ET.SubElement(case, "failure", message=check.reason)
    ET.indent(suite)
    write_file(path, ET.tostring(suite, encoding="utf-8", xml_declaration=True) + b"\n")


def checked(found: Acceptance) -> Table:
    """Checks with their values and limits."""
    return table(
        "Checks",
        ("check", "result", *figures("value", "at least", "at most"), "unit"),
        (
            (
                check.subject,
                check.word if check.word == "good" else Marked(check.word),
                *(signed(text_of(each)) for each in (check.value, check.least, check.most)),
                unit(check.unit),
            )
            for check in found.checks
        ),
    )
