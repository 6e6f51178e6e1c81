"""The AS-i bench: devices on a cable, and the signals, voltages, times and rules that follow."""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Mapping
from dataclasses import asdict, replace
from functools import cached_property
from itertools import pairwise
from typing import Any

import numpy as np

from shipnet import asi, fields
from shipnet.arrays import Bools
from shipnet.asi.modulation import HALF_BIT
from shipnet.asi.plan import PlanFindings, plan_of
from shipnet.asi.receiver import MINIMUM, matched_filter
from shipnet.asi.segment import Element, signals_of, telegram_voltages
from shipnet.asi.timing import ADDRESSES
from shipnet.asi.topologies import assign_addresses
from shipnet.errors import ArgumentError, FrameError, SilenceError
from shipnet.fields import choice, number, switch, whole
from shipnet.lazy import pd
from shipnet.tables import as_csv
from shipnet.tools._bench_devices import (
    CABLE_CHOICES,
    KINDS,
    LONGEST,
    RESISTOR,
    Device,
    open_plan,
    read_devices,
)
from shipnet.tools._tool import Tool
from shipnet.tools._view import Upload, View, words

_WORDS = words("asi_bench")

#: Sampling interval, and times recorded before and after the response [s].
STEP, BEFORE, AFTER = 250e-9, 6e-6, 28.8e-6

#: Ratio of the standard deviations of white noise after and before the matched filter:
#: sqrt(8 d / 3), where d is the sampling interval in half-bits.
FILTERED = (8 / 3 * STEP / HALF_BIT) ** 0.5

#: Number of responses in noise, of which the lost ones are counted.
TRIES = 250


