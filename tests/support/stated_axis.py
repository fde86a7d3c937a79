"""One axis of a drives file, to be changed key by key."""

from __future__ import annotations

from typing import Any

from drivers.drives_file import DrivesFile


def axis(**changes: Any) -> dict[str, Any]:
    stated: dict[str, Any] = {
        "name": "shoulder",
        "node": 2,
        "identity": {"vendor": 1, "product": 2},
        "gear_ratio": 100,
        "sign": 1,
        "zero": 0,
        "increments_per_revolution": 4096,
        "velocity_unit": "inc/s",
        "acceleration_unit": "inc/s^2",
        "current": {
            "index": 0x6078,
            "type": "i16",
            "basis": "per mille of rated current",
            "amplitude": "peak",
        },
        "rated_current": 2.0,
        "rated_torque": 3.0,
        "torque_constant": 0.5,
        "torque_constant_amplitude": "peak",
        "limits": {"q_min": -2, "q_max": 2, "velocity": 2, "acceleration": 10, "torque": 300},
        "following_error_window": 0.05,
        "following_error_time": 0.05,
        "position_window": 0.001,
        "position_window_time": 0.02,
    }
    return {**stated, **changes}


def drives(*axes: dict[str, Any], **changes: Any) -> DrivesFile:
    return DrivesFile.model_validate({"bitrate": 1_000_000, "axes": list(axes), **changes})
