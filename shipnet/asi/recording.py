"""Simulate what a scope records on a segment while its master polls the slaves."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from shipnet.arrays import Floats
from shipnet.asi.master import FAULTY, SILENT, Phase, RunningMaster
from shipnet.asi.modulation import HALF_BIT, Modulation
from shipnet.asi.receiver import Disturbance, RNGLike, receive
from shipnet.asi.segment import Segment, step_response
from shipnet.asi.slave import RunningSlave
from shipnet.asi.telegram import REQUEST_BITS, RESPONSE_BITS
from shipnet.asi.timing import Transaction
from shipnet.errors import ArgumentError
from shipnet.fields import check_rng, check_scalar
from shipnet.line.waveform import Waveform

#: Duration for which the voltage of a current step is computed [s]; no line rings longer.
_RINGS = 250e-6

#: Largest random delay of a response [s]: the range of delays in the A2SI data sheet.
_LATE = 0.5e-6

#: Silence before the first request, and margins with which receivers process a telegram [s].
_AHEAD, _BEFORE, _AFTER = 50e-6, 6e-6, 9e-6

_TIMES = Transaction()


class _Recorder:
    """A line whose devices receive telegrams that the cables have distorted."""

    def __init__(
        self, segment: Segment, node: str, size: int, dt: float, weak: Mapping[str, float]
    ) -> None:
        if segment.head is None or not segment.slaves:
            raise ArgumentError(f"{segment} needs a master and a slave")
        self.slaves = [RunningSlave(slave) for slave in segment.slaves]
        for slave in self.slaves:
            slave.fields["active"] = True
            slave.pause()
        network = segment.network
        rows = [network.index(slave.node) for slave in segment.slaves]
        listeners = [*rows, network.index(node, "node")]
        self.dt, self.slot, self.at = dt, round(HALF_BIT / dt), round(_AHEAD / dt)

        def steps_of(sender: str, rows: list[int]) -> Floats:
            u = step_response(network, sender, rows, round(_RINGS / dt), dt)
            # Fade out the end, which would otherwise be a step.
            return u * np.minimum(1, 2 * np.linspace(1, 0, u.shape[-1]))

        #: Voltages [V] that a step of the master's current causes at each slave and at the scope;
        #: by reciprocity, a step of a slave's current causes the same voltage at the master.
        self.from_master = steps_of(segment.head, listeners)
        #: Voltages [V] that a step of each slave's current causes at the scope.
        self.scope = self.from_master[:-1] if node == segment.head else steps_of(node, rows)
        self.strength = np.array([weak.get(slave.label, 1.0) for slave in segment.slaves])
        self.telegrams: dict[str, Floats] = {}
        #: Voltage at each slave, at the scope and at the master.
        self.u = np.zeros((len(rows) + 2, size), np.float32)

    @property
    def seconds(self) -> float:
        """Simulated time [s]."""
        return self.at * self.dt

    def begin(self, phase: Phase, cycle: int) -> None:
        """Ignore the phases of the master."""

    def put(self, rows: slice, telegram: Floats, start: int) -> None:
        """Add a telegram to some rows of the voltages, beginning at sample `start`."""
        room = max(0, self.u.shape[1] - start)
        self.u[rows, start : start + telegram.shape[-1]] += telegram[..., :room]

    def request(self, bits: str) -> Floats:
        """Return the voltages of a request at slaves and scope [V]; compute each request once."""
        if bits not in self.telegrams:
            self.telegrams[bits] = self.telegram(self.from_master, bits)
        return self.telegrams[bits]

    def telegram(self, change: Floats, bits: str) -> Floats:
        """Return the voltage of a telegram, computed from that of one current step."""
        steps = Modulation(bits).steps
        u = np.zeros((*change.shape[:-1], change.shape[-1] + len(steps) * self.slot), np.float32)
        for start in np.flatnonzero(steps) * self.slot:
            u[..., start : start + change.shape[-1]] += steps[start // self.slot] * change
        return u

    def bits(self, rows: slice, start: int, count: int) -> list[str]:
        """Return the bits that receivers read, "" for a bad telegram."""
        end = start + round((2 * count * HALF_BIT + _AFTER) / self.dt)
        received = receive(self.u[rows, start - round(_BEFORE / self.dt) : end], self.dt, count)
        texts = ("".join(map(str, row)) for row in received.bits.tolist())
        return ["" if error else text for text, error in zip(texts, received.error, strict=True)]

    def transact(self, request: str, rng: np.random.Generator) -> int:
        """Send a request, let the slaves respond, and return their data, `SILENT` or `FAULTY`."""
        start, count, bit = self.at, len(self.slaves), 2 * self.slot
        self.put(slice(count + 1), self.request(request), start)
        end = start + REQUEST_BITS * bit
        self.at = end + round(_TIMES.timeout * bit)
        first = last = 0
        for k, text in enumerate(self.bits(slice(count), start, REQUEST_BITS)):
            slave = self.slaves[k]
            slave.fields["inputs"] = rng.integers(16)
            in_step = slave.fields["synchronised"]
            answer = slave.hear(text, start * self.dt)
            slave.pause()
            if answer is not None:
                pause = _TIMES.master_pause + (0 if in_step else _TIMES.unsynchronised)
                begin = end + round(pause * bit) + round(rng.uniform(0, _LATE) / self.dt)
                voltages = np.stack([self.scope[k], self.from_master[k]]) * self.strength[k]
                self.put(slice(count, None), self.telegram(voltages, answer.bits), begin)
                first, last = min(first or begin, begin), max(last, begin)
        if not last:
            return SILENT
        self.at = last + round((RESPONSE_BITS + _TIMES.slave_pause) * bit)
        (text,) = self.bits(slice(count + 1, None), first, RESPONSE_BITS)
        return int(text[1:5], 2) if text else FAULTY


def record_segment(
    segment: Segment,
    duration: float,
    *,
    node: str | None,
    dt: float,
    weak: Mapping[str, float],
    disturbance: Disturbance | None,
    amplitude: float,
    rng: RNGLike | None,
) -> Waveform:
    """Return the record of a scope at a node; see `Plan.record`."""
    duration = check_scalar("duration", duration, "s", 1e-3, 0.2)
    dt = check_scalar("dt", dt, "s", 50e-9, 500e-9)
    amplitude = check_scalar("amplitude", amplitude, "V", 0, 1e9)
    labels = [slave.label for slave in segment.slaves]
    for label, strength in weak.items():
        if label not in labels:
            raise ArgumentError(f"weak contains {label!r}; the slaves are {', '.join(labels)}")
        check_scalar(f"weak[{label!r}]", strength, "", 0, 10)
    random = check_rng(rng)
    size = round(duration / dt)
    node = node or segment.head or ""
    line = _Recorder(segment, node, size, dt, weak)
    if disturbance is not None:
        t = np.asarray(np.arange(size) * dt, np.float64)
        line.u += disturbance.voltage(t, amplitude, random, 1, span=(0.0, duration))
    profiles = {slave.label: slave.kind for slave in segment.slaves}
    master = RunningMaster(replace(segment.masters[0], projected=profiles))
    program = master.run(line, dict.fromkeys(profiles, 0))
    request = next(program)
    while line.at + round(400e-6 / dt) < size:
        request = program.send(line.transact(request.bits, random))
    # With several supplies only the voltage at their own terminals is known.
    several = len(segment.supplies) > 1
    volts = segment.supplies[0].voltage if several else segment.voltages[node]
    u = line.u[-2].astype(np.float64) + volts
    return Waveform(u, dt, names=("voltage",), description=f"{segment}, scope at {node}")
