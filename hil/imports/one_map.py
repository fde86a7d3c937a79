"""One map and its recording into the motions of a run folder, here or in another process."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from checked_files.yaml_file import FileError
from hil.imports.excerpt import excerpts_of
from hil.imports.motions import measured_motions, numbered_pieces
from hil.imports.plausibility import suspicions
from hil.imports.samples import read_samples
from hil.imports.segments import chosen_rows
from hil.imports.spikes import spike_suspicions
from hil.imports.stamps import WrongStamps, timing_of
from hil.imports.statement import Statement
from hil.planning.free_motion import FreeMotion
from hil.runs.recording_file import write_measured

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence
    from pathlib import Path

    from hil.imports.map_file import MapFile
    from hil.imports.samples import Samples
    from hil.imports.stamps import Timing
    from hil.imports.suspicion import Suspicion
    from hil.model.robot import Robot
    from hil.runs.recording_file import Measured


@dataclass(frozen=True)
class OneMap:
    """What is to be done for one map; all of it can be sent to another process.

    Attributes
    ----------
    number : int
        Among the maps of the run, from 0.
    the_map : MapFile
    robot : Robot
        Of the run.
    folder : Path
        Of the run, with a folder `recordings`.
    stem : str
        Begin of the ids of the motions.
    """

    number: int
    the_map: MapFile
    robot: Robot
    folder: Path
    stem: str

    def anywhere(self) -> OneMap:
        """The same, with paths that hold in whatever folder a process works."""
        the_map = replace(self.the_map, path=self.the_map.path.absolute())
        return replace(self, the_map=the_map, folder=self.folder.absolute())


def import_one(
    job: OneMap, progress: Callable[[Path, int], None] = lambda _, __: None
) -> Statement:
    """Write the motions of one map into a run folder.

    Raises
    ------
    FileError
        The recording cannot be used, or contradicts itself.
    """
    the_map, robot = job.the_map, job.robot
    scratch = job.folder / f"{job.stem}.samples"
    samples = read_samples(the_map, robot, scratch, progress)
    scratch.unlink()  # what is mapped stays until it is no longer used
    timing = _timing(the_map, samples)
    spikes = list(spike_suspicions(samples, timing.stretches, robot))
    _refuse(the_map, spikes)
    numbered = numbered_pieces(the_map, samples, timing)
    excerpts = excerpts_of(samples, [piece for piece, _ in numbered])
    alone = the_map.content.kind
    found = suspicions(excerpts, robot, None if alone is None else alone - 1, the_map.unknown_gains)
    _refuse(the_map, found)
    recorded = tuple(joint.velocity is not None for joint in the_map.content.joints)
    measured = measured_motions(the_map, samples, numbered, job.stem)
    motions = tuple(_written(each, job.folder, job.robot) for each in measured)
    return Statement(the_map, timing.summary(), samples.wraps, recorded, motions, (*spikes, *found))


def _refuse(the_map: MapFile, found: Sequence[Suspicion]) -> None:
    """Refuse what contradicts itself for certain, unless the map accepts it."""
    refusing = [s for s in found if s.certain and s.check not in the_map.content.accept]
    if refusing:
        remedy = "; if it is right as it is, write accept: [{}]"
        lines = (the_map.wrong(s.location, s.message + remedy.format(s.check)) for s in refusing)
        raise FileError("\n".join(map(str, lines)))


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
