"""Nodes on a bus, as found by a scan."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from drivers.in_node import ALONE, InNode

if TYPE_CHECKING:
    from drivers.dictionary.dictionary import Dictionary
    from drivers.dictionary.review import Review


@dataclass
class FoundNode:
    """Node found by a scan.

    Attributes
    ----------
    node : int
        Node number.
    state, shown_by : str
        NMT state of the last heartbeat, empty if none was received; on EtherCAT the AL state.
    boots, emergencies : int
        Number of boot-ups and emergencies received.
    answers : int
        Number of answers to one request: more than one come from devices with the same number.
    dictionary : Dictionary or None
        Dictionary read; None without SDO answers.
    review : Review or None
        Review of the dictionary.
    further : list of (InNode, Dictionary, Review)
        Further axes of the node.
    within : InNode
        PDOs of the first axis.
    """

    node: int
    state: str = ""
    shown_by: str = "heartbeat"
    boots: int = 0
    emergencies: int = 0
    answers: int = 0
    dictionary: Dictionary | None = None
    review: Review | None = None
    further: list[tuple[InNode, Dictionary, Review]] = field(default_factory=list)
    within: InNode = ALONE


@dataclass
class Scan:
    """Result of a scan.

    Attributes
    ----------
    nodes : dict of int to FoundNode
        Nodes by number.
    syncs : int
        SYNCs received, from another master.
    """

    nodes: dict[int, FoundNode] = field(default_factory=dict)
    syncs: int = 0

    def heard(self, node: int) -> FoundNode:
        """Return the node of a number, added if new."""
        return self.nodes.setdefault(node, FoundNode(node))
