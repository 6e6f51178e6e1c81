"""The messages of a bus as columns of whole numbers, the winner of an arbitration first."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
import pandas as pd

from shipnet.can.lengths import worst_length
from shipnet.errors import ArgumentError

__all__ = ["Messages", "arbitration_key", "bit_time_ns", "read_messages"]

Integers = npt.NDArray[np.int64]
Booleans = npt.NDArray[np.bool_]

#: Legal times in a table [ms]: a microsecond to about a day.
_SHORTEST, _LONGEST = 1e-3, 1e8

#: Legal lengths of a classic frame with its intermission [bit]: 47, and 160 by the bound.
_BITS = (47, 160)


class Messages(NamedTuple):
    """Messages in the order of their priority, times in whole nanoseconds.

    Attributes
    ----------
    name, sender : list of str
        Names of the messages, and of the nodes that send them.
    arbitration_id, bits : ndarray of int64, shape (n_messages,)
        Identifier; length of a frame with stuff bits and intermission [bit].
    extended, remote : ndarray of bool, shape (n_messages,)
        Whether the identifier has 29 bits, and whether the frame asks for data.
    period, offset, jitter, deadline : ndarray of int64, shape (n_messages,)
        Times [ns].
    order : ndarray of int64, shape (n_messages,)
        Row of the table that each message came from.
    """

    name: list[str]
    sender: list[str]
    arbitration_id: Integers
    bits: Integers
    extended: Booleans
    remote: Booleans
    period: Integers
    offset: Integers
    jitter: Integers
    deadline: Integers
    order: Integers


def arbitration_key(
    arbitration_id: npt.ArrayLike, extended: npt.ArrayLike = False, remote: npt.ArrayLike = False
) -> Integers:
    """Return the bits that decide an arbitration as one number; the smallest wins.

    Parameters
    ----------
    arbitration_id : int or array_like of int, shape (...)
        Identifier, 0..0x7FF, extended 0..0x1FFFFFFF.
    extended : bool or array_like of bool, shape (...), default False
        Whether it has 29 bits.
    remote : bool or array_like of bool, shape (...), default False
        Whether the frame asks for data.

    Returns
    -------
    ndarray of int64, shape (...)
        11 bits of the identifier, RTR or SRR, IDE, 18 more bits, RTR, the first bit leading.

    Raises
    ------
    ArgumentError
        If an identifier is out of range.

    Notes
    -----
    Among equal first 11 bits the standard data frame wins by its RTR bit, which is dominant where
    the extended frame has SRR; a standard remote frame wins by IDE, one bit later [1]_.

    References
    ----------
    .. [1] Robert Bosch GmbH, "CAN specification 2.0", 1991, part B, section 3.2.1.

    Examples
    --------
    >>> keys = arbitration_key([0x123, 0x123, 0x123 << 18, 0x122], [0, 0, 1, 0], [1, 0, 0, 0])
    >>> keys.argsort().tolist()
    [3, 1, 0, 2]
    """
    ids = np.asarray(arbitration_id)
    if ids.dtype.kind not in "iu":
        raise ArgumentError(f"arbitration_id must be whole numbers, but its dtype is {ids.dtype}")
    ids, long, asks = np.broadcast_arrays(
        ids.astype(np.int64), np.asarray(extended, dtype=bool), np.asarray(remote, dtype=bool)
    )
    highest = np.where(long, 0x1FFFFFFF, 0x7FF)
    bad = (ids < 0) | (ids > highest)
    if bad.any():
        raise ArgumentError(
            f"arbitration_id is {ids[bad][0]:#x}; it must be 0..{highest[bad][0]:#x}, as it is "
            + ("extended" if long[bad][0] else "not extended")
        )
    standard = ids << 21 | asks.astype(np.int64) << 20
    longer = (ids >> 18) << 21 | 3 << 19 | (ids & 0x3FFFF) << 1 | asks
    return np.where(long, longer, standard)


def bit_time_ns(bit_rate: float) -> int:
    """Return the length of a bit in whole nanoseconds.

    Parameters
    ----------
    bit_rate : float
        Bit rate, 5e3 to 1e6 [bit/s]; a bit must last a whole number of nanoseconds, to 1e-6.

    Returns
    -------
    int
        Bit time [ns].

    Raises
    ------
    ArgumentError
        If the bit rate is out of range, or its bit no whole number of nanoseconds.

    Examples
    --------
    >>> bit_time_ns(125e3)
    8000
    """
    if not isinstance(bit_rate, int | float | np.number) or not 5e3 <= bit_rate <= 1e6:
        raise ArgumentError(f"bit_rate is {bit_rate!r} bit/s; it must be 5e3..1e6")
    exact = 1e9 / float(bit_rate)
    if abs(exact - round(exact)) > 1e-6 * exact:
        raise ArgumentError(
            f"bit_rate is {bit_rate} bit/s, a bit of {exact:.6g} ns; it must be a whole number of "
            f"nanoseconds, such as {1e9 / round(exact):.9g} bit/s has"
        )
    return round(exact)


def read_messages(messages: pd.DataFrame | Mapping[str, npt.ArrayLike]) -> Messages:
    """Check a table of messages and sort it by priority.

    Parameters
    ----------
    messages : pandas.DataFrame or mapping of str to array_like
        Columns ``arbitration_id``, ``period_ms``, and ``bits`` (of a frame with stuff bits and
        intermission, 47..160) or ``dlc`` (0..15, which takes the longest frame by the bound of
        [1]_); where given ``name`` (else the identifier), ``sender`` (else each message is sent
        by a node of its own), ``extended``, ``remote`` (else False), ``offset_ms``, ``jitter_ms``
        (else 0) and ``deadline_ms`` (else the period). Others are ignored.

    Returns
    -------
    Messages
        The columns, times rounded to nanoseconds.

    Raises
    ------
    ArgumentError
        If a column is missing or of another length, there is no message, a value is out of
        range, or two messages have the same name or meet undecided in the arbitration.

    References
    ----------
    .. [1] R. I. Davis, A. Burns, R. J. Bril, J. J. Lukkien, "Controller Area Network (CAN)
       schedulability analysis: refuted, revisited and revised", Real-Time Systems 35 (2007).

    Examples
    --------
    >>> table = {"arbitration_id": [0x200, 0x100], "dlc": [8, 1], "period_ms": [10, 5.5]}
    >>> columns = read_messages(table)
    >>> columns.name, columns.bits.tolist(), columns.period.tolist()
    (['0x100', '0x200'], [65, 135], [5500000, 10000000])
    """
    try:
        table = pd.DataFrame(messages).reset_index(drop=True)
    except (TypeError, ValueError) as problem:
        raise ArgumentError(f"messages are no table: {problem}") from None
    if table.empty:
        raise ArgumentError("messages are empty; there must be at least one")
    for column in ("arbitration_id", "period_ms"):
        if column not in table:
            raise ArgumentError(f"messages have no column {column!r}")
    ids = _whole(table, "arbitration_id", 0, 0x1FFFFFFF)
    extended, remote = _flag(table, "extended"), _flag(table, "remote")
    key = arbitration_key(ids, extended, remote)
    period = _times(table, "period_ms", low=_SHORTEST)
    hexadecimal = [
        f"{number:#0{10 if long else 5}x}" for number, long in zip(ids, extended, strict=True)
    ]
    name = _texts(table, "name", hexadecimal)
    order = np.argsort(key, kind="stable")
    for what, values in (("arbitration", key.tolist()), ("name", name)):
        seen = pd.Series(values)
        if seen.duplicated().any():
            rows = seen[seen == seen[seen.duplicated()].iloc[0]].index[:2] + 1
            raise ArgumentError(
                f"messages {rows[0]} and {rows[1]} have the same {what}, "
                f"{name[rows[1] - 1] if what == 'name' else hexadecimal[rows[1] - 1]}"
            )
    offset = _times(table, "offset_ms") if "offset_ms" in table else np.zeros_like(period)
    jitter = _times(table, "jitter_ms") if "jitter_ms" in table else np.zeros_like(period)
    deadline = _times(table, "deadline_ms", low=_SHORTEST) if "deadline_ms" in table else period
    sender = _texts(table, "sender", name)
    return Messages(
        name=[name[row] for row in order],
        sender=[sender[row] for row in order],
        arbitration_id=ids[order],
        bits=_lengths(table, extended, remote)[order],
        extended=extended[order],
        remote=remote[order],
        period=period[order],
        offset=offset[order],
        jitter=jitter[order],
        deadline=deadline[order],
        order=order.astype(np.int64),
    )


def _numbers(table: pd.DataFrame, column: str, low: float, high: float) -> npt.NDArray[np.float64]:
    given = table[column]
    values = pd.to_numeric(given, errors="coerce").to_numpy(dtype=float, na_value=np.nan)
    if given.dtype.kind == "b":
        values[:] = np.nan
    good = (values >= low) & (values <= high)
    if not good.all():
        row = int(np.argmin(good))
        raise ArgumentError(
            f"{column} of message {row + 1} is {given.tolist()[row]!r}; "
            f"it must be {low:g}..{high:g}"
        )
    return values


def _whole(table: pd.DataFrame, column: str, low: int, high: int) -> Integers:
    values = _numbers(table, column, low, high)
    whole = values == np.rint(values)
    if not whole.all():
        row = int(np.argmin(whole))
        raise ArgumentError(f"{column} of message {row + 1} is {values[row]}; it must be whole")
    return values.astype(np.int64)


def _times(table: pd.DataFrame, column: str, low: float = 0.0) -> Integers:
    return np.rint(_numbers(table, column, low, _LONGEST) * 1e6).astype(np.int64)


def _flag(table: pd.DataFrame, column: str) -> Booleans:
    if column not in table:
        return np.zeros(len(table), dtype=bool)
    if table[column].dtype.kind == "b":
        return table[column].to_numpy(dtype=bool)
    return _whole(table, column, 0, 1).astype(bool)


def _texts(table: pd.DataFrame, column: str, default: list[str]) -> list[str]:
    if column not in table:
        return default
    given = table[column]
    for row, value in enumerate(given):
        if not isinstance(value, str) or not value:
            raise ArgumentError(f"{column} of message {row + 1} is {value!r}; it must be a text")
    return given.tolist()


def _lengths(table: pd.DataFrame, extended: Booleans, remote: Booleans) -> Integers:
    given = table["bits"].notna() if "bits" in table else None
    if given is not None and given.all():
        return _whole(table, "bits", *_BITS)
    if "dlc" not in table:
        raise ArgumentError("messages have neither a column 'bits' nor a column 'dlc'")
    size = np.where(remote, 0, np.minimum(_whole(table, "dlc", 0, 15), 8))
    longest = [worst_length(int(n), extended=bool(e)) for n, e in zip(size, extended, strict=True)]
    if given is None or not given.any():
        return np.array(longest, dtype=np.int64)
    filled = table.assign(bits=table["bits"].where(given, pd.Series(longest, index=table.index)))
    return _whole(filled, "bits", *_BITS)
