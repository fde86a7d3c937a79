"""``python -m sim_plant``: serve a plant on any python-can bus, or draft the plant of a robot."""

from __future__ import annotations

import threading
from contextlib import closing, nullcontext
from pathlib import Path  # noqa: TC003 - typer reads the annotations
from typing import TYPE_CHECKING, Annotated, Any

import can
import typer
from typer.core import TyperGroup

from checked_files.yaml_file import FileError
from sim_plant.faults.fault_plan import load_fault_plan
from sim_plant.serving.hand import Hand
from sim_plant.serving.server import serve
from sim_plant.slave_network import CLOCKS, CYCLE_DEFAULT, Clock
from sim_plant.switch_on import load_machine

if TYPE_CHECKING:
    from contextlib import AbstractContextManager

    from sim_plant.faults.fault_plan import FaultPlan
    from sim_plant.machine_protocol import Machine
    from sim_plant.plant import Plant

SERVE, ETHERCAT = "serve", "ethercat"


class _ServesByDefault(TyperGroup):
    """Command group with `serve` as the default command."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Return the arguments, the command first."""
        if args and args[0] not in {"-h", "--help"} and args[0] not in self.commands:
            args = [SERVE, *args]
        return super().parse_args(ctx, args)


app = typer.Typer(
    cls=_ServesByDefault,
    add_completion=False,
    pretty_exceptions_enable=False,
    no_args_is_help=True,
    help="Virtual machines with simulated drives that speak CANopen or EtherCAT.",
    context_settings={"help_option_names": ["-h", "--help"]},
)


@app.command(SERVE)
def main(
    interface: Annotated[
        str, typer.Option(help="python-can interface, e.g. socketcan; or ethercat.")
    ],
    channel: Annotated[
        str, typer.Option(help="Channel, e.g. vcan0; for ethercat a network interface.")
    ],
    plant: Annotated[str, typer.Option(help="Packaged plant or plant file.")] = "manutec-r15",
    seed: Annotated[
        int | None, typer.Option(min=0, help="Random seed, instead of the file's.")
    ] = None,
    clock: Annotated[str, typer.Option(help="sync: time advances by SYNC; or wall.")] = "sync",
    bus_option: Annotated[
        list[str] | None, typer.Option(help="key=value for the interface; may be repeated.")
    ] = None,
    personality: Annotated[str | None, typer.Option(help="Name or path, for all drives.")] = None,
    cycle: Annotated[
        float, typer.Option(min=1e-4, max=10, help="SYNC period of drives without 1006h \\[s].")
    ] = CYCLE_DEFAULT,
    faults: Annotated[
        str | None, typer.Option(help="Fault plan with the faults to inject.")
    ] = None,
    hand: Annotated[
        str | None, typer.Option(help="Path of a new socket for pushes of the arm.")
    ] = None,
) -> None:
    """Serve the simulated plant's drives on a bus until Ctrl-C (the default command)."""
    try:
        options, passing = _options(bus_option or []), _clock(clock)
        machine = load_machine(plant, seed, personality)
        fault_plan = load_fault_plan(faults) if faults else None
        if interface == ETHERCAT:
            if options or hand:
                raise ValueError(  # noqa: TRY301
                    f"{'--bus-option' if options else '--hand'}: not for interface ethercat; omit"
                )
            _serve_ethercat(channel, plant, machine, passing, fault_plan, cycle)
            return
        with _open(interface, channel, options) as bus, _hand(hand, machine) as pushing:
            typer.echo(_announcement(machine, plant, bus.channel_info, passing))
            serve(bus, machine, passing, threading.Event(), fault_plan, cycle, pushing)
    except KeyboardInterrupt:
        typer.echo("stopped")
    except (FileError, can.CanError, ValueError, OSError) as error:
        typer.echo(f"sim_plant: {error or type(error).__name__}", err=True)
        raise typer.Exit(1) from None


