"""The data that a packet carries: numbers, their values, and what a receiver asks of them."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import pairwise
from typing import Literal

from shipnet.crc import crc
from shipnet.errors import ArgumentError, FieldError
from shipnet.fields import check_whole

__all__ = ["NumberCheck", "check_bytes", "check_items", "check_number_check", "check_numbers"]
__all__ += ["read_items", "trailer"]

#: Number and value of each item, in the order of the packet.
Items = tuple[tuple[int, int], ...]

#: What a receiver asks of the numbers: nothing; that its table has them; that they also rise.
NumberCheck = Literal["any", "known", "rising"]

#: Bytes of a CRC-16.
_CRC = 2


def trailer(data: bytes) -> bytes:
    """Return the CRC-16/MODBUS of some bytes as it is sent, low byte first.

    Parameters
    ----------
    data : bytes
        What it is taken over.

    Returns
    -------
    bytes
        Two bytes.

    Examples
    --------
    >>> trailer(b"123456789").hex()
    '374b'
    """
    return crc("CRC-16/MODBUS", data).to_bytes(_CRC, "little")


def check_bytes(name: str, data: object) -> bytes:
    """Return bytes, or raise: of a number, `bytes` would make so many zeros.

    Parameters
    ----------
    name : str
        What it is.
    data : bytes-like
        What was given.

    Returns
    -------
    bytes
        The same.

    Raises
    ------
    ArgumentError
        If these are no bytes.

    Examples
    --------
    >>> check_bytes("data", bytearray(b"ab"))
    b'ab'
    """
    if not isinstance(data, (bytes, bytearray, memoryview)):
        raise ArgumentError(f"{name} is {data!r}; it must be bytes")
    return bytes(data)


def check_number_check(numbers: str) -> None:
    """Raise unless this is a way to check numbers.

    Parameters
    ----------
    numbers : str
        What was given.

    Raises
    ------
    ArgumentError
        If it is none of "any", "known" and "rising".

    Examples
    --------
    >>> check_number_check("known")
    """
    if numbers not in ("any", "known", "rising"):
        raise ArgumentError(f"numbers is {numbers!r}; it must be 'any', 'known' or 'rising'")


def check_items(items: Mapping[int, int], n_numbers: int) -> Items:
    """Return numbers and values in rising order, or raise unless a packet can hold them.

    Parameters
    ----------
    items : mapping of int to int
        Numbers and their values.
    n_numbers : int
        How many numbers there are.

    Returns
    -------
    Items
        The pairs.

    Raises
    ------
    ArgumentError
        If a number is not 0..n_numbers - 1, or a value not 0..65535.

    Examples
    --------
    >>> check_items({3: 7, 1: 500}, 10)
    ((1, 500), (3, 7))
    """
    if not isinstance(items, Mapping):
        raise ArgumentError(f"items is {items!r}; it must map numbers to values")
    return tuple(
        sorted(
            (
                check_whole("number", number, 0, n_numbers - 1),
                check_whole(f"value of item {number}", value, 0, 0xFFFF),
            )
            for number, value in items.items()
        )
    )


def read_items(data: bytes) -> Items:
    """Return the items in bytes that hold nothing else.

    Parameters
    ----------
    data : bytes
        Number, low and high byte of each.

    Returns
    -------
    Items
        The pairs.

    Examples
    --------
    >>> read_items(bytes([3, 0x34, 0x12]))
    ((3, 4660),)
    """
    return tuple(zip(data[::3], map(_value, data[1::3], data[2::3]), strict=True))


def check_numbers(items: Items, numbers: NumberCheck, n_numbers: int) -> Items:
    """Return the items, or raise unless a receiver takes their numbers.

    Parameters
    ----------
    items : Items
        The pairs.
    numbers : {"any", "known", "rising"}
        What it asks of them.
    n_numbers : int
        How many numbers there are.

    Returns
    -------
    Items
        The same.

    Raises
    ------
    FieldError
        If it does not take them.

    Examples
    --------
    >>> check_numbers(((3, 7), (2, 9)), "rising", 10)
    Traceback (most recent call last):
        ...
    shipnet.errors.FieldError: numbers are 3, 2; they must be 0..9 and rising
    """
    if numbers == "any":
        return items
    found = [number for number, _ in items]
    rising = numbers == "rising"
    falls = any(one >= other for one, other in pairwise(found))
    if any(number >= n_numbers for number in found) or (rising and falls):
        raise FieldError(
            f"numbers are {', '.join(map(str, found))}; they must be "
            f"0..{n_numbers - 1}{' and rising' * rising}"
        )
    return items


def _value(low: int, high: int) -> int:
    return low | high << 8
