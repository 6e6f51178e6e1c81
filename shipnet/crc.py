"""Cyclic redundancy checks: one table of algorithms, one value at a time or many rows at once.

The register is shifted by whole bytes through a table of 256 entries. Where an algorithm is
reflected, a byte goes onto the line with its lowest bit first, and the register runs backwards.
"""

from __future__ import annotations

from functools import cache
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from shipnet.errors import ArgumentError, SymbolError
from shipnet.fields import check_whole

__all__ = ["ALGORITHMS", "Algorithm", "crc", "crc_batch", "syndromes", "undetected"]


class Algorithm(NamedTuple):
    """What tells one CRC from another.

    Attributes
    ----------
    width : int
        Bits of the register, 8..64.
    polynomial : int
        Generator without its highest term.
    init : int
        Register before the first bit.
    xorout : int
        What is added to the register at the end.
    reflected : bool
        Whether bytes go in, and the register comes out, with the lowest bit first.
    check : int
        The value over ``b"123456789"``.
    """

    width: int
    polynomial: int
    init: int
    xorout: int
    reflected: bool
    check: int


#: From G. Cook, "Catalogue of parametrised CRC algorithms", and the standards it names:
#: ISO 11898-1 for CAN, "MODBUS over serial line" V1.02 for Modbus.
ALGORITHMS = {
    "CRC-15/CAN": Algorithm(15, 0x4599, 0, 0, False, 0x059E),
    "CRC-16/MODBUS": Algorithm(16, 0x8005, 0xFFFF, 0, True, 0x4B37),
}


def _algorithm(name: str) -> Algorithm:
    try:
        return ALGORITHMS[name]
    except (KeyError, TypeError):
        raise ArgumentError(f"name is {name!r}; it must be one of {sorted(ALGORITHMS)}") from None


def _reversed(value: int, width: int) -> int:
    return int(f"{value:0{width}b}"[::-1], 2)


def _shifted(algorithm: Algorithm, register: int, bit: int) -> int:
    """Return the register after one more bit."""
    width, polynomial = algorithm.width, algorithm.polynomial
    if algorithm.reflected:
        return register >> 1 ^ (register & 1 ^ bit) * _reversed(polynomial, width)
    out = register >> (width - 1) ^ bit
    return (register << 1 ^ out * polynomial) & ((1 << width) - 1)


@cache
def _table(algorithm: Algorithm) -> tuple[int, ...]:
    """Return the register after each byte, from a register of 0."""
    entries = []
    for byte in range(256):
        register = 0
        for bit in f"{byte:08b}"[:: -1 if algorithm.reflected else 1]:
            register = _shifted(algorithm, register, int(bit))
        entries.append(register)
    return tuple(entries)


def _first_register(algorithm: Algorithm) -> int:
    width, init = algorithm.width, algorithm.init
    return _reversed(init, width) if algorithm.reflected else init


def crc(name: str, data: bytes | bytearray | memoryview | str) -> int:
    """Return the check value of bytes, or of bits in any number.

    Parameters
    ----------
    name : str
        Row of `ALGORITHMS`.
    data : bytes-like or str
        Bytes, or the bits in the order in which they are sent, as characters 0 and 1; may be
        empty.

    Returns
    -------
    int
        Check value, 0..2**width - 1.

    Raises
    ------
    ArgumentError
        If there is no such algorithm, or `data` are of another type.
    SymbolError
        If a bit is neither 0 nor 1.

    Examples
    --------
    >>> hex(crc("CRC-16/MODBUS", b"123456789"))
    '0x4b37'

    CAN checks all bits from the start of frame on, here 19 and a byte of data:

    >>> crc("CRC-15/CAN", "0" + f"{0x7C0:011b}" + "0000001" + f"{0x7D:08b}")
    30
    """
    algorithm = _algorithm(name)
    register, table = _first_register(algorithm), _table(algorithm)
    if isinstance(data, str):
        if odd := set(data) - set("01"):
            raise SymbolError(f"data has {min(odd)!r} among its bits; bits are 0 or 1")
        # The bits that make no whole byte go first, so that the rest can pass by bytes.
        whole = len(data) % 8
        for bit in data[:whole]:
            register = _shifted(algorithm, register, int(bit))
        order = -1 if algorithm.reflected else 1
        data = bytes(int(data[k : k + 8][::order], 2) for k in range(whole, len(data), 8))
    elif not isinstance(data, bytes | bytearray | memoryview):
        raise ArgumentError(f"data is {data!r}; it must be bytes, or a str of bits")
    if algorithm.reflected:
        for byte in bytes(data):
            register = table[(register ^ byte) & 255] ^ register >> 8
    else:
        high, mask = algorithm.width - 8, (1 << algorithm.width) - 1
        for byte in bytes(data):
            register = table[(register >> high) ^ byte] ^ register << 8 & mask
    return register ^ algorithm.xorout


