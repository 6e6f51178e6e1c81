"""Sections 2 and 3: unit ids, scan times, the broken loop, Modbus on Ethernet."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations, pairwise, product
from typing import Literal

import numpy as np

from shipnet.ballast import scan
from shipnet.ballast.live import TestBed
from shipnet.ballast.master import operate
from shipnet.ballast.plant import Command, Fault, Plant
from shipnet.ballast.registers import (
    COMMAND_REGISTER,
    FIRST_REGISTER,
    N_REGISTERS,
    Code,
    RegisterMap,
)
from shipnet.ballast.scan import System, status_poll
from shipnet.ballast.sensors import CHANNELS
from shipnet.ballast.simulation import simulate_valves
from shipnet.ballast.slave import valve_slaves
from shipnet.lazy import pd
from shipnet.modbus.electrical import INTERFACES
from shipnet.modbus.faults import Break, DeadPort, DeadSlave
from shipnet.modbus.frame import MAX_UNIT, rtu_frame
from shipnet.modbus.pdu import Adu, FunctionCode, Request, Response
from shipnet.modbus.redundancy import Loop
from shipnet.modbus.slave import answer
from shipnet.modbus.uart import SerialLine
from shipnet.papers.kim2014.registers import answer_table
from shipnet.papers.registry import check, is_legal, numeric

# The ID switches of a slave: two decimal dials and two DIP pins.


def switch_table() -> pd.DataFrame:
    """Return the number and a verdict for each of the 400 settings of the switches."""
    n = np.arange(400)
    settings = {"pins": n // 100, "tens": n // 10 % 10, "units": n % 10, "number": n}
    words = ["more than a byte", "reserved", "legal"]
    verdict = np.select([n > 0xFF, n > MAX_UNIT, n > 0], words, "the broadcast")
    return pd.DataFrame({**settings, "verdict": verdict})


# Sections 1, 3.2 and 3.3: the valves that one master can address.


@numeric("kim2014-001")
def slaves_of_a_master(*, bits: int = 8) -> int:
    """Number of slaves that one master can address with an id of this many bits."""
    read = Request.read_input_registers(0, 1).pdu
    return sum(is_legal(rtu_frame, unit, read) for unit in range(1, 2**bits))


@numeric("kim2014-003")
def selectable_ids(*, positions: int = 10, pins: int = 2) -> int:
    """Number of byte values that two dials and DIP pins, which set the hundreds, can select."""
    settings = product(range(2**pins), range(positions), range(positions))
    return len({100 * pin + 10 * tens + units for pin, tens, units in settings} & {*range(256)})


# Sections 2.1, 3.2 and 3.3: the serial line, its closed loop, and scan times.

#: Common bit rates within the limits that sections 3.2 and 3.3 print [bit/s].
RATES = scan.BIT_RATES

#: What a master moves to its other port when a slave does not respond.
MOVES: tuple[Literal["slave", "downstream"], ...] = ("slave", "downstream")


@numeric("kim2014-005", rate=float(SerialLine.SILENCE_LIMIT))
@numeric("kim2014-077", rate=RATES[-1])
def silence(*, rate: float) -> float:
    """Silence between two frames, in characters."""
    return SerialLine(rate).t35 / SerialLine(rate).character_time


@numeric("kim2014-075", rate=RATES[0])
@numeric("kim2014-076", rate=RATES[-1])
def scan_time(*, slaves: int = MAX_UNIT, rate: float) -> float:
    """Time to read the status of all slaves at a bit rate of the paper [s]."""
    return status_poll(rate).scan_time(slaves)


@check("kim2014-008", counter={"breaks": 2})
def survives(*, breaks: int = 1, slaves: int = 5) -> bool:
    """Whether every slave remains reachable with this many breaks anywhere in the loop."""
    loop = Loop(slaves, status_poll())
    cuts = combinations(range(loop.n_sections), breaks)
    return not any(loop.reach([Break(section) for section in cut]).lost for cut in cuts)


@numeric("kim2014-117")
def gap_after_a_break(*, slaves: int = 5) -> float:
    """Longest time without data of a slave after one break anywhere in the loop [s]."""
    loop = Loop(slaves, status_poll())
    return max(float(loop.worst_gap(Break(place)).max()) for place in range(loop.n_sections))


@numeric("kim2014-118")
def gap_after_a_silence(*, slaves: int = 5) -> float:
    """Longest time without data of a slave that is silent for four seconds [s]."""
    plant, silent = Plant(System(slaves, status_poll(9600))), DeadSlave(1, start=1.0, stop=5.0)
    shown = operate(plant, until=80, faults=[silent]).shown
    return float(np.diff([status.time for status in shown if status.unit == 1]).max())


@check("kim2014-050", counter={"dead": "B"})
def every_slave_has_two_ways(*, dead: Literal["A", "B", ""] = "", slaves: int = 5) -> bool:
    """Whether both ports of the master reach every slave, each of which has one port."""
    reach = Loop(slaves, status_poll()).reach([DeadPort(dead)] if dead else [])
    return reach.through_a == reach.through_b == list(range(1, slaves + 1))


@check("kim2014-051", counter={"at_end": False})
def sensors_are_seen_before_the_reply(*, at_end: bool = True, movement: float = 10.0) -> bool:
    """Whether a moving valve is polled if it responds at the end of its movement, or at once."""
    table = answer_table(SerialLine(9600), 5, movement)
    row = table.loc["at the end, waited for" if at_end else "at the start"]
    return bool(row["answered"] and row["polls_while_moving"] > 0)


@check("kim2014-111", rate=9600.0, counter={"slaves": MAX_UNIT})
@check("kim2014-041", rate=float(RATES[0]), counter={"slaves": MAX_UNIT})
def sensors_are_watched(*, rate: float, slaves: int = 5, stroke: float = 10.0) -> float:
    """Margin by which the master reads each valve ten times during a stroke [s]."""
    return 1 - 10 * status_poll(rate).scan_time(slaves) / stroke


@check("kim2014-115", counter={"start": 1})
def slaves_are_scanned_in_order(*, start: int = 0) -> bool:
    """Whether the statuses arrive in the order of the unit ids, round after round."""
    units = [status.unit for status in operate(Plant(System(5, status_poll(9600))), until=5).shown]
    return units == [1 + (start + k) % 5 for k in range(len(units))]


@check("kim2014-085", counter={"interface": "RS-422"})
def two_wires_are_enough(*, interface: str = "RS-485") -> bool:
    """Whether one pair and a common conductor serve both directions."""
    pair_and_common = 3
    return INTERFACES[interface].wires == pair_and_common


def break_table(
    n_slaves: int = MAX_UNIT, *, timeouts: Sequence[float] = (0.05, 0.1, 0.5, 1.0)
) -> pd.DataFrame:
    """Return how long data are missing when the loop breaks in its middle, at 9600 bit/s.

    The master moves to the other port either one slave at a time or also all slaves downstream.
    """
    middle = Break((n_slaves + 1) // 2)
    rows = {
        timeout: [
            float(Loop(n_slaves, status_poll(timeout=timeout), move=move).worst_gap(middle).max())
            for move in MOVES
        ]
        for timeout in timeouts
    }
    columns = ["one_by_one_s", "with_downstream_s"]
    table = pd.DataFrame.from_dict(rows, orient="index", columns=columns)
    return table.rename_axis("timeout_s")


# Master and valve, message by message: a command, and the registers while it is executed.


def conversation(position: int = 40, times: Sequence[float] = (0.5, 2.0, 5.0)) -> pd.DataFrame:
    """Command a valve to a position, read its status at these times, and return the messages."""
    registers = RegisterMap()
    valve = valve_slaves(Plant())[1]
    write = Request.write_single_register(
        COMMAND_REGISTER, registers.command(Code.POSITION_OPEN, position)
    )
    read = Request.read_input_registers(FIRST_REGISTER, N_REGISTERS)
    queries = [(0.0, write, f"go to {position} %"), *((t, read, "read the status") for t in times)]
    rows = []
    for time, query, meant in queries:
        response, says = bytes(valve.answer(query.pdu, time)), "the same"
        if query is read:
            seen = registers.decode([Response.parse(response).registers]).readings[:, 0]
            values = [f"{c.name} {x:.3g} {c.unit}" for c, x in zip(CHANNELS, seen, strict=True)]
            says = ", ".join(values)
        rows.append((time, "master", rtu_frame(1, query.pdu).hex(" "), meant))
        rows.append((time, "valve", rtu_frame(1, response).hex(" "), says))
    return pd.DataFrame(rows, columns=["time_s", "from", "frame", "says"])


# Section 3.2, Fig 10, and section 3.5: what a valve does with a command.


@check("kim2014-106", counter={"units": (1,)})
def other_ids_are_ignored(*, units: Sequence[int] = range(2, MAX_UNIT + 1)) -> bool:
    """Whether valve 1 neither moves nor responds to commands for these unit ids."""
    plant = Plant()
    slaves = valve_slaves(plant)
    pdu = Request.write_single_register(COMMAND_REGISTER, RegisterMap().command(Code.OPEN)).pdu
    silent = [not answer(slaves, Adu(unit, pdu), serial=True).pdu for unit in units]
    return all(silent) and not plant.running.any()


@check("kim2014-107", positions=(*range(0, 101, 10), 49, 51), counter={"within": 0.01})
@check("kim2014-088", positions=(0, 100), counter={"reversible": False})
def reaches_the_position(
    *, positions: Sequence[int], within: float = 1.0, reversible: bool = True
) -> float:
    """Margin by which a half-open valve stops within this distance [%] of each of these positions.

    Without a reversible motor it could only open.
    """
    distances = []
    for position in positions:
        plant = Plant(System(1, opening=0.5))
        plant.order(Command(float(position if reversible else max(position, 50))))
        plant.run_until(20.0)
        distances.append(abs(100 * float(plant.opening[0]) - position))
    return 1 - max(distances) / within


@check("kim2014-072", counter={"leak": 0.5})
def opens_within_ten_seconds(*, leak: float = 0.0) -> float:
    """Margin by which a valve is open after 10 s, with a pump leak of this severity."""
    faults = [Fault("P2", leak)] if leak else []
    run = simulate_valves(System(1), [Command("open")], faults, until=60)
    return 1 - float(run.strokes()["end_s"].max()) / 10.0


@check("kim2014-110", counter={"unit": 4})
def pc_and_master_send_the_same(*, unit: int = 3) -> bool:
    """Whether a PC's command makes the master send what it sends for its own command to valve 3."""
    beds = TestBed(), TestBed()
    beds[0].command(3, "open")
    value = RegisterMap().command(Code.OPEN)
    beds[1].gateway[unit].answer(Request.write_single_register(COMMAND_REGISTER, value).pdu)
    sent, forwarded = (bed.station.writes[-1] for bed in beds)
    return (sent.unit, sent.value) == (forwarded.unit, forwarded.value)


