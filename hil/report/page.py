"""Report of a run: one self-contained HTML file, computed from the recordings alone.

The report can be written again at any time, without hardware and without the network. The registry
of `hil.report.sections` states content and order; the leading section is on the first screen, next
to the judgement of the result and a picture of the robot. Plots are part of the page as SVG, and
their points link to the recordings that the page carries: as on the page of `hil view`, thinned to
the resolution of a screen. Base parameters are CSV for tables and JSON for programs.
"""

from __future__ import annotations

import csv
import io
import json
from pathlib import Path
from typing import TYPE_CHECKING

from hil.commands.torques import arm, packed_recordings
from hil.model.base_parameters import base_parameters
from hil.report.reported_run import ReportedRun
from hil.report.sections import OF_FRICTION, OF_IDENTIFIED
from hil.runs.atomic_file import file_errors, write_file
from hil.runs.run import opened
from hil.show.html import environment, write_html
from hil.show.outcome import Verdict, data_uri
from hil.show.rounding import duration, significant, when
from hil.view.along_motion import carriers, join_predictions
from hil.view.page import view_script

if TYPE_CHECKING:
    from collections.abc import Collection, Sequence

    from hil.results.model import Model
    from hil.runs.recording_file import Measured
    from hil.runs.run import Run


def carried(run: ReportedRun, ids: Collection[str], played: Collection[str]) -> str:
    """Pack the data for a page's script (`hil.view.page`), compressed; empty without data.

    Parameters
    ----------
    ids : collection of str
        Measurements behind points.
    played : collection of str
        Recordings whose time has a cursor.
    """
    own = run.own_torques if run.is_identified else None
    found = own.stretches if own else {}
    of = carriers(found, base_parameters(run.robot).names) if own else {}
    wanted = {*ids, *(name for each in of.values() for name, _ in each)}
    shown = run.shown_torques if run.is_identified else None
    wanted |= set(played) if shown is own else set()
    pairs = (pair for pair in run.recordings if pair[0].id in wanted)
    recordings = [*join_predictions(pairs, found)]
    # the run's own recordings come first, since recordings of both runs may have equal ids
    if shown is not None and shown is not own:
        others = (pair for pair in shown.recordings if pair[0].id in played)
        recordings += join_predictions(others, shown.stretches)
    titles = base_parameters(run.robot).titles if of else ()
    parameters = {
        name: {"title": title, "by": [[each, round(100 * share, 1)] for each, share in by]}
        for (name, by), title in zip(of.items(), titles, strict=True)
    }
    return packed_recordings(run.robot, recordings, parameters)


Downloads = tuple[tuple[str, str, str], ...]
"""File name, format and data address of downloads."""


def downloads(model: Model) -> Downloads:
    """Convert the base parameters of a model to files."""
    low, high = model.interval(0.95).T.tolist()
    columns = {
        "name": model.names, "meaning": base_parameters(model.robot).meanings,
        "value": model.values.tolist(), "standard_error": model.standard_errors.tolist(),
        "low_95": low, "high_95": high, "unit": model.units, "expression": model.expressions,
    }  # fmt: skip
    rows = [dict(zip(columns, each, strict=True)) for each in zip(*columns.values(), strict=True)]
    text = io.StringIO()
    written = csv.DictWriter(text, columns, lineterminator="\n")
    written.writeheader()
    written.writerows(rows)
    content = {
        "robot": model.robot.name,
        "method": model.method,
        "parameters": rows,
        "covariance": model.covariance.tolist(),
    }
    by_kind = (
        ("csv", "text/csv;charset=utf-8", text.getvalue()),
        ("json", "application/json", json.dumps(content, indent=1) + "\n"),
    )
    name = f"{model.robot.name}-parameters"
    return tuple(
        (f"{name}.{kind}", kind.upper(), data_uri(whole.encode(), media))
        for kind, media, whole in by_kind
    )


NAME = "report.html"
TEMPLATES: tuple[Path, ...] = (Path(__file__).parent / "sections",)


