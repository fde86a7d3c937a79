"""Fault plans: kind, place, start and duration of faults, as data.

A fault plan is a list of faults, in YAML or built in Python::

    faults:
      - {what: tpdo-lost, axis: 2, at: {set_point: 3, after: 0.2}, lasts: {syncs: 1}}
      - {what: fault, axis: 1, code: 0x2310, at: {time: 12.5}}

The plant sees frames, so "at a measurement" means at one of its strokes: `When.set_point` counts
the set-points of an axis.
"""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from pydantic import Field, model_validator

from checked_files.yaml_file import FileError, FileModel, load_yaml

if TYPE_CHECKING:
    from typing import Self

NotNegative = Annotated[float, Field(ge=0)]
Positive = Annotated[float, Field(gt=0)]
Count = Annotated[int, Field(ge=1)]


class What(StrEnum):
    """Kinds of faults."""

    TPDO_LOST = "tpdo-lost"
    """Loss of the drive's process data."""
    TPDO_DOUBLED = "tpdo-doubled"
    TPDO_LATE = "tpdo-late"
    """Delay of the drive's process data until the drives receive the next frame."""
    SDO_SILENT = "sdo-silent"
    SDO_ABORTED = "sdo-aborted"
    """Refusal of every request with `code`."""
    WARNING = "warning"
    """EMCY `code` without a fault; the drive continues to work."""
    FAULT = "fault"
    """EMCY `code`, fault reaction, FAULT."""
    NODE_RESET = "node-reset"
    HEARTBEAT_LOST = "heartbeat-lost"
    """Loss of the drive's heartbeat."""
    MASTER_HEARTBEAT_LOST = "master-heartbeat-lost"
    """Loss of the master's heartbeat, for all drives."""
    BUS_OFF = "bus-off"
    """Bus-off of the drive's controller; the drive continues to work."""
    ADAPTER_BUS_OFF = "adapter-bus-off"
    """Bus-off of the master's controller: no frame is sent or received."""
    TRANSMIT_OUTAGE = "transmit-outage"
    """Refusal of every frame by the master's adapter, which still receives."""
    RECEIVE_OUTAGE = "receive-outage"
    """Loss of all frames from the drives; frames of the master arrive."""
    CABLE_CUT = "cable-cut"
    """Cable cut between the master and all drives."""
    VOLTAGE_LOST = "voltage-lost"
    """Loss of the DC link: EMCY 3220, FAULT, brake; the drive's controller continues to work."""
    STO_ACTIVE = "sto-active"
    """Safe torque off: no torque, brake, and the drive does not leave SWITCH ON DISABLED."""
    SUPPLY_LOST = "supply-lost"
    """Loss of all supply, the brake closed; the drive boots when the supply returns."""
    ENCODER_JUMP = "encoder-jump"
    """Jump by `size` increments. The control loop follows the encoder."""
    CURRENT_OFFSET = "current-offset"
    """Offset of `size` per mille of rated current."""
    CURRENT_CLIPPED = "current-clipped"
    """Clipping at +- `size` per mille of rated current."""
    CURRENT_STUCK = "current-stuck"
    """Constant reading."""
    POSITION_SLOW = "position-slow"
    """Position refreshed only once per `size` (key of the fault) in ms."""
    CURRENT_SLOW = "current-slow"
    """Current refreshed only once per `size` in ms."""
    BRAKE_CLOSED = "brake-closed"
    """Brake closed on an energised axis."""
    AXIS_WEAK = "axis-weak"
    """Torque of at most `size` per mille of the rated torque: the axis does not follow."""
    PUSH = "push"
    """External torque or force on the joint, `size` [N m or N]."""
    SEGMENT_CUT = "segment-cut"
    """EtherCAT: cable cut between the drive and the preceding drive."""
    FRAMES_LOST = "frames-lost"
    """EtherCAT: random loss of `size` % of the frames on their way back."""
    FRAME_LATE = "frame-late"
    """EtherCAT: delay of every frame until the next frame is sent."""
    AL_ERROR = "al-error"
    """EtherCAT: the slave falls to SAFEOP with AL status code `code`."""
    ALIAS = "alias"
    """EtherCAT: alias of the slave equal to `size`, possibly also the alias of another slave."""
    CLOCK_DRIFT = "clock-drift"
    """EtherCAT: the slave's clock is too fast by `size` parts per million."""
    QUICK_STOP_IGNORED = "quick-stop-ignored"
    """Quick stop by controlword is ignored: the drive stays in OPERATION ENABLED and continues its
    move.
    """
    DISABLE_VOLTAGE_IGNORED = "disable-voltage-ignored"
    """Disable voltage, shutdown and disable operation by controlword are ignored; after a quick
    stop the drive stays in QUICK STOP ACTIVE, regardless of 605A."""
    STOP_WITHOUT_EFFECT = "stop-without-effect"
    """The drive shows QUICK STOP ACTIVE, but the axis continues to its target."""


