"""Data link layer: who answers whom, what a lost reply leads to, and who takes over."""

from __future__ import annotations

from shipnet.asi.faults import DeadSlave, LostReply, MasterFailure
from shipnet.asi.master import Master
from shipnet.asi.simulation import Run, Standby, simulate
from shipnet.asi.slave import Slave
from shipnet.asi.telegram import REQUEST_BITS, Request
from shipnet.papers.registry import check

__all__: list[str] = []

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
    """Whether the master repeats a request after so many bit times without an answer."""
    run = simulate(line(), cycles=20, faults=[DeadSlave("3", start=0.02)])
    rows = run.events()
    silent = rows[(rows["slave"] == "3") & (rows["outcome"] == "SilenceError")]
    return bool((silent["attempt"] == 1).any()) and round(gap_after_silence(run, "3"), 6) == wait


@check("icn2007-038", counter={"wait": 11.0})
def goes_on_after(*, wait: float = 10.0) -> bool:
    """Whether the next request follows so many bit times after one without an answer."""
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
