"""What a campaign's report shows of results that other commands keep in the run's folder.

A load (`payload.yaml`) and a diagnosis (`diagnosis.yaml`) take as long as the report itself, and a
load needs a second run, so they are not computed again. Each is held against the run as it is now:
one that no longer belongs to it is not shown, and the report says why and how to make it anew.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol, TypeVar

from checked_files.yaml_file import FileError
from hil.planning.measurement import ELEMENT_KINDS
from hil.report.plots.findings import shifted_sinusoid, with_and_without_load
from hil.results import diagnosis_file, payload_file
from hil.results.diagnosis_file import DiagnosisFile, load_diagnosis
from hil.results.payload_file import PayloadFile, read_payload

if TYPE_CHECKING:
    from collections.abc import Callable

    from matplotlib.figure import Figure

    from hil.estimation.estimate import Estimate
    from hil.runs.run import Run


@dataclass(frozen=True, slots=True)
class Findings:
    """Results that were kept; None where there is none, or a stale one that a note tells of.

    Attributes
    ----------
    load : PayloadFile or None
    load_note : str
    diagnosis : DiagnosisFile or None
    diagnosis_note : str
    """

    load: PayloadFile | None
    load_note: str
    diagnosis: DiagnosisFile | None
    diagnosis_note: str


class _Kept(Protocol):
    def stale(self, folder: Run, estimate: Estimate) -> str:
        """Why it is stale."""


K = TypeVar("K", bound=_Kept)


def of_campaign(folder: Run, estimate: Estimate) -> Findings:
    """Read what is kept in the folder and hold it against `estimate`."""
    load, load_note = _current(
        read_payload, folder, estimate, payload_file.NAME, f"hil payload WITHOUT {folder.path}"
    )
    diagnosis, diagnosis_note = _current(
        load_diagnosis, folder, estimate, diagnosis_file.NAME, f"hil diagnose {folder.path}"
    )
    return Findings(load, load_note, diagnosis, diagnosis_note)


def _current(
    read: Callable[[Run], K | None],
    folder: Run,
    estimate: Estimate,
    name: str,
    command: str,
) -> tuple[K | None, str]:
    try:
        kept = read(folder)
        stale = kept.stale(folder, estimate) if kept else ""
    except FileError as error:
        return None, f"{name} cannot be used: {error}. Make it anew with: {command}"
    if stale:
        return None, f"{name} is stale and not shown: {stale}. Make it anew with: {command}"
    return kept, ""


def drawings(findings: Findings) -> dict[str, Figure]:
    """Plots of what is kept; call within `plot_style.drawn`."""
    made: dict[str, Figure] = {}
    if findings.load is not None:
        runs = findings.load.elements_without, findings.load.elements_loaded
        for name in payload_file.DRAWN:
            made[f"load-{name}"] = with_and_without_load(*runs, ELEMENT_KINDS[name])
    if findings.diagnosis is not None and findings.diagnosis.phase is not None:
        shown = findings.diagnosis.phase.phase()
        made["phase"] = shifted_sinusoid(shown, ", ".join(findings.diagnosis.found))
    return made
