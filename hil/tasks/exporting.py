"""Export of a model, or of a run's recordings, to files of other tools."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from checked_files.xml_file import XmlFile
from hil.errors import InvalidValue
from hil.estimation.consistent.conditions import BodyBounds
from hil.estimation.consistent.nearest import SHAPES
from hil.export.exported import origin, write_exported
from hil.export.formats import RECORDINGS, SIMULATORS, export_recordings, refuse_unknown
from hil.export.formats import export as formatted
from hil.export.patch import find_near_bodies, patched_file, write_patched
from hil.export.urdf_file import bodies_of, given_urdf, inertial_faults
from hil.export.watch_code import WATCHES, write_watch
from hil.results.consistency import find_consistent_robot
from hil.results.model import Model
from hil.results.model_file import file_of
from hil.results.watch import load_thresholds
from hil.runs.pooling import pooled
from hil.runs.run import Run

if TYPE_CHECKING:
    from collections.abc import Callable

    from hil.export.exported import Exported


def export(
    what: Model | Run | Path | str,
    to: str,
    output: Path | str,
    *,
    urdf: Path | str | None = None,
    patch: Path | str | None = None,
    masses: dict[int, tuple[float, float]] | None = None,
    watch: Path | str | None = None,
    force: bool = False,
) -> tuple[Path, ...]:
    """Export an identified model, or the recordings of a run, to files of other tools.

    Parameters
    ----------
    what : Model, Run or path
        Model, run, or the folder of an identified run.
    to : str
        Format: ``c``, ``python``, ``st``, ``json``, ``friction``, ``ros2``, ``urdf``, ``mjcf``,
        ``ranges`` of a model; ``csv``, ``parquet``, ``mcap`` of recordings.
    output : path
        Folder to write into.
    urdf : path, optional
        URDF of the robot; ``urdf`` and ``mjcf`` keep its shapes and names, ``mcap`` its names.
    patch : path, optional
        URDF for ``urdf``, or MJCF for ``mjcf``, of the robot, to be copied with the model's values
        and otherwise unchanged.
    masses : dict, optional
        Bounds on masses of links, from 1, for ``urdf`` and ``mjcf`` [kg].
    watch : path, optional
        Folder of a watch with this model; ``c``, ``python``, ``st`` and ``json`` get its alarms.
    force : bool
        True to export a model whose identification failed.

    Returns
    -------
    tuple of Path
        Written files.

    Raises
    ------
    UnknownName
        The format does not exist.
    InvalidValue
        A model for a format of recordings, or a model whose identification failed.
    FileError
        A file already exists, or cannot be written.

    Examples
    --------
    >>> [path.as_posix() for path in hil.export("runs/head", "c", "code")]
    ['code/pan_tilt_dynamics.h', 'code/example.c', 'code/CMakeLists.txt']
    """
    refuse_unknown(to)
    output = Path(output)
    urdf = None if urdf is None else Path(urdf)
    if to in RECORDINGS:
        if isinstance(what, Model):
            raise InvalidValue(f"{to} holds recordings; give a run, not a model")
        run = what if isinstance(what, Run) else Run.open(what)
        return exported_recordings(run, to, output, urdf)
    source = Path("model")
    if not isinstance(what, Model):
        source = what.path if isinstance(what, Run) else Path(what)
    model = what if isinstance(what, Model) else Model.load(source)
    if model.failed and not force:
        raise InvalidValue(f"the model's identification {model.verdict}; force=True exports it")
    bounds = BodyBounds(masses=masses) if masses else None
    patch = None if patch is None else Path(patch)
    watch = None if watch is None else Path(watch)
    exported = exported_model(model, to, source, urdf, bounds, patch, watch)[1]
    return write_exported(exported, output)


def exported_model(
    model: Model,
    to: str,
    source: Path,
    urdf: Path | None = None,
    bounds: BodyBounds | None = None,
    patch: Path | None = None,
    watch: Path | None = None,
) -> tuple[Model, Exported]:
    """Return a model with the exported bodies, and its files in a format; nothing is written.

    Parameters
    ----------
    source : path
        Model file, or the folder of its run.
    bounds : BodyBounds, optional
        Bounds for a new computation of the bodies.
    patch : path, optional
        File of the format, to be copied with changed values.
    watch : path, optional
        Folder of a watch, for the code of its alarms.

    Raises
    ------
    InvalidValue
        A `watch` for another format, a `patch` of another format or together with `urdf`, or a
        failed identification.
    Mismatch
        A `watch` of another model.
    """
    if patch is not None:
        root = XmlFile(patch).root.tag
        kind = {"mujoco": "mjcf", "robot": "urdf"}.get(root, "no simulator's file")
        if urdf is not None or kind != to:
            raise InvalidValue(
                f"{patch}: is {kind}, to be patched as {to}; a URDF is patched with --to urdf, an"
                " MJCF with --to mjcf, both without --urdf"
            )
        if model.failed:
            raise InvalidValue(
                f"the model's identification {model.verdict}, which a patched file cannot state: "
                "export without --patch"
            )
        file = patched_file(patch, model.robot)
        model = find_near_bodies(model, file, bounds or BodyBounds())
        return model, write_patched(model, file)
    given = None if urdf is None else given_urdf(urdf, model.robot)
    about = origin(model, source)
    if watch is not None and to not in WATCHES:
        raise InvalidValue(f"{to} has no alarms; export a watch to {', '.join(WATCHES)}")
    if to not in SIMULATORS:
        found = formatted(model, to, about, given)
        if watch is not None:
            alarms = write_watch(model, to, about, load_thresholds(watch, model))
            found = found._replace(files=found.files | alarms)
        return model, found
    unused: tuple[str, ...] = ()
    if given is not None and given.reader.file.root.find("link/inertial") is not None:
        faults = inertial_faults(given, model.robot)
        unused = tuple(
            f"{x}; until then {SHAPES} replace the inertials of all links" for x in faults
        )
    likely = None if given is None else bodies_of(given, model.robot)
    if model.consistent is None or bounds is not None or likely is not None:
        of = SHAPES if given is None or likely is None else f"the inertials of {given.path}"
        folder = file_of(source).parent
        own = pooled([Run.open(folder)]) if (folder / "run.json").exists() else ()
        model = find_consistent_robot(model, own, bounds or BodyBounds(), likely, of)
    found = formatted(model, to, (*about, *unused), given)
    return model, found._replace(remarks=(*unused, *found.remarks))


def exported_recordings(
    run: Run,
    to: str,
    output: Path,
    urdf: Path | None = None,
    progress: Callable[[str], None] = lambda _: None,
) -> tuple[Path, ...]:
    """Write the recordings of a run; errors as of `hil.export.formats.export_recordings`."""
    chain = () if urdf is None else given_urdf(urdf, run.robot).chain.joints
    return export_recordings(run, to, output, [joint.name for joint in chain], progress)
