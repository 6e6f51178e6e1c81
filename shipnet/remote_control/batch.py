"""Packets by the million: built and checked in arrays, with the results of the scalar functions.

All rows of an array have one number of items, so that the boundaries of the packets are known.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from shipnet.crc import crc_batch
from shipnet.errors import ArgumentError, CrcError, FieldError, FormError, LengthError
from shipnet.remote_control.packet import PACKET_END, Markers
from shipnet.remote_control.stuffed import Stuffed

__all__ = ["Checked", "check_batch", "encode_batch"]

Bytes = npt.NDArray[np.uint8]
Flags = npt.NDArray[np.bool_]


class Checked(NamedTuple):
    """What a receiver makes of many packets.

    Attributes
    ----------
    error : ndarray of uint8, shape (n_packets,)
        0 where the packet is accepted, else the code of `LengthError`, `FormError`, `CrcError` or
        `FieldError`.
    numbers : ndarray of uint8, shape (n_packets, n_items)
        Numbers of the items; 0 where there is an error.
    values : ndarray of uint16, shape (n_packets, n_items)
        Their values; 0 where there is an error.
    """

    error: Bytes
    numbers: Bytes
    values: npt.NDArray[np.uint16]

    @property
    def accepted(self) -> Flags:
        """Whether each packet is taken as in order, shape (n_packets,)."""
        accepted: Flags = self.error == 0
        return accepted


def encode_batch(
    packet_format: Markers | Stuffed, numbers: npt.ArrayLike, values: npt.ArrayLike
) -> Bytes:
    """Return many packets, each as ``packet_format.encode`` makes it.

    Parameters
    ----------
    packet_format : Markers or Stuffed
        The format.
    numbers : array_like of int, shape (n_items,) or (n_packets, n_items)
        Numbers of the items, 0..n_numbers - 1, rising in each row.
    values : array_like of int, shape (n_packets, n_items)
        Their values, 0..65535.

    Returns
    -------
    ndarray of uint8, shape (n_packets, packet_format.size(n_items))
        A packet a row.

    Raises
    ------
    ArgumentError
        If an array holds anything else, or the shapes do not fit.

    Examples
    --------
    >>> rows = encode_batch(Markers(), [0, 3], [[120, 0x1234], [121, 0x1235]])
    >>> [row.tobytes().hex(" ") for row in rows]
    ['cc dd 00 78 00 03 34 12 ee', 'cc dd 00 79 00 03 35 12 ee']
    """
    value = _whole("values", values, 0xFFFF)
    number = _whole("numbers", numbers, packet_format.n_numbers - 1)
    if value.ndim != 2 or number.shape not in (value.shape, value.shape[1:]):
        raise ArgumentError(
            f"numbers and values have the shapes {number.shape} and {value.shape}; they must be "
            "(n_items,) or (n_packets, n_items), and (n_packets, n_items)"
        )
    if (np.diff(number, axis=-1) <= 0).any():
        raise ArgumentError("numbers must rise in each row")
    n_packets, n_items = value.shape
    items = np.empty((n_packets, n_items, 3), np.uint8)
    items[..., 0], items[..., 1], items[..., 2] = number, value & 0xFF, value >> 8
    if isinstance(packet_format, Stuffed):
        return _stuff(_with_check(items.reshape(n_packets, -1)))
    head, lead = packet_format.head, packet_format.lead
    size = packet_format.size(n_items) - 2 * packet_format.crc
    rows = np.empty((n_packets, size), np.uint8)
    rows[:, : len(head)] = list(head)
    groups = rows[:, len(head) : -1].reshape(n_packets, n_items, len(lead) + 3)
    groups[..., : len(lead)], groups[..., len(lead) :] = list(lead), items
    # A reshaped part of the rows is a copy, not a view.
    rows[:, len(head) : -1] = groups.reshape(n_packets, -1)
    rows[:, -1] = PACKET_END
    return _with_check(rows) if packet_format.crc else rows


def check_batch(packet_format: Markers | Stuffed, packets: npt.ArrayLike) -> Checked:
    """Return what a receiver makes of many packets, each as ``packet_format.decode`` finds it.

    Parameters
    ----------
    packet_format : Markers or Stuffed
        The format.
    packets : array_like of uint8, shape (n_packets, n_bytes)
        A packet a row, disturbed or not.

    Returns
    -------
    Checked
        Errors, numbers and values; without items where no packet has this length.

    Raises
    ------
    ArgumentError
        If `packets` are no rows of uint8.

    Examples
    --------
    A bit of a value and a bit of the last marker are turned over. The markers see only the second:

    >>> rows = encode_batch(Markers(), [0, 3], [[120, 1], [121, 2], [122, 3]])
    >>> rows[1, 3] ^= 1
    >>> rows[2, -1] ^= 1
    >>> checked = check_batch(Markers(), rows)
    >>> checked.error.tolist(), checked.values.tolist()
    ([0, 0, 13], [[120, 1], [120, 2], [0, 0]])
    """
    rows = np.asarray(packets)
    if rows.dtype != np.uint8 or rows.ndim != 2:
        raise ArgumentError(f"packets must be rows of uint8, but are {rows.dtype}, {rows.ndim}-d")
    n_items, rest = divmod(rows.shape[1] - packet_format.size(0), _step(packet_format))
    if rest or not 0 <= n_items <= packet_format.n_numbers:
        error = np.full(len(rows), LengthError.code, np.uint8)
        return Checked(error, np.zeros((len(rows), 0), np.uint8), np.zeros((len(rows), 0), "u2"))
    if isinstance(packet_format, Stuffed):
        formed, checked, items = _read_stuffed(rows, n_items)
    else:
        formed, checked, items = _read_markers(packet_format, rows, n_items)
    numbers = items[..., 0]
    taken = _takes(packet_format, numbers)
    error = np.where(taken, 0, FieldError.code).astype(np.uint8)
    error[~checked] = CrcError.code
    error[~formed] = FormError.code
    values = items[..., 1] | items[..., 2].astype(np.uint16) << 8
    # The items of what is refused are 0.
    numbers = numbers * (error == 0)[:, None]
    values = values * (error == 0)[:, None]
    return Checked(error, numbers, values)


def _step(packet_format: Markers | Stuffed) -> int:
    return packet_format.size(1) - packet_format.size(0)


def _takes(packet_format: Markers | Stuffed, numbers: Bytes) -> Flags:
    if packet_format.numbers == "any":
        return np.ones(len(numbers), bool)
    takes: Flags = np.all(numbers < packet_format.n_numbers, axis=1)
    if packet_format.numbers == "rising":
        takes &= np.all(numbers[:, 1:] > numbers[:, :-1], axis=1)
    return takes


def _read_markers(form: Markers, rows: Bytes, n_items: int) -> tuple[Flags, Flags, Bytes]:
    """Return whether the markers, and the CRC, are in order, and the items."""
    head, lead = len(form.head), len(form.lead)
    end = rows.shape[1] - 1 - 2 * form.crc
    groups = rows[:, head:end].reshape(len(rows), n_items, lead + 3)
    formed = (rows[:, end] == PACKET_END) & (rows[:, :head] == list(form.head)).all(axis=1)
    if lead:
        formed &= (groups[..., :lead] == list(form.lead)).all(axis=(1, 2))
    else:
        formed &= (groups[..., 0] != PACKET_END).all(axis=1)
    checked = np.ones(len(rows), bool) if not form.crc else _check_fits(rows)
    return formed, checked, groups[..., lead:]


def _read_stuffed(rows: Bytes, n_items: int) -> tuple[Flags, Flags, Bytes]:
    body = rows[:, :-1]
    n_packets, width = body.shape
    columns = np.ascontiguousarray(body.T)
    code = np.zeros(n_packets, np.int64)
    plain = np.empty_like(columns)
    for place, column in enumerate(columns):
        here = code == place
        plain[place] = np.where(here, 0, column)
        code = np.where(here, place + column.astype(np.int64), code)
    formed = (code == width) & (body != 0).all(axis=1) & (rows[:, -1] == 0)
    data = np.ascontiguousarray(plain[1:].T)
    return formed, _check_fits(data), data[:, :-2].reshape(n_packets, n_items, 3)


def _check_fits(rows: Bytes) -> Flags:
    # Behind its own check, the register of a reflected CRC without final addition is 0.
    fits: Flags = crc_batch("CRC-16/MODBUS", rows) == 0
    return fits


def _with_check(rows: Bytes) -> Bytes:
    check = crc_batch("CRC-16/MODBUS", rows)
    return np.column_stack([rows, (check & 0xFF).astype(np.uint8), (check >> 8).astype(np.uint8)])


def _stuff(data: Bytes) -> Bytes:
    """Stuff every row, with the 0 behind it."""
    n_packets, size = data.shape
    rows = np.zeros((n_packets, size + 2), np.uint8)
    rows[:, 1:-1] = data
    places = np.arange(size + 2)
    zero = np.where(rows == 0, places, size + 1)
    following = np.minimum.accumulate(zero[:, :0:-1], axis=1)[:, ::-1]
    step = (following - places[:-1]).astype(np.uint8)
    rows[:, :-1] = np.where(rows[:, :-1] == 0, step, rows[:, :-1])
    return rows


def _whole(name: str, values: npt.ArrayLike, highest: int) -> npt.NDArray[np.int64]:
    try:
        array = np.asarray(values)
    except ValueError:
        raise ArgumentError(f"{name} must be whole numbers, in rows of equal length") from None
    if array.size and (array.dtype.kind not in "iu" or array.min() < 0 or array.max() > highest):
        raise ArgumentError(f"{name} must be whole numbers 0..{highest}")
    return array.astype(np.int64)