_WITHOUT_AXIS = {
    What.MASTER_HEARTBEAT_LOST,
    What.ADAPTER_BUS_OFF,
    What.TRANSMIT_OUTAGE,
    What.RECEIVE_OUTAGE,
    What.CABLE_CUT,
    What.FRAMES_LOST,
    What.FRAME_LATE,
}
_WITH_CODE = {What.SDO_ABORTED, What.WARNING, What.FAULT, What.AL_ERROR}
_WITH_SIZE = {
    What.ENCODER_JUMP,
    What.CURRENT_OFFSET,
    What.CURRENT_CLIPPED,
    What.POSITION_SLOW,
    What.CURRENT_SLOW,
    What.AXIS_WEAK,
    What.PUSH,
    What.FRAMES_LOST,
    What.ALIAS,
    What.CLOCK_DRIFT,
}


class When(FileModel):
    """Start of a fault: one of the first four keys, and a delay."""

    time: NotNegative | None = None
    """Since power-on [s]."""
    sync: Count | None = None
    """Number of the SYNC, from 1."""
    frame: Count | None = None
    """Number of the frame that reaches the drives, from 1."""
    set_point: Count | None = None
    """Number of the set-point of the fault's axis, from 1; of any axis if the fault has none."""
    after: NotNegative = 0.0
    """Delay [s]."""

    @model_validator(mode="after")
    def _one_moment(self) -> Self:
        keys = ("time", "sync", "frame", "set_point")
        given = [key for key in keys if getattr(self, key) is not None]
        if len(given) != 1:
            raise ValueError(
                f"must have one of {', '.join(keys)}, not {' and '.join(given) or 'none'}"
            )
        return self


class Span(FileModel):
    """Duration of a fault: either `time` or `syncs`."""

    time: Positive | None = None
    """Duration in time [s]."""
    syncs: Count | None = None

    @model_validator(mode="after")
    def _one_length(self) -> Self:
        if (self.time is None) == (self.syncs is None):
            raise ValueError("must have either time or syncs")
        return self


class Fault(FileModel):
    """Fault with kind, place, start and duration."""

    what: What
    axis: Count | None = None
    """Axis number, from 1."""
    at: When
    lasts: Span | None = None
    """Duration; permanent if left out."""
    code: Annotated[int, Field(ge=1, le=0xFFFF_FFFF)] | None = None
    size: float | None = None

    @model_validator(mode="after")
    def _fits_its_kind(self) -> Self:
        for key, needed in (
            ("axis", self.what not in _WITHOUT_AXIS),
            ("code", self.what in _WITH_CODE),
            ("size", self.what in _WITH_SIZE),
        ):
            if (getattr(self, key) is not None) != needed:
                raise ValueError(f"{self.what} {'needs' if needed else 'takes no'} {key}")
        if self.code and self.what is not What.SDO_ABORTED and self.code > 0xFFFF:
            raise ValueError(f"code {self.code:X}h of {self.what} must be at most FFFFh")
        return self


class FaultPlan(FileModel):
    """List of faults."""

    faults: tuple[Fault, ...]

    def check_axes(self, n_axes: int, source: str = "fault plan") -> None:
        """Check that the machine has the axes of all faults.

        Raises
        ------
        FileError
        """
        for number, fault in enumerate(self.faults):
            if fault.axis is not None and fault.axis > n_axes:
                raise FileError(
                    f"{source}: faults.{number}.axis: {fault.axis} must be at most {n_axes}"
                )


def load_fault_plan(path: Path | str) -> FaultPlan:
    """Read a fault plan.

    Raises
    ------
    FileError
        The file cannot be read or is invalid; the message states the line.
    """
    return load_yaml(Path(path), FaultPlan)
