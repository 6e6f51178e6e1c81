"""CAN signals on a cable: the voltage at every node, and the bits read at the sample point.

A dominant driver is a voltage source with a source resistance; a recessive driver is off. Several
drivers therefore form a wired AND, and only the terminators discharge the line.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from shipnet import style
from shipnet.arrays import Floats
from shipnet.errors import ArgumentError
from shipnet.fields import check_fields, check_scalar, check_whole, number, record, whole
from shipnet.lazy import Axes, pd
from shipnet.line.cable import Cable
from shipnet.line.characteristics import simulate
from shipnet.line.network import CableRun, Load, Network

Bits = npt.NDArray[np.int8]

#: Differential voltage [V] from which a receiver reads dominant, and up to which it reads recessive
#: (ISO 11898-2); between the two, it may read either level.
DOMINANT, RECESSIVE = 0.9, 0.5

_INPUT = Load(r=20e3, c=100e-12)  #: Load of a node on the line, within the limits of ISO 11898-2.

#: Differential voltage of a dominant driver [V], its source resistance [ohm], its switching time
#: [s], and the number of time steps during switching.
_VOLTAGE, _SOURCE, _EDGE, _STEPS = 3.2, 40.0, 30e-9, 5


@record(repr=False)
class Segment:
    """A straight trunk with equally spaced nodes, counted from 1.

    `stubs` maps nodes to the lengths of their stubs [m]. A node with a stub is at the far end of
    the stub; the tap loads the trunk like a node. `cable` is used for trunk and stubs; it is
    lossless by default, with 120 ohm and 5 ns/m. A node loads the line with 20 kohm and 100 pF.

    Examples
    --------
    Bits sent at 1 Mbit/s on a 40 m line; without terminators the line stays dominant.

    >>> from shipnet import can
    >>> can.Segment(40).send({1: "01001101"}, 1e6).table().loc[9, "read"]
    '01001101'
    >>> can.Segment(40, terminator=None).send({1: "01001101"}, 1e6).table().loc[9, "read"]
    '00000000'
    >>> can.Segment(40, nodes=5, stubs={3: 10.0})
    Segment(40 m, 5 nodes, terminated, stubs {3: 10.0})
    """

    length: float = number(0.1, 1e4, "m", "Length of the trunk")
    nodes: int = whole(2, 200, "", "Number of nodes, with one at each end of the trunk", default=9)
    terminator: float | None = number(
        1e-3,
        1e9,
        "ohm",
        "Terminating resistance at each end; None leaves the ends open",
        default=120.0,
        optional=True,
    )
    stubs: Mapping[int, float] = field(default_factory=dict)
    cable: Cable = field(default_factory=lambda: Cable.lossless(120, 5e-9))

    def __post_init__(self) -> None:
        check_fields(self)
        for node, metres in self.stubs.items():
            check_whole("node of a stub", node, 1, self.nodes)
            check_scalar(f"length of the stub at node {node}", metres, "m", 1e-3, 1e3)

    def point(self, node: int) -> str:
        """Return the name of a node's point in the network."""
        number = check_whole("node", node, 1, self.nodes)
        return f"{'s' if number in self.stubs else 'b'}{number}"

    def network(self) -> Network:
        """Return the network of trunk and stubs, with the loads of nodes and terminators."""
        step = self.length / (self.nodes - 1)
        runs = [
            CableRun(f"b{node}", f"b{node + 1}", step, self.cable) for node in range(1, self.nodes)
        ]
        for node, metres in self.stubs.items():
            runs.append(CableRun(f"b{node}", f"s{node}", metres, self.cable))
        loads = dict.fromkeys(Network(runs).nodes, _INPUT)
        if self.terminator is not None:
            for name in ("b1", f"b{self.nodes}"):
                loads[name] += Load(r=self.terminator)
        return Network(runs, loads)

    def send(
        self, patterns: Mapping[int, str], bit_rate: float, *, sample_point: float = 0.75
    ) -> Signals:
        """Return the voltages at all nodes, and the bits that they read, while some nodes send.

        The first bit begins half a bit time after time 0. A dominant driver is a source of 3.2 V
        with 40 ohm in series, and switches within 30 ns.

        Parameters
        ----------
        patterns : mapping of int to str
            Bits that each node sends; 0 is dominant. All other nodes and later bits are recessive.
        bit_rate : float
            Bit rate, 1e3..1e6 [bit/s].
        sample_point : float, default 0.75
            Sample point as a fraction of the bit time, 0.01..0.99; all nodes sample simultaneously.
        """
        rate = check_scalar("bit_rate", bit_rate, "bit/s", 1e3, 1e6)
        point = check_scalar("sample_point", sample_point, "", 0.01, 0.99)
        bit = 1 / rate
        begin = bit / 2
        network = self.network()
        length = max(map(len, patterns.values()), default=0)
        if not length:
            raise ArgumentError("patterns are empty; at least one bit must be sent")
        shortest = min(float(run.length * run.made_of.delay) for run in network.runs)
        step = shortest / np.ceil(shortest / min(_EDGE / _STEPS, shortest))
        t: Floats = np.arange(int((begin + length * bit) / step + 1e-9) + 1, dtype=float) * step
        sources, sent = {}, np.ones(length, dtype=np.int8)
        for node, pattern in patterns.items():
            name = self.point(node)
            if set(pattern) - {"0", "1"}:
                raise ArgumentError(f"pattern of node {node} is {pattern!r}; use only 0 and 1")
            levels = np.array([int(c) for c in pattern.ljust(length, "1")], dtype=np.int8)
            sent &= levels
            steps = np.diff(1 - levels, prepend=0, append=0)
            on = np.zeros_like(t)
            for k in np.flatnonzero(steps):
                x = np.clip((t - begin - k * bit) / _EDGE, 0, 1)
                on += steps[k] * (x - np.sin(2 * np.pi * x) / (2 * np.pi))
            # Rounding errors may make the sum of steps slightly negative.
            conductance = np.maximum(on, 0) / _SOURCE
            sources[name] = _VOLTAGE * conductance, conductance
        v = simulate(network, sources, step)
        at: Floats = begin + (np.arange(length, dtype=float) + point) * bit
        seen = np.array([np.interp(at, t, row) for row in v])
        bits = np.where(seen >= DOMINANT, 0, np.where(seen <= RECESSIVE, 1, -1)).astype(np.int8)
        return Signals(self, rate, t, at, sent, network.nodes, v, seen, bits)

    def __repr__(self) -> str:
        ends = "open ends" if self.terminator is None else "terminated"
        stubs = f", stubs {dict(self.stubs)}" if self.stubs else ""
        return f"Segment({self.length:g} m, {self.nodes} nodes, {ends}{stubs})"