@fields.record
class AsiBench(Tool):
    """An AS-i line as devices on a cable: its signals, voltages, times and rules.

    Each device is a text: its kind, and its distance from the start of the cable, such as
    ``"supply@50"``. ``"slave@50/3"`` is a slave on a spur of 3 m, and ``"31*slave@100"`` is 31
    evenly spaced slaves, the last at 100 m; slaves get addresses in this order. A repeater divides
    the cable into segments, each of which needs a supply.

    `plan` is the installation, an `asi.Plan`, and `result` has the findings of its check. `wave` is
    the response of a slave at the scope, and `reading` what a master there reads. `table` has one
    row per slave.

    Examples
    --------
    >>> AsiBench().verdict
    'all rules met: 288 checks'
    >>> AsiBench(devices=("master@0", "supply@0", "scope@0", "slave@5"), length=200).reading
    'InformationError: slot 3, the middle of bit 1, is empty'
    """

    devices: tuple[str, ...] = fields.part(
        tuple,
        _WORDS["devices"],
        default=("master@0", "supply@50", "scope@0", "31*slave@100"),
        make=lambda value: tuple(fields.check_kind("devices", value, list)),
    )
    length: float = number(1, LONGEST, "m", _WORDS["length"], (10, 300), default=100.0, step=0.1)
    cable: str = choice(
        {key: key.replace("ohm", "Ω") for key in CABLE_CHOICES},
        _WORDS["cable"],
        default=next(iter(CABLE_CHOICES)),
    )
    ring: bool = switch(_WORDS["ring"], default=False)
    current_ma: float = number(0, 500, "mA", _WORDS["current_ma"], (0, 200), default=65.0, step=1)
    pairs: int = whole(0, ADDRESSES, help=_WORDS["pairs"], default=0)
    sender: int = whole(1, 2 * ADDRESSES, help=_WORDS["sender"], default=1, typed=True)
    data: int = whole(0, 15, help=_WORDS["data"], default=6)
    noise: float = number(0, 10, "V", _WORDS["noise"], (0, 1.5), default=0.0, step=0.05)
    error_rate: float = number(0, 1, "", _WORDS["error_rate"], (0, 0.5), default=0.0, step=0.01)

    def __post_init__(self) -> None:
        fields.check_fields(self)
        object.__setattr__(self, "length", round(self.length, 2))
        object.__setattr__(self, "devices", tuple(map(str, read_devices(self.devices))))
        cuts = self.cuts
        if self.ring and cuts:
            raise ArgumentError("ring is True; a cable with a repeater cannot be a ring")
        if len(set(cuts)) < len(cuts) or not all(0 < cut < self.length for cut in cuts):
            raise ArgumentError(
                f"repeaters are at {', '.join(f'{cut:g} m' for cut in cuts)}; each must have its "
                f"own place between the ends of the cable, 0 and {self.length:g} m"
            )

    # The installation ------------------------------------------------------------------------

    @cached_property
    def placed(self) -> list[Device]:
        """The devices; those beyond the end of the cable are at its end."""
        devices = read_devices(self.devices)
        return [one._replace(place=min(one.place, self.length)) for one in devices]

    def of_kind(self, kind: str) -> dict[int, float]:
        """Return the index and the place [m] of each device of a kind."""
        return {k: one.place for k, one in enumerate(self.placed) if one.kind == kind}

    @property
    def scope(self) -> float:
        """Place of the scope [m]."""
        (place,) = self.of_kind("scope").values()
        return place

    @cached_property
    def cuts(self) -> list[float]:
        """Places of the repeaters, in order [m]."""
        return sorted(self.of_kind("repeater").values())

    @cached_property
    def places(self) -> list[float]:
        """Places along the cable that are nodes of the plan, in order [m]."""
        # A ring needs two places besides its start.
        least = [0.0, *([self.length / 3, self.length / 1.5] if self.ring else []), self.length]
        return sorted({*least, *(device.place for device in self.placed)})

    def node(self, place: float, *, right: bool = False) -> str:
        """Return the node at a place; a repeater has a second one, for the cable on its right."""
        start = 0.0 if self.ring and place == self.length else place
        return f"{start:g} m" + (", right" if right and place in self.cuts else "")

    @cached_property
    def plan(self) -> asi.Plan:
        """The plan of the installation."""
        cable, slaves = CABLE_CHOICES[self.cable], self.of_kind("slave")
        pairs = int(np.clip(self.pairs, max(0, len(slaves) - ADDRESSES), len(slaves) // 2))
        labels = dict(zip(slaves, assign_addresses(len(slaves), pairs=pairs), strict=True))
        elements: list[Element] = [
            asi.CableRun(self.node(a, right=True), self.node(b), b - a, cable)
            for a, b in pairwise(self.places)
        ]
        for index, (kind, place, spur) in enumerate(self.placed):
            node = self.node(place)
            if kind == "slave":
                end = f"{node}, spur {labels[index]}" if spur else node
                elements += [asi.CableRun(node, end, spur, cable)] if spur else []
                elements.append(asi.Slave(labels[index], node=end, current=self.current_ma / 1e3))
            elif kind == "master":
                elements.append(asi.Master(node=node))
            elif kind == "supply":
                elements.append(asi.Supply(node))
            elif kind == "repeater":
                elements.append(asi.Repeater(node, self.node(place, right=True)))
            elif kind == "terminator":
                elements.append(asi.Terminator(node))
            elif kind == "resistor":
                elements.append(asi.Terminator(node, RESISTOR, inductance=1e3))
        return plan_of(elements)

    @cached_property
    def result(self) -> PlanFindings:
        """The findings when the plan is checked against the rules."""
        return self.plan.check()

    # Signals, voltages and times -------------------------------------------------------------

    @property
    def receiver(self) -> asi.Receiver:
        """The receiver at the scope."""
        # Noise rarely exceeds four standard deviations, so it rarely looks like a pulse.
        return asi.Receiver(minimum=max(MINIMUM, 4 * FILTERED * self.noise))

    @property
    def sending(self) -> int:
        """Index of the slave whose response is shown; that of the last slave if there are fewer."""
        return min(self.sender, len(self.plan.slaves)) - 1

    @property
    def verified(self) -> bool:
        """Whether both the scope and the slave are in a segment with exactly one supply."""
        nodes = self.node(self.scope), self.plan.slaves[self.sending].node
        return bool(np.isfinite([self.voltages[node] for node in nodes]).all())

    @cached_property
    def waves(self) -> asi.Waveform:
        """The voltage at the scope while the slave responds; with noise, that of each try."""
        here = bisect_left(self.cuts, self.scope)
        there = bisect_left(self.cuts, [*self.of_kind("slave").values()][self.sending])
        # From another segment, the response arrives through the repeater between the two.
        source = self.plan.slaves[self.sending].node
        if there > here:
            source = self.node(self.cuts[here])
        elif there < here:
            source = self.node(self.cuts[here - 1], right=True)
        network, bits = self.plan.segments[here].network, asi.Response(self.data).bits
        (u,) = telegram_voltages(
            network, source, [self.node(self.scope)], bits, dt=STEP, before=BEFORE, after=AFTER
        )
        sent = asi.Modulation([bits] * (TRIES if self.noise else 1)).bits
        wave = asi.Waveform(np.repeat(u[0], len(sent), axis=0), STEP, start=-BEFORE, bits=sent)
        return wave.disturbed(asi.emc.Noise(), self.noise, 0)

    @cached_property
    def wave(self) -> asi.Waveform:
        """The voltage at the scope while the slave responds; with noise, the first try."""
        return replace(self.waves, u=self.waves.u[0], bits=self.waves.bits[0])

    @cached_property
    def received(self) -> asi.Reception:
        """The response as a master at the scope receives it."""
        return self.wave.receive(self.receiver)

    def right(self, received: asi.Reception) -> Bools:
        """Return True for each response that is received as it was sent."""
        return np.asarray((received.error == 0) & (received.bits == self.wave.bits).all(axis=-1))

    @property
    def reading(self) -> str:
        """The response as it is read at the scope, or the error that is detected."""
        sent, received = asi.Response(self.data).bits, self.received
        if not self.verified:
            return "not verified: a segment does not have exactly one supply"
        try:
            if received.error == SilenceError.code:
                raise SilenceError("no pulse rises above the noise")
            read = received.pulses.decode()
            response = asi.Response.parse(read)
        except FrameError as error:
            return f"{type(error).__name__}: {error}"
        if read != sent:
            return f"read {read}, but {sent} was sent: the fault went undetected"
        within = "" if received.within_tolerance else "; pulses outside their tolerance"
        return f"read {read}: {response}{within}"

    @cached_property
    def strengths(self) -> asi.Quality:
        """The worst signals of each slave's telegrams; NaN without exactly one supply."""
        labels = tuple(slave.label for slave in self.plan.slaves)
        segments = [segment for segment in self.plan.segments if len(segment.supplies) == 1]
        values = np.full((5, len(labels)), np.nan)
        for segment, quality in zip(segments, signals_of(segments), strict=True):
            columns = [labels.index(slave.label) for slave in segment.slaves]
            values[:, columns] = np.array(quality[:5])[:, : len(columns)]
        return asi.Quality._make([*values, labels])

    @cached_property
    def voltages(self) -> dict[str, float]:
        """Supply voltage at each node [V]; NaN in a segment without exactly one supply."""
        volts: dict[str, float] = {}
        for segment in self.plan.segments:
            one = len(segment.supplies) == 1
            volts |= segment.voltages if one else dict.fromkeys(segment.network.nodes, np.nan)
        return volts

    @cached_property
    def times(self) -> pd.DataFrame:
        """Response times of each slave; with errors, the worst one includes a repetition."""
        return self.plan.response_times(repetitions=1 if self.error_rate else None)

    def table(self) -> pd.DataFrame:
        """Return the place, voltage, signals and times of each slave."""
        placed = [device for device in self.placed if device.kind == "slave"]
        table = self.strengths.table().drop(columns="received")
        table.insert(0, "place_m", [device.place for device in placed])
        table.insert(1, "spur_m", [device.spur for device in placed])
        table.insert(2, "voltage_V", [self.voltages[slave.node] for slave in self.plan.slaves])
        names = ["best", "worst", "update"]
        return table.assign(**{f"{name}_ms": 1e3 * self.times[f"{name}_s"] for name in names})

    # The page --------------------------------------------------------------------------------

    def answer(self) -> dict[str, Any]:
        """Return what the drawing shows while a device is dragged: text, numbers and `arrays`."""
        wave, received, strengths = self.wave, self.received, self.strengths
        filtered, looks = matched_filter(wave.u, wave.dt), received.looks(wave)[1:]
        hidden = 1.0 if self.verified else np.nan
        # At a repeater, the voltages on the left and on the right differ.
        ends = [(x, self.node(x, right=right)) for x in self.places for right in (False, True)]
        arrays = {
            "line": hidden * wave.u,
            "filtered": hidden * filtered,
            "look_us": 1e6 * looks,
            "look_V": hidden * np.interp(looks, wave.t, filtered),
            "filled": received.slots[1:],
            "weakest": 100 * strengths.evenness,
            "ringing": 100 * strengths.ringing,
            "volts": [self.voltages[slave.node] for slave in self.plan.slaves],
            "profile_m": [x for x, _ in ends],
            "profile_V": [self.voltages[node] for _, node in ends],
        }
        return {
            "state": asdict(self) | {"devices": list(self.devices)},
            "labels": list(strengths.slaves),
            "sending": self.sending,
            "reading": self.reading,
            "read_well": bool(self.right(received) and received.within_tolerance and self.verified),
            "start_us": 1e6 * wave.start,
            "step_us": 1e6 * wave.dt,
            "arrays": {name: np.asarray(values, "<f4") for name, values in arrays.items()},
        }

    def broken(self) -> list[dict[str, Any]]:
        """Return the rules that are not met: text, devices by index, and stretches of cable [m]."""
        plan, worst = self.plan, self.result.worst()
        kinds = {"master": plan.masters, "supply": plan.supplies, "slave": plan.slaves}
        kinds["repeater"] = plan.repeaters
        devices = {
            str(element): index
            for kind, elements in kinds.items()
            for index, element in zip(self.of_kind(kind), elements, strict=True)
        }
        ends = pairwise([0.0, *self.cuts, self.length])
        stretches = dict(zip(map(str, plan.segments), ends, strict=True))
        table = self.result.table()
        table = table[table["verdict"] != "met"]
        broken = []
        rules = worst.index[worst["verdict"] != "met"]
        for rule, text in zip(rules, self.result.broken, strict=True):
            objects = [worst["object"][rule], *table["object"][table["rule"] == rule]]
            where = [devices[one] for one in objects if one in devices]
            along = [stretches[one] for one in objects if one in stretches]
            broken.append({"text": text, "devices": where, "stretches": along})
        return broken

    def _view(self) -> View:
        plan, broken, received, times = self.plan, self.result.broken, self.received, self.times
        cycle, shared = plan.cycle, sum(slave.half == "B" for slave in plan.slaves)
        effect = asi.emc.independent_failures(self.error_rate, cycle).iloc[0]
        unknown = "; ".join(times.loc[times["why"] != "", "why"].unique())
        known = f"{1e3 * times['best_s'].min():.2f} to {1e3 * times['worst_s'].max():.2f} ms"
        least, most = asi.TOLERANCE
        numbers = {
            "cycle": f"{1e3 * float(cycle.time):.2f} ms; bus time {100 * cycle.bus_time:.1f} %",
            "addresses": f"{cycle.addresses} of {ADDRESSES}, {shared} of them shared",
            "polled every": unknown or f"{1e3 * times['update_s'].max():.2f} ms",
            "input known after": unknown or known,
            "repetitions": f"{effect['repetitions_per_s']:.3g} per second",
            "slaves dropped": f"{effect['drops_per_h']:.3g} per hour, if independent",
            f"slave {plan.slaves[self.sending].label}": self.reading,
            "its signal": f"{np.ptp(self.wave.u):.1f} Vpp; first pulse {received.amplitude:.2f} V",
            "its weakest pulse": f"{received.weakest:.1%}, at least {least:.0%} required",
            "its ringing": f"{received.ringing:.1%}, at most {most:.0%} allowed",
        }
        if self.noise:
            lost = int((~self.right(self.waves.receive(self.receiver))).sum())
            numbers["lost in noise"] = f"{lost} of {TRIES} such responses"
        lines = [f"{number}. {line}" for number, line in enumerate(broken, 1)]
        longest = max(segment.length for segment in plan.segments)
        settings = f"[asi]\ncurrent = {self.current_ma / 1e3:g}\nlength = {longest:g}\n"
        samples = {"time_us": 1e6 * self.wave.t, "voltage_V": self.wave.u}
        return View(
            verdict="\n".join(lines) or f"all rules met: {len(self.result)} checks",
            ok=not broken,
            numbers=numbers,
            plot=self.plot,
            height=3.2,
            about="Plan of master, supply, cables and slaves; parts that violate a rule are red",
            files={
                "slaves.csv": as_csv(self.table().reset_index(), digits=5),
                "waveform.csv": as_csv(pd.DataFrame(samples), digits=5),
            },
            uses={"ship_design": {"own": settings}},
        )

    def _options(self) -> dict[str, Any]:
        from shipnet.tools._drawing import Drawing

        least, most = asi.TOLERANCE
        volts = float(asi.rule_limits()["low"]["slave_voltage"])
        limits = {"weakest": 100 * least, "ringing": 100 * most, "volts": volts}
        labels = {"resistor": f"{RESISTOR:g} Ω"}
        kinds = {kind: (*counts, labels.get(kind, kind)) for kind, counts in KINDS.items()}
        help = "An AS-i plan as CSV or Excel; its slaves are numbered from 1, in address order."
        return {
            "drawing": Drawing(update, {"limits": limits, "kinds": kinds}),
            "uploads": [Upload("open a plan", help, ".csv,.txt,.xlsx", open_plan)],
        }


def update(state: Mapping[str, Any]) -> dict[str, Any]:
    """Return what the drawing shows for a state, which is a record of the bench's fields.

    Raises ArgumentError if a field is unknown or illegal; missing ones have their defaults.
    """
    names = ", ".join(fields.declared(AsiBench))
    for name in state:
        if name not in fields.declared(AsiBench):
            raise ArgumentError(f"the state has a field {name!r}; its fields are {names}")
    return AsiBench(**state).answer()
