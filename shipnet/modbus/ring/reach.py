"""Which slaves each port of a master reaches.

Three things say it: port A reaches the slaves up to one, port B those from another on, and some
are dead.
"""

from __future__ import annotations

from typing import NamedTuple

__all__ = ["Reach"]


class Reach(NamedTuple):
    """Which slaves each port reaches.

    Examples
    --------
    >>> reach = Reach(5, last_a=2, first_b=4, dead=frozenset({5}))
    >>> reach.through_a, reach.through_b, reach.lost
    ([1, 2], [4], [3, 5])
    """

    n_slaves: int
    #: Port A reaches the slaves up to this one, port B those from `first_b` on.
    last_a: int
    first_b: int
    dead: frozenset[int]

    @property
    def through_a(self) -> list[int]:
        """Slaves that port A reaches."""
        return [s for s in range(1, self.last_a + 1) if s not in self.dead]

    @property
    def through_b(self) -> list[int]:
        """Slaves that port B reaches."""
        return [s for s in range(self.first_b, self.n_slaves + 1) if s not in self.dead]

    @property
    def lost(self) -> list[int]:
        """Slaves that neither reaches."""
        reached = {*self.through_a, *self.through_b}
        return [s for s in range(1, self.n_slaves + 1) if s not in reached]

    @property
    def served(self) -> list[str]:
        """Port of each slave, A where both reach it, and ``"-"`` for the lost ones."""
        a, b = set(self.through_a), set(self.through_b)
        slaves = range(1, self.n_slaves + 1)
        return ["A" if s in a else "B" if s in b else "-" for s in slaves]
