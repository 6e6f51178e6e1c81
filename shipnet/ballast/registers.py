"""The registers of a valve: a command of two bytes, and four registers of status.

The paper prints no scales, and its tables disagree about the status bits and the command codes; a
`RegisterMap` says which reading is meant.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from shipnet.ballast.codes import READINGS, Code, command_codes
from shipnet.ballast.scales import (
    FIRST_REGISTER,
    HIGHEST,
    MISSING,
    N_REGISTERS,
    SCALES,
    whole_steps,
)
from shipnet.errors import ArgumentError, FieldError
from shipnet.fields import check_whole

__all__ = ["COMMAND_REGISTER", "Packed", "RegisterMap", "Status"]

Floats = npt.NDArray[np.float64]

#: Holding register of the command; Tables 1 and 2 of the paper.
COMMAND_REGISTER = 0x4001

#: Step of the operating time [s]; our assumption, as all scales are.
_TIME_STEP = 0.1

#: Step of each reading, shape (5, 1).
_STEPS = np.array([[scale.step] for scale in SCALES])

#: What is sent at most, and instead of NaN, by the longest operating time; each shape (6, 1).
_HIGHEST = {last: np.array([[HIGHEST]] * len(SCALES) + [[last]]) for last in (0xFF, 0xFFFF)}
_MISSING = {last: np.array([[MISSING]] * len(SCALES) + [[last]]) for last in (0xFF, 0xFFFF)}

#: What a step of each reading, and of the operating time, adds to each register, shape (4, 6).
_PLACES = np.zeros((N_REGISTERS, len(SCALES) + 1), np.int64)
for _k, _scale in enumerate(SCALES):
    _PLACES[_scale.register - FIRST_REGISTER, _k] = 1 << _scale.shift
_PLACES[1, -1] = 1

#: Bits of Manual, Auto, Close and Open, from the first of them on.
_FLAGS = np.array([1, 2, 4, 8])


class Packed(NamedTuple):
    """What a slave sends.

    Attributes
    ----------
    registers : ndarray of uint16, shape (n_valves, 4)
        Registers 0x4020 to 0x4023.
    saturated : ndarray of bool, shape (n_valves, 6)
        Whether FP, OP, MC, OT, VPos or the operating time did not fit into its bits, or was
        missing.
    """

    registers: npt.NDArray[np.uint16]
    saturated: npt.NDArray[np.bool_]


class Status(NamedTuple):
    """What a master reads.

    Attributes
    ----------
    readings : ndarray of float, shape (5, n_valves)
        FP, OP, MC, OT and VPos, in steps of their scale; NaN where the slave had none.
    manual, auto, close, open : ndarray of bool, shape (n_valves,)
        Mode, and which way the valve was sent last.
    fault : ndarray of int, shape (n_valves,)
        Row of the rule table, 0 for none.
    operating_time : ndarray of float, shape (n_valves,)
        How long the motor ran last [s].
    """

    readings: Floats
    manual: npt.NDArray[np.bool_]
    auto: npt.NDArray[np.bool_]
    close: npt.NDArray[np.bool_]
    open: npt.NDArray[np.bool_]
    fault: npt.NDArray[np.int64]
    operating_time: Floats


@dataclass(frozen=True, slots=True)
class RegisterMap:
    """A reading of Tables 2 and 3.

    Parameters
    ----------
    status : str, default "table 3"
        Places of Manual, Auto, Close and Open in the low byte of 0x4020: Bit2 to Bit5 as in
        ``table 3``, or Bit0 to Bit3 as in the response of ``table 2``. The number of the fault,
        whose place neither prints, then stands in the high byte of 0x4021 or in Bit4 to Bit7; the
        operating time has the other 8 bits of 0x4021, or all 16.
    codes : str, default "flag sum"
        Command codes: ``flag sum`` (position codes 6 and 10, auto added to close and open),
        ``one bit`` (16 and 32), or as printed, with 10 read as ``decimal`` or ``hexadecimal``.

    Raises
    ------
    ArgumentError
        If there is no such reading.

    Examples
    --------
    >>> registers = RegisterMap().pack([[90.06], [2.07], [1.2], [50.2], [40]], close=False,
    ...                                open=True, operating_time=3.6).registers
    >>> [f"{value:04x}" for value in registers[0]]
    ['2828', '0024', '325a', '0c15']
    """

    status: str = "table 3"
    codes: str = "flag sum"

    def __post_init__(self) -> None:
        """Check both."""
        if self.status not in ("table 2", "table 3"):
            raise ArgumentError(f"status is {self.status!r}; it must be 'table 2' or 'table 3'")
        if not isinstance(self.codes, str):
            raise ArgumentError(f"codes is {self.codes!r}; it must be one of {', '.join(READINGS)}")
        command_codes(self.codes)

    def pack(
        self,
        readings: npt.ArrayLike,
        *,
        auto: npt.ArrayLike = True,
        close: npt.ArrayLike,
        open: npt.ArrayLike,
        fault: npt.ArrayLike = 0,
        operating_time: npt.ArrayLike = 0.0,
    ) -> Packed:
        """Return the registers of many valves.

        Parameters
        ----------
        readings : array_like of float, shape (5, n_valves)
            FP, OP, MC, OT and VPos; up to 254 steps of their scale. NaN, such as of a dead sensor,
            is sent as 255, which stands for nothing else.
        auto : array_like of bool, default True
            Mode: auto, else manual.
        close, open : array_like of bool
            Which way the valve was sent last.
        fault : array_like of int, default 0
            Row of the rule table, 0..12.
        operating_time : array_like of float, default 0
            How long the motor ran last, 0 or more [s].

        Returns
        -------
        Packed
            Registers, and what did not fit: it is sent as the nearest that does.

        Raises
        ------
        ArgumentError
            If a fault is out of range, a flag is not True or False (or 1 or 0), a reading is no
            number, or if the shapes do not fit.
        """
        try:
            values = np.asarray(readings, float)
        except (TypeError, ValueError):
            raise ArgumentError("readings must be five rows of numbers of one length") from None
        if values.ndim != 2 or len(values) != len(SCALES):
            raise ArgumentError(f"readings have the shape {values.shape}; it must be (5, n_valves)")
        n = values.shape[1]
        flags, times = np.empty((4, n), bool), np.empty(n)
        for name, flag in (("auto", auto), ("close", close), ("open", open)):
            _check_flag(name, flag)
        try:
            given = np.asarray(fault)
            faults = np.empty(n, given.dtype)
            # An assignment costs a tenth of broadcast_to, and a slave is packed at every poll.
            flags[1], flags[2], flags[3], times[:], faults[:] = (
                auto, close, open, operating_time, given,
            )  # fmt: skip
        except (TypeError, ValueError):
            raise ArgumentError(f"a flag, fault or time does not fit {n} valves") from None
        if faults.dtype.kind not in "iu" or np.count_nonzero((faults < 0) | (faults > 12)):
            raise ArgumentError(f"fault is {fault!r}; it must be a whole number 0..12")
        flags[0] = ~flags[1]
        in_status = self.status == "table 2"
        steps = np.empty((len(SCALES) + 1, n))
        steps[:-1], steps[-1] = values / _STEPS, times / _TIME_STEP
        longest = 0xFFFF if in_status else 0xFF
        numbers, saturated = whole_steps(steps, _HIGHEST[longest], _MISSING[longest])
        registers = _PLACES @ numbers
        registers[0] |= (_FLAGS @ flags) << self._first_bit
        registers[0 if in_status else 1] |= faults.astype(int) << (4 if in_status else 8)
        return Packed(registers.T.astype(np.uint16), saturated.T)

    def unpack(self, registers: npt.ArrayLike) -> Status:
        """Return what registers say.

        Parameters
        ----------
        registers : array_like of int, shape (n_valves, 4)
            Registers 0x4020 to 0x4023, 0..65535.

        Returns
        -------
        Status
            Readings and flags of each valve; a byte of 255 is a reading that is missing.

        Raises
        ------
        ArgumentError
            If they are no rows of four registers.
        """
        try:
            rows = np.asarray(registers)
        except ValueError:
            raise ArgumentError("registers must be rows of four whole numbers") from None
        if rows.ndim != 2 or rows.shape[1] != N_REGISTERS or rows.dtype.kind not in "iu":
            raise ArgumentError("registers must be rows of four whole numbers")
        if rows.size and (rows.min() < 0 or rows.max() > 0xFFFF):
            raise ArgumentError("registers must be 0..65535")
        words = rows.astype(np.int64).T
        numbers = np.stack([(words[s.register - FIRST_REGISTER] >> s.shift) & 0xFF for s in SCALES])
        readings = np.where(numbers == MISSING, np.nan, numbers * _STEPS)
        bits = words[0] >> self._first_bit
        if self.status == "table 2":
            fault, ticks = words[0] >> 4 & 0xF, words[1]
        else:
            fault, ticks = words[1] >> 8, words[1] & 0xFF
        manual, auto, close, opened = ((bits >> place & 1).astype(bool) for place in range(4))
        return Status(readings, manual, auto, close, opened, fault, ticks * _TIME_STEP)

    def command(self, code: Code, position: int = 0) -> int:
        """Return the value of the command register.

        Parameters
        ----------
        code : Code
            What to do.
        position : int, default 0
            Where to go, 0..100 [%]; with a position code only.

        Returns
        -------
        int
            0..65535, the position in the high byte.

        Raises
        ------
        ArgumentError
            If it is no `Code`, or if the position is out of range, or not 0 with another code.

        Examples
        --------
        >>> f"0x{RegisterMap().command(Code.POSITION_OPEN, 40):04X}"
        '0x280A'
        """
        if not isinstance(code, Code):
            names = ", ".join(f"Code.{known.name}" for known in Code)
            raise ArgumentError(f"code is {code!r}; it must be one of {names}")
        highest = 100 if code in (Code.POSITION_CLOSE, Code.POSITION_OPEN) else 0
        percent = check_whole("position", position, 0, highest, f" for {code.value}")
        return percent << 8 | command_codes(self.codes)[code]

    def decode_command(self, value: int) -> tuple[Code, int]:
        """Return what a command register asks for.

        Parameters
        ----------
        value : int
            0..65535.

        Returns
        -------
        code : Code
            What to do.
        position : int
            Where to go [%]; 0 with a code that needs none.

        Raises
        ------
        FieldError
            If no command, or more than one, has this code, or if the position is beyond 100 %.

        Examples
        --------
        >>> RegisterMap(codes="decimal").decode_command(0x0008)
        Traceback (most recent call last):
            ...
        shipnet.errors.FieldError: code 8 stands for Open and for Position Close
        """
        word = check_whole("value", value, 0, 0xFFFF)
        position, number = word >> 8, word & 0xFF
        meant = [code for code, known in command_codes(self.codes).items() if known == number]
        if len(meant) != 1:
            names = " and for ".join(code.value for code in meant) or "no command"
            raise FieldError(f"code {number} stands for {names}")
        if meant[0] not in (Code.POSITION_CLOSE, Code.POSITION_OPEN):
            return meant[0], 0
        if position > 100:
            raise FieldError(f"position is {position} %; it must be 0..100")
        return meant[0], position

    @property
    def _first_bit(self) -> int:
        return 0 if self.status == "table 2" else 2


def _check_flag(name: str, flag: npt.ArrayLike) -> None:
    if isinstance(flag, bool | np.bool_):
        return
    try:
        values = np.asarray(flag)
        good = values.dtype.kind in "biu" and bool(((values == 0) | (values == 1)).all())
    except ValueError:
        good = False
    if not good:
        raise ArgumentError(f"{name} is {flag!r}; it must be True or False, one or a row of them")
