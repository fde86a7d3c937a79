"""What every exported file states at its head: where the model comes from and what it is worth.

A model that no recording has confirmed can be exported all the same, but never silently.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from pathlib import Path

    from hil.results.model import Model


def passed(model: Model) -> bool:
    """Whether the model passed a validation on another recording."""
    return any(each.verdict == "PASS" for each in model.validations)


def origin(model: Model, source: Path) -> tuple[str, ...]:
    """Lines on robot, run, method, date and validation of a model.

    Parameters
    ----------
    model : Model
    source : Path
        Its file, or the folder of the run that gave it, as the user named it.
    """
    made = model.provenance
    also = f" with {', '.join(made.together_with)}" if made.together_with else ""
    return (
        f"robot {model.robot.name} (robot file {model.robot.digest[:12]})",
        f"model of {source}{also}: {made.measurements} measurements, {made.method} method",
        f"identified {made.identified} by version {made.version}",
        *validations(model, source),
    )


def validations(model: Model, source: Path) -> tuple[str, ...]:
    """Lines on what the model was worth on other recordings."""
    found = tuple(
        f"validation on {each.run} ({each.validated}): {each.verdict}: {each.reason}"
        for each in model.validations
    )
    if passed(model):
        return found
    none = "no validation passed; judge the model by another recording with: hil validate RUN"
    return (*found, f"{none} --model {source}")
