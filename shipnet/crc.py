"""Cyclic redundancy checks of one message, or of many at once.

The register is shifted one byte at a time with a table of 256 entries. In a reflected algorithm the
lowest bit of a byte comes first, and the register is shifted right instead of left.
"""

from __future__ import annotations

from functools import cached_property
from typing import Any, overload

import numpy as np
import numpy.typing as npt

from shipnet.errors import ArgumentError, SymbolError
from shipnet.fields import check_whole, record, switch, text, whole

__all__ = ["CAN", "MODBUS", "Crc"]


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

    def _reversed(self, value: int) -> int:
        return int(f"{value:0{self.width}b}"[::-1], 2) if self.reflected else value

    def _shifted(self, register: int, bit: int) -> int:
        """Return the register after one more bit."""
        if self.reflected:
            return register >> 1 ^ (register & 1 ^ bit) * self._reversed(self.polynomial)
        out = register >> (self.width - 1) ^ bit
        return (register << 1 ^ out * self.polynomial) & ((1 << self.width) - 1)

    @cached_property
    def _table(self) -> list[int]:
        """The register after each possible byte, for an initial value of 0."""
        entries = []
        for byte in range(256):
            register = 0
            for bit in f"{byte:08b}"[:: -1 if self.reflected else 1]:
                register = self._shifted(register, int(bit))
            entries.append(register)
        return entries

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
        if isinstance(data, np.ndarray):
            return self._rows(data)
        register, table = self._reversed(self.init), self._table
        if isinstance(data, str):
            if odd := set(data) - set("01"):
                raise SymbolError(f"data contains {min(odd)!r}; bits must be 0 or 1")
            # The first len(data) % 8 bits are shifted one by one, so that whole bytes remain.
            whole = len(data) % 8
            for bit in data[:whole]:
                register = self._shifted(register, int(bit))
            order = -1 if self.reflected else 1
            data = bytes(int(data[k : k + 8][::order], 2) for k in range(whole, len(data), 8))
        elif not isinstance(data, bytes | bytearray | memoryview):
            raise ArgumentError(f"data is {data!r}; it must be bytes, a str of bits, or an array")
        if self.reflected:
            for byte in bytes(data):
                register = table[(register ^ byte) & 255] ^ register >> 8
        else:
            high, mask = self.width - 8, (1 << self.width) - 1
            for byte in bytes(data):
                register = table[(register >> high) ^ byte] ^ register << 8 & mask
        return register ^ self.xorout

    def _rows(self, rows: npt.NDArray[Any]) -> npt.NDArray[np.unsignedinteger]:
        if rows.dtype != np.uint8 or rows.ndim == 0:
            raise ArgumentError(f"data is {rows.dtype}, {rows.ndim}-D; it must be rows of uint8")
        kind = np.dtype(f"u{next(n for n in (2, 4, 8) if self.width <= 8 * n)}")
        table = np.array(self._table, dtype=kind)
        register = np.full(rows.shape[:-1], self._reversed(self.init), dtype=kind)
        mask = kind.type((1 << self.width) - 1)
        for column in np.ascontiguousarray(np.moveaxis(rows, -1, 0)):
            if self.reflected:
                register = table.take(register.astype(np.uint8) ^ column) ^ register >> 8
            else:
                top = (register >> (self.width - 8)).astype(np.uint8)
                register = table.take(top ^ column) ^ register << 8 & mask
        checks: npt.NDArray[np.unsignedinteger] = register ^ kind.type(self.xorout)
        return checks

    def undetected(self, payload: int = 6, flips: int = 2) -> int:
        """Return how many patterns of `flips` (1 or 2) wrong bits the check does not detect.

        Any bits of the payload (1..16 bytes) and CRC may be wrong. On CAN these are the bits before
        stuffing: two wrong bits on the wire can change stuff bits and so shift the bits in between.

        All 64 single and 2016 double errors in a request of 8 bytes are detected:

        >>> [MODBUS.undetected(flips=n) for n in (1, 2)]
        [0, 0]
        """
        found = self.syndromes(check_whole("payload", payload, 1, 16))
        if check_whole("flips", flips, 1, 2) == 1:
            return int((found == 0).sum())
        _, counts = np.unique(found, return_counts=True)
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