@dataclass(frozen=True, eq=False, repr=False)
class Signals:
    """Voltages on a line and the bits read from them, as returned by `Segment.send`.

    `t` contains the times [s], `sample_times` the sampling instants [s], and `sent` the wired AND
    of the bits sent. `v` (differential voltages [V]), `samples` (voltages at the sampling instants
    [V]) and `bits` have one row per point of the network. A bit is 0 (dominant), 1 (recessive) or
    -1 if a receiver may read either. `points` names the rows: b1, b2, ... on the trunk and s1,
    s2, ... at the ends of stubs.

    Examples
    --------
    >>> from shipnet import can
    >>> signals = can.Segment(40).send({1: "01001101"}, 1e6)
    >>> signals, signals.wrong
    (Signals(8 bits at 1000 kbit/s, 9 nodes read all bits), [])
    """

    segment: Segment
    bit_rate: float
    t: Floats
    sample_times: Floats
    sent: Bits
    points: tuple[str, ...]
    v: Floats
    samples: Floats
    bits: Bits

    def row(self, node: int) -> int:
        """Return the row of a node in `v`, `samples` and `bits`."""
        return self.points.index(self.segment.point(node))

    @property
    def wrong(self) -> list[int]:
        """Nodes that may read at least one bit incorrectly."""
        nodes = range(1, self.segment.nodes + 1)
        return [node for node in nodes if (self.bits[self.row(node)] != self.sent).any()]

    def table(self) -> pd.DataFrame:
        """Return one row per node: stub, bits read, number of wrong bits, and worst samples.

        ``read`` contains ? where a receiver may read either value; ``least_dominant_V`` must be at
        least 0.9 V, and ``most_recessive_V`` at most 0.5 V.
        """
        nodes = range(1, self.segment.nodes + 1)
        rows = [self.row(node) for node in nodes]
        dominant = self.sent == 0
        return pd.DataFrame(
            {
                "stub_m": [float(self.segment.stubs.get(node, 0.0)) for node in nodes],
                "read": ["".join("?01"[bit + 1] for bit in self.bits[row]) for row in rows],
                "wrong": [int((self.bits[row] != self.sent).sum()) for row in rows],
                "least_dominant_V": [
                    self.samples[row].min(where=dominant, initial=np.inf) for row in rows
                ],
                "most_recessive_V": [
                    self.samples[row].max(where=~dominant, initial=-np.inf) for row in rows
                ],
            },
            index=pd.Index(nodes, name="node"),
        )

    @style.applied
    def plot(self, node: int | None = None, ax: Axes | None = None) -> Axes:
        """Draw the voltage at a node, by default the last, and the bits that it reads."""
        node = self.segment.nodes if node is None else node
        row, ax, red = self.row(node), style.axes(ax), style.LIMIT["color"]
        ax.plot(self.t * 1e6, self.v[row], color="C0", label=f"voltage at node {node}")
        top = max(self.v[row].max(), DOMINANT)
        for level, name, above in ((DOMINANT, "dominant", True), (RECESSIVE, "recessive", False)):
            ax.axhline(level, lw=1, color=red, linestyle=style.LIMIT["linestyle"])
            ax.annotate(
                name,
                (1, level),
                (3, 2 if above else -2),
                xycoords=("axes fraction", "data"),
                textcoords="offset points",
                color=red,
                ha="left",
                va="bottom" if above else "top",
            )
        at, good = self.sample_times * 1e6, self.bits[row] == self.sent
        for chosen, marker, name in ((good, "o", "sample, right"), (~good, "x", "sample, wrong")):
            if chosen.any():
                ax.plot(at[chosen], self.samples[row, chosen], marker, color="0.2", label=name)
        for when, bit in zip(at, self.bits[row], strict=True):
            ax.annotate("?" if bit < 0 else str(bit), (when, 1.06 * top), ha="center")
        ax.set(
            xlabel="time [µs]",
            ylabel="voltage [V]",
            xlim=(0, self.t[-1] * 1e6),
            ylim=(min(-0.2, 1.1 * float(np.min(self.v[row]))), 1.2 * top),
        )
        style.legend(ax, 2)
        return ax

    def __repr__(self) -> str:
        nodes, wrong = self.segment.nodes, len(self.wrong)
        outcome = (
            f"{wrong} of {nodes} nodes read wrong bits" if wrong else f"{nodes} nodes read all bits"
        )
        return f"Signals({len(self.sent)} bits at {self.bit_rate / 1e3:g} kbit/s, {outcome})"
