"""Arguments that several commands take, and what is refused about them in the same words."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from checked_files.yaml_file import FileError
from hil.runs.journal import SIMULATED

if TYPE_CHECKING:
    from collections.abc import Sequence

PLANT = "manutec-r15"
"""Channel of the virtual plant where neither a robot nor drives name one."""

RunPath = Annotated[Path, typer.Argument(help="Folder of a run.")]
RobotName = Annotated[str, typer.Argument(help="Name, or path of a robot file.")]
NewPlan = Annotated[Path, typer.Option("-o", "--output", help="Plan to write.")]
BusOptions = Annotated[
    list[str] | None,
    typer.Option("--bus-option", help="key=value for python-can, may be repeated."),
]
RealTime = Annotated[
    bool, typer.Option("--realtime", help="Use what this system grants of real time.")
]


def refuse_existing(output: Path) -> None:
    """Refuse to write over a file.

    Raises
    ------
    FileError
        It is there.
    """
    if output.exists():
        raise FileError(f"{output}: is there already; remove it or choose another name with -o")


def refuse_no_channel(interface: str, channel: str | None) -> None:
    """Refuse an interface without a channel, save that of the virtual plant.

    Raises
    ------
    typer.BadParameter
        There is no channel.
    """
    if channel is None and interface != SIMULATED:
        raise typer.BadParameter(
            f"interface {interface} needs a channel too, such as can0", param_hint="--channel"
        )


def bus_options(pairs: Sequence[str] | None) -> dict[str, object]:
    """Turn ``key=value`` into keyword arguments: numbers and true or false become such.

    Raises
    ------
    typer.BadParameter
        Something else than a name, ``=`` and a value.
    """
    options: dict[str, object] = {}
    for pair in pairs or ():
        key, separator, value = pair.partition("=")
        if not separator or not key.isidentifier():
            raise typer.BadParameter(f"{pair!r} must read key=value, such as bitrate=1000000")
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
