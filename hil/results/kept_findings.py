"""`findings.json`: what was found in a run, kept beside it for as long as it would be found again.

Estimating takes most of the time of a report, and of the same recordings the same program finds the
same. So what `hil identify` or `hil report` found is kept with a digest of all that it follows
from: the recordings byte by byte, robot file, plan, journal, measurements left out, the program and
the libraries that it calculates with. Where one of them differs, or the file is damaged, a run is
estimated anew; the file may be deleted at any time.
"""

from __future__ import annotations

import hashlib
import json
from functools import cache
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING

import hil
from hil.errors import FileError
from hil.results.findings import Findings, findings
from hil.results.provenance import RunStamp
from hil.runs.atomic_file import write_file
from hil.runs.pooling import recorded

if TYPE_CHECKING:
    from hil.results.identification import Identified
    from hil.runs.run import Run

NAME = "findings.json"
FOLLOWS_FROM = ("results", "estimation", "friction", "least_squares", "model", "planning", "runs")
"""Packages of `hil` that findings are made by."""
LIBRARIES = ("canopen-robot-identification", "numpy", "scipy", "numba", "h5py")


def keep(run: Run, found: Findings) -> None:
    """Write what was found in a run into its folder.

    Raises
    ------
    FileError
        Disk full, read-only folder.
    """
    from hil.results.records import plain  # noqa: PLC0415 - it knows all records there are

    content = json.dumps([plain(each) for each in found])
    whole = {"state": _state(run), "digest": _digest(content), "content": content}
    write_file(run.path / NAME, json.dumps(whole).encode() + b"\n")


def identify_and_keep(run: Run, method: str) -> Identified:
    """Identify a run, and keep that and what follows from it; recordings are read once.

    Raises
    ------
    FileError
        Disk full, read-only folder, or a damaged recording.
    NotIdentifiable, NotEnoughData
        As of `hil.results.identification.identified`.
    """
    from hil.results.identification import identified  # noqa: PLC0415 - as of `findings`

    campaign = tuple(run)
    recordings = tuple(recorded(campaign))
    found = identified(run, method, recorded=recordings)
    keep(run, findings(run, found, campaign, recordings))
    return found


def kept(run: Run) -> Findings | None:
    """Read what is kept; None where there is nothing, or it is not what would be found now."""
    from hil.results.records import restored  # noqa: PLC0415 - as above

    try:
        whole = json.loads((run.path / NAME).read_bytes())
        content = whole["content"]
        if whole["digest"] != _digest(content) or whole["state"] != _state(run):
            return None
        return Findings(*(restored(each, run.robot) for each in json.loads(content)))
    except (OSError, ValueError, TypeError, KeyError, AttributeError, RecursionError, FileError):
        return None


def _state(run: Run) -> str:
    """Digest of all that findings follow from."""
    stamp, journal = RunStamp.of(run), run.journal.model_dump_json()
    follows = (stamp.robot_digest, stamp.plan_digest, stamp.recordings, journal, _program())
    return _digest("\n".join((*follows, *sorted(run.set_aside))))


@cache
def _program() -> str:
    """Digest of the program and of what it calculates with."""
    digest = hashlib.sha256()
    place = Path(hil.__file__).parent
    for package in FOLLOWS_FROM:
        for path in sorted((place / package).rglob("*.py")):
            digest.update(path.read_bytes())
    for library in LIBRARIES:
        digest.update(f"{library} {version(library)}\n".encode())
    return digest.hexdigest()


def _digest(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()