# Sections 2.2 and 3.5, Figs 5 and 6: the header on Ethernet, and lost or late datagrams.


@check("kim2014-057", counter={"widths": (2, 2, 1, 2)})
def header_has_these_fields(*, widths: tuple[int, ...] = (2, 2, 2, 1)) -> bool:
    """Whether the fields identifier, 0, length of the rest and unit id have these widths [byte]."""
    identifier, unit = 0x1501, 17
    request = Request.read_input_registers(0x4020, 4)
    pdu, adu = request.pdu, request.tcp(unit, identifier)
    ends = np.cumsum([0, *widths])
    fields = [int.from_bytes(adu[a:b], "big") for a, b in pairwise(ends)]
    return fields == [identifier, 0, len(pdu) + 1, unit] and sum(widths) + len(pdu) == len(adu)


@check("kim2014-084", counter={"header": 6})
def same_pdu_on_both(*, header: int = 7) -> bool:
    """Whether, after a header of this many bytes, a TCP message has the same PDU as in RTU."""
    messages = [Request.read_input_registers(0x4020, 4), Request.write_single_register(0x4001, 8)]
    return all(m.tcp(17, 0x1501)[header:] == m.rtu(17)[1:-2] for m in messages)


@check("kim2014-102", counter={"bit_rate": 50e3})
def carries_more(*, bit_rate: float = 10e6, registers: int = 125) -> float:
    """Margin by which Ethernet at this rate is faster than a serial line at 115200 bit/s.

    The Ethernet frame adds 18 bytes, IP and TCP 20 each, preamble and gap another 20.
    """
    response = Response(FunctionCode.READ_INPUT_REGISTERS, registers=(0,) * registers)
    serial = SerialLine(RATES[-1]).frame_time(len(response.rtu(1)))
    return 1 - 8 * (len(response.tcp(1, 0)) + 78) / bit_rate / serial
