"""Arguments for every kernel: edges and largest values included, small enough for plain Python."""

from __future__ import annotations

from hypothesis import strategies as st

#: A strategy of argument tuples by the full name of the kernel.
ARGUMENTS: dict[str, st.SearchStrategy[tuple]] = {}
