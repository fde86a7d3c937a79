"""Drive trains in a robot file: motors, gears, couplings and springs."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal

from pydantic import Field, ValidationInfo, field_validator, model_validator

from checked_files.yaml_file import FileModel

if TYPE_CHECKING:
    from typing import Self

Unknown = Literal["unknown"]
UNKNOWN: Unknown = "unknown"
"""Placeholder for an unknown value."""
USUAL_BOUND = 0.1
"""Common relative tolerance of torque constants and rotor inertias of servo motors: +-10 % of all
values but dimensions in assembly instructions of HIWIN's torque motors (TM-04-0-EN-2108, section
8.1)."""
USUAL_UNCERTAINTY = USUAL_BOUND / 3**0.5
"""Standard deviation of a uniform distribution within the tolerance (JCGM 100:2008, 4.3.7)."""


class Drive(FileModel):
    """Drive train of a joint.

    Identification of a recording needs none of these values. An unknown rotor inertia is identified
    as well; measuring needs gear ratio and torque constant.

    Attributes
    ----------
    gear_ratio : float
        Motor angle over joint coordinate [1, or rad/m].
    rotor_inertia, torque_constant : float
        Rotor inertia and torque constant, motor side [kg m^2, N m/A].
    rotor_inertia_uncertainty, torque_constant_uncertainty : float
        Relative standard deviations; 0 where none is stated.
    encoder_resolution : float, optional
        Increments per turn of the motor, for predictions.
    """

    gear_ratio: float | Unknown = UNKNOWN
    rotor_inertia: float | Unknown
    torque_constant: float | Unknown
    rotor_inertia_uncertainty: float = 0.0
    torque_constant_uncertainty: float = 0.0
    encoder_resolution: float | None = None

    @field_validator("encoder_resolution")
    @classmethod
    def _check_encoder_resolution(cls, value: float | None) -> float | None:
        if value is not None and not 1 <= value <= 2**32:
            raise ValueError(
                f"{value:g} must be between 1 and 2^32 increments per turn of the motor; omit "
                "the key if unknown"
            )
        return value

    @field_validator("gear_ratio")
    @classmethod
    def _check_gear_ratio(cls, value: float | Unknown) -> float | Unknown:
        if value == UNKNOWN:
            return value
        if not value > 0:
            raise ValueError(
                f"{value:g} must be positive; state the sense of rotation in the drives file, or "
                "as sign in the map of recordings"
            )
        return value

    @field_validator("rotor_inertia")
    @classmethod
    def _check_rotor_inertia(cls, value: float | Unknown) -> float | Unknown:
        if value in (0, UNKNOWN):
            return value  # 0: no separate rotor; a direct drive is part of its link
        return positive(value, "kg m2", 0.5, "it looks like kg cm2, or a joint-side value")

    @field_validator("torque_constant")
    @classmethod
    def _check_torque_constant(cls, value: float | Unknown) -> float | Unknown:
        if value == UNKNOWN:
            return value
        return positive(value, "N m/A", 20.0, "it looks like mN m/A, or a joint-side value")

    @field_validator("rotor_inertia_uncertainty", "torque_constant_uncertainty")
    @classmethod
    def _check_uncertainty(cls, value: float) -> float:
        if not 0 <= value < 0.5:
            raise ValueError(f"{value:g} must be in [0, 0.5): 0.02 stands for 2 %")
        return value

    @model_validator(mode="after")
    def _check_reflection(self) -> Self:
        if self.gear_ratio == UNKNOWN and self.rotor_inertia not in (0, UNKNOWN):
            raise ValueError(
                f"rotor_inertia {self.rotor_inertia:g} kg m2 needs a known gear_ratio; state the "
                "gear_ratio, or leave rotor_inertia unknown too"
            )
        return self


NO_DRIVE = Drive(rotor_inertia=UNKNOWN, torque_constant=UNKNOWN)
"""Drive train of a joint without a `drive` in the file."""


class CoupledMotor(FileModel):
    """Motor also turned by the motion of a second joint, as in many wrists.

    Attributes
    ----------
    motor, joint : int
        Numbers from 1: motor 6 drives joint 6, and joint 5 turns it too.
    ratio : float
        The motor turns with ``q[motor] + ratio q[joint]``, times its gear ratio.
    """

    motor: int = Field(ge=1)
    joint: int = Field(ge=1)
    ratio: float = 1.0

    @field_validator("joint")
    @classmethod
    def _check_joint(cls, value: int, info: ValidationInfo) -> int:
        if value == info.data.get("motor"):
            raise ValueError(f"{value} must be another joint than the motor's own")
        return value

    @field_validator("ratio")
    @classmethod
    def _check_ratio(cls, value: float) -> float:
        if not 0 < abs(value) <= 100:
            raise ValueError(f"{value:g} must be within +-100 and not 0; remove the coupling")
        return value


class Spring(FileModel):
    """Spring or counterbalance at a joint, with a strength to be identified.

    Attributes
    ----------
    joint : int
        Number from 1.
    shape : {"linear", "cosine", "sine"}
        Torque proportional to q, cos q or sin q of the joint. The rest position of a linear spring
        adds a constant torque, which the estimators fit as part of friction.
    """

    joint: int = Field(ge=1)
    shape: Literal["linear", "cosine", "sine"] = "linear"


def positive(value: float, unit: str, bound: float, hint: str) -> float:
    """Return `value`, or raise ValueError with `hint` if not positive or above `bound`."""
    if not value > 0:
        raise ValueError(f"{value:g} {unit} must be positive")
    if value > bound:
        raise ValueError(f"{value:g} {unit} must be at most {bound:g} {unit}: {hint}")
    return value
