"""All measurements of a run on one clock, in nanoseconds, in the order in which they were made.

A stamp is the computer's clock when the session began plus the bus's time: instants within a
session are exact to 1 ns, those of sessions to seconds. In lock-step a session lasts longer in
robot time than by that clock; what follows is put behind it. When imported recordings were made is
not known: theirs begin at 0.
"""

from __future__ import annotations

from datetime import datetime
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from checked_files.yaml_file import FileError
from hil.export.recordings.ros_messages import SECOND

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import NDArray

    from hil.runs.recording import Recording
    from hil.runs.run import Run

APART = SECOND
"""Between measurements that would overlap."""


class Placed(NamedTuple):
    """A measurement and where its time begins.

    Attributes
    ----------
    id : str
    begin : int
        What the recording's time 0 is on the clock [ns].
    """

    id: str
    begin: int

    def stamps(self, recording: Recording) -> NDArray[np.int64]:
        """Stamps of the samples [ns]."""
        return self.begin + np.rint(recording.time * SECOND).astype(np.int64)


class _Span(NamedTuple):
    session: int
    first: float
    last: float
    id: str


def timeline(run: Run) -> Iterator[Placed]:
    """Yield where each measurement lies, none before another has ended.

    Raises
    ------
    FileError
        A recording is damaged, or the journal states no instant at which a session began.
    """
    spans = sorted(
        _Span(session, float(time[0]), float(time[-1]), measurement.id)
        for measurement, session, time in (
            (each.measurement, each.session, each.recording.time) for each in run
        )
    )
    session, begin, end = -1, 0, -APART
    for span in spans:
        if span.session != session or begin + round(span.first * SECOND) <= end:
            session = span.session
            begin = max(_begun(run, session), end + APART - round(span.first * SECOND))
        end = begin + round(span.last * SECOND)
        yield Placed(span.id, begin)


def _begun(run: Run, session: int) -> int:
    """When a session began [ns since 1970]; 0 of imported recordings."""
    if run.imported:
        return 0
    stated = run.journal.sessions[session].started
    try:
        return round(datetime.fromisoformat(stated).timestamp()) * SECOND
    except ValueError as error:
        raise FileError(
            f"{run.path / 'run.json'}: {stated!r} is no instant at which a session began; put the"
            " run's own file back"
        ) from error
