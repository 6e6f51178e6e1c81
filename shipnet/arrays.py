"""Type aliases for arrays, and functions that read long arrays in parts."""

from __future__ import annotations

import mmap
from collections.abc import Iterator
from typing import TypeAlias

import numpy as np
import numpy.typing as npt

Bools: TypeAlias = npt.NDArray[np.bool_]
Complexes: TypeAlias = npt.NDArray[np.complex128]
Floats: TypeAlias = npt.NDArray[np.float64]
Indices: TypeAlias = npt.NDArray[np.intp]
Integers: TypeAlias = npt.NDArray[np.int64]
#: 8-bit bytes, and 16-bit registers.
Bytes: TypeAlias = npt.NDArray[np.uint8]
Words: TypeAlias = npt.NDArray[np.uint16]


def parts_of(u: Floats, length: int = 2**20) -> Iterator[tuple[int, Floats]]:
    """Yield the offset and values of each part; a mapped file is in memory one part at a time."""
    for low in range(0, len(u), length):
        yield low, u[low : low + length]
        release(u)


def release(u: npt.NDArray[np.generic]) -> None:
    """Release the memory of the pages read from a mapped file; do nothing for other arrays."""
    base: object = u
    while isinstance(base, np.ndarray):
        base = base.base
    if isinstance(base, mmap.mmap) and hasattr(base, "madvise"):
        base.madvise(mmap.MADV_DONTNEED)
