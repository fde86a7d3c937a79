"""A load as tables: the change of each base parameter, the load itself, the drives' gains."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rich import box
from rich.table import Table

from hil.model.base_parameters import base_parameters, link_share
from hil.results.rounding import rounded, signed

if TYPE_CHECKING:
    from rich.console import Console

    from hil.results.payload import FoundPayload


def render(load: FoundPayload, console: Console) -> None:
    """Print what was found, and how well a rigid load explains it."""
    console.print(_changes(load))
    console.print(_load(load))
    found = load.payload
    console.print(
        f"a rigid load leaves chi-squared {found.chi_squared:.1f} with"
        f" {found.degrees_of_freedom} degrees of freedom (p = {found.p_value:.2g})"
        + ("" if found.p_value > 0.001 else ": something else changed between the runs"),
        highlight=False, soft_wrap=True,
    )  # fmt: skip
    if found.unseen:
        console.print(
            f"not observed: {', '.join(found.unseen)} of the load, absent from the last link in"
            " the robot file and taken as zero; hil diagnose tests them",
            highlight=False, soft_wrap=True,
        )  # fmt: skip
    if load.gains is not None:
        console.print(_gains(load))


def _changes(load: FoundPayload) -> Table:
    base, found = base_parameters(load.robot), load.payload
    table = Table(title=f"{load.robot.name}: change by the load", box=box.SIMPLE_HEAD,
                  pad_edge=False)  # fmt: skip
    table.add_column("")
    for heading in ("without", "with", "change", "std. error", "expected", "z"):
        table.add_column(heading, justify="right", no_wrap=True)
    table.add_column("of the load")
    shares = link_share(load.robot, load.robot.n_joints - 1)
    for k, name in enumerate(base.names):
        s = float(found.standard_error[k])
        values = (found.before, found.after, found.change, found.standard_error, found.expected)
        z = (found.change[k] - found.expected[k]) / s
        table.add_row(name, *(rounded(float(value[k]), s) for value in values),
                      signed(f"{z:.1f}"), shares[k])  # fmt: skip
    return table


def _load(load: FoundPayload) -> Table:
    table = Table(title="the load, in the last link's frame", box=box.SIMPLE_HEAD, pad_edge=False)
    table.add_column("")
    for heading in ("value", "std. error"):
        table.add_column(heading, justify="right", no_wrap=True)
    table.add_column("unit")
    for q in load.payload.quantities():
        s = q.standard_error
        table.add_row(q.name, rounded(q.value, s), rounded(s, s) if s else "stated", q.unit)
    return table


def _gains(load: FoundPayload) -> Table:
    gains = load.gains
    table = Table(title="torque constants, by the known mass", box=box.SIMPLE_HEAD, pad_edge=False)
    table.add_column("axis")
    for heading in ("assumed", "corrected", "std. error", "off by %", "± %"):
        table.add_column(heading, justify="right", no_wrap=True)
    if gains is None:
        return table
    for k in range(load.robot.n_joints):
        assumed = f"{load.robot.torque_constant[k]:.4f}"
        if not gains.identifiable[k]:
            table.add_row(str(k + 1), assumed, "the load does not tell", "", "", "")
            continue
        value, s = float(gains.constant[k]), float(gains.constant_error[k])
        off, error = 100 * float(gains.error[k]), 100 * float(gains.standard_error[k])
        table.add_row(str(k + 1), assumed, rounded(value, s), rounded(s, s),
                      rounded(off, error), rounded(error, error))  # fmt: skip
    return table
