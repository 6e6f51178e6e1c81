"""A planned segment as an electrical network: the supply's voltage and the signal's quality.

Behind a repeater begins a network of its own: the repeater sends and hears there as a master
does, and is assumed to load the cable like one. A repeater that leads on is a slave to this
segment's signals.
"""

from __future__ import annotations

import numpy as np

from shipnet.asi.network.plan import PlanSegment
from shipnet.asi.quality import SignalQuality, signal_quality
from shipnet.asi.segment import DEVICE, POWER_SUPPLY, Segment
from shipnet.asi.telegram import RESPONSES
from shipnet.asi.topology import joined
from shipnet.errors import ArgumentError
from shipnet.line.network import CableRun, Load, Network

__all__ = [
    "PROBES",
    "device_voltages",
    "listeners",
    "segment_network",
    "segment_quality",
    "supply_current",
]

#: Requests that stand for all 2048: the first makes the least signal, as its pulses are the
#: fewest; runs of ones and of zeros make the most uneven one. A test tries them all.
PROBES = ("01010101010101", "01111111111111", "00011111111111")


def segment_network(segment: PlanSegment) -> Network:
    """Return a planned segment as a network of lines and loads.

    Parameters
    ----------
    segment : PlanSegment
        A segment of a plan.

    Returns
    -------
    shipnet.line.Network
        Its nodes in the order of its cables.

    Examples
    --------
    >>> from shipnet.asi.network.structures import line
    >>> segment_network(line(100, [40, 100]).segments[0]).nodes
    ('0 m', '40 m', '100 m')
    """
    loads: list[tuple[str, Load]] = [(node, DEVICE) for node, _ in segment.draws]
    loads += [(supply.node, POWER_SUPPLY) for supply in segment.supplies]
    loads += [(one.node, Load(r=one.resistance)) for one in segment.terminators]
    runs = [CableRun(run.a, run.b, run.length, run.cable) for run in segment.cables]
    return Network(runs, joined(*({node: load} for node, load in loads)))


def supply_current(segment: PlanSegment) -> float:
    """Return what all devices of a segment draw together.

    Parameters
    ----------
    segment : PlanSegment
        A segment of a plan.

    Returns
    -------
    float
        Current of masters, slaves and repeaters [A].

    Examples
    --------
    >>> from shipnet.asi.network.structures import line
    >>> print(f"{supply_current(line(100, [40, 100]).segments[0]):.3f} A")
    0.195 A
    """
    return sum(current for _, current in segment.draws)


def device_voltages(segment: PlanSegment) -> dict[str, float]:
    """Return the voltage of the supply that is left at each node.

    Parameters
    ----------
    segment : PlanSegment
        A segment of a plan, with one supply.

    Returns
    -------
    dict of str to float
        Voltage at each node [V]. Devices draw their current whatever the voltage.

    Raises
    ------
    ArgumentError
        If the segment has no supply, or more than one.

    Examples
    --------
    A slave of 1 A at the end of 100 m; then the cable is closed to a ring of the same 100 m, so
    that the slave lies 50 m away both ways round:

    >>> from shipnet.asi.network.structures import line, ring
    >>> there = line(100, [100], current=1.0)
    >>> round_ = ring(100, [50], current=1.0)
    >>> for plan, node in [(there, "100 m"), (round_, "50 m")]:
    ...     print(f"{30 - device_voltages(plan.segments[0])[node]:.3f} V lost")
    2.700 V lost
    0.675 V lost
    """
    if len(segment.supplies) != 1:
        raise ArgumentError(f"{segment} has {len(segment.supplies)} supplies; it must be one")
    network = segment_network(segment)
    drawn: dict[str, float] = {}
    for node, current in segment.draws:
        drawn[node] = drawn.get(node, 0.0) + current
    (supply,) = segment.supplies
    voltage = network.operating_point(supply.node, supply.voltage, drawn).voltage
    return {node: float(value) for node, value in voltage.items()}


def listeners(segment: PlanSegment) -> tuple[tuple[str, str], ...]:
    """Return who talks with the head of a segment.

    Parameters
    ----------
    segment : PlanSegment
        A segment of a plan.

    Returns
    -------
    tuple of tuple of str
        Name and node of each slave, then of each repeater that leads on.

    Examples
    --------
    >>> from shipnet.asi.network.structures import line
    >>> listeners(line(100, [40]).segments[0])
    (('slave 1 at 40 m', '40 m'),)
    """
    slaves = ((str(slave), slave.node) for slave in segment.slaves)
    return (*slaves, *((str(repeater), node) for repeater, node in segment.onward))


def segment_quality(segment: PlanSegment) -> SignalQuality:
    """Return how telegrams come over between the head of a segment and each listener.

    Parameters
    ----------
    segment : PlanSegment
        A segment of a plan, with a head.

    Returns
    -------
    shipnet.asi.quality.SignalQuality
        One entry for each of `listeners`: the worst of all 16 responses and of the requests
        `PROBES`.

    Raises
    ------
    ArgumentError
        If the segment has no head, as its line has no master.

    Examples
    --------
    >>> from shipnet.asi.network.structures import line
    >>> quality = segment_quality(line(100, [5, 100]).segments[0])
    >>> [f"{least:.2f} V" for least in quality.level_least], quality.received.tolist()
    (['4.61 V', '6.11 V'], [1.0, 1.0])
    """
    if segment.head is None:
        raise ArgumentError(f"{segment} has no head; its line needs a master")
    nodes = tuple(node for _, node in listeners(segment))
    if not nodes:
        return SignalQuality(*[np.empty(0)] * 5)
    places = tuple(dict.fromkeys(nodes))
    line = Segment(segment_network(segment), segment.head, places)
    responses, requests = (signal_quality(line, words) for words in (RESPONSES, PROBES))
    share = len(RESPONSES) / (len(RESPONSES) + len(PROBES))
    worst = SignalQuality(
        np.minimum(responses.level_least, requests.level_least),
        np.maximum(responses.level_most, requests.level_most),
        np.minimum(responses.evenness, requests.evenness),
        np.maximum(responses.ringing, requests.ringing),
        share * responses.received + (1 - share) * requests.received,
    )
    each = [places.index(node) for node in nodes]
    return SignalQuality(*(values[each] for values in worst))
