"""Options of the live page and stream, shared by the measuring commands."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Any, cast

import typer
from typer.core import TyperCommand

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from typer.models import OptionInfo

    from hil.live.listener import Listener

PORTS = {"--live": 8420, "--foxglove": 8765}
"""Options with a port, and the default ports."""
LOOPBACK = "127.0.0.1"


def _address(value: str | None) -> str | None:
    """Refuse an invalid IP address."""
    from ipaddress import ip_address

    if value is not None:
        try:
            ip_address(value)
        except ValueError:
            raise typer.BadParameter(
                f"{value!r} is not an IP address; give that of an interface of this computer, "
                "such as 192.168.0.5, or 0.0.0.0 for all"
            ) from None
    return value


def _address_options(option: str, what: str, elsewhere: str) -> tuple[OptionInfo, OptionInfo]:
    """Create the options for port and address of a live display."""
    port = typer.Option(
        option, metavar="PORT", min=0, max=65535,
        help=f"{what}; port {PORTS[option]} unless one is given, 0 for a free one.",
    )  # fmt: skip
    address = typer.Option(
        f"{option}-address", metavar="ADDRESS", callback=_address, help=elsewhere
    )
    return cast("OptionInfo", port), cast("OptionInfo", address)


def hand_of(bus_option: Sequence[str] | None) -> str:
    """Return the path of the virtual plant's push interface from the bus options, or ""."""
    given = [each.removeprefix("hand=") for each in bus_option or () if each.startswith("hand=")]
    return given[-1] if given else ""


_LIVE, _LIVE_ADDRESS = _address_options(
    "--live",
    "Show the run on a page in the browser of this computer",
    "Serve the live page to other computers at this IP address; its URL contains a secret.",
)
_FOXGLOVE, _FOXGLOVE_ADDRESS = _address_options(
    "--foxglove",
    "Stream the run to Foxglove on this computer",
    "Stream to Foxglove on other computers at this IP address, without access control.",
)


class PortsOptional(TyperCommand):
    """Command that inserts default ports after the options in `PORTS`."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Parse arguments after the insertion of default ports."""
        parsed: list[str] = super().parse_args(ctx, insert_ports(args))
        return parsed


def insert_ports(arguments: list[str]) -> list[str]:
    """Insert the default port after every option in `PORTS` without a number."""
    found = []
    for word, after in zip(arguments, [*arguments, ""][1:], strict=True):
        found.append(word)
        if word in PORTS and not after.lstrip("-").isdecimal():
            found.append(str(PORTS[word]))
    return found


@dataclass(frozen=True)
class Shown:
    """Options for the live display of a run."""

    live: Annotated[int | None, _LIVE] = None
    live_address: Annotated[str | None, _LIVE_ADDRESS] = None
    foxglove: Annotated[int | None, _FOXGLOVE] = None
    foxglove_address: Annotated[str | None, _FOXGLOVE_ADDRESS] = None


def listeners(
    shown: Shown,
    bus_option: Sequence[str] | None = None,
    folder: Path | None = None,
    *,
    while_open: bool = False,
) -> list[Listener]:
    """Create the processes informed of the run.

    Parameters
    ----------
    bus_option : sequence of str, optional
        Options of the bus, for access to the virtual plant's hand from the page.
    folder : Path, optional
        Run folder whose recordings are identified while the page shows the run.
    while_open : bool
        Stop the run once its page has been closed, and show the report of `folder` on the page when
        finished.

    Raises
    ------
    typer.BadParameter
        An address for a display that is not served.
    """
    page = "--live", "the live page", "hil.live.page_server"
    stream = "--foxglove", "the stream to Foxglove", "hil.live.foxglove_server"
    found = []
    pushed = ["--hand", hand] if (hand := hand_of(bus_option)) else []
    if while_open:
        pushed += ["--while-open"]
        pushed += ["--report", str(folder / "report.html")] if folder is not None else []
    for option, what, module, port, address, more in (
        (*page, shown.live, shown.live_address, pushed),
        (*stream, shown.foxglove, shown.foxglove_address, ()),
    ):
        if port is not None:
            found.append((what, module, address or LOOPBACK, str(port), *more))
        elif address is not None:
            raise typer.BadParameter(
                f"needs {option}; add {option}", param_hint=f"{option}-address"
            )
    if not found:
        return []
    from hil.live.listener import Listener

    started = [Listener(*each) for each in found]
    if shown.live is not None and folder is not None:
        estimator = "the estimation during the run", "hil.live.estimator", str(folder)
        started.append(Listener(*estimator, answers=True))
    return started
