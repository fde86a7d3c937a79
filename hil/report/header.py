"""What stands above all sections of a report: its title, the verdict and the facts."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import datetime
from typing import TYPE_CHECKING

import numpy as np

from hil.report.reported_run import IdentifiedRun
from hil.results.rounding import clock, percent

if TYPE_CHECKING:
    from collections.abc import Sequence

    from hil.report.reported_run import ReportedRun
    from hil.results.judgement import Judgement
    from hil.runs.recording_file import Measured

Facts = tuple[tuple[str, str], ...]


@dataclass(frozen=True, slots=True)
class Header:
    """Top of a page.

    Attributes
    ----------
    title, verdict : str
        The latter may be empty.
    outcome : Judgement or None
        What the identification is worth, where there is one.
    facts : tuple of (str, str)
        Each with its name.
    shortfall : str
        What the plan has and the run has not.
    simulated : bool
    """

    title: str
    verdict: str
    outcome: Judgement | None
    facts: Facts
    shortfall: str
    simulated: bool


def of(run: ReportedRun) -> Header:
    """Top of the report of a run: what it is about, in two sentences where it was identified."""
    source, journal = run.source, run.source.journal
    about, verdict, outcome = "friction", "", None
    facts: Facts = (
        ("Measurements", f"{len(run.campaign)} of {len(source.motions)} planned"),
        ("Sessions", str(len(journal.sessions))),
    )
    if isinstance(run, IdentifiedRun):
        about, outcome = "identified dynamics", run.model.outcome
        verdict, facts = (_of_motions if run.found.prediction is None else _of_campaign)(run)
    last = journal.sessions[-1] if journal.sessions else None
    began, bus = (when(last.started), last.bus) if last else ("unknown", "unknown")
    bus += ", the virtual plant" if journal.simulated else ""
    begun = ("Imported", "From") if source.imported else ("Measured", "Bus")
    facts = (*zip(begun, (began, bus), strict=True), *facts)
    title = f"{run.robot.name}: {about}"
    return Header(title, verdict, outcome, facts, source.shortfall, journal.simulated)


def _of_motions(run: IdentifiedRun) -> tuple[str, Facts]:
    """Verdict and facts of an imported run, by motions or strokes back and forth."""
    identified, fit = run.model.identified, run.model.back_and_forth or run.model.friction
    left = percent(0.0 if fit is None else fit.overall_residual, 1.0)
    verdict = (
        f"All {len(run.model.values)} base parameters of {run.robot.name} were identified together"
        f" with friction. Of the recorded torques {left} % are left, all samples and axes taken"
        " together."
    )
    if run.model.back_and_forth is not None:
        which = "All" if identified.all() else f"{identified.sum()} of"
        lost = "" if identified.all() else " Those not identified are zero in the model."
        verdict = (
            f"{which} {len(identified)} base parameters of {run.robot.name} were identified from"
            f" strokes back and forth, without a law of friction. Of the recorded torques {left} %"
            f" are left, all axes taken together, away from the reversals.{lost}"
        )
    took = sum(float(each.time[-1] - each.time[0]) for _, each in run.recordings)
    return verdict, (("Recordings", str(len(run.recordings))), ("Recorded", duration(took)))


def _of_campaign(run: IdentifiedRun) -> tuple[str, Facts]:
    """Verdict and facts of a run whose torques of a free motion are predicted."""
    assert run.found.prediction is not None  # noqa: S101 - asked for before
    relative = percent(float(np.nanmean(run.found.prediction.relative)), 1.0)
    urgent = sum(item.word != "good" for item in run.found.advice)
    attention = f"{urgent} finding{'s require' if urgent > 1 else ' requires'} action, see below."
    verdict = (
        f"All {len(run.estimate.p)} base parameters were identified; the rigid-body torques of a"
        f" free motion follow from them to {relative} % on average over the axes (one standard"
        f" error). {attention if urgent else 'No finding requires action.'}"
    )
    sessions = len(run.source.journal.sessions)
    took = duration(run.robot_time) + (f" in {sessions} sessions" if sessions > 1 else "")
    return verdict, (("Measurements", counts(run.campaign)), ("Robot time", took))


def counts(campaign: Sequence[Measured]) -> str:
    """State how many measurements there are of each kind."""
    kinds: list[str] = [measured.measurement.kind for measured in campaign]
    each = (f"{kinds.count(kind)} {kind}" for kind in dict.fromkeys(kinds))
    return f"{len(kinds)} ({', '.join(each)})"


def when(stamp: str) -> str:
    """Write an ISO time stamp for readers."""
    return f"{datetime.fromisoformat(stamp):%d %B %Y, %H:%M %Z}".lstrip("0") if stamp else "unknown"


def duration(seconds: float) -> str:
    """Write a duration for readers."""
    return f"{clock(seconds)} {'h' if seconds >= 3600 else 'min'}"
