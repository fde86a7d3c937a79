"""Who is on a bus, as a scan found it."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from drivers.in_node import ALONE, InNode

if TYPE_CHECKING:
    from drivers.dictionary.dictionary import Dictionary
    from drivers.dictionary.review import Review


@dataclass
class FoundNode:
    """One node.

    Attributes
    ----------
    node : int
        Its number.
    state, shown_by : str
        NMT state of its last heartbeat, empty where none was heard; on EtherCAT the AL state.
    boots, emergencies : int
        So many boot-ups and emergencies were heard.
    answers : int
        So many answers came to one question: more than one are two devices with the same number.
    dictionary : Dictionary or None
        What was read; None where no SDO is answered.
    review : Review or None
        What it offers.
    further : list of (InNode, Dictionary, Review)
        Its other axes, where it has several.
    within : InNode
        Which PDOs are those of its first axis.
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
    """What a scan found.

    Attributes
    ----------
    nodes : dict of int to FoundNode
        By node number.
    syncs : int
        SYNCs heard, from another master.
    """

    nodes: dict[int, FoundNode] = field(default_factory=dict)
    syncs: int = 0

    def heard(self, node: int) -> FoundNode:
        """Return the node of this number, found from now on."""
        return self.nodes.setdefault(node, FoundNode(node))
