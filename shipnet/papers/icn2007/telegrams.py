"""Sections 4 and 5 and the data link layer: cable of a star, bits, telegrams, access, rates."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import numpy.typing as npt

from shipnet.asi.faults import DeadSlave, LostReply, MasterFailure
from shipnet.asi.master import Master
from shipnet.asi.simulation import Run, Standby, simulate
from shipnet.asi.slave import Slave
from shipnet.asi.telegram import REQUEST_BITS, Call, Half, Request
from shipnet.asi.timing import Transaction, cycle_time
from shipnet.errors import ArgumentError
from shipnet.fields import check_whole
from shipnet.papers.kim2023.network import CHIP_EDGES, master_pause_of_chip
from shipnet.papers.registry import check, numeric

if TYPE_CHECKING:
    import pandas as pd


@numeric("icn2007-035")
def metres_per_star_leg(*, total: float = 100, trunk: float = 90, slaves: int = 62) -> float:
    """Cable that is left for each leg of the star at the end of the trunk."""
    return (total - trunk) / slaves


@numeric("icn2007-005")
def bit_time_in_ms(*, rate: float = 167e3) -> float:
    """Milliseconds a bit, from the rate in the same paragraph."""
    return 1e3 / rate


@numeric("icn2007-015")
def extra_pause(*, edges: tuple[float, ...] = CHIP_EDGES) -> float:
    """Bit times that a slave takes longer when it is not synchronous, at most."""
    synchronous, asynchronous = edges[1], edges[-1]
    return master_pause_of_chip(edge=asynchronous) - master_pause_of_chip(edge=synchronous)


@check("icn2007-018", counter={"data": 0xA})
def example_for_21a(*, data: int = 0xE) -> bool:
    """Whether the example's request is also a request to slave 21A with data 6."""
    bits = Request.data_exchange(21, data).bits
    return Request.parse(bits, extended=True) == Request.data_exchange(21, 0x6, "A")


@numeric("icn2007-044")
def standard_output_bits(*, layout: str = Call.DATA_EXCHANGE.rule.pattern) -> int:
    """Output bits of a request to a standard slave."""
    return layout.count("d")


@check("icn2007-045", counter={"asked": True})
def same_answer(
    *, halves: tuple[Half | None, Half | None] = (None, "A"), asked: bool = False
) -> bool:
    """Whether a standard slave and an A slave answer with the same bits (not: are asked)."""
    requests = [Request.data_exchange(21, 0x6, half) for half in halves]
    said = [request if asked else request.answer(0x6) for request in requests]
    return said[0].bits == said[1].bits


@numeric("icn2007-036")
def slaves_before_2_1(*, layout: str = Call.DATA_EXCHANGE.rule.pattern) -> int:
    """Every address but 0."""
    return (1 << layout.count("a")) - 1


@numeric("icn2007-020")
def extended_output_bits(*, layout: str = Call.DATA_EXCHANGE.rule.extended) -> int:
    """Output bits of a request to a slave that shares its address."""
    return layout.count("d")


@numeric("icn2007-021")
def request_information(*, layout: str = Call.DATA_EXCHANGE.rule.pattern) -> int:
    """Bits of a request that must be checked: all but start, parity and end bit."""
    return len(layout)


@numeric("icn2007-025")
def net_rate(*, user_bits: int = 8, master_pause: float = 2, slave_pause: float = 2) -> float:
    """Kilobits of user data a second, four bits each way in every transaction."""
    return 1e-3 * user_bits / Transaction(master_pause, slave_pause).duration


@numeric("icn2007-026")
def efficiency(*, user_bits: int = 8, master_pause: float = 2, slave_pause: float = 2) -> float:
    """User bits in percent of all bit times of a transaction."""
    return 100 * user_bits / Transaction(master_pause, slave_pause).bits


@check("icn2007-029", counter={"call": Call.RESET})
def broadcast_is_silent(*, call: Call = Call.BROADCAST_RESET) -> bool:
    """Whether no slave answers this call."""
    return call.rule.answer is None


# Who answers whom, what a lost reply leads to, and who takes over ------------------------------


ADDRESSES = range(1, 6)


def line() -> list[Slave]:
    """Return five slaves with four inputs each."""
    return [Slave(f"{address}") for address in ADDRESSES]


