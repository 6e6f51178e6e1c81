"""The differences between two plans, element by element."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import fields
from typing import Any

from shipnet.asi.segment import Element, nodes_of
from shipnet.asi.slave import Slave
from shipnet.lazy import pd
from shipnet.line.network import CableRun

#: What two elements of a kind share if they are the same one, tried in this order; None: nothing.
_SAME: tuple[Callable[[Element], Any], ...] = (
    lambda one: one,
    lambda one: (one.label, one.node) if isinstance(one, Slave) else None,
    lambda one: one.label if isinstance(one, Slave) else frozenset(nodes_of(one)),
    lambda one: (one.a, one.length) if isinstance(one, CableRun) else None,
    lambda one: (one.b, one.length) if isinstance(one, CableRun) else None,
    lambda one: one.node if isinstance(one, Slave) else None,
    lambda one: None if isinstance(one, CableRun | Slave) else "moved",
)


def differences(old: Iterable[Element], new: Iterable[Element]) -> pd.DataFrame:
    """Return one row per element of the new plan that is not in the old one, or the reverse."""
    gone, come, rows = list(old), list(new), []
    for same in _SAME:
        for one in list(gone):
            key = type(one), same(one)
            match = next((two for two in come if key == (type(two), same(two))), None)
            if key[1] is None or match is None:
                continue
            gone.remove(one)
            come.remove(match)
            if one != match:
                rows.append((str(one), "changed", _changes(one, match)))
    rows += [(str(one), "removed", "") for one in gone] + [(str(one), "added", "") for one in come]
    return pd.DataFrame(rows, columns=["element", "change", "how"])


def _changes(one: Element, two: Element) -> str:
    pairs = ((f.name, getattr(one, f.name), getattr(two, f.name)) for f in fields(one))
    return ", ".join(f"{name} {a} -> {b}" for name, a, b in pairs if a != b)
