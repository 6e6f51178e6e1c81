"""Sections II, III.2.c and IV.2: responses, switch-over, dead boxes, class rules, scope traces."""

from __future__ import annotations

from dataclasses import replace
from typing import Literal

import numpy as np
import numpy.typing as npt

from shipnet.engine.class_rules import Description, Redundancy
from shipnet.engine.class_rules import check as check_rules
from shipnet.engine.faults import CanBreak, DeadBox, ModbusBreak
from shipnet.engine.points import read_points
from shipnet.engine.serving import FUNCTIONS
from shipnet.engine.simulation import simulate, single_failures
from shipnet.engine.system import RULE, System
from shipnet.modbus.slave import Slave
from shipnet.papers.lee2012.buses import BIT_RATE, JB1, JB3, LINE, read, whole_poll
from shipnet.papers.lee2012.engine import printed_points
from shipnet.papers.registry import check, numeric


@check("lee2012-058", counter={"rate": 1000.0})
def answers_in_time(*, rate: float = BIT_RATE) -> float:
    """Margin by which a request for all points is answered within the 2 s of the rule."""
    poll = whole_poll(rate=rate)
    return 1 - (poll.line.frame_time(poll.request_size) + poll.shortest_timeout) / RULE


@check("lee2012-003", counter={"second": "JB1"})
def links_share_nothing(*, second: str = "JB3") -> bool:
    """Whether the two Modbus channels lead to different boxes."""
    links = {"channel 1": ("JB1",), "channel 2": (second,)}
    findings = check_rules(replace(Description.printed(), links=links)).table()
    return bool(findings.set_index("rule")["verdict"]["links duplicated"] == "met")


@numeric("lee2012-101")
def worst_loss(*, double_row: bool = True) -> int:
    """Largest number of points that the failure of one box loses."""
    return Redundancy(printed_points(double_row=double_row)).worst()


@check("lee2012-112", counter={"each": 1})
def both_are_needed(*, each: int = 2) -> bool:
    """Whether no failure loses a point only if supplies and processors are both duplicated."""
    points = read_points()
    alone = [Redundancy(points, supplies=each).worst(), Redundancy(points, cpus=each).worst()]
    return min(alone) > Redundancy(points, supplies=each, cpus=each).worst() == 0


@check("lee2012-045", counter={"stale_limit": 0.5})
def marked_after_four_seconds(*, stale_limit: float = 4.0) -> bool:
    """Whether the AMS reports all points of a dead box as marked about 4 s after the box dies."""
    start, printed = 10.0, System()
    run = simulate(System(stale_limit=stale_limit), faults=DeadBox("JB2", start=start), until=20)
    after = run.alarms().query("kind == '0xFF'")["time_s"] - start
    early, late = printed.stale_limit - printed.update_period, printed.staleness_flag().after
    return len(after) == 18 and bool(after.between(early, late).all())


@numeric("lee2012-099", of="mark")  # [s]
@numeric("lee2012-103", of="value")  # [s]
@numeric("lee2012-110", of="conversion")  # [ms]
def longest(*, of: str) -> float:
    """Longest time until a dead box's mark is shown, age of a shown value, or conversion."""
    system = System()
    return {
        "mark": system.staleness_flag().after,
        "value": float(system.worst_age()["worst_s"].max()),
        "conversion": 1e3 * max(system.conversion_times.values()),
    }[of]


@check("lee2012-046", counter={"dead": "JB1"})
def ams_sees_the_mark(*, dead: str = "JB2") -> bool:
    """Whether, if box `dead` dies, the AMS reports 0xFF for all points of JB2 and no others."""
    run = simulate(System(), faults=DeadBox(dead, start=10.0), until=20)
    marked = set(run.alarms().query("kind == '0xFF'")["source"])
    return marked == {point.tag for point in read_points().by_box()["JB2"]}


@check("lee2012-054", counter={"limit": 2.0})
def shown_within(*, limit: float = 1.0, pause: bool = False) -> float:
    """Margin by which a changed input reaches the AMS within this time [s].

    As in Fig 5, the loops of the boxes do not pause, unless `pause` is set.
    """
    system = System() if pause else System(update_period=0.0)
    return 1 - float(system.worst_age()["worst_s"].max()) / limit


@check("lee2012-055", counter={"printed": 133e-3})
def switch_over_is_possible(*, printed: float = 133e-6) -> float:
    """Margin by which request and shortest wait for its response fit into the printed time [s]."""
    request = LINE.frame_time(len(read(1).pdu) + 3)
    return 1 - (request + LINE.t35) / printed


@check("lee2012-056", counter={"timeout": 1.5})
def switches_in_time(*, timeout: float | None = None) -> float:
    """Margin by which a response arrives within the 2 s of the rule after a channel is lost."""
    system = System() if timeout is None else System(timeout=timeout)
    return 1 - system.switch_over().loss / RULE


