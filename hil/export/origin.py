"""What every exported file states at its head: where the model comes from and what it is worth.

A model that no recording has confirmed can be exported all the same, but never silently; one whose
identification failed only where that is asked for.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from hil.runs.journal import NO_REAL_MACHINE

if TYPE_CHECKING:
    from pathlib import Path

    from hil.results.model import Model


def cautions(model: Model) -> tuple[str, ...]:
    """What stands on top of whatever is made from the model: that it failed, or is simulated."""
    simulated = (NO_REAL_MACHINE,) if model.provenance.of_virtual_plant else ()
    if model.outcome is None or not model.failed:
        return simulated
    return (f"FAILED: {' '.join(model.outcome.clause.split())}", *simulated)


def passed(model: Model) -> bool:
    """Whether the model passed a validation on another recording."""
    return any(each.word == "good" for each in model.validations)


def origin(model: Model, source: Path) -> tuple[str, ...]:
    """Lines on robot, run, method, date and validation of a model, `cautions` before them.

    Parameters
    ----------
    model : Model
    source : Path
        Its file, or the folder of the run that gave it, as the user named it.
    """
    made = model.provenance
    also = f" with {', '.join(made.together_with)}" if made.together_with else ""
    return (
        *cautions(model),
        f"robot {model.robot.name} (robot file {model.robot.digest[:12]})",
        f"model of {source}{also}: {made.measurements} measurements, {made.method} method",
        f"identified {made.identified} by version {made.version}",
        *validations(model, source),
    )


def validations(model: Model, source: Path) -> tuple[str, ...]:
    """Lines on what the model was worth on other recordings."""
    found = tuple(
        f"validation on {each.run} ({each.validated}): {each}" for each in model.validations
    )
    if passed(model):
        return found
    none = "no validation passed; judge the model by another recording with: hil validate RUN"
    return (*found, f"{none} --model {source}")
