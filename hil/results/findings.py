"""`findings.json`: results of a run, cached in the run's folder until an input changes.

Estimation takes most of the time of a report, and for the same recordings the same program finds
the same results. Therefore the results of `hil identify` or `hil report` are kept with a digest of
everything that determines them: the recordings byte by byte, robot file, plan, journal,
measurements left out, further runs, the program and its numerical libraries. If any of these
changes, or if the file is damaged, the run is estimated anew. The file may be deleted at any time.

The format is JSON: records by their names and fields, arrays with all their digits. The robot is
not included, since it has its own file.
"""

from __future__ import annotations

import hashlib
import hmac
import json
import re
from contextlib import suppress
from dataclasses import fields, is_dataclass
from enum import Enum
from functools import cache
from importlib import import_module
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from checked_files.yaml_file import FileModel, read_text
from hil.errors import FileError, NotEnoughData, NotIdentifiable
from hil.estimation.estimate import MeasurementFit
from hil.estimation.identify import JOINT
from hil.estimation.options import DEFAULTS
from hil.results.provenance import RunStamp
from hil.runs.atomic_file import write_file
from hil.runs.pooling import recorded
from hil.runs.user_state import own_key
from hil.version import DISTRIBUTION

if TYPE_CHECKING:
    from collections.abc import Sequence

    from hil.arrays import Array
    from hil.estimation.options import Options
    from hil.friction.drift import Drift
    from hil.model.robot import Robot
    from hil.planning.measurement import RecordedMotion
    from hil.results.judgement import Reservation
    from hil.results.model import Model
    from hil.runs.recording import Recording
    from hil.runs.recording_file import Measured
    from hil.runs.run import Run

NAME = "findings.json"
FOLLOWS_FROM = ("results", "estimation", "friction", "least_squares", "model", "planning", "runs")
"""Packages of `hil` that determine the findings."""
LIBRARIES = (DISTRIBUTION, "numpy", "scipy", "numba", "h5py")
_DAMAGE = (
    FileError, ValueError, LookupError, TypeError, AttributeError, ImportError, RecursionError
)  # fmt: skip
_NUMBERS = re.compile(r"[<>|][biuf][1248]")


class Findings(NamedTuple):
    """Findings of a run with identifiable base parameters.

    Attributes
    ----------
    model : Model
        Model of `hil identify`, with the data of its estimation.
    check : Model or None
        Model by the published method, for comparison with the improved one; None if the
        measurements lack elements of some group.
    effect : ndarray or None
        Effect of the parameters' errors on torques (`hil.results.prediction.effect_of_errors`);
        None for imports alone.
    advice : tuple of Reservation
        Advice; none for imports, which cannot be repeated.
    drifts : tuple of Drift
        Time constants of friction, for axes with enough levels over time.
    """

    model: Model
    check: Model | None = None
    effect: Array | None = None
    advice: tuple[Reservation, ...] = ()
    drifts: tuple[Drift, ...] = ()


def found_in(
    run: Run, method: str, others: Sequence[Run] = (), campaign: Sequence[Measured] | None = None
) -> Findings:
    """Return the cached findings of a run, or identify the run; see `identify_and_keep`."""
    found = kept(run, others)
    if found is not None and found.model.method == method:
        return found
    return identify_and_keep(run, method, others, campaign)


def identify_and_keep(
    run: Run,
    method: str,
    others: Sequence[Run] = (),
    campaign: Sequence[Measured] | None = None,
    options: Options = DEFAULTS,
) -> Findings:
    """Identify a run, and cache the findings.

    Findings of several runs are not cached, since a report covers a single run. Findings with a
    prior are not cached either, since the report's conclusions are about recordings.

    Parameters
    ----------
    others : sequence of Run
        Runs identified jointly with `run`.
    campaign : sequence of Measured, optional
        All measurements of the run, if already read.

    Raises
    ------
    FileError
        Disk full, read-only folder, or a damaged recording.
    NotIdentifiable, NotEnoughData
        See `hil.results.identification.identified`.
    """
    # a report with cached findings needs no modules loaded here
    from hil.results.identification import identified  # noqa: PLC0415

    if (others and method != JOINT) or options.prior is not None:
        return Findings(identified(run, method, others, options=options).model)
    alone = run.imported and not others  # only a model: its large file is not read here
    if campaign is None:
        campaign = () if alone else tuple(run)
    recordings = tuple(recorded(campaign))
    made = identified(run, method, others, None if alone or others else recordings)
    found = follow_from(run, made.model, campaign, recordings)
    with suppress(FileError):  # in a read-only folder the findings are valid but not cached
        keep(run, found, others)
    return found