@check("lee2012-061", counter={"polled": "both"})
def survives_any_cut(*, polled: Literal["one", "both"] = "one") -> bool:
    """Whether all points stay reachable if any single CAN or Modbus cable is cut."""
    system = System.corrected(polled=polled)
    breaks = [CanBreak(where, start=10.0) for where in system.segments]
    channels = [ModbusBreak(channel, start=10.0) for channel in ("1", "2")]
    table = single_failures(system, [*breaks, *channels], trials=1)
    return not table["lost"].any()


@check("lee2012-094", counter={"also": "JB2-JB3"})
def reads_all_through_channel_2(*, also: str = "") -> bool:
    """Whether the AMS changes to channel 2 after channel 1 is cut, and still reads all points."""
    more = [CanBreak(also, start=10.0)] if also else []
    run = simulate(System(), faults=[ModbusBreak("1", start=10.0), *more], until=25)
    changed = bool((run.requests().query("time_s > 12")["channel"] == 2).all())
    return changed and not len(run.alarms().query("kind == '0xFF'"))


@check("lee2012-082", counter={"inputs": (27, 27, 27)})
def conversion_times_differ(*, inputs: tuple[int, ...] = ()) -> bool:
    """Whether the boxes need different times to convert their analogue inputs."""
    system = System()
    times = [system.firmware.conversion_time(n) for n in inputs] or system.convert_ns.tolist()
    return len(set(times)) == len(times)


@check("lee2012-085", counter={"update_period": 6.0})
def healthy_boxes_are_not_marked(*, update_period: float = System().update_period) -> bool:
    """Whether healthy boxes with this update period stay unmarked."""
    return not len(simulate(System(update_period=update_period), until=60).alarms())


@numeric("lee2012-047")
def interrupts(*, silent_box: bool = True) -> int:
    """Number of kinds of interrupt that JB1 handles, with JB2 silent or with all boxes healthy."""
    faults = [DeadBox("JB2", start=10.0)] if silent_box else []
    work = simulate(System(), faults=faults, until=20).timeline(0, 20)
    return len(set(work.loc[work["row"] == "JB1", "task"]) - {"convert", "send"})


@check("lee2012-053", counter={"rate": 1000.0})
def answers_each_second(*, rate: float = BIT_RATE) -> float:
    """Margin by which a poll of all points ends before the next one begins."""
    return 1 - whole_poll(rate=rate).time / System().poll_period


@check("lee2012-084", counter={"task": "convert"})
def is_never_interrupted(*, task: str = "Modbus") -> bool:
    """Whether JB1 always carries out this task in one piece; requests come while it converts."""
    phases = dict.fromkeys(System().boxes, 0.0)
    work = simulate(System(), until=20.0, phases=phases).timeline(0, 20)
    pieces = work[(work["row"] == "JB1") & (work["task"] == task)]
    lasted = pieces["end_ms"] - pieces["start_ms"]
    return bool(np.allclose(lasted, lasted.max()))


@check("lee2012-062", counter={"functions": FUNCTIONS | {4}})
def only_function_3_is_served(*, functions: frozenset[int] = FUNCTIONS) -> bool:
    """Whether a box refuses all function codes except 3 with exception 1."""
    box = Slave(holding_registers=[0] * 99, functions=functions)
    refused = {
        code for code in range(1, 128) if box.answer(bytes([code, 0, 0, 0, 1]))[1:] == b"\x01"
    }
    return refused == set(range(1, 128)) - {3}


# The traces of a two-channel scope in Figs 12 and 13 ------------------------------------------

Trace = tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]]

#: The response of 8 bytes that Fig 4(b) draws, with a byte count that is two bytes long.
_DRAWN = bytes([JB1, 3, 0, 2, 0, 100, 0, 0])


def response_scope() -> dict[str, Trace]:
    """Return time [s] and level of both lines during a request and its response: Fig 13."""
    request = read(1).rtu(JB1)
    begin = LINE.frame_time(len(request)) + LINE.t35
    end = begin + LINE.frame_time(len(_DRAWN)) + LINE.t35
    return {"AMS sends": _trace([request], [0.0], end), "JB1 sends": _trace([_DRAWN], [begin], end)}


def _trace(frames: list[bytes], begins: list[float], end: float) -> Trace:
    """Return a line's trace with frames that begin at these times."""
    if not frames:
        return np.array([0.0, end]), np.ones(2)
    ends = [begin + LINE.frame_time(len(f)) for f, begin in zip(frames, begins, strict=True)]
    gaps = [after - before for before, after in zip(ends, [*begins[1:], end], strict=True)]
    waveform = LINE.waveform(frames, gap=gaps, start=begins[0])
    return waveform.time, waveform.level


def switch_over_scope(system: System, *, cut: float = 1.5, end: float = 3.4) -> dict[str, Trace]:
    """Return the AMS's requests on both channels, with channel 1 cut at `cut` [s]: Fig 12(b)."""
    requests = simulate(system, faults=ModbusBreak("1", start=cut), until=end).requests()
    traces = {}
    for channel, unit in ((1, JB1), (2, JB3)):
        begins = requests.loc[requests["channel"] == channel, "time_s"].tolist()
        request = read(system.registers).rtu(unit)
        traces[f"Tx of channel {channel}"] = _trace([request] * len(begins), begins, end)
    return traces
