"""Maps and the recordings that they name, into a run folder: all of it, or nothing."""

from __future__ import annotations

import hashlib
import re
import secrets
import shutil
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING

from checked_files.yaml_file import FileError
from hil.imports.excerpt import excerpts_of
from hil.imports.map_file import load_map
from hil.imports.motions import measured_motions, numbered_pieces
from hil.imports.plausibility import suspicions
from hil.imports.robot_of_map import robot_of
from hil.imports.samples import read_samples
from hil.imports.segments import chosen_rows
from hil.imports.stamps import WrongStamps, timing_of
from hil.imports.statement import Statement
from hil.imports.velocities import choose
from hil.planning.free_motion import FreeMotion
from hil.planning.plan import PlannedRobot
from hil.planning.recorded_motions import RecordedMotions
from hil.runs.atomic_file import PART, file_errors, write_file
from hil.runs.journal import Journal, Session, now, write_journal
from hil.runs.recording_file import write_measured
from hil.runs.run import MOTIONS, Run

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

    from hil.imports.map_file import MapFile
    from hil.imports.samples import Samples
    from hil.imports.stamps import Timing
    from hil.model.robot import Robot
    from hil.runs.recording_file import Measured

MAPS = "maps"
"""Folder of a run folder, with the maps verbatim."""


def import_recordings(
    maps: Sequence[Path | str],
    output: Path | str,
    state: Callable[[Statement], None] = lambda _: None,
    progress: Callable[[Path, int], None] = lambda _, __: None,
) -> Run:
    """Make a run folder of recordings.

    Parameters
    ----------
    maps : sequence of paths
        Of maps, all of one robot.
    output : path
        Of the folder, which must not be there.
    state : callable
        Takes what was found of each map's recording.
    progress : callable
        Takes the file that is read, and how many rows of it were.

    Raises
    ------
    FileError
        A map or a recording cannot be used, or contradicts itself; nothing is written then.
    """
    output = Path(output)
    if output.exists() or output.is_symlink():
        raise FileError(f"{output}: is there already; choose another folder with -o")
    loaded = [load_map(path) for path in maps]
    robots = [robot_of(the_map) for the_map in loaded]
    _refuse_differing(loaded, robots)
    with _made_whole(output) as folder:
        started = now()
        motions: list[FreeMotion] = []
        statements = []
        for number, the_map in enumerate(loaded):
            statement = _import_one(the_map, robots[0], folder, _stem(loaded, number), progress)
            state(statement)
            motions += statement.motions
            statements.append(statement)
        _write_about(folder, loaded, robots[0], motions, started, statements)
    return Run.open(output)


@contextmanager
def _made_whole(output: Path) -> Iterator[Path]:
    """Yield a folder beside `output` that gets its name at the end, or goes.

    Folders about it that had to be made go with it.
    """
    missing = [folder for folder in output.parents if not folder.exists()]
    part = output.with_name(f".{output.name}.{secrets.token_hex(4)}{PART}")
    try:
        with file_errors(output, "made"):
            (part / "recordings").mkdir(parents=True)
            (part / MAPS).mkdir()
        yield part
        with file_errors(output, "made"):
            part.rename(output)
    except BaseException:
        shutil.rmtree(part, ignore_errors=True)
        with suppress(OSError):  # somebody else put something there meanwhile
            for folder in missing:
                folder.rmdir()
        raise


def _import_one(
    the_map: MapFile,
    robot: Robot,
    folder: Path,
    stem: str,
    progress: Callable[[Path, int], None],
) -> Statement:
    scratch = folder / "samples.part"
    samples = read_samples(the_map, robot, scratch, progress)
    scratch.unlink()  # what is mapped stays until it is no longer used
    timing = _timing(the_map, samples)
    numbered = numbered_pieces(the_map, samples, timing)
    excerpts = excerpts_of(samples, [piece for piece, _ in numbered])
    alone = the_map.content.kind
    found = suspicions(excerpts, robot, None if alone is None else alone - 1)
    refusing = [s for s in found if s.certain and s.check not in the_map.content.accept]
    if refusing:
        remedy = "; if it is right as it is, write accept: [{}]"
        lines = (the_map.wrong(s.location, s.message + remedy.format(s.check)) for s in refusing)
        raise FileError("\n".join(map(str, lines)))
    choices = tuple(choose(excerpts, joint) for joint in range(robot.n_joints))
    measured = measured_motions(the_map, samples, numbered, choices, stem)
    motions = tuple(_written(each, folder, robot) for each in measured)
    return Statement(the_map, timing, samples.wraps, choices, motions, tuple(found))


def _timing(the_map: MapFile, samples: Samples) -> Timing:
    stated = the_map.content.time
    trusted = stated is not None and stated.rate is not None
    try:
        return timing_of(samples, chosen_rows(the_map, samples), trusted=trusted)
    except WrongStamps as error:
        raise the_map.wrong(("time",) if stated else (), str(error)) from error


def _written(measured: Measured, folder: Path, robot: Robot) -> FreeMotion:
    motion = measured.measurement
    assert isinstance(motion, FreeMotion)  # noqa: S101 - made as such
    write_measured(folder / "recordings" / f"{motion.id}.h5", measured, robot)
    return motion


def _write_about(
    folder: Path,
    maps: Sequence[MapFile],
    robot: Robot,
    motions: Sequence[FreeMotion],
    started: str,
    statements: Sequence[Statement],
) -> None:
    """Write all but the recordings; `run.json` comes last, as in every run."""
    digest = hashlib.sha256("".join(the_map.text for the_map in maps).encode()).hexdigest()
    content = RecordedMotions(
        robot=PlannedRobot(name=robot.name, digest=robot.digest),
        map_digest=digest,
        measurements=tuple(motions),
    )
    for number, the_map in enumerate(maps):
        write_file(folder / MAPS / f"{_stem(maps, number)}.yaml", the_map.text.encode())
    write_file(folder / "robot.yaml", robot.text.encode())
    write_file(folder / MOTIONS, content.text().encode())
    session = Session(
        started=started,
        ended=now(),
        reason="imported",
        bus=f"recordings of {', '.join(the_map.path.name for the_map in maps)}",
        simulated=False,
        notes=tuple(line for statement in statements for line in statement.lines()),
    )
    journal = Journal(plan_digest=content.digest, robot_digest=robot.digest)
    write_journal(folder / "run.json", journal.with_session(session))


def _refuse_differing(maps: Sequence[MapFile], robots: Sequence[Robot]) -> None:
    for the_map, robot in zip(maps, robots, strict=True):
        if robot.digest != robots[0].digest:
            raise the_map.wrong(
                ("robot",),
                f"{robot.name} differs from the robot of {maps[0].path}, or their gains'"
                " uncertainties do; a run is of one robot: import them into two",
            )


def _stem(maps: Sequence[MapFile], number: int) -> str:
    """Begin of the ids of a map's motions: its file's name, and its number where that is shared."""
    stems = [re.sub(r"[^A-Za-z0-9_.-]+", "-", m.path.stem).strip("-._")[:40] for m in maps]
    stem = stems[number] or "map"
    return stem if stems.count(stems[number]) == 1 else f"{stem}-{number + 1}"