def crc_batch(
    name: str, data: npt.ArrayLike, lengths: npt.ArrayLike | None = None
) -> npt.NDArray[np.unsignedinteger]:
    """Return the check value of every row of bytes.

    Parameters
    ----------
    name : str
        Row of `ALGORITHMS`.
    data : array_like of uint8, shape (..., n_bytes)
        One message a row.
    lengths : array_like of int, shape (...), optional
        How many bytes of each row count, 0..n_bytes; all if omitted.

    Returns
    -------
    ndarray of uint16, uint32 or uint64, shape (...)
        Check values, of the smallest of these types that holds the register.

    Raises
    ------
    ArgumentError
        If there is no such algorithm, `data` are no uint8, or a length is out of range.

    Notes
    -----
    An algorithm whose register begins at 0, like that of CAN, does not see leading zeros: rows of
    different length may be padded in front instead of giving `lengths`.

    Examples
    --------
    >>> rows = np.frombuffer(b"123456789123400000", np.uint8).reshape(2, 9)
    >>> [hex(value) for value in crc_batch("CRC-16/MODBUS", rows, [9, 4])]
    ['0x4b37', '0x30ba']
    """
    algorithm = _algorithm(name)
    rows = np.asarray(data)
    if rows.dtype != np.uint8 or rows.ndim == 0:
        raise ArgumentError(f"data must be rows of uint8, but are {rows.dtype}, {rows.ndim}-d")
    size = rows.shape[-1]
    used = None if lengths is None else _lengths(lengths, rows.shape[:-1], size)
    kind = np.dtype(f"u{next(n for n in (2, 4, 8) if algorithm.width <= 8 * n)}")
    table = np.array(_table(algorithm), dtype=kind)
    register = np.full(rows.shape[:-1], _first_register(algorithm), dtype=kind)
    mask = kind.type((1 << algorithm.width) - 1)
    for place, column in enumerate(np.ascontiguousarray(np.moveaxis(rows, -1, 0))):
        if algorithm.reflected:
            after = table[register.astype(np.uint8) ^ column] ^ register >> 8
        else:
            top = (register >> (algorithm.width - 8)).astype(np.uint8)
            after = table[top ^ column] ^ register << 8 & mask
        register = after if used is None else np.where(place < used, after, register)
    checks: npt.NDArray[np.unsignedinteger] = register ^ kind.type(algorithm.xorout)
    return checks


def _lengths(lengths: npt.ArrayLike, shape: tuple[int, ...], size: int) -> npt.NDArray[np.int64]:
    given = np.asarray(lengths)
    if given.dtype.kind not in "iu" and given.size:
        raise ArgumentError(f"lengths must be whole numbers, but their dtype is {given.dtype}")
    if given.shape not in ((), shape):
        raise ArgumentError(f"lengths have shape {given.shape}, but the rows have {shape}")
    if given.size and not 0 <= given.min() <= given.max() <= size:
        raise ArgumentError(f"lengths are {given.min()}..{given.max()}; they must be 0..{size}")
    return given.astype(np.int64)


def undetected(name: str, payload: int = 6, flips: int = 2) -> int:
    """Return how many patterns of wrong bits a CRC does not see, by trying all of them.

    Parameters
    ----------
    name : str
        Row of `ALGORITHMS`.
    payload : int, default 6
        Bytes before the CRC, 1..16.
    flips : int, default 2
        Wrong bits in the frame, 1..2.

    Returns
    -------
    int
        Patterns after which the CRC fits again.

    Raises
    ------
    ArgumentError
        If an argument is out of range.

    Notes
    -----
    The bits are those that the CRC is computed from. On CAN that is before bit stuffing: two wrong
    bits on the wire can remove one stuff bit and make another, which shifts all between them and
    is far more than two wrong bits to the CRC.

    Examples
    --------
    The 64 single and 2016 double errors of a request of 8 bytes:

    >>> [undetected("CRC-16/MODBUS", flips=n) for n in (1, 2)]
    [0, 0]
    """
    size = check_whole("payload", payload, 1, 16)
    found = syndromes(name, size)
    if check_whole("flips", flips, 1, 2) == 1:
        return int((found == 0).sum())
    _, counts = np.unique(found, return_counts=True)
    return int((counts * (counts - 1) // 2).sum())


def syndromes(name: str, n_bytes: int) -> npt.NDArray[np.int64]:
    """Return by how much the check is wrong for each single wrong bit of some bytes and their CRC.

    What several wrong bits do is the sum of these, modulo 2. The bits of the bytes come first, in
    order, then those of the CRC, the lowest first.
    """
    flips = np.packbits(np.eye(8 * n_bytes, dtype=np.uint8), axis=1)
    data = crc_batch(name, flips) ^ crc(name, bytes(n_bytes))
    return np.append(data.astype(np.int64), 1 << np.arange(_algorithm(name).width))
