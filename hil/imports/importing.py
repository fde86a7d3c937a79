"""Import of maps and recordings into a run folder, completely or not at all."""

from __future__ import annotations

import hashlib
import re
from concurrent.futures import BrokenExecutor
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import yaml

from checked_files.yaml_file import FileError
from checked_files.yaml_text import comment
from hil.errors import UnknownName
from hil.imports.map_file import load_map
from hil.imports.one_map import OneMap, import_one
from hil.imports.readers import KNOWN
from hil.model.drive_train_file import UNKNOWN
from hil.model.readers.robot_draft import NOT_TAKEN
from hil.model.robot import Robot, available_robots, load_description, parse_robot
from hil.planning.plan import PlannedRobot, RecordedMotions
from hil.runs.atomic_file import own_folder, whole_folder, write_file
from hil.runs.journal import Journal, Session, now, write_journal
from hil.runs.run import MOTIONS, Run

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

    from hil.execution import Execute
    from hil.imports.map_file import MapFile
    from hil.imports.statement import Statement

MAPS = "maps"
"""Subfolder of a run with the unchanged maps."""
_UNKNOWN_DRIVE = dict.fromkeys(("gear_ratio", "rotor_inertia", "torque_constant"), UNKNOWN)
_NO_MOTOR: dict[str, float] = {"gear_ratio": 1, "rotor_inertia": 0}


def import_recordings(
    maps: Sequence[Path | str],
    output: Path | str,
    state: Callable[[Statement], None] = lambda _: None,
    progress: Callable[[Path, int], None] = lambda _, __: None,
    execute: Execute[OneMap, Statement] | None = None,
    files: Sequence[Path | str] = (),
) -> Run:
    """Make a run folder of recordings, with equal results for serial and parallel import.

    Parameters
    ----------
    maps : sequence of paths
        Map files of a single robot.
    output : path
        Run folder to be made.
    state : callable
        Function that receives the statement about each map's recording.
    progress : callable
        Function that receives the present file and its number of rows read; not called with
        `execute`.
    execute : callable, optional
        Function that imports several maps in parallel, on this machine or elsewhere
        (`hil.execution`). By default maps are imported in sequence in this process.
    files : sequence of paths
        Permitted files and folders outside the maps' own folders. Content of named files becomes
        part of the run, and a map may come from a stranger.

    Raises
    ------
    FileError
        A map or a recording cannot be used, or is contradictory; nothing is written. The message
        states the problems of all maps.

    Examples
    --------
    >>> hil.import_recordings(["examples/pan_tilt/other.yaml"], "runs/imported")
    <Run runs/imported: pan-tilt, 1 of 1 measurements>
    """
    output = Path(output)
    if output.exists() or output.is_symlink():
        raise FileError(f"{output}: already exists; choose another folder with -o")
    loaded = [_loaded(path, files) for path in maps]
    robots = [robot_of(the_map) for the_map in loaded]
    _refuse_differing(loaded, robots)
    # the prefixes of the motions' ids: file names of the maps, numbered where equal
    plain = [re.sub(r"[^A-Za-z0-9_.-]+", "-", m.path.stem).strip("-._")[:40] for m in loaded]
    stems: list[str] = []
    for number, name in enumerate(plain, start=1):
        stem = name or "map"
        while stem in stems or (plain.count(name) > 1 and stem == (name or "map")):
            stem = f"{stem}-{number}"
        stems.append(stem)
    with whole_folder(output) as folder:
        own_folder(folder / "recordings")
        own_folder(folder / MAPS)
        started = now()
        jobs = [
            OneMap(number, the_map, robots[0], folder, stem)
            for number, (the_map, stem) in enumerate(zip(loaded, stems, strict=True))
        ]
        if execute is None:
            statements = list(_import_serially(jobs, state, progress))
        else:
            # all jobs are awaited, so that none writes after a failure
            done: dict[int, Statement] = {}
            failed: dict[int, FileError] = {}
            for job, result in execute(import_one, [job.anywhere() for job in jobs]):
                if isinstance(result, FileError):
                    failed[job.number] = _named(job, result)
                elif isinstance(result, BrokenExecutor):
                    failed[job.number] = FileError(
                        f"{job.the_map.path}: a process ended before its maps were imported; memory"
                        " may be exhausted: give fewer --workers"
                    )
                elif isinstance(result, Exception):
                    raise result
                else:
                    done[job.number] = replace(result, the_map=jobs[job.number].the_map)
                    state(done[job.number])
            if failed:
                raise FileError("\n".join(str(error) for _, error in sorted(failed.items())))
            statements = [done[number] for number in range(len(jobs))]
        _write_about(folder, jobs, statements, started)
    return Run.open(output)