@app.command()
def twin(
    robot: Annotated[Path, typer.Argument(help="Robot file.")],
    output: Annotated[Path, typer.Option("-o", "--output", help="Folder for both files.")],
) -> None:
    """Write plant file and drives file of a robot's virtual twin."""
    from sim_plant.twin.write import write_twin  # noqa: PLC0415 - serving needs none of it

    try:
        typer.echo(write_twin(robot, output))
    except (FileError, OSError) as error:
        typer.echo(f"sim_plant: {error}", err=True)
        raise typer.Exit(1) from None


@app.command()
def esi(
    axis: Annotated[int, typer.Option(min=1, help="Number of the axis, from 1.")],
    output: Annotated[Path, typer.Option("-o", "--output", help="File to write.")],
    plant: Annotated[str, typer.Option(help="Packaged plant or plant file.")] = "manutec-r15",
    personality: Annotated[str | None, typer.Option(help="Name or path.")] = None,
) -> None:
    """Write the EtherCAT description (ESI) of a drive, for a master's configuration tool."""
    from sim_plant.ethercat.esi import write_esi  # noqa: PLC0415 - CAN needs none of it
    from sim_plant.ethercat.objects import drive_objects, strip_can  # noqa: PLC0415

    try:
        drives = load_machine(plant, None, personality).drives
        if axis > len(drives):
            raise ValueError(f"--axis {axis}: must be at most {len(drives)}")  # noqa: TRY301
        drive = drives[axis - 1]
        text = write_esi(drive_objects(strip_can(drive.personality)), drive)
        output.write_text(text, encoding="utf-8")
        typer.echo(f"{output}: drive of {drive.name}")
    except (FileError, ValueError, OSError) as error:
        typer.echo(f"sim_plant: {error}", err=True)
        raise typer.Exit(1) from None


def _serve_ethercat(
    channel: str, plant: str, machine: Plant, clock: Clock, faults: FaultPlan | None, cycle: float
) -> None:
    from sim_plant.ethercat.segment import Segment  # noqa: PLC0415 - CAN needs none of it
    from sim_plant.faults.faulty_segment import FaultySegment  # noqa: PLC0415
    from sim_plant.serving.raw_ethernet import open_interface, serve_frames  # noqa: PLC0415

    with open_interface(channel) as wire:
        segment = (
            Segment(machine, clock, cycle)
            if faults is None
            else FaultySegment(machine, clock, faults, cycle)
        )
        segment.power_on()
        typer.echo(_announcement(machine, plant, f"EtherCAT on {channel}", clock))
        serve_frames(wire, segment, clock, threading.Event())


def _open(interface: str, channel: str, options: dict[str, str]) -> can.BusABC:
    try:
        return can.Bus(channel, interface=interface, **options)  # type: ignore[arg-type]
    except Exception as error:  # back ends without their vendor's library raise errors of any type
        raise can.CanInitializationError(
            f"{interface} channel {channel!r} cannot be opened: {error}; check channel and"
            " options, and an adapter's cable and driver where the interface has one"
        ) from error


def _hand(path: str | None, machine: Plant) -> AbstractContextManager[Hand | None]:
    return nullcontext() if path is None else closing(Hand(path, machine))


def _options(pairs: list[str]) -> dict[str, str]:
    for pair in pairs:
        if "=" not in pair:
            raise ValueError(f"--bus-option {pair}: must be key=value")
    return dict(pair.split("=", 1) for pair in pairs)


def _clock(text: str) -> Clock:
    for clock in CLOCKS:
        if clock == text:
            return clock
    raise ValueError(f"--clock {text}: must be one of {', '.join(CLOCKS)}")


def _announcement(machine: Machine, plant: str, bus: object, clock: Clock) -> str:
    drives = ", ".join(f"{drive.node_id} {drive.name}" for drive in machine.drives)
    passing = "its time advances by SYNC" if clock == "sync" else "on the wall clock"
    return (
        f"Simulated plant {plant}, {passing}: no real machine moves.\n"
        f"Nodes {drives} on {bus}. Ctrl-C ends it."
    )


if __name__ == "__main__":
    app()