def report(run: Run | Path | str, figures: Path | None = None) -> Path:
    """Write the report of a run into the run's folder, identified as by `hil identify`.

    Parameters
    ----------
    run : Run or path
    figures : path, optional
        Folder for additional SVG files of the plots, created if missing.

    Returns
    -------
    Path
        Path of the report.

    Raises
    ------
    FileError
        A damaged recording, or a full disk.
    NotIdentifiable, NotEnoughData
        The measurements do not suffice.

    Examples
    --------
    >>> hil.report("runs/head").as_posix()
    'runs/head/report.html'
    """
    run = opened(run)
    whole = ReportedRun(run)
    registry = OF_IDENTIFIED if whole.is_identified else OF_FRICTION
    sections = list(filter(None, (each(whole) for each in registry)))
    path = run.path / NAME
    templates = environment(*TEMPLATES)
    texts = [
        (
            each,
            templates.get_template(each.template).render(
                plots={plot.name: plot for plot in each.plots}, **each.values
            ),
        )
        for each in sections
    ]
    plots = [plot for each in sections for plot in each.plots]
    charts = [plot.chart for plot in plots]
    behind = frozenset[str]().union(*(chart.ids for chart in charts))
    played = {panel.recording for chart in charts for panel in chart.panels if panel.recording}
    values = {
        **_top(whole),
        "lead": next((text for section, text in texts if section.leads), ""),
        "sections": [each for each in texts if not each[0].leads],
        "downloads": downloads(whole.model) if whole.is_identified else (),
        "carried": carried(whole, behind, played),
        "run": whole.source,
        "picture": arm(whole.robot, whole.campaign[0].recording),
    }
    write_html(path, NAME, view_script() if values["carried"] else "", **values)
    if figures is not None:
        with file_errors(figures, "made"):
            figures.mkdir(parents=True, exist_ok=True)
        for plot in plots:
            write_file(figures / f"{plot.name}.svg", plot.file)
    return path


def _top(run: ReportedRun) -> dict[str, object]:
    """Return title, judgement and facts of a report."""
    source, journal = run.source, run.source.journal
    last = journal.sessions[-1] if journal.sessions else None
    began, bus = (when(last.started), last.bus) if last else ("unknown", "unknown")
    bus += ", the virtual plant" if journal.simulated else ""
    begun = ("Imported", "From") if source.imported else ("Measured", "Bus")
    recorded = sum(float(each.time[-1] - each.time[0]) for _, each in run.recordings)
    total = max(float(each.time[-1]) for _, each in run.recordings)
    verdicts: list[Verdict] = []
    if run.is_identified:
        # the judgement of the model, and the error on other recordings or on the same ones
        verdicts += run.model.verdict.verdicts[:1] if run.model.verdict else ()
        validations = run.kept_model.validations if run.kept_model else ()
        if validations:
            first, other = validations[-1].verdicts[0], validations[-1].run
            verdicts.append(first._replace(text=f"on other recordings ({other}): {first.text}"))
        elif run.model.band_residual is not None:
            left = run.model.band_residual.describe(run.robot.torque_limit)
            text = f"on these recordings: {left}"
            verdicts.append(Verdict("note", "note", text))
    # the chosen law of each axis, with the error
    for each in run.friction.axes if not run.is_identified and run.friction else ():
        error, unit = each.models[each.chosen].held_out_error, run.robot.torque_unit(each.axis)
        tested = "" if error is None else f", {significant(error, 3)} {unit} rms at held-out speeds"
        verdicts.append(Verdict("note", f"axis {each.axis + 1}", f"{each.chosen}{tested}"))
    sessions, took = len(journal.sessions), duration(recorded if source.imported else total)
    took += f" in {sessions} sessions" if sessions > 1 else ""
    return {
        "title": f"{run.robot.name}: {'identified dynamics' if run.is_identified else 'friction'}",
        "verdicts": tuple(verdicts),
        "facts": (
            *zip(begun, (began, bus), strict=True),
            ("Measurements", counts(run.campaign)),
            ("Recorded" if source.imported else "Robot time", took),
        ),
    }


def counts(campaign: Sequence[Measured]) -> str:
    """Format the number of measurements by kind."""
    kinds: list[str] = [measured.measurement.kind for measured in campaign]
    each = (f"{kinds.count(kind)} {kind}" for kind in dict.fromkeys(kinds))
    return f"{len(kinds)} ({', '.join(each)})"