def follow_from(
    run: Run,
    model: Model,
    campaign: Sequence[Measured],
    recordings: Sequence[tuple[RecordedMotion, Recording]],
) -> Findings:
    """Derive all findings from a model."""
    from hil.estimation.friction.points import history  # noqa: PLC0415 - as above
    from hil.estimation.two_step_methods import fit_published  # noqa: PLC0415
    from hil.friction.drift import Level, drift  # noqa: PLC0415
    from hil.results.advice import CampaignResult, advice  # noqa: PLC0415
    from hil.results.identification import model_of  # noqa: PLC0415
    from hil.results.prediction import effect_of_errors  # noqa: PLC0415

    robot, check = run.robot, None
    if not isinstance(model.details, MeasurementFit):
        return Findings(model)
    if model.method == "improved":
        with suppress(NotIdentifiable, NotEnoughData):
            check = model_of(run, fit_published(robot, recordings))
    effect = effect_of_errors(model)
    past, local = history(robot, recordings), [each for each in model.local if each.friction > 0]
    levels = (
        (axis, [Level(v.time, v.friction, v.kind) for v in local if v.axis == axis])
        for axis in range(robot.n_joints)
    )
    drifts = tuple(filter(None, (drift(axis, own, past) for axis, own in levels)))
    if run.imported:
        return Findings(model, check, effect, drifts=drifts)
    said = advice(CampaignResult(model, effect, run.planned, campaign))
    return Findings(model, check, effect, said, drifts)


def keep(run: Run, found: Findings, others: Sequence[Run] = ()) -> None:
    """Write the findings of a run into its folder.

    Raises
    ------
    FileError
        Disk full, read-only folder.
    """
    content = json.dumps([_plain(each) for each in found])
    whole = {"state": _state(run, others), "digest": _digest(content), "content": content}
    write_file(run.path / NAME, json.dumps(whole).encode() + b"\n")


def kept(run: Run, others: Sequence[Run] = ()) -> Findings | None:
    """Read the cached findings; None for missing or outdated findings."""
    try:
        whole = json.loads(read_text(run.path / NAME))
        content = whole["content"]
        if whole["digest"] != _digest(content) or whole["state"] != _state(run, others):
            return None
        return Findings(*(_restored(each, run.robot) for each in json.loads(content)))
    except _DAMAGE:
        return None


def _state(run: Run, others: Sequence[Run]) -> str:
    """Return the digest of everything that determines the findings."""
    follows = [_program()]
    for each in (run, *others):
        stamp, journal = RunStamp.create(each), each.journal.model_dump_json()
        follows += stamp.robot_digest, stamp.plan_digest, stamp.recordings, journal
        follows += sorted(each.set_aside)
    return _digest("\n".join(follows))


@cache
def _program() -> str:
    """Return the digest of the program and of its numerical libraries."""
    digest = hashlib.sha256()
    place = Path(__file__).parents[1]
    for package in FOLLOWS_FROM:
        for path in sorted((place / package).rglob("*.py")):
            digest.update(path.read_bytes())
    for library in LIBRARIES:
        with suppress(PackageNotFoundError):  # numba is optional
            digest.update(f"{library} {version(library)}\n".encode())
    return digest.hexdigest()


def _digest(text: str) -> str:
    """Return a digest with the user's key, so that findings of other users are never accepted."""
    return hmac.digest(own_key(), text.encode(), "sha256").hex()


def _plain(value: Any) -> Any:
    """Convert a record to types of JSON."""
    found = value
    if isinstance(value, np.ndarray):
        found = {"array": value.tolist(), "kind": value.dtype.str}
    elif isinstance(value, FileModel):
        found = {"record": _name(type(value)), "fields": value.model_dump(mode="json")}
    elif isinstance(value, Enum):
        found = {"record": _name(type(value)), "value": value.value}
    elif is_dataclass(value) or hasattr(value, "_asdict"):
        names = [each.name for each in fields(value)] if is_dataclass(value) else value._fields
        own = {name: _plain(getattr(value, name)) for name in names if name != "robot"}
        found = {"record": _name(type(value)), "fields": own}
    elif isinstance(value, tuple):
        found = [_plain(each) for each in value]
    elif isinstance(value, dict):
        found = {"mapping": {key: _plain(each) for key, each in value.items()}}
    elif isinstance(value, np.generic):
        found = value.item()
    return found


def _name(kind: type) -> str:
    return f"{kind.__module__}:{kind.__qualname__}"


def _restored(found: Any, robot: Robot) -> Any:
    """Restore a record converted by `_plain`; `robot` is the robot of its models."""
    if isinstance(found, list):
        return tuple(_restored(each, robot) for each in found)
    if not isinstance(found, dict):
        return found
    if "array" in found:
        if not _NUMBERS.fullmatch(found["kind"]):
            raise ValueError(f"{found['kind']} must be numbers of at most 8 bytes")
        return np.array(found["array"], dtype=found["kind"])
    if "mapping" in found:
        return {key: _restored(each, robot) for key, each in found["mapping"].items()}
    return _record(found, robot)


def _record(found: dict[str, Any], robot: Robot) -> Any:
    module, _, name = found["record"].partition(":")
    # the file may come from a stranger: only records defined in modules of the program are created
    if not module.startswith(tuple(f"hil.{each}." for each in FOLLOWS_FROM)):
        raise ValueError(f"{module} must be a module of results")
    kind = getattr(import_module(module), name)
    is_record = is_dataclass(kind) or issubclass(kind, FileModel | Enum | tuple)
    if _name(kind) != found["record"] or not is_record:
        raise ValueError(f"{name} must be a record of {module}")
    if "value" in found and issubclass(kind, Enum):
        return kind(found["value"])
    if issubclass(kind, FileModel):
        return kind.model_validate(found["fields"])
    own = {key: _restored(each, robot) for key, each in found["fields"].items()}
    with_robot = is_dataclass(kind) and "robot" in (each.name for each in fields(kind))
    return kind(robot=robot, **own) if with_robot else kind(**own)
