"""Arguments shared by several commands, and their validation.

Options that belong together are a record, which a command takes as one parameter
(`expand_records`). The modules of commands import these and little else: help and completion of a
command load no numerics, no bus and no files; a command imports its dependencies when called.
"""

from __future__ import annotations

import os
import sys
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass, fields, is_dataclass
from functools import partial, wraps
from inspect import Parameter, signature
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal, ParamSpec, get_type_hints

import typer
from typer import Argument, Option
from typer.core import TyperGroup

from hil.runs import SIMULATED

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

    from _typeshed import DataclassInstance

    from hil.estimation.consistent.conditions import BodyBounds


METHODS = (
    "improved", "published", "joint", "back and forth", "free motion", "least squares",
    "weighted least squares", "instrumental variables",
)  # fmt: skip
FORMATS = (
    "c", "python", "st", "json", "friction", "ros2", "urdf", "mjcf", "ranges",
    "csv", "parquet", "mcap",
)  # fmt: skip
"""Names offered by completion; a test compares these with the accepted ones."""
_ROBOTS = Path(__file__).parents[1] / "robots"
_DRIVES = ".drives"


def robots(incomplete: str) -> list[str]:
    """Complete built-in robots and possible robot files."""
    names = sorted({path.stem.removesuffix(_DRIVES) for path in _ROBOTS.glob("*.yaml")})
    return [*_beginning(names, incomplete), *_paths(incomplete, {".yaml", ".yml", ".urdf"})]


def drives(incomplete: str) -> list[str]:
    """Complete robots with built-in drives and possible drives files."""
    found = _ROBOTS.glob(f"*{_DRIVES}.yaml")
    names = sorted(path.stem.removesuffix(_DRIVES) for path in found)
    return [*_beginning(names, incomplete), *_paths(incomplete, {".yaml", ".yml"})]


def methods(incomplete: str) -> list[str]:
    """Complete estimation methods."""
    return [name.replace(" ", "\\ ") for name in _beginning(METHODS, incomplete)]


def formats(incomplete: str) -> list[str]:
    """Complete formats of models and recordings."""
    return _beginning(FORMATS, incomplete)


def runs(incomplete: str) -> list[str]:
    """Complete folders of runs and their parents."""
    return list(_paths(incomplete, set()))


def files(incomplete: str) -> list[str]:
    """Complete YAML files and folders."""
    return list(_paths(incomplete, {".yaml", ".yml"}))


def _beginning(names: list[str] | tuple[str, ...], incomplete: str) -> list[str]:
    return [name for name in names if name.startswith(incomplete)]


def _paths(incomplete: str, suffixes: set[str]) -> Iterator[str]:
    """Yield files with these suffixes, and folders; only a run's folder ends the word."""
    before, _, begun = incomplete.rpartition("/")
    folder = Path(f"{before}/") if before or incomplete.startswith("/") else Path()
    if not folder.is_dir():
        return
    for path in sorted(folder.iterdir()):
        name = path.name
        if not name.startswith(begun) or (name.startswith(".") and not begun):
            continue
        shown = f"{before}/{name}" if "/" in incomplete else name
        if path.is_dir():
            yield shown if (path / "run.json").exists() else f"{shown}/"
        elif path.suffix in suffixes:
            yield shown


P = ParamSpec("P")
PLANT = "manutec-r15"
"""Default channel of the virtual plant, if neither a robot nor drives name one."""


