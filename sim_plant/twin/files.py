"""Text of a twin's plant file and drives file."""

from __future__ import annotations

from typing import TYPE_CHECKING

from checked_files.yaml_text import comment, scalar
from checked_files.yaml_text import number as _n
from sim_plant.build import PRODUCT_CODE, REVISION, VENDOR_ID
from sim_plant.twin.draft import SYNC_PERIOD

if TYPE_CHECKING:
    from collections.abc import Iterator

    from pydantic import BaseModel

    from sim_plant.plant_file import PlantAxis, PlantFile
    from sim_plant.twin.draft import Twin

PLANT, DRIVES = "plant.yaml", "drives.yaml"


def plant_text(file: PlantFile, source: str) -> str:
    """Return the text of the plant file; `source` names the robot file."""
    loops = file.loops
    noise = f"{{torque: {_n(file.noise.torque)}, ripple: {_n(file.noise.ripple)}}}"
    head = [
        comment(
            f"A virtual twin of {source}: frames, ranges, limits and drive trains are those of the"
        ),
        "# robot file, the rest is assumed, scaled from the limits. Change it freely; the link",
        "# parameters are the truth for an identification. Joint side is rad and N m, or m and N.",
        f"name: {scalar(file.name)}",
        f"seed: {file.seed}",
        "drift: true",
        f"gravity: [{', '.join(_n(g) for g in file.gravity)}] # m/s2, in the base frame",
        f"loops: {{position: {_n(loops.position)}, velocity: {_n(loops.velocity)},"
        f" integral: {_n(loops.integral)}}} # 1/s",
        f"noise: {noise} # shares of peak torque",
        "axes:",
    ]
    return "\n".join([*head, *(line for axis in file.axes for line in _plant_axis(axis)), ""])


def _plant_axis(axis: PlantAxis) -> Iterator[str]:
    drive = axis.drive
    yield f"  - name: {scalar(axis.name)}"
    yield f"    joint: {axis.joint}"
    yield f"    frame: {{{_stated(axis.frame)}}}"
    yield f"    link: {{{_stated(axis.link)}}}"
    yield f"    position: {_n(axis.start)}"
    yield "    drive:"
    yield (
        f"      {{node: {drive.node}, gear_ratio: {_n(drive.gear_ratio)},"
        f" rotor_inertia: {_n(drive.rotor_inertia)}, torque_constant: {_n(drive.torque_constant)},"
    )
    yield (
        f"       rated_torque_mNm: {drive.rated_torque_mNm},"
        f" rated_current_mA: {drive.rated_current_mA}, peak_torque: {_n(drive.peak_torque)},"
    )
    yield (
        f"       increments: {drive.increments}, direction: {drive.direction}, zero: {drive.zero},"
        f" velocity_max: {_n(drive.velocity_max)}, acceleration_max: {_n(drive.acceleration_max)},"
    )
    low, high = drive.reach
    yield f"       range: [{_n(low)}, {_n(high)}], load_inertia: {_n(drive.load_inertia)}}}"
    friction = axis.friction
    yield (
        f"    friction: {{creep: {_n(friction.creep)}, full_speed: {_n(friction.full_speed)},"
        f" heat_time: {_n(friction.heat_time)}, asymmetry: {_n(friction.asymmetry)},"
        f" presliding: {_n(friction.presliding)}}}"
    )


def _stated(part: BaseModel) -> str:
    """Return the non-zero values of a part as text."""
    values = part.model_dump()
    return ", ".join(f"{key}: {_n(value)}" for key, value in values.items() if value)


def drives_text(twin: Twin, source: str) -> str:
    """Return the text of the drives file; `source` names the robot file."""
    head = [
        comment(
            f"Drives of the virtual twin of {source}, as its plant file has them. Joint side and SI"
        ),
        "# unless said otherwise. A real machine needs its own drives file: hil drives new.",
        "bitrate: 1000000 # bit/s",
        f"sync_period: {_n(SYNC_PERIOD)} # s",
        "master_node: 127",
        "heartbeat_period: 0.1 # s",
        "heartbeat_timeout: 0.5 # s",
        "quick_stop_option: 2 # 605A: quick stop ramp, then off",
        "",
        "axes:",
    ]
    axes = [line for number in range(len(twin.file.axes)) for line in _drives_axis(twin, number)]
    return "\n".join([*head, *axes, ""])


def _drives_axis(twin: Twin, number: int) -> Iterator[str]:
    axis = twin.file.axes[number]
    drive, (low, high) = axis.drive, axis.drive.reach
    unit = "rad" if axis.joint == "revolute" else "m"
    yield f"  - name: {scalar(axis.name)}"
    yield f"    node: {drive.node}"
    yield (
        f"    identity: {{vendor: {VENDOR_ID:#x}, product: {PRODUCT_CODE:#x},"
        f" revision: {REVISION:#x}}}"
    )
    yield f"    joint: {axis.joint}"
    yield f"    gear_ratio: {_n(drive.gear_ratio)}" + (" # rad/m" if unit == "m" else "")
    yield f"    sign: {drive.direction}"
    yield f"    zero: {drive.zero} # increments at q = 0"
    yield f"    increments_per_revolution: {drive.increments}"
    yield "    velocity_unit: inc/s"
    yield "    acceleration_unit: inc/s^2"
    yield (
        "    current: {index: 0x6078, type: i16, basis: per mille of rated current,"
        " amplitude: peak}"
    )
    yield f"    rated_current: {_n(drive.rated_current_mA / 1e3)} # A"
    yield f"    rated_torque: {_n(drive.rated_torque_mNm / 1e3)} # N m, of the motor"
    yield f"    torque_constant: {_n(drive.torque_constant)} # N m/A, of the motor"
    yield "    torque_constant_amplitude: peak"
    yield (
        f"    limits: {{q_min: {_n(low)}, q_max: {_n(high)}, velocity: {_n(drive.velocity_max)},"
        f" acceleration: {_n(drive.acceleration_max)}, torque: {_n(drive.peak_torque)}}}"
    )
    yield f"    following_error_window: {_following_error_window(twin, number):.2g} # {unit}"
    yield "    following_error_time: 0.05 # s"
    yield f"    position_window: {_position_window(axis):.2g} # {unit}"
    yield "    position_window_time: 0.02 # s"
    yield (
        f"    homing: {{method: 17, position: {_n(low)}, velocity: {drive.velocity_max / 10:.3g},"
        f" creep: {drive.velocity_max / 100:.3g}, acceleration: {drive.acceleration_max / 10:.3g}}}"
    )


def _following_error_window(twin: Twin, number: int) -> float:
    """Return eight times the following error of the peak torque without integral action."""
    drive, loops = twin.file.axes[number].drive, twin.file.loops
    inertia = drive.motor_inertia + drive.load_inertia
    return 8 * drive.peak_torque / (inertia * loops.velocity * loops.position)


def _position_window(axis: PlantAxis) -> float:
    """Return a 3000th of the range, at least 5 increments and 3 presliding distances."""
    drive, (low, high) = axis.drive, axis.drive.reach
    increment = 6.3 / drive.increments / drive.gear_ratio
    return max((high - low) / 3000, 5 * increment, 3 * axis.friction.presliding)
