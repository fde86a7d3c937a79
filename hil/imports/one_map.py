"""Import of a map with its recording into a run folder, in this or another process."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from checked_files.yaml_file import FileError
from hil.imports.clipped import clipped_positions
from hil.imports.evidence import Evidence, Suspicion, even_samples, excerpts_of
from hil.imports.mixed_rows import source_suspicions
from hil.imports.plausibility import suspicions
from hil.imports.rounded import rounded_torques
from hil.imports.row_count import RowCount, recounted
from hil.imports.samples import columns_of, positions_reached, read_samples
from hil.imports.segments import (
    LONGEST,
    SHORTEST,
    block_counts,
    blocks,
    chosen_rows,
    pieces_by_pairs,
    pieces_of,
    split_at_jumps,
)
from hil.imports.spikes import jump_suspicions, spike_suspicions
from hil.imports.stamps import WrongStamps, even_rate, timing_of
from hil.imports.statement import Statement, explanation
from hil.planning.free_motion import FreeMotion
from hil.runs.recording import IDLE, Recording
from hil.runs.recording_file import Measured, write_measured

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence
    from pathlib import Path

    from hil.arrays import Integers, Numbers
    from hil.imports.map_file import MapFile
    from hil.imports.samples import Location, Samples
    from hil.imports.segments import Piece
    from hil.imports.stamps import Timing
    from hil.model.robot import Robot

    Numbered = tuple[Piece, Numbers]

SLOWEST = 0.1
"""Maximum time between samples that resolves the motion of a robot [s]."""


@dataclass(frozen=True)
class OneMap:
    """Import job of a map, which can be sent to another process.

    Attributes
    ----------
    number : int
        Number among the maps of the run, from 0.
    robot : Robot
        Robot of the run.
    folder : Path
        Folder of the run, with a folder `recordings`.
    stem : str
        Prefix of the motions' ids.
    """

    number: int
    the_map: MapFile
    robot: Robot
    folder: Path
    stem: str

    def anywhere(self) -> OneMap:
        """Return a copy with absolute paths, valid in the folder of any process."""
        the_map = self.the_map
        allowed = tuple(path.absolute() for path in the_map.allowed)
        the_map = replace(the_map, path=the_map.path.absolute(), allowed=allowed)
        return replace(self, the_map=the_map, folder=self.folder.absolute())


def import_one(
    job: OneMap, progress: Callable[[Path, int], None] = lambda _, __: None
) -> Statement:
    """Write the motions of a map into a run folder.

    Raises
    ------
    FileError
        The recording cannot be used, or contradicts itself.
    """
    the_map, robot = job.the_map, job.robot
    scratch = job.folder / f"{job.stem}.samples"
    samples = read_samples(the_map, robot, scratch, progress)
    scratch.unlink()  # memory maps remain until their last use
    timing, numbered, found, explained = interpret(the_map, robot, samples)
    recorded = tuple(joint.velocity is not None for joint in the_map.content.joints)
    motions = []
    for motion, recording in measured_motions(the_map, samples, numbered, job.stem):
        path = job.folder / "recordings" / f"{motion.id}.h5"
        write_measured(path, Measured(motion, recording), robot)
        motions.append(motion)
    timing.stretches = []  # arrays as long as the recording
    return Statement(
        the_map,
        timing,
        samples.wraps,
        recorded,
        tuple(motions),
        found,
        (*robot.not_taken, *samples.notes, *_lacking(the_map, samples)),
        explained,
    )


def interpret(
    the_map: MapFile, robot: Robot, samples: Samples
) -> tuple[Timing, list[Numbered], tuple[Suspicion, ...], tuple[str, ...]]:
    """Return times, motions and doubts of a map's samples, and the interpretation of its joints.

    Raises
    ------
    FileError
        The recording cannot be used, or contradicts itself.
    """
    _refuse_without_numbers(the_map, samples)
    segments = chosen_rows(the_map, samples)
    lost, count = [], RowCount()
    stated = the_map.content.time.rate if the_map.content.time else None
    rate = stated
    if stated is None and (even := even_rate(samples, segments)) is not None:
        # if stamps only count the rows, a part of the rows shows it
        _, _, first = recounted(samples, [rows[:100_000] for rows in segments], even)
        rate = even if first.missing or first.surplus else None
    if rate is not None:
        samples, segments, count = recounted(samples, segments, rate)
        parts = split_at_jumps(samples, segments)
        lost = list(_lost_rows(segments, parts, count, stamped=stated is None))
        segments = parts
    mixed = list(source_suspicions(samples, segments))
    _refuse(the_map, mixed)
    timing = _timing(the_map, samples, segments, rate)
    timing.counts.at_rate = count
    timing.counts.rows += count.surplus
    spikes = list(spike_suspicions(samples, timing.stretches, robot))
    spikes += jump_suspicions(samples, timing.stretches, robot)
    spikes += clipped_positions(samples, timing.stretches, robot)
    _refuse(the_map, spikes)
    numbered = numbered_pieces(the_map, samples, timing)
    pieces = [piece for piece, _ in numbered]
    excerpts = excerpts_of(samples, pieces)
    alone = the_map.content.kind
    evidence = Evidence.join(excerpts)
    moving = None if alone is None else alone - 1
    rows = [stretch.rows for stretch in timing.stretches]
    found = suspicions(
        excerpts, evidence, robot, moving, the_map.unknown_gains, the_map.passive,
        partial(positions_reached, samples, rows),
        the_map.content.time.rate if the_map.content.time else None,
        partial(excerpts_of, samples, pieces, LONGEST),
    )  # fmt: skip
    found += rounded_torques(samples, rows, evidence.moves)
    # the following checks of the rate use the remaining rows only
    if (held := timing.counts.held) > 1:
        repeat = f"values repeat over {held} rows each; without repeated rows, "
        found = [
            replace(s, message=repeat + s.message) if s.location == ("time",) else s for s in found
        ]
    _refuse(the_map, found)
    explained = explanation(the_map, robot, excerpts, evidence)
    return timing, numbered, (*lost, *mixed, *spikes, *found), explained


def _lost_rows(
    segments: list[Integers], parts: list[Integers], count: RowCount, *, stamped: bool
) -> Iterator[Suspicion]:
    """Yield suspicions of rows missing in a recording at a stated rate or with even stamps."""
    at: Location = ("time",) if stamped else ("time", "rate")
    record = "record stamps"
    if stamped:
        record = "the stamps only count the rows: record those of the samples"
    if count.missing:
        yield Suspicion(
            "spikes",
            at,
            f"{count.missing} rows are missing, the first after row {count.first_missing}: the step"
            " of all moving joints is a multiple of those around it; their time is inserted, but"
            f" rows missing close to reversals are not seen; {record}",
            certain=False,
            first=True,
        )
    first = {int(rows[0]) for rows in segments}
    begins = [int(rows[0]) for rows in parts if int(rows[0]) not in first]
    if begins:
        times = f", and {len(begins)} times in all" if len(begins) > 1 else ""
        yield Suspicion(
            "spikes",
            at,
            f"positions jump from row {begins[0]} to {begins[0] + 1}{times}: rows are missing "
            "there, and a count does not show how many; the parts are taken "
            f"as separate motions; {record}, or state the parts as rows",
            certain=False,
            first=True,
        )


def _refuse(the_map: MapFile, found: Sequence[Suspicion]) -> None:
    """Refuse certain contradictions unless accepted by the map."""
    refusing = [s for s in found if s.certain and s.check not in the_map.content.accept]
    if refusing:
        remedy = f"; if this is correct, {the_map.accepting}"
        lines = (the_map.wrong(s.location, s.message + remedy.format(s.check)) for s in refusing)
        raise FileError("\n".join(map(str, lines)))


def _timing(
    the_map: MapFile, samples: Samples, segments: list[Integers], rate: float | None
) -> Timing:
    try:
        return timing_of(samples, segments, rate)
    except WrongStamps as error:
        lacking = "".join(f"; {each}" for each in _lacking(the_map, samples))
        raise the_map.wrong(
            ("time",) if the_map.content.time else (), f"{error}{lacking}"
        ) from error


def _refuse_without_numbers(the_map: MapFile, samples: Samples) -> None:
    """Refuse columns without any number, by name."""
    lines = [
        the_map.wrong(
            location,
            f"column {name} holds no number in any of {len(samples.time)} rows; name another"
            " column, or record it",
        )
        for location, name, count in _numbers(the_map, samples)
        if not count
    ]
    if lines:
        raise FileError("\n".join(map(str, lines)))


def _numbers(the_map: MapFile, samples: Samples) -> Iterator[tuple[Location, str, int]]:
    """Yield place, name and count of numbers of all columns; none for samples from arrays."""
    columns = [(at, str(each.column)) for at, each in columns_of(the_map) if each is not None]
    # stamps of the format, absent in the map, come before all other columns
    own = max(0, len(samples.numbers) - len(columns))
    for (location, name), count in zip(columns, samples.numbers[own:], strict=False):
        yield location, name, count


def _lacking(the_map: MapFile, samples: Samples) -> Iterator[str]:
    """Yield statements of the columns with missing numbers."""
    n, by_count = len(samples.time), dict[int, list[str]]()
    for _, name, count in _numbers(the_map, samples):
        by_count.setdefault(n - count, []).append(name)
    for missing, names in by_count.items():
        if missing:
            yield f"{missing} of {n} rows hold no number in {', '.join(names)}"


def numbered_pieces(the_map: MapFile, samples: Samples, timing: Timing) -> list[Numbered]:
    """Return the motions of a recording, with the block or stroke number of every sample.

    Raises
    ------
    FileError
        No stretch is long enough, or no stroke is found.
    """
    if timing.period > SLOWEST:
        raise the_map.wrong(
            ("time",) if the_map.content.time else (),
            f"sampling period {timing.period:.3g} s, at most {SLOWEST:g} s allowed for a robot's "
            "motion; correct the unit of time or the rate",
        )
    alone = the_map.content.kind
    found: list[Numbered] = []
    for stretch in timing.stretches:
        if alone is None:
            of_stretch = [(piece, np.zeros(0, dtype=np.int16)) for piece in pieces_of(stretch)]
        else:
            of_stretch = pieces_by_pairs(samples, stretch, alone - 1)
        if not of_stretch:
            timing.counts.short += 1
            timing.counts.short_time += stretch.duration
        found += of_stretch
    if not found:
        raise _nothing_left(the_map, timing)
    if alone is not None:
        return found
    counts = block_counts([piece.duration for piece, _ in found])
    return [
        (piece, blocks(piece.n, count)) for (piece, _), count in zip(found, counts, strict=True)
    ]


def _nothing_left(the_map: MapFile, timing: Timing) -> Exception:
    longest = max((stretch.duration for stretch in timing.stretches), default=0.0)
    if the_map.content.kind is not None and longest >= SHORTEST:
        return the_map.wrong(
            ("kind",),
            f"joint {the_map.content.kind} has no forward stroke with a backward stroke after "
            "it; write kind: free, or choose other rows",
        )
    at = ("rows",) if the_map.content.rows else ("time",) if the_map.content.time else ()
    if len(timing.stretches) == 1 and not timing.counts.gaps:
        rows = "the chosen rows last" if the_map.content.rows else "the recording lasts"
        return the_map.wrong(
            at,
            f"{rows} {longest:.3g} s, {timing.counts.rows} rows at {1 / timing.period:.5g} Hz; "
            f"at least {SHORTEST:g} s needed: record longer, or correct the unit of time or the "
            "rate",
        )
    return the_map.wrong(
        at,
        f"no stretch without a gap is as long as {SHORTEST:g} s: the longest of"
        f" {len(timing.stretches)} has {longest:.3g} s at a period of {timing.period:.4g} s;"
        " correct the unit of time or the rate, or choose other rows",
    )


def measured_motions(
    the_map: MapFile,
    samples: Samples,
    numbered: Sequence[Numbered],
    stem: str,
) -> Iterator[tuple[FreeMotion, Recording]]:
    """Yield motions with their recordings; ids are `stem` and a number."""
    begin = numbered[0][0].grid[0]
    digits = max(2, len(str(len(numbered))))
    for number, (piece, numbers) in enumerate(numbered, start=1):
        recording = _recording(the_map, samples, piece, numbers, begin)
        motion = FreeMotion(
            id=f"{stem}-{number:0{digits}}",
            q=tuple(recording.q.mean(axis=0).tolist()),
            duration=piece.duration,
            cycles=(int(numbers.max()) + 1) // (1 if the_map.content.kind is None else 2),
            alone=the_map.content.kind,
            cut_off=the_map.content.cut_off,
            unknown_gains=tuple(joint + 1 for joint in the_map.unknown_gains) or None,
            source=_source(the_map, samples, piece),
        )
        yield motion, recording


def _recording(
    the_map: MapFile, samples: Samples, piece: Piece, numbers: Numbers, begin: float
) -> Recording:
    strokes = the_map.content.kind is not None
    idle = np.full_like(numbers, IDLE)
    q, tau, qd = even_samples(samples, piece)
    return Recording(
        time=piece.grid - begin,
        q=np.ascontiguousarray(q),
        tau=np.ascontiguousarray(tau),
        flags=np.zeros(q.shape, dtype=np.uint8),
        stroke=numbers if strokes else idle,
        partner_stroke=idle,
        qd=np.ascontiguousarray(qd) if np.isfinite(qd).any() else None,
        group=numbers // 2 if strokes else numbers,
    )


def _source(the_map: MapFile, samples: Samples, piece: Piece) -> str:
    """Return file and rows, from 1, of a motion."""
    instants, rows, grid = piece.stretch.instants, piece.stretch.rows, piece.grid
    first, last = (
        int(rows[min(int(np.searchsorted(instants, t)), len(rows) - 1)]) for t in grid[[0, -1]]
    )
    file = int(np.searchsorted(samples.begins, first, side="right")) - 1
    begin = samples.begins[file]
    return f"{the_map.content.files[file]}, rows {first - begin + 1} to {last - begin + 1}"