RunPath = Annotated[Path, Argument(metavar="RUN", help="Run folder.", autocompletion=runs)]
RunPaths = Annotated[
    list[Path],
    Argument(metavar="RUN", help="Run folders, identified jointly.", autocompletion=runs),
]
Masses = Annotated[
    list[str] | None,
    Option(
        "--mass",
        metavar="LINK:MIN:MAX",
        help="Bounds on the mass of a link \\[kg], for physical consistency; may be repeated.",
    ),
]
Without = Annotated[
    list[str] | None,
    Option(
        "--without",
        metavar="ID",
        help="Measurement to exclude, such as a damaged one; may be repeated.",
    ),
]
Workers = Annotated[
    int | None, Option(min=1, help="Maximum number of parallel processes on this machine.")
]
LOCAL = "local"
Scheduler = Annotated[
    str | None,
    Option(
        help="Address of a Dask scheduler, such as tcp://host:8786; or local: a process per"
        " processor of this machine."
    ),
]
RobotName = Annotated[
    str,
    Argument(metavar="ROBOT", help="Built-in robot, or robot file.", autocompletion=robots),
]
PlanFile = Annotated[Path, Argument(metavar="PLAN", help="Plan file.", autocompletion=files)]
ModelPath = Annotated[
    Path,
    Option("--model", help="Model file, or folder of the identified run.", autocompletion=runs),
]
RobotOption = Annotated[
    str | None,
    Option(
        "--robot", help="Robot file in place of the path stated in the plan.", autocompletion=robots
    ),
]
WorkspaceOption = Annotated[
    Path | None,
    Option(
        "--workspace",
        help="Workspace file (joint ranges, forbidden boxes) in place of the plan's own.",
        autocompletion=files,
    ),
]
PlanWorkspace = Annotated[
    Path | None,
    Option(
        "--workspace",
        help="Workspace file: joint ranges and forbidden boxes that the plan respects.",
        autocompletion=files,
    ),
]
NoiseFrom = Annotated[
    Path | None,
    Option(
        help="Run from which noise is estimated; by default noise is as stated in the robot file.",
        autocompletion=runs,
    ),
]
Drives = Annotated[
    str,
    Argument(metavar="DRIVES", help="Drives file, or built-in robot.", autocompletion=drives),
]
RobotsDrives = Annotated[
    Path | None,
    Option(
        "--drives",
        help="Drives file; the built-in one of the robot by default.",
        autocompletion=files,
    ),
]
AxisName = Annotated[str, Argument(metavar="AXIS", help="Axis by name, or by number from 1.")]
Yes = Annotated[bool, Option("--yes", help="Consent to motion beforehand; no question is asked.")]
RealTime = Annotated[
    bool, Option("--realtime", help="Use real-time scheduling, as far as the system permits.")
]


Interface = Annotated[str, Option(help="Interface of python-can, such as socketcan, or ethercat.")]
RobotsChannel = Annotated[
    str | None,
    Option(
        help="Channel of the interface, such as can0; for sim_plant a virtual plant, by "
        "default that of the robot."
    ),
]
DrivesChannel = Annotated[
    str | None,
    Option(
        help="Channel of the interface, such as can0; by default the virtual plant with "
        "these drives."
    ),
]
BusOptions = Annotated[
    list[str] | None,
    Option(
        "--bus-option",
        metavar="KEY=VALUE",
        help="Additional option of the interface; may be repeated.",
    ),
]
BitRate = partial(Option, min=10_000, max=1_000_000)
"""Option for the bit rate of a CAN bus [bit/s]."""


Pacing = Literal["auto", "lock-step", "wall-clock"]
"""Clock of SYNC."""


def executor(
    workers: int | None, scheduler: str | None, jobs: int | None = None
) -> AbstractContextManager[Any]:
    """Return an executor of parallel jobs; None for a single job.

    By default it has a process per processor of this machine.
    """
    from hil import execution

    if scheduler not in (None, LOCAL):
        if workers is not None:
            raise typer.BadParameter(
                "--workers applies to this machine, not to a Dask cluster; omit --workers",
                param_hint="--workers",
            )
        return execution.cluster(scheduler)
    most = min(workers or os.cpu_count() or 1, jobs or sys.maxsize)
    return nullcontext() if jobs and most == 1 else execution.local(most)