def _loaded(path: Path | str, files: Sequence[Path | str]) -> MapFile:
    if str(path).lower().endswith(KNOWN):
        raise FileError(
            f"{path}: is a recording, and a map states what its columns hold; draft one with:"
            f" hil import --draft {path} -o map.yaml"
        )
    return load_map(path, files)


def _import_serially(
    jobs: Sequence[OneMap],
    state: Callable[[Statement], None],
    progress: Callable[[Path, int], None],
) -> Iterator[Statement]:
    for job in jobs:
        try:
            statement = import_one(job, progress)
        except FileError as error:
            raise _named(job, error) if len(jobs) > 1 else error from error
        state(statement)
        yield statement


def _named(job: OneMap, error: FileError) -> FileError:
    """Return an error that names the map."""
    path = str(job.the_map.path)
    return error if str(error).startswith(path) else FileError(f"{path}: {error}")


def _write_about(
    folder: Path, jobs: Sequence[OneMap], statements: Sequence[Statement], started: str
) -> None:
    """Write all files except the recordings; `run.json` comes last, as in every run."""
    maps, robot = [job.the_map for job in jobs], jobs[0].robot
    digest = hashlib.sha256("".join(the_map.text for the_map in maps).encode()).hexdigest()
    content = RecordedMotions(
        robot=PlannedRobot(name=robot.name, digest=robot.digest),
        map_digest=digest,
        measurements=tuple(motion for statement in statements for motion in statement.motions),
    )
    for job in jobs:
        write_file(folder / MAPS / f"{job.stem}.yaml", job.the_map.text.encode())
    write_file(folder / "robot.yaml", robot.text.encode())
    write_file(folder / MOTIONS, content.text().encode())
    session = Session(
        started=started,
        ended=now(),
        reason="imported",
        bus=f"recordings of {', '.join(the_map.path.name for the_map in maps)}",
        simulated=False,
        notes=tuple(line for statement in statements for line in statement.lines()),
        warnings=tuple(each for statement in statements for each in statement.warnings),
    )
    journal = Journal(plan_digest=content.digest, robot_digest=robot.digest)
    write_journal(folder / "run.json", journal.add_session(session))


def _refuse_differing(maps: Sequence[MapFile], robots: Sequence[Robot]) -> None:
    for the_map, robot in zip(maps, robots, strict=True):
        if robot.digest != robots[0].digest:
            raise the_map.wrong(
                ("robot",),
                f"{robot.name} differs from the robot of {maps[0].path}, or uncertainties of "
                "gains or joints without motor differ; a run has one robot: import the maps into "
                "two runs",
            )
        if the_map.unknown_gains != maps[0].unknown_gains:
            raise the_map.wrong(
                ("joints",),
                f"joints of unknown gain differ from those in {maps[0].path}; state the gain of "
                "a joint in both maps, or in neither",
            )


def robot_of(the_map: MapFile) -> Robot:
    """Load the robot of a map, with the uncertainties of the map's gains.

    Raises
    ------
    FileError
        The robot is missing or cannot be used.
    """
    stated = the_map.content.robot
    name = str(stated.name)
    is_file = Path(name).suffix or len(Path(name).parts) > 1
    known = stated.urdf is None and (name in available_robots() or not is_file)
    path = None if known else the_map.resolve(stated.urdf or name, ("robot",))
    try:
        if path is None or stated.urdf is None:
            robot = Robot.load(path or name)
        else:
            robot = load_description(path, stated.base, stated.tip, stated.gravity)
    except (FileError, UnknownName) as error:
        raise the_map.wrong(("robot",), str(error)) from error
    # uncertainties of gains, and joints without motor: gains and torque constants both scale all
    # torques of a joint, but estimates use uncertainties of torque constants only; a joint without
    # motor has no unknown rotor and no unknown gear
    torques = [joint.torque for joint in the_map.content.joints]
    if len(torques) != robot.n_joints:
        return robot
    content = robot.file.model_dump(mode="json", exclude_none=True)
    changed = False
    for joint, torque in zip(content["joints"], torques, strict=True):
        drive = _UNKNOWN_DRIVE | joint.get("drive", {})
        if torque is None:
            more = {k: v for k, v in _NO_MOTOR.items() if drive[k] == UNKNOWN}
        else:
            relative = torque.gain_uncertainty / torque.gain_value
            more = {"torque_constant_uncertainty": relative} if relative else {}
        if more:
            joint["drive"], changed = drive | more, True
    if not changed:
        return robot
    text = yaml.safe_dump(content, sort_keys=False, width=200)
    about = [f"{NOT_TAKEN}{each}" for each in robot.not_taken]
    about.append(f"{robot.source}, with statements of the map on drives")
    return parse_robot("\n".join([*map(comment, about), text]), robot.source)