def gap_after_silence(run: Run, slave: str) -> float:
    """Return how long the master waits for an answer that does not come [bit]."""
    rows = run.events()
    silent = rows.index[(rows["slave"] == slave) & (rows["outcome"] == "SilenceError")]
    start = rows["time_s"].to_numpy()
    bit_time = run.record.transaction.bit_time
    return float(min(start[silent[:-1] + 1] - start[silent[:-1]])) / bit_time - REQUEST_BITS


@check("kim2023-089", counter={"wait": 11.0})
def repeats_after(*, wait: float = 10.0) -> bool:
    """Whether the master repeats a request after this many bit times without an answer."""
    run = simulate(line(), cycles=20, faults=[DeadSlave("3", start=0.02)])
    rows = run.events()
    silent = rows[(rows["slave"] == "3") & (rows["outcome"] == "SilenceError")]
    return bool((silent["attempt"] == 1).any()) and round(gap_after_silence(run, "3"), 6) == wait


@check("icn2007-038", counter={"wait": 11.0})
def goes_on_after(*, wait: float = 10.0) -> bool:
    """Whether the next request follows this many bit times after one without an answer."""
    run = simulate(line(), cycles=20, faults=[DeadSlave("3", start=0.02)])
    return round(gap_after_silence(run, "3"), 6) == wait


@check("icn2007-028", counter={"damaged": False})
def silent_after_error(*, damaged: bool = True) -> bool:
    """Whether a slave in step leaves a damaged request without an answer."""
    bits = Request.read_id(3).bits
    return (
        answer_to(bits[:-2] + str(1 - int(bits[-2])) + bits[-1] if damaged else bits) == "silence"
    )


@check("icn2007-052", counter={"bits": Request.read_id(3).bits})
def silent_to_others(*, bits: str = "") -> bool:
    """Whether a slave in step leaves a foreign request and an unknown call without an answer."""
    asked = [bits] if bits else [Request.read_id(4).bits, UNKNOWN]
    return all(answer_to(one) == "silence" for one in asked)


#: Control bit 1, address 3, information 10111: reserved, and no call of the standard.
UNKNOWN = "01000111011111"


def answer_to(bits: str) -> str:
    """Return what slave 3, in step, says to a request."""
    return str(Slave("3").listen(["", bits])["answer"].iloc[-1])


@check("icn2007-034", counter={"lost": 0})
def repeats_what_was_done(*, lost: int = 1) -> bool:
    """Whether a request is repeated that its slave had carried out, if replies are lost."""
    faults = [LostReply("3", start=0.02, count=lost)] if lost else []
    run = simulate(line(), cycles=20, faults=faults)
    rows = run.events()
    done = rows.index[rows["executed_but_lost"]]
    return bool(len(done)) and bool((rows["attempt"][done + 1] == 1).all())


@check("icn2007-039", counter={"standby": False})
def standby_takes_over(*, standby: bool = True) -> bool:
    """Whether data are exchanged with all slaves after the master fell silent."""
    master = Master({str(address): "S-0.F.F" for address in ADDRESSES})
    second = Standby(master) if standby else None
    run = simulate(line(), master, until=0.2, faults=MasterFailure(start=0.1), standby=second)
    later = run.events().query("time_s > 0.15 and call == 'DATA_EXCHANGE' and outcome == 'ok'")
    return set(later["slave"]) == {str(address) for address in ADDRESSES}


# Rates under every assumption ------------------------------------------------------------------


#: User bits of one exchange: four in the request, four in the response.
USER_BITS = 8

#: A CAN data frame with an 11-bit identifier around its data, the three bits of intermission
#: included and stuff bits left out, ISO 11898-1: 1 + 11 + 3 + 4 + 15 + 1 + 2 + 7 + 3 [bit].
CAN_FRAME, CAN_BYTES = 47, 8

#: Modbus function 23, which writes and reads registers at once: bytes around the data of request
#: and response, silence before either [character], bits of a character, most bytes of data one
#: way. Modbus Application Protocol V1.1b3, section 6.17, and Modbus over Serial Line V1.02.
MODBUS_BYTES, MODBUS_SILENCE, MODBUS_CHARACTER, MODBUS_MOST = 13 + 5, 2 * 3.5, 11, 242


class Rates(NamedTuple):
    """What a line carries."""

    gross: float
    net: float
    efficiency: float


