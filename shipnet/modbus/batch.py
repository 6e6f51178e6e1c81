"""RTU frames by the million: requests of function codes 1 to 6, and the check of any frames.

The functions raise nothing for a frame that cannot be: an array of codes of `shipnet.errors` says
which.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from shipnet.crc import crc_batch
from shipnet.errors import ArgumentError, CrcError, FieldError, LengthError
from shipnet.modbus.codes import READ_LIMITS, FunctionCode
from shipnet.modbus.frame import LAST_UNIT

__all__ = ["Encoded", "check_frames", "encode_requests"]

Codes = npt.NDArray[np.uint8]
Integers = npt.NDArray[np.int64]

#: Highest last field by function code; a coil is 0 or 1. No other code has a frame of 8 bytes.
_HIGHEST = np.array([-1, *(READ_LIMITS[FunctionCode(k)] for k in range(1, 5)), 1, 0xFFFF])


class Encoded(NamedTuple):
    """Requests on the line.

    Attributes
    ----------
    error : ndarray of uint8, shape (n,)
        0, or ``ArgumentError.code`` where there is no such request; its row is then 0.
    frames : ndarray of uint8, shape (n, 8)
        A frame a row, CRC included.
    """

    error: Codes
    frames: npt.NDArray[np.uint8]


def encode_requests(
    unit_id: npt.ArrayLike,
    function: npt.ArrayLike,
    address: npt.ArrayLike,
    value: npt.ArrayLike,
) -> Encoded:
    """Return the RTU frames of many requests of function codes 1 to 6.

    Parameters
    ----------
    unit_id : array_like of int, shape () or (n,)
        Addresses of the slaves, 0..247.
    function : array_like of int, shape () or (n,)
        Function codes, 1..6.
    address : array_like of int, shape () or (n,)
        Starting addresses, 0..65535.
    value : array_like of int, shape () or (n,)
        Function codes 1 and 2: quantity 1..2000; 3 and 4: quantity 1..125; 5: coil 0 or 1; 6:
        register 0..65535.

    Returns
    -------
    Encoded
        Errors and frames.

    Raises
    ------
    ArgumentError
        If an array is not of whole numbers, or if the shapes do not fit.

    Examples
    --------
    >>> [row.tobytes().hex() for row in encode_requests([1, 2], [4, 6], 0x4020, 4).frames]
    ['010440200004e5c3', '0206402000049c30']
    """
    given = {"unit_id": unit_id, "function": function, "address": address, "value": value}
    arrays = [_whole(name, values) for name, values in given.items()]
    try:
        unit, code, start, last = (np.atleast_1d(a) for a in np.broadcast_arrays(*arrays))
    except ValueError:
        shapes = ", ".join(str(array.shape) for array in arrays)
        raise ArgumentError(f"shapes are {shapes}; each must be () or (n,)") from None
    if unit.ndim != 1:
        raise ArgumentError(f"the arrays have {unit.ndim} axes; they must have one")
    known = (code >= 1) & (code < len(_HIGHEST))
    highest = _HIGHEST[np.where(known, code, 0)]
    good = known & (unit >= 0) & (unit <= LAST_UNIT) & (start >= 0) & (start <= 0xFFFF)
    good &= (last >= (code <= FunctionCode.READ_INPUT_REGISTERS)) & (last <= highest)
    field = np.where(code == FunctionCode.WRITE_SINGLE_COIL, 0xFF00 * (last == 1), last)
    frames = np.zeros((unit.size, 8), np.uint8)
    columns = (unit, code, start >> 8, start, field >> 8, field)
    for place, column in enumerate(columns):
        frames[:, place] = column & 0xFF
    check = crc_batch("CRC-16/MODBUS", frames[:, :6])
    frames[:, 6], frames[:, 7] = check & 0xFF, check >> 8
    frames[~good] = 0
    return Encoded(np.where(good, 0, ArgumentError.code).astype(np.uint8), frames)


def check_frames(frames: npt.ArrayLike, lengths: npt.ArrayLike | None = None) -> Codes:
    """Return what is wrong with many RTU frames, as `decode_rtu` finds it one by one.

    Parameters
    ----------
    frames : array_like of uint8, shape (n, n_bytes)
        A frame a row.
    lengths : array_like of int, shape () or (n,), optional
        Bytes of each frame, 0..n_bytes; all if omitted.

    Returns
    -------
    ndarray of uint8, shape (n,)
        0, or the code of `LengthError`, `CrcError` or `FieldError`.

    Raises
    ------
    ArgumentError
        If `frames` are no rows of uint8, or a length is out of range.

    Examples
    --------
    >>> rows = encode_requests(1, 4, 0, [1, 2]).frames
    >>> rows[1, 3] ^= 1
    >>> check_frames(rows).tolist()
    [0, 14]
    """
    rows = np.asarray(frames)
    if rows.dtype != np.uint8 or rows.ndim != 2:
        raise ArgumentError(f"frames must be rows of uint8, but are {rows.dtype}, {rows.ndim}-d")
    n, width = rows.shape
    size = _whole("lengths", width if lengths is None else lengths)
    if size.shape not in ((), (n,)) or (size.size and not 0 <= size.min() <= size.max() <= width):
        raise ArgumentError(f"lengths must be 0..{width}, one for each of {n} frames")
    legal = np.broadcast_to((size >= 4) & (size <= 256), (n,))
    if not legal.any():
        return np.full(n, LengthError.code, np.uint8)
    # Behind the frame itself, the register of a reflected CRC without final addition is 0.
    rest = crc_batch("CRC-16/MODBUS", rows, np.broadcast_to(size, (n,)))
    error = np.where(rest != 0, CrcError.code, np.where(rows[:, 0] > LAST_UNIT, FieldError.code, 0))
    return np.where(legal, error, LengthError.code).astype(np.uint8)


def _whole(name: str, values: Any) -> Integers:
    try:
        array = np.asarray(values)
    except ValueError:
        raise ArgumentError(f"{name} must be whole numbers, in rows of equal length") from None
    if array.dtype.kind not in "iu" and array.size:
        raise ArgumentError(f"{name} must be whole numbers, but their dtype is {array.dtype}")
    if array.dtype == np.uint64 and array.size and array.max() > np.iinfo(np.int64).max:
        raise ArgumentError(f"{name} reaches {array.max()}, which no field holds")
    return array.astype(np.int64)
