"""Files of an acceptance: the limits, and the checks as JUnit XML, which CI systems read."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Literal, Self
from xml.etree import ElementTree as ET

import yaml
from pydantic import Field, model_validator

from checked_files.yaml_file import FileModel
from hil.runs.atomic_file import write_file

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

Axis = Annotated[int, Field(ge=1)]
Amount = Annotated[float, Field(ge=0)]


class QuantityLimits(FileModel):
    """Limits of a parameter, or of friction: by `axis` and `speed`, without speed of its offset."""

    name: str
    unit: str
    axis: Axis | None = None
    speed: Annotated[float, Field(gt=0)] | None = None
    least: float
    most: float

    @model_validator(mode="after")
    def _ordered(self) -> Self:
        if self.least > self.most:
            raise ValueError(f"least {self.least:g} must not exceed most {self.most:g}")
        return self


class Limits(FileModel):
    """Content of a file of limits.

    Attributes
    ----------
    robot : str
        Name of the robot that they are for.
    drafted_from : str
        Run whose intervals they are, widened by `factor`; empty where somebody stated them.
    outcome : {"good", "doubtful", "failed"}
        The worst that the identification may be.
    missing, with_findings : int
        Measurements that may be missing or left out, and recordings that may have findings.
    flagged : float
        Share of the samples that may be flagged.
    residual : dict
        Torque that the fit may leave, rms, by axis [N m or N].
    """

    format: Literal[1] = 1
    robot: str
    drafted_from: str = ""
    factor: Annotated[float, Field(gt=0)] | None = None
    outcome: Literal["good", "doubtful", "failed"] = "good"
    missing: Annotated[int, Field(ge=0)] = 0
    with_findings: Annotated[int, Field(ge=0)] = 0
    flagged: Annotated[float, Field(ge=0, le=1)] = 0.001
    residual: dict[Axis, Amount] = Field(default_factory=dict)
    quantities: tuple[QuantityLimits, ...] = ()


@dataclass(frozen=True, slots=True)
class Check:
    """A value and its limits; texts where they are no numbers.

    Attributes
    ----------
    name, unit : str
    value : float, str or None
        None where the run does not give it.
    least, most : float, str or None
        None where there is no such limit.
    passed : bool
    """

    name: str
    unit: str
    value: float | str | None
    least: float | str | None
    most: float | str | None
    passed: bool


def write_limits(path: Path, limits: Limits) -> None:
    """Write limits as YAML, whole or not at all."""
    content = limits.model_dump(mode="json", exclude_none=True)
    content["residual"] = limits.residual  # JSON knows no numbers as keys
    write_file(path, yaml.safe_dump(content, sort_keys=False, allow_unicode=True).encode())


def write_junit(path: Path, robot: str, measured: str, checks: Sequence[Check]) -> None:
    """Write the checks as JUnit XML, a test case each."""
    failed = sum(not check.passed for check in checks)
    suite = ET.Element(
        "testsuite",
        name=robot,
        tests=str(len(checks)),
        failures=str(failed),
        errors="0",
        timestamp=measured,
    )
    for check in checks:
        case = ET.SubElement(suite, "testcase", classname=robot, name=check.name)
        if not check.passed:
            ET.SubElement(case, "failure", message=reason(check))
    ET.indent(suite)
    write_file(path, ET.tostring(suite, encoding="utf-8", xml_declaration=True) + b"\n")


def reason(check: Check) -> str:
    """State value and limits of a check in a sentence's part."""
    if check.value is None:
        return "was not identified"
    bounds = [
        f"{word} {_text(bound)}"
        for word, bound in (("at least", check.least), ("at most", check.most))
        if bound is not None
    ]
    return f"{_text(check.value)} {check.unit}".strip() + f" must be {' and '.join(bounds)}"


def _text(value: float | str) -> str:
    return value if isinstance(value, str) else f"{value:.6g}"