def rates(
    transaction: Transaction | None = None,
    *,
    addresses: int | None = None,
    user_bits: int = USER_BITS,
    management: int = 1,
    inclusion: int = 1,
) -> Rates:
    """Return gross rate, net rate and efficiency over one transaction, or over a whole cycle.

    Parameters
    ----------
    transaction : asi.Transaction, optional
        The transaction; with pauses of 2 and 2 bit times if omitted.
    addresses : int, optional
        Slaves in the cycle, 1..31; a single transaction if omitted.
    user_bits : int, default 8
        User bits of a transaction in both directions, 0..8.
    management, inclusion : int, default 1
        Transactions of a cycle beside those for data.

    Returns
    -------
    Rates
        `gross` and `net` [bit/s], `efficiency` 0..1.

    Raises
    ------
    ArgumentError
        If a number is out of range.

    Examples
    --------
    >>> rates().efficiency
    0.32
    """
    transaction = Transaction(2, 2) if transaction is None else transaction
    bits = check_whole("user_bits", user_bits, 0, USER_BITS)
    gross = 1 / transaction.bit_time
    if addresses is None:
        net = bits / transaction.duration
    else:
        asked = check_whole("addresses", addresses, 1, 31)
        time = cycle_time(
            asked, transaction=transaction, management=management, inclusion=inclusion
        )
        net = asked * bits / float(time)
    return Rates(gross, net, net / gross)


def rate_table() -> pd.DataFrame:
    """Return the rates under each assumption about the length of a transaction.

    Returns
    -------
    pandas.DataFrame
        A row per assumption: ``transaction_bit``, ``net_kbit_per_s``, ``efficiency_percent`` and
        the ``assumption`` in words.

    Examples
    --------
    >>> rate_table()["efficiency_percent"].round(1).head(2).tolist()
    [32.7, 32.0]
    """
    import pandas as pd

    pauses = {
        "24.5 bit": (2.0, 1.5, "shortest pauses of the papers, 2 and 1.5 bit"),
        "25 bit": (2.0, 2.0, "pauses of 2 and 2 bit: 150 us (Siemens)"),
        "153 us": (2.5, 2.0, "25.5 bit (Bihl+Wiedemann)"),
        "154 us": (3.0, 154 / 6 - 24, "25.7 bit (OMRON, p. 21)"),
        "26 bit": (3.0, 2.0, "pauses of 3 and 2 bit: 156 us (OMRON, p. 5; Schneider)"),
    }
    rows = {}
    for name, (master_pause, slave_pause, says) in pauses.items():
        transaction = Transaction(master_pause, slave_pause)
        rows[name] = (transaction.bits, *rates(transaction)[1:], says)
    for name in ("25 bit", "26 bit"):
        transaction = Transaction(*pauses[name][:2])
        whole = rates(transaction, addresses=31)
        rows[f"{name}, whole cycle"] = (
            transaction.bits,
            *whole[1:],
            "31 of 33 transactions carry user data",
        )
    columns = ["transaction_bit", "net_kbit_per_s", "efficiency_percent", "assumption"]
    table = pd.DataFrame.from_dict(rows, orient="index", columns=columns)
    table["net_kbit_per_s"] *= 1e-3
    table["efficiency_percent"] *= 100
    return table


def bus_efficiencies(user_bits: npt.ArrayLike) -> pd.DataFrame:
    r"""Return the efficiencies of three buses that exchange the same data with one station.

    .. math:: \eta = \frac{2 n}{\text{bit times of all frames and silences}}

    Parameters
    ----------
    user_bits : array_like of int
        User bits n in each direction, 1..1936.

    Returns
    -------
    pandas.DataFrame
        A row per number of bits, a column each for ``as_i``, ``can`` and ``modbus_rtu``.

    Raises
    ------
    ArgumentError
        If a number is out of range.

    Examples
    --------
    >>> bus_efficiencies(4).round(2).values.tolist()
    [[0.32, 0.07, 0.03]]
    """
    import pandas as pd

    n = np.atleast_1d(user_bits)
    if n.dtype.kind not in "iu" or not ((n >= 1) & (n <= 8 * MODBUS_MOST)).all():
        raise ArgumentError(
            f"user_bits is {user_bits!r}; it must be whole numbers 1..{8 * MODBUS_MOST}"
        )
    octets = -(-n // 8)
    registers = -(-n // 16)
    line = {
        "as_i": Transaction(2, 2).bits * -(-n // 4),
        "can": 2 * (CAN_FRAME * -(-octets // CAN_BYTES) + 8 * octets),
        "modbus_rtu": MODBUS_CHARACTER * (MODBUS_BYTES + MODBUS_SILENCE + 4 * registers),
    }
    index = pd.Index(n, name="user_bits")
    return pd.DataFrame({bus: 2 * n / bits for bus, bits in line.items()}, index=index)