@dataclass(frozen=True)
class RobotsBus:
    """Options for the bus of a robot's drives."""

    interface: Interface = SIMULATED
    channel: RobotsChannel = None
    drives_file: RobotsDrives = None
    bus_option: BusOptions = None
    pacing: Annotated[
        Pacing, Option(help="Clock of SYNC: this computer, or the virtual plant (lock-step).")
    ] = "auto"


@dataclass(frozen=True)
class DrivesBus:
    """Options for the bus of a drives file."""

    interface: Interface = SIMULATED
    channel: DrivesChannel = None
    bus_option: BusOptions = None


def expand_records(command: Callable[P, None]) -> Callable[..., None]:
    """Replace parameters that are records by the records' fields as options.

    Parameters
    ----------
    command : callable
        Command with data classes of options among its parameters, in the order of the help.
    """
    records: dict[str, type[DataclassInstance]] = {}
    options: list[Parameter] = []
    hints = get_type_hints(command, include_extras=True)
    for name, parameter in signature(command).parameters.items():
        if isinstance(kind := hints[name], type) and is_dataclass(kind):
            records[name] = kind
            own = get_type_hints(kind, include_extras=True)
            stated = [(each.name, each.default, own[each.name]) for each in fields(kind)]
        else:
            stated = [(name, parameter.default, kind)]
        options += [
            Parameter(each, Parameter.KEYWORD_ONLY, default=default, annotation=hint)
            for each, default, hint in stated
        ]

    @wraps(command)
    def expanded(*args: P.args, **given: P.kwargs) -> None:
        for name, kind in records.items():
            if name not in given:
                own = {each.name: given.pop(each.name) for each in fields(kind)}
                given[name] = kind(**own)
        command(*args, **given)

    vars(expanded)["__signature__"] = signature(command).replace(parameters=options)
    expanded.__annotations__ = {each.name: each.annotation for each in options}
    return expanded


def group_of(command: str) -> type[TyperGroup]:
    """Return a group class with `command` as default for arguments without a command's name."""

    class Group(TyperGroup):
        def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
            if args and args[0] not in {"-h", "--help", *self.commands}:
                args = [command, *args]
            return super().parse_args(ctx, args)

    return Group


def refuse_no_channel(interface: str, channel: str | None) -> None:
    """Refuse an interface without a channel, except for the virtual plant.

    Raises
    ------
    typer.BadParameter
        No channel is given.
    """
    if channel is None and interface != SIMULATED:
        raise typer.BadParameter(
            f"interface {interface} needs a channel too, such as can0 or eth0",
            param_hint="--channel",
        )


def parse_pairs(pairs: Sequence[str] | None) -> dict[str, object]:
    """Convert ``key=value`` to keyword arguments, with numbers and booleans recognised.

    Raises
    ------
    typer.BadParameter
        An option is not a name, ``=`` and a value.
    """
    options: dict[str, object] = {}
    for pair in pairs or ():
        key, separator, value = pair.partition("=")
        if not separator or not key.isidentifier():
            raise typer.BadParameter(f"{pair!r} must read key=value")
        options[key] = _value(value)
    return options


def _value(text: str) -> object:
    if text in {"true", "false"}:
        return text == "true"
    for kind in (int, float):
        try:
            return kind(text)
        except ValueError:
            continue
    return text


def body_bounds(masses: Sequence[str] | None) -> BodyBounds:
    """Parse bounds of masses, ``LINK:MIN:MAX``.

    Raises
    ------
    InvalidValue
        No body meets the bounds.
    """
    from hil.estimation.consistent.conditions import BodyBounds

    found = {}
    for text in masses or ():
        try:
            link, least, most = text.split(":")
            found[int(link)] = float(least), float(most)
        except ValueError as error:
            raise typer.BadParameter(
                f"{text} must be LINK:MIN:MAX, such as 2:10:40 for 10 to 40 kg of link 2",
                param_hint="--mass",
            ) from error
    return BodyBounds(masses=found)
