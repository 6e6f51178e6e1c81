"""Fault confinement: who may still disturb the bus, from two error counters a node."""

from __future__ import annotations

__all__ = ["BUS_OFF", "PASSIVE", "RECOVERY_SEQUENCES", "SEQUENCE_BITS", "SUSPEND_BITS", "Counters"]

#: Counts from which a node is error passive, and off the bus; Bosch CAN specification 2.0,
#: part B, section 8.
PASSIVE, BUS_OFF = 128, 256

#: Sequences of recessive bits that a node off the bus waits for, and their length [bit]; as above.
RECOVERY_SEQUENCES, SEQUENCE_BITS = 128, 11

#: Bits that an error passive node lets pass after its own frame, part B, section 3.2.5.
SUSPEND_BITS = 8


class Counters:
    """Transmit and receive error counters of all the nodes of a bus.

    Parameters
    ----------
    nodes : int
        Number of nodes, 1 or more.

    Attributes
    ----------
    tec, rec : list of int
        Transmit and receive error counter of each node.
    missing : dict of int to int
        Nodes that are off the bus, and how many recessive sequences they still wait for.

    Notes
    -----
    Every error is seen by every node. The exceptions of the standard for a node that is alone on
    its bus, and for errors during an error flag, are not modelled. A receive counter above 127
    falls to 127 with the next good frame, the slowest return that the standard allows.

    Examples
    --------
    >>> counters = Counters(2)
    >>> for _ in range(16):
    ...     _ = counters.failed(0)
    >>> counters.tec, counters.rec, counters.state(0), counters.state(1)
    ([128, 0], [0, 16], 'error passive', 'error active')
    >>> counters.sent(0)
    >>> counters.tec, counters.rec, counters.state(0)
    ([127, 0], [0, 15], 'error active')
    """

    def __init__(self, nodes: int) -> None:
        self.tec = [0] * nodes
        self.rec = [0] * nodes
        self.missing: dict[int, int] = {}

    def failed(self, sender: int) -> bool:
        """Count an error in a frame of a node; return whether this took the node off the bus."""
        for node in range(len(self.tec)):
            if node == sender:
                self.tec[node] += 8
                if self.tec[node] >= BUS_OFF:
                    self.missing[node] = RECOVERY_SEQUENCES
            elif node not in self.missing:
                self.rec[node] += 1
        return self.missing.get(sender) == RECOVERY_SEQUENCES

    def sent(self, sender: int) -> None:
        """Count a good frame of a node."""
        for node, count in enumerate(self.rec):
            if node != sender and node not in self.missing:
                self.rec[node] = min(max(count - 1, 0), PASSIVE - 1)
        self.tec[sender] = max(self.tec[sender] - 1, 0)

    def rested(self, sequences: int) -> list[int]:
        """Count recessive sequences; return the nodes that are back on the bus by them."""
        back = []
        for node in list(self.missing):
            self.missing[node] -= sequences
            if self.missing[node] <= 0:
                del self.missing[node]
                self.tec[node] = self.rec[node] = 0
                back.append(node)
        return back

    def is_passive(self, node: int) -> bool:
        """Return whether a node is error passive."""
        return self.tec[node] >= PASSIVE or self.rec[node] >= PASSIVE

    def state(self, node: int) -> str:
        """Return ``"error active"``, ``"error passive"`` or ``"bus off"``."""
        if node in self.missing:
            return "bus off"
        return "error passive" if self.is_passive(node) else "error active"
