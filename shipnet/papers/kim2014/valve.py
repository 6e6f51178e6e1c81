"""Tables 2 and 3, section 3.2: registers of a valve, its command codes, its converter."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from shipnet import datasets
from shipnet.ballast.registers import (
    CODE_READINGS,
    HIGHEST,
    SCALES,
    Code,
    RegisterMap,
    command_codes,
    whole_steps,
)
from shipnet.ballast.sensors import CHANNELS, Sensors
from shipnet.papers.registry import check, numeric

if TYPE_CHECKING:
    import pandas as pd


_VPOS = [channel.name for channel in CHANNELS].index("VPos")


def _status(readings: list[list[float]], **flags: bool) -> tuple[int, bool]:
    """Return register 0x4020 as Table 2 has it, and whether the position did not fit."""
    packed = RegisterMap(status="table 2").encode(readings, **flags)
    return int(packed.registers[0, 0]), bool(packed.saturated[0, _VPOS])


def _at(position: float) -> list[list[float]]:
    return [[0.0], [0.0], [0.0], [50.0], [position]]


@numeric("kim2014-023")
def channels(
    *, pressure: int = 2, current: int = 1, temperature: int = 1, position: int = 1
) -> int:
    """Sensors of a slave, each of which needs a channel of the converter."""
    return pressure + current + temperature + position


@check("kim2014-021", counter={"reading": "flag sum"})
def codes_differ(*, reading: str = "decimal") -> bool:
    """Whether every command has a code of its own, as this reading of Table 2 has them."""
    return bool(code_table()[reading].is_unique)


@check("kim2014-022", counter={"highest": 305.0})
def position_fits(*, highest: float = 100.0) -> bool:
    """Whether positions up to this [%] fit the high byte of a register."""
    ends = (_status(_at(position), close=False, open=True) for position in (0.0, highest))
    return not any(saturated for _, saturated in ends)


@check("kim2014-055", counter={"commands": ("Position Close", "Position Open")})
def status_is_the_command(*, commands: tuple[str, ...] = tuple(c.value for c in Code)) -> bool:
    """Whether the status of Table 2, read where the command leads, is the value of the command."""
    where = {"Close": 0.0, "Open": 100.0, "Position Close": 40.0, "Position Open": 40.0}
    for name in commands:
        code, position = Code(name), where.get(name, 0.0)
        written = RegisterMap().command(code, int(position) if "Position" in name else 0)
        opened, closed = (word in name for word in ("Open", "Close"))
        flags = {"auto": code is not Code.MANUAL, "open": opened, "close": closed}
        if _status(_at(position), **flags)[0] != written:
            return False
    return True


@check("kim2014-059", counter={"other": "table 2"})
def status_bits_agree(*, other: str = "table 3") -> bool:
    """Whether this table has the status bits where Table 2 has them."""
    words = [
        RegisterMap(status=table).encode(_at(0.0), close=False, open=True).registers[0, 0]
        for table in ("table 2", other)
    ]
    return bool(words[0] == words[1])


@check("kim2014-060", counter={"mode": "Auto"})
def position_codes_hold(*, mode: str = "Manual") -> bool:
    """Whether both position codes, read as sums of flags, hold the flag of this mode."""
    codes = command_codes("flag sum")
    positions = (codes[Code.POSITION_CLOSE], codes[Code.POSITION_OPEN])
    return all(code & codes[Code(mode)] for code in positions)


@numeric("kim2014-078")
def converter_step(*, bits: int = 12, span: float = 100.0) -> float:
    """Percent of the position from one code of the converter to the next."""
    scale = Sensors()
    high = (*scale.high[:_VPOS], span)
    return float(Sensors((0.0,) * len(CHANNELS), high, bits=bits).step[_VPOS])


@numeric("kim2014-079")
def angle_step(*, travel: float = 90.0) -> float:
    """Degrees that one step of the position is, of a travel of so many degrees."""
    return SCALES[_VPOS].step / 100 * travel


@numeric("kim2014-081")
def largest_position(*, bits: int = 8) -> int:
    """What a register of so many bits tells of a position of 305."""
    return int(whole_steps(np.array([305.0]), 2**bits - 1)[0][0])


@numeric("kim2014-044")
def colours(*, bits: int = 16) -> int:
    """Colours of a display with so many bits a pixel."""
    return int(2**bits)


@check("kim2014-062", counter={"other": "PP"})
def pump_pressure_is_called(*, other: str = "FP") -> bool:
    """Whether this, the name in the rule table, is the name of the pump pressure in Table 3."""
    rows = datasets.read("kim2014_table3_read_registers_bits.csv").query("part == 'register'")
    remark = rows.loc[rows["remark_printed"].str.startswith("motor temperature"), "remark_printed"]
    return bool(remark.str.endswith(f"pressure {other}").all())


def code_table() -> pd.DataFrame:
    """Return the codes of all readings beside each other.

    Returns
    -------
    pandas.DataFrame
        Indexed by command, one column a reading.

    Examples
    --------
    Only two of the readings tell all commands apart:

    >>> code_table().apply(lambda codes: codes.is_unique).to_dict()
    {'flag sum': True, 'one bit': True, 'decimal': False, 'hexadecimal': False}
    """
    import pandas as pd

    columns = {reading: command_codes(reading) for reading in CODE_READINGS}
    index = pd.Index([code.value for code in Code], name="command")
    return pd.DataFrame({r: list(codes.values()) for r, codes in columns.items()}, index=index)


def survival_table() -> pd.DataFrame:
    """Return what becomes of the values of the paper's fault tests on their way to the master.

    Returns
    -------
    pandas.DataFrame
        One row a value of the rule table: ``code``, ``channel``, ``value``, ``received``,
        ``saturated``, and ``survives``: received within half a step. Positions are the mended ones,
        and 305 as printed besides.

    Examples
    --------
    >>> table = survival_table()
    >>> table[~table["survives"]].groupby("channel")["value"].unique().to_dict()
    {'VPos': array([305.,  -5.])}
    """
    import pandas as pd

    rules = pd.read_csv(datasets.path("kim2014_rule_table.csv"), dtype=str)
    rows = []
    for rule in rules.to_dict("records"):
        for k, scale in enumerate(SCALES):
            name = scale.channel.lower()
            texts = [rule[f"{name}_printed"]] + [rule.get("vpos_mended_percent")] * (name == "vpos")
            numbers = [str(t).split(" or ") for t in texts if isinstance(t, str)]
            for value in dict.fromkeys(float(n) for several in numbers for n in several):
                sent, saturated = whole_steps(np.array([value]) / scale.step, HIGHEST)
                got = float(sent[0]) * scale.step
                survives = abs(got - value) <= scale.step / 2 + 1e-9
                rows.append((rule["code"], CHANNELS[k].name, value, got, saturated[0], survives))
    columns = ["code", "channel", "value", "received", "saturated", "survives"]
    return pd.DataFrame(rows, columns=columns)
