"""Bits on a CAN cable: what every node sees, and what it reads at its sample point.

A dominant driver is a voltage behind a resistance; a recessive one is off. So several drivers at
once make a wired AND, and nothing but the terminators takes the charge off the line.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from shipnet.errors import ArgumentError
from shipnet.fields import check_scalar, check_whole
from shipnet.line.cable import Cable
from shipnet.line.characteristics import Driver, simulate
from shipnet.line.network import CableRun, Load, Network

__all__ = ["BusLine", "LineRun", "send"]

Floats = npt.NDArray[np.float64]

#: Differential voltages [V] from which a receiver sees dominant, and up to which it sees
#: recessive: ISO 11898-2; between them either may be read.
DOMINANT, RECESSIVE = 0.9, 0.5

#: A cable of 120 ohm and 5 ns/m without loss.
_CABLE = Cable.lossless(120, 5e-9)


@dataclass(frozen=True)
class BusLine:
    """A straight trunk with nodes at equal distances, and perhaps stubs.

    Parameters
    ----------
    length : float
        Length of the trunk, 0.1 to 1e4 [m].
    nodes : int, default 9
        Nodes on it, called b0, b1 ..., the first and the last at its ends; 2..200.
    terminator : float or None, default 120
        Resistance at either end [ohm]; None leaves the ends open.
    stubs : mapping of int to float, optional
        Length of the stub at a node by its number [m]; its far end is called s0, s1 ...
    cable : Cable, default 120 ohm and 5 ns/m without loss
        Cable of trunk and stubs.
    resistance, capacitance : float
        Input of each node, 20 kohm and 100 pF by default.

    Raises
    ------
    ArgumentError
        If an argument is out of range.

    Examples
    --------
    >>> BusLine(40, stubs={4: 10}).network().nodes
    ('b0', 'b1', 'b2', 'b3', 'b4', 'b5', 'b6', 'b7', 'b8', 's4')
    """

    length: float
    nodes: int = 9
    terminator: float | None = 120.0
    stubs: Mapping[int, float] | None = None
    cable: Cable = _CABLE
    resistance: float = 20e3
    capacitance: float = 100e-12

    def __post_init__(self) -> None:
        """Check what the network does not."""
        check_scalar("length", self.length, "m", 0.1, 1e4)
        check_whole("nodes", self.nodes, 2, 200)
        if self.terminator is not None:
            check_scalar("terminator", self.terminator, "ohm", 1e-3, 1e9)
        check_scalar("resistance", self.resistance, "ohm", 1e-3, 1e12)
        check_scalar("capacitance", self.capacitance, "F", 1e-15, 1e-3)
        for node, metres in (self.stubs or {}).items():
            check_whole("node of a stub", node, 0, self.nodes - 1)
            check_scalar(f"length of the stub at node {node}", metres, "m", 1e-3, 1e3)

    def network(self) -> Network:
        """Return the cable with all its loads."""
        step = self.length / (self.nodes - 1)
        runs = [
            CableRun(f"b{node}", f"b{node + 1}", step, self.cable) for node in range(self.nodes - 1)
        ]
        for node, metres in (self.stubs or {}).items():
            runs.append(CableRun(f"b{node}", f"s{node}", metres, self.cable))
        loads = {name: Load(r=self.resistance, c=self.capacitance) for name in Network(runs).nodes}
        if self.terminator is not None:
            for name in ("b0", f"b{self.nodes - 1}"):
                loads[name] += Load(r=self.terminator)
        return Network(runs, loads)


class LineRun(NamedTuple):
    """Voltages on the line, and what is read from them.

    Attributes
    ----------
    nodes : tuple of str
        Nodes that were looked at.
    t : ndarray of float, shape (n_t,)
        Times [s].
    v : ndarray of float, shape (n_nodes, n_t)
        Differential voltages [V].
    sample_times : ndarray of float, shape (n_bits,)
        Sample points [s], by a clock that begins with the first bit of the senders.
    samples : ndarray of float, shape (n_nodes, n_bits)
        Voltages there [V].
    bits : ndarray of int8, shape (n_nodes, n_bits)
        0 dominant, 1 recessive, -1 where a receiver may read either.
    sent : ndarray of int8, shape (n_bits,)
        The wired AND of what was sent.
    """

    nodes: tuple[str, ...]
    t: Floats
    v: Floats
    sample_times: Floats
    samples: Floats
    bits: npt.NDArray[np.int8]
    sent: npt.NDArray[np.int8]

    @property
    def correct(self) -> npt.NDArray[np.bool_]:
        """Which bits each node reads as they were sent, shape (n_nodes, n_bits)."""
        return np.asarray(self.bits == self.sent)


def send(
    bus: BusLine,
    patterns: Mapping[str, str],
    bit_rate: float,
    *,
    sample_point: float = 0.75,
    edge: float = 30e-9,
    voltage: float = 3.2,
    resistance: float = 40.0,
    dt: float | None = None,
    start: float | None = None,
) -> LineRun:
    """Return what every node sees and reads while some of them send bits.

    Parameters
    ----------
    bus : BusLine
        The cable.
    patterns : mapping of str to str
        By the name of a node, the bits that it sends: 0 dominant, 1 recessive. Shorter ones are
        recessive at their end; all begin at once.
    bit_rate : float
        Bit rate, 1e3 to 1e6 [bit/s].
    sample_point : float, default 0.75
        Where in its bit a node reads the line, between 0 and 1.
    edge : float, default 30e-9
        Time of an edge of a driver, a raised cosine, positive and at most half a bit [s].
    voltage, resistance : float
        A dominant driver: open-circuit voltage [V] and inner resistance [ohm], 3.2 V and 40 ohm
        by default, which is assumed; it drives 2.4 V into 120 ohm.
    dt : float, optional
        Step of the simulation [s]; by default the largest that is no more than a fifth of an edge
        and divides the delay of a section.
    start : float, optional
        Time of the first bit's beginning, half a bit by default [s].

    Returns
    -------
    LineRun
        Voltages and bits at all nodes.

    Raises
    ------
    ArgumentError
        If an argument is out of range, a pattern holds other than 0 and 1, or a node is unknown.

    Notes
    -----
    The clock of a reader begins with the sender's, so a far node samples early by the delay of
    the cable. In a network without terminators the voltage decays through the inputs only.

    Examples
    --------
    Without its terminators, a bus of 40 m never shows its far end a recessive bit at 1 Mbit/s:

    >>> for ends in (120, None):
    ...     run = send(BusLine(40, terminator=ends), {"b0": "01001101"}, 1e6)
    ...     print(run.bits[run.nodes.index("b8")].tolist())
    [0, 1, 0, 0, 1, 1, 0, 1]
    [0, 0, 0, 0, 0, 0, 0, 0]
    """
    rate = check_scalar("bit_rate", bit_rate, "bit/s", 1e3, 1e6)
    point = check_scalar("sample_point", sample_point, "", 0.01, 0.99)
    bit = 1 / rate
    rise = check_scalar("edge", edge, "s", 1e-12, bit / 2)
    begin = bit / 2 if start is None else check_scalar("start", start, "s", 0.0, 1.0)
    ohms = check_scalar("resistance", resistance, "ohm", 1e-3, 1e6)
    volts = check_scalar("voltage", voltage, "V", 0.1, 100.0)
    network = bus.network()
    length = max(map(len, patterns.values()), default=0)
    if not length:
        raise ArgumentError("patterns are empty; there must be a bit to send")
    drivers, sent = [], np.ones(length, dtype=np.int8)
    for node, pattern in patterns.items():
        if set(pattern) - {"0", "1"}:
            raise ArgumentError(f"pattern of node {node!r} is {pattern!r}; it must hold 0 and 1")
        network.index(node)
        levels = np.array([int(c) for c in pattern.ljust(length, "1")], dtype=np.int8)
        sent &= levels
        steps = np.diff(1 - levels, prepend=0, append=0)

        def conductance(t: Floats, steps: npt.NDArray[np.int8] = steps) -> Floats:
            g = np.zeros_like(t)
            for k in np.flatnonzero(steps):
                x = np.clip((t - begin - k * bit) / rise, 0, 1)
                g += steps[k] * (x - np.sin(2 * np.pi * x) / (2 * np.pi))
            # Sums of steps may fall a rounding below zero.
            return np.maximum(g, 0) / ohms

        drivers.append(Driver(node, voltage=volts, conductance=conductance))
    shortest = min(float(run.length * run.made_of.delay) for run in network.runs)
    if dt is None:
        dt = shortest / np.ceil(shortest / min(rise / 5, shortest))
    wave = simulate(network, drivers, begin + length * bit, dt)
    t, v = wave.t, wave.u
    at = begin + (np.arange(length) + point) * bit
    seen = np.array([np.interp(at, t, row) for row in v])
    bits = np.where(seen >= DOMINANT, 0, np.where(seen <= RECESSIVE, 1, -1)).astype(np.int8)
    return LineRun(network.nodes, t, v, np.asarray(at, dtype=float), seen, bits, sent)
