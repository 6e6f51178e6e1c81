"""Cyclic redundancy checks: the remainder of a message that is divided by a polynomial.

A register holds the remainder so far. In a reflected algorithm the lowest bit of a byte comes
first, and the register is shifted right instead of left.
"""

from __future__ import annotations

from collections.abc import Iterable
from functools import cached_property
from typing import Any, overload

import numpy as np
import numpy.typing as npt

from shipnet.errors import ArgumentError, SymbolError
from shipnet.fields import check_fields, check_whole, record, switch, text, whole

__all__ = ["CAN", "MODBUS", "Crc"]
__dir__ = __all__.copy


def shift_bits(
    register: int, bits: Iterable[int], polynomial: int, width: int, reflected: bool
) -> int:
    """Return the register after some bits: whenever a 1 leaves it, the polynomial is subtracted."""
    mask = 2**width - 1
    for bit in bits:
        if reflected:
            out = register & 1 ^ bit
            register = register >> 1 ^ out * polynomial
        else:
            out = register >> (width - 1) ^ bit
            register = register << 1 & mask ^ out * polynomial
    return register


def shift_bytes(register: Any, data: Iterable[Any], table: Any, width: int, reflected: bool) -> Any:
    """Return the register after some bytes; `table` contains the remainder of each byte.

    With arrays for numbers, it takes many messages at once: the n-th byte of each, for every n.
    """
    if reflected:
        for byte in data:
            register = register >> 8 ^ table[(register ^ byte) & 255]
    else:
        high, mask = width - 8, 2**width - 1
        for byte in data:
            register = register << 8 & mask ^ table[register >> high ^ byte]
    return register


@record
class Crc:
    """A cyclic redundancy check, with the parameters of G. Cook's catalogue.

    `polynomial` is given without its highest term.

    >>> hex(MODBUS.of(b"123456789"))
    '0x4b37'
    """

    name: str = text("Name in the catalogue")
    width: int = whole(8, 64, "bit", "Width of the register")
    polynomial: int = whole(0, 2**64 - 1, help="Polynomial")
    init: int = whole(0, 2**64 - 1, help="Initial value of the register", default=0)
    xorout: int = whole(0, 2**64 - 1, help="XORed with the register at the end", default=0)
    reflected: bool = switch("Whether the lowest bit comes first", default=False)

    def __post_init__(self) -> None:
        check_fields(self)
        for name in ("polynomial", "init", "xorout"):
            check_whole(name, getattr(self, name), 0, 2**self.width - 1, f", {self.width} bits")

    def _reversed(self, value: int) -> int:
        return int(f"{value:0{self.width}b}"[::-1], 2) if self.reflected else value

    @cached_property
    def _start(self) -> int:
        return self._reversed(self.init)

    @cached_property
    def _divisor(self) -> int:
        return self._reversed(self.polynomial)

    @cached_property
    def _table(self) -> list[int]:
        """The remainder of each byte, which the register holds after eight shifts."""
        how = 8 * [0], self._divisor, self.width, self.reflected
        shift = 0 if self.reflected else self.width - 8
        return [shift_bits(byte << shift, *how) for byte in range(256)]

    @overload
    def of(self, data: bytes | bytearray | memoryview | str) -> int: ...

    @overload
    def of(self, data: npt.NDArray[np.uint8]) -> npt.NDArray[np.unsignedinteger]: ...

    def of(self, data: Any) -> Any:
        """Return the check value of bytes, of bits in the order sent, or of each row of an array.

        Bits are a str of 0 and 1; an array has shape (..., n_bytes). If the register starts at 0,
        as for CAN, leading zeros do not change the result, so rows may be padded with them.

        >>> CAN.of("0" + f"{0x7C0:011b}" + "0000001" + f"{0x7D:08b}")
        30
        >>> CAN.of(np.array([[1, 2], [3, 4]], np.uint8)).tolist()
        [2701, 20796]
        """
        first, width, reflected = self._start, self.width, self.reflected
        if isinstance(data, bytes):
            register = shift_bytes(first, data, self._table, width, reflected)
        elif isinstance(data, str):
            if odd := set(data) - set("01"):
                raise SymbolError(f"data contains {min(odd)!r}; bits must be 0 or 1")
            register = shift_bits(first, map(int, data), self._divisor, width, reflected)
        elif isinstance(data, np.ndarray):
            if data.dtype != np.uint8 or data.ndim == 0:
                kind = f"{data.dtype}, {data.ndim}-D"
                raise ArgumentError(f"data is {kind}; it must be rows of uint8")
            table = np.array(self._table, f"u{next(n for n in (2, 4, 8) if width <= 8 * n)}")
            registers = np.full(data.shape[:-1], first, table.dtype)
            columns = np.ascontiguousarray(np.moveaxis(data, -1, 0))
            register = shift_bytes(registers, columns, table, width, reflected)
        elif isinstance(data, bytearray | memoryview):
            return self.of(bytes(data))
        else:
            raise ArgumentError(f"data is {data!r}; it must be bytes, a str of bits, or an array")
        return register ^ self.xorout

    def undetected(self, payload: int = 6, flips: int = 2) -> int:
        """Return how many patterns of `flips` (1 or 2) wrong bits the check does not detect.

        Any bits of the payload (1..16 bytes) and CRC may be wrong. On CAN these are the bits before
        stuffing: two wrong bits on the wire can change stuff bits and so shift the bits in between.

        All 64 single and 2016 double errors in a request of 8 bytes are detected:

        >>> [MODBUS.undetected(flips=n) for n in (1, 2)]
        [0, 0]
        """
        syndromes = self.syndromes(check_whole("payload", payload, 1, 16))
        if check_whole("flips", flips, 1, 2) == 1:
            return int((syndromes == 0).sum())
        _, counts = np.unique(syndromes, return_counts=True)
        return int((counts * (counts - 1) // 2).sum())

    def syndromes(self, n_bytes: int) -> npt.NDArray[np.int64]:
        """Return how each single wrong bit in a message and its CRC changes the check value.

        The effect of several wrong bits is the XOR of their changes. The bits of the message come
        first, highest bit of each byte first; then those of the CRC, lowest first.
        """
        size = check_whole("n_bytes", n_bytes, 0, 4096)
        flips = np.packbits(np.eye(8 * size, dtype=np.uint8), axis=1)
        data = self.of(flips) ^ self.of(bytes(size))
        return np.append(data.astype(np.int64), 1 << np.arange(self.width))


CAN = Crc("CRC-15/CAN", 15, 0x4599)  #: ISO 11898-1.

#: "MODBUS over serial line" V1.02.
MODBUS = Crc("CRC-16/MODBUS", 16, 0x8005, init=0xFFFF, reflected=True)
