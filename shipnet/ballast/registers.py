"""The registers of a valve: command codes, scales, and a status of four registers.

The paper prints no scales, and its tables disagree about the status bits and the command codes.
"""

from __future__ import annotations

import csv
from collections.abc import Iterable
from enum import Enum
from functools import cache
from numbers import Real
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from shipnet.arrays import Bools, Floats, Integers, Words
from shipnet.ballast.sensors import CHANNELS, Sensors
from shipnet.datasets import path
from shipnet.errors import ArgumentError, FieldError
from shipnet.fields import check_scalar, check_whole, choice, record
from shipnet.lazy import pd

#: Interpretations of the codes of Table 2: column of the data file, and base of its numbers. The
#: first is used: its position codes are 6 and 10, the code for auto plus that for close or open.
CODE_READINGS = {
    "flag sum": ("code_flag_sum", 10),
    "one bit": ("code_one_bit", 10),
    "decimal": ("code_printed", 10),
    "hexadecimal": ("code_printed", 16),
}


class Code(Enum):
    """The commands in the command register, by their names in Table 2."""

    MANUAL = "Manual"
    AUTO = "Auto"
    CLOSE = "Close"
    OPEN = "Open"
    POSITION_CLOSE = "Position Close"
    POSITION_OPEN = "Position Open"


@cache
def command_codes(reading: str = "flag sum") -> dict[Code, int]:
    """Return the command codes for one of the `CODE_READINGS`."""
    column, base = CODE_READINGS[reading]
    with path("kim2014_table2_write_register_bits.csv").open(encoding="utf-8") as file:
        rows = [row for row in csv.DictReader(file) if row["message"] == "query"]
    return {Code(row["name_printed"]): int(row[column], base) for row in rows}


#: Input registers of the status; Tables 1 and 3 of the paper.
FIRST_REGISTER, N_REGISTERS = 0x4020, 4

#: The largest number of steps in a byte, and the byte for a missing value. The paper names no such
#: byte; without it, a dead sensor would seem to read the end of its scale.
HIGHEST, MISSING = 0xFE, 0xFF


class Scale(NamedTuple):
    """The register and bits of a reading, and its step."""

    channel: str
    register: int
    shift: int
    step: float


#: Scales in the order of the channels. The bytes are those of Table 3; the steps are assumed.
SCALES = (
    Scale("FP", 0x4022, 0, 1.0),
    Scale("OP", 0x4023, 0, 0.1),
    Scale("MC", 0x4023, 8, 0.1),
    Scale("OT", 0x4022, 8, 1.0),
    Scale("VPos", 0x4020, 8, 1.0),
)


def whole_steps(
    values: Floats, highest: npt.ArrayLike, missing: npt.ArrayLike | None = None
) -> tuple[Integers, Bools]:
    """Return values rounded and clipped to 0..`highest`, and a mask of those outside or NaN."""
    unknown = np.isnan(values)
    rounded = np.rint(np.where(unknown, highest, values))
    kept = np.minimum(np.maximum(rounded, 0), highest)
    sent = kept if missing is None else np.where(unknown, missing, kept)
    return sent.astype(np.int64), unknown | (kept != rounded)


#: Holding register of the command; Tables 1 and 2 of the paper.
COMMAND_REGISTER = 0x4001

#: Step of the operating time [s]; our assumption, like all scales.
_TIME_STEP = 0.1

#: Step of each reading, shape (5, 1).
_STEPS = np.array([[scale.step] for scale in SCALES])

#: The amount that one step of each reading, and of the operating time, adds to each register.
_PLACES = np.zeros((N_REGISTERS, len(SCALES) + 1), np.int64)
for _k, _scale in enumerate(SCALES):
    _PLACES[_scale.register - FIRST_REGISTER, _k] = 1 << _scale.shift
_PLACES[1, -1] = 1


class Packed(NamedTuple):
    """Registers that a slave sends, and a mask of the readings that did not fit."""

    registers: Words
    saturated: Bools


class Status(NamedTuple):
    """A status that a master has read."""

    readings: Floats
    auto: Bools
    close: Bools
    open: Bools
    fault: Integers
    operating_time: Floats

    def table(self) -> pd.DataFrame:
        """Return one row per status: readings, flags, ``fault`` and ``operating_s``."""
        table = pd.DataFrame(self.readings.T, columns=[channel.column for channel in CHANNELS])
        flags = {name: getattr(self, name) for name in ("auto", "close", "open", "fault")}
        return table.assign(**flags, operating_s=self.operating_time)


