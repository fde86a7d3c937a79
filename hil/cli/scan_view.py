"""What a scan found: a line a node, then what they lack and why that matters, stated once."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

from rich.table import Table
from rich.text import Text

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from rich.console import Console

STYLES = {"yes": "green", "no": "bold red"}


class Remark(NamedTuple):
    """Something to know about a node; a fatal one keeps it from being used."""

    text: str
    fatal: bool


class NodeRow(NamedTuple):
    """One node, in words.

    Attributes
    ----------
    heard : str
        How it was noticed.
    device, identity, modes, state : str
        What it said of itself; empty where it did not.
    serves : str
        Whether it can be used: "yes", "no" or "unknown".
    remarks : tuple of Remark
        What it lacks.
    """

    node: int
    heard: str
    device: str
    identity: str
    modes: str
    state: str
    serves: str
    remarks: tuple[Remark, ...]


def render(rows: Sequence[NodeRow], console: Console) -> None:
    """Print the nodes and their remarks."""
    title = "1 node" if len(rows) == 1 else f"{len(rows)} nodes"
    table = Table("node", "heard by", "device", "identity (1018)", title=title)
    table.add_column("modes")
    table.add_column("state")
    table.add_column("serves")
    for row in rows:
        serves = Text(row.serves, style=STYLES.get(row.serves, "yellow"))
        texts = (row.heard, row.device, row.identity, row.modes, row.state)
        table.add_row(str(row.node), *map(Text, texts), serves)
    console.print(table)
    for remark, nodes in _grouped(rows).items():
        line = Text(f"{_spans(nodes)}: ", style="bold red" if remark.fatal else "yellow")
        line.append(remark.text, style="none")
        console.print(line, soft_wrap=True, highlight=False)


def _grouped(rows: Iterable[NodeRow]) -> dict[Remark, list[int]]:
    """Return the nodes that each remark is about, what is fatal first."""
    grouped: dict[Remark, list[int]] = {}
    for row in rows:
        for remark in row.remarks:
            grouped.setdefault(remark, []).append(row.node)
    return dict(sorted(grouped.items(), key=lambda item: not item[0].fatal))


def _spans(nodes: Sequence[int]) -> str:
    """Return node numbers as "node 3" or "nodes 1-4, 7"."""
    spans: list[list[int]] = []
    for node in sorted(set(nodes)):
        if spans and node == spans[-1][-1] + 1:
            spans[-1].append(node)
        else:
            spans.append([node])
    texts = (f"{span[0]}-{span[-1]}" if len(span) > 1 else f"{span[0]}" for span in spans)
    return ("nodes " if len(set(nodes)) > 1 else "node ") + ", ".join(texts)
