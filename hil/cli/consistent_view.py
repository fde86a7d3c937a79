"""The nearest robot that consists of bodies: its bounds as arguments, and what is shown of it."""

from __future__ import annotations

from typing import TYPE_CHECKING

import typer

if TYPE_CHECKING:
    from collections.abc import Sequence

    from hil.estimation.consistent.conditions import BodyBounds
    from hil.results.model import Model


def body_bounds(masses: Sequence[str] | None) -> BodyBounds:
    """Bounds of masses as they are written, ``LINK:LEAST:MOST``.

    Raises
    ------
    InvalidValue
        Bounds that no body meets.
    """
    from hil.estimation.consistent.conditions import BodyBounds

    found = {}
    for text in masses or ():
        try:
            link, least, most = text.split(":")
            found[int(link)] = float(least), float(most)
        except ValueError as error:
            raise typer.BadParameter(
                f"{text} must be LINK:LEAST:MOST, such as 2:10:40 for 10 to 40 kg of link 2",
                param_hint="--mass",
            ) from error
    return BodyBounds(masses=found)


def render(model: Model) -> None:
    """Show the bodies of a model, if they were asked for."""
    from hil.results.tables.consistent import bodies, changed_parameters, torque_costs
    from hil.results.tables.terminal import show
    from hil.terminal.console import out

    if model.consistent is not None:
        for table in (bodies, changed_parameters, torque_costs):
            show(table(model.robot, model.consistent), out)