@record(slots=True)
class RegisterMap:
    """An interpretation of Tables 2 and 3.

    Examples
    --------
    >>> registers = RegisterMap().encode([[90.06], [2.07], [1.2], [50.2], [40]], close=False,
    ...                                open=True, operating_time=3.6).registers
    >>> [f"{value:04x}" for value in registers[0]]
    ['2828', '0024', '325a', '0c15']
    >>> f"0x{RegisterMap().encode_command(40):04X}"
    '0x280A'
    """

    status: str = choice(
        ("table 3", "table 2"),
        "Bits of Manual, Auto, Close and Open in 0x4020: Bit2 to Bit5 as in table 3, or Bit0 to "
        "Bit3 as in the response of table 2. Neither table prints the place of the fault number. "
        "With table 3 it is the high byte of 0x4021, and the operating time is the low byte; "
        "with table 2 it is Bit4 to Bit7, and the time fills 0x4021",
        default="table 3",
    )

    def encode(
        self,
        readings: npt.ArrayLike,
        *,
        auto: bool = True,
        close: bool,
        open: bool,
        fault: int = 0,
        operating_time: float = 0.0,
    ) -> Packed:
        """Return the status registers of valves with the given flags and readings (5, n_valves)."""
        values = np.asarray(readings, float)
        if values.ndim != 2 or len(values) != len(SCALES):
            raise ArgumentError(f"readings have the shape {values.shape}; it must be (5, n_valves)")
        row = check_whole("fault", fault, 0, 12)
        lasted = check_scalar("operating_time", operating_time, "s", 0, 1e9)
        in_status = self.status == "table 2"
        steps = np.full((len(SCALES) + 1, values.shape[1]), lasted / _TIME_STEP)
        steps[:-1] = values / _STEPS
        highest, missing = np.full((2, len(steps), 1), 0xFFFF if in_status else 0xFF)
        highest[:-1], missing[:-1] = HIGHEST, MISSING
        numbers, saturated = whole_steps(steps, highest, missing)
        registers = _PLACES @ numbers
        flags = (not auto) | auto << 1 | close << 2 | open << 3
        registers[0] |= flags << self._first_bit
        registers[0 if in_status else 1] |= row << (4 if in_status else 8)
        return Packed(registers.T.astype(np.uint16), saturated.T)

    def decode(self, registers: npt.ArrayLike) -> Status:
        """Return the statuses contained in rows of four registers."""
        rows = np.asarray(registers)
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
        # The Manual bit is the inverse of Auto.
        auto, close, opened = ((bits >> bit & 1).astype(bool) for bit in (1, 2, 3))
        return Status(readings, auto, close, opened, fault, ticks * _TIME_STEP)

    def command(self, code: Code, position: int = 0) -> int:
        """Return the value of the command register."""
        code = Code(code)
        highest = 100 if code in (Code.POSITION_CLOSE, Code.POSITION_OPEN) else 0
        percent = check_whole("position", position, 0, highest, f" for {code.value}")
        return percent << 8 | command_codes()[code]

    def encode_command(self, action: str | float, now: float = 0.0) -> int:
        """Return the command register for ``open``, ``close``, ``manual``, ``auto`` or a position.

        A position, 0..100 [%], is rounded to a whole number; the code depends on whether the
        position is below the present one, `now`.
        """
        codes = {c.value.lower(): c for c in (Code.OPEN, Code.CLOSE, Code.MANUAL, Code.AUTO)}
        target, last = check_action(action, codes), check_scalar("now", now, "%", 0, 255)
        if isinstance(target, str):
            return self.command(codes[target])
        whole = round(target)
        return self.command(Code.POSITION_CLOSE if whole < last else Code.POSITION_OPEN, whole)

    def table(self) -> pd.DataFrame:
        """Return the register, the step and the largest error of each reading.

        The error is that of converter and register together, for readings within both scales.
        """
        rows = [
            (
                scale.channel,
                channel.unit,
                f"0x{scale.register:04X}",
                "high" if scale.shift else "low",
                scale.step,
                HIGHEST * scale.step,
                MISSING,
                step,
                (scale.step + step) / 2,
            )
            for scale, channel, step in zip(SCALES, CHANNELS, Sensors().step, strict=True)
        ]
        columns = ["channel", "unit", "register", "byte", "step", "highest", "missing"]
        columns += ["converter_step", "largest_error"]
        return pd.DataFrame(rows, columns=columns).set_index("channel")

    def decode_command(self, value: int) -> tuple[Code, int]:
        """Return the command encoded in a register value, and its position [%]; 0 if none."""
        word = check_whole("value", value, 0, 0xFFFF)
        position, number = word >> 8, word & 0xFF
        codes = {number: code for code, number in command_codes().items()}
        if number not in codes:
            raise FieldError(f"code is {number}; it must be one of {', '.join(map(str, codes))}")
        if codes[number] not in (Code.POSITION_CLOSE, Code.POSITION_OPEN):
            return codes[number], 0
        if position > 100:
            raise FieldError(f"position is {position} %; it must be 0..100")
        return codes[number], position

    @property
    def _first_bit(self) -> int:
        return 0 if self.status == "table 2" else 2


def check_action(action: Any, words: Iterable[str]) -> str | float:
    """Return an action if it is one of the words or a position [%]; raise for anything else."""
    if isinstance(action, str) and action in words:
        return action
    plain = isinstance(action, Real) and not isinstance(action, bool)
    if plain and 0 <= action <= 100:
        return float(action)
    names = ", ".join(words)
    raise ArgumentError(f"action is {action!r}; it must be one of {names}, or a position 0..100 %")
