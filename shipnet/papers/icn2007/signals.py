"""Sections 4 and 5: allowed structures, the ring, the modulation, and what reflections do to it."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from shipnet.asi.modulation import HALF_BIT, ramp_spectrum, send_spectrum, steps_of
from shipnet.asi.plan import Plan
from shipnet.asi.segment import telegram_voltages
from shipnet.asi.telegram import RESPONSES, Request
from shipnet.asi.topologies import line, ring, star
from shipnet.line.cable import CABLES, Cable
from shipnet.line.network import Load, Network
from shipnet.papers.icn2007.telegrams import bus_efficiencies
from shipnet.papers.registry import check

#: Frequencies on which energies are summed [Hz].
FREQUENCIES = np.arange(0.5e3, 30e6, 1e3)

Floats = npt.NDArray[np.float64]


@check("icn2007-031", counter={"closed": False})
def ring_lowers_drop(*, closed: bool = True) -> bool:
    """Whether a consumer half-way along gets more voltage if the cable comes back to the supply."""
    return consumer_drop(closed=closed) < consumer_drop(closed=False)


def consumer_drop(*, closed: bool, place: float = 50.0, length: float = 100.0) -> float:
    """Return the voltage that 1 A loses on the way to its place on a line or a ring [V].

    Parameters
    ----------
    closed : bool
        Whether the cable comes back to the supply.
    place : float, default 50
        Where the consumer is, more than 0 and less than `length` [m].
    length : float, default 100
        Length of the whole cable, of two cores of 1.5 mm2 [m].

    Returns
    -------
    float
        Voltage lost in both wires [V].

    Examples
    --------
    >>> f"{consumer_drop(closed=False):.2f} V, {consumer_drop(closed=True):.3f} V"
    '1.35 V, 0.675 V'
    """
    (segment,) = (ring if closed else line)(length, [place], current=1.0).segments
    voltage = segment.voltages
    return voltage[segment.supplies[0].node] - voltage[segment.slaves[0].node]


@check("icn2007-007", counter={"supply": {"r": 78.0}})
def no_direct_component(*, supply: dict[str, float] | None = None) -> bool:
    """Whether the voltage of every response adds up to less than 1 % of what its pulses hold.

    The supply's inductor does it; the counter leaves a resistor alone in its place.
    """
    plan = line(100, slaves=(5, 50, 100))
    network = plan.network
    if supply is not None:
        network = Network(plan.cables, {"0 m": Load(**supply)})
    nodes = [slave.node for slave in plan.slaves]
    u = telegram_voltages(network, "0 m", nodes, RESPONSES, after=55e-6)
    return bool((np.abs(u.sum(axis=-1)) < 1e-2 * np.abs(u).sum(axis=-1)).all())


@check("icn2007-032", counter={"length": 200.0})
def dense_pulses_change_more(*, length: float = 100.0) -> bool:
    """Whether an open end changes pulses 3 us apart more than pulses 6 us apart.

    A matched end is the measure: the same cable without a reflection.
    """
    change = [
        abs(pulse_height(length, bits) / pulse_height(length, bits, terminator=100.0) - 1)
        for bits in ("0" * 16, "01" * 8)
    ]
    return bool(change[0] > change[1])


def pulse_height(
    length: float, bits: str, *, place: float = 5.0, terminator: float | None = None
) -> float:
    """Return the height of the pulses in the middle of a long row of bits [V].

    Equal bits make pulses a half-bit apart, alternating bits a bit apart.

    Parameters
    ----------
    length : float
        Length of the cable [m].
    bits : str
        The row of bits.
    place : float, default 5
        Where the sender is; master and supply are at 0 [m].
    terminator : float, optional
        Resistance across the far end [ohm].

    Returns
    -------
    float
        Height at the master [V].

    Examples
    --------
    >>> print(f"{pulse_height(100, '0' * 16):.2f} V, {pulse_height(100, '01' * 8):.2f} V")
    2.46 V, 2.34 V
    """
    plan = line(length, slaves=(place,), terminator=terminator)
    dt, end = 50e-9, 2 * len(bits) * HALF_BIT
    node = plan.slaves[0].node
    u = telegram_voltages(plan.network, "0 m", [node], bits, dt=dt, before=0, after=6.4e-6)
    t = dt * np.arange(u.shape[-1])
    return float(np.abs(u[..., (t > 0.4 * end) & (t < 0.8 * end)]).max())


@check("icn2007-033", counter={"length": 1000.0})
def signal_suits_cable(*, length: float = 100.0) -> bool:
    """Whether nine tenths of a request's energy arrive at the matched end of the cable."""
    return arriving_share(length) > 0.9


def arriving_share(length: float, *, cable: Cable = CABLES["as-i 1.5"]) -> float:
    """Return which share of the energy of the example's request a matched cable passes on.

    Parameters
    ----------
    length : float
        Length of the cable [m].
    cable : shipnet.line.Cable, optional
        The nominal AS-i cable if omitted.

    Returns
    -------
    float
        Share, 0..1.

    Examples
    --------
    >>> print(f"{arriving_share(100):.1%}")
    94.2%
    """
    s = 2j * np.pi * FREQUENCIES
    energy = np.abs(s * send_spectrum(s, Request.data_exchange(21, 0xE).bits)) ** 2
    passed = np.exp(-2 * cable.propagation(s).real * length)
    return float((passed * energy).sum() / energy.sum())


@check("icn2007-051", counter={"pulse": "rectangle"})
def narrow_band(*, pulse: str = "sin2") -> bool:
    """Whether less than a thousandth of the energy lies above the band, 667 kHz."""
    return share_above(2 / HALF_BIT, pulse=pulse) < 1e-3


def share_above(frequency: float, *, pulse: str = "sin2") -> float:
    """Return which share of the energy of the example's request lies above a frequency.

    Parameters
    ----------
    frequency : float
        Frequency [Hz].
    pulse : {"sin2", "half sine", "rectangle"}, default "sin2"
        Form of the pulses, all a half-bit long.

    Returns
    -------
    float
        Share, 0..1.

    Examples
    --------
    >>> print(f"{share_above(667e3):.2%}, {share_above(667e3, pulse='rectangle'):.1%}")
    0.07%, 7.1%
    """
    x = FREQUENCIES * HALF_BIT
    shape = {
        "sin2": np.abs(ramp_spectrum(2j * np.pi * FREQUENCIES)),
        "half sine": np.abs(np.cos(np.pi * x) / (1 - (2 * x) ** 2)),
        "rectangle": np.abs(np.sinc(x)),
    }[pulse]
    steps = steps_of(Request.data_exchange(21, 0xE).bits)
    code = steps @ np.exp(-2j * np.pi * np.outer(np.arange(steps.size), x))
    energy = np.abs(shape * code) ** 2
    return float(energy[FREQUENCIES > frequency].sum() / energy.sum())


# Structures and buses --------------------------------------------------------------------------


SLAVES = 62


def allowed_plans() -> dict[str, Plan]:
    """Return the structures that section 4 allows, as plans with the supply in a good place.

    Returns
    -------
    dict of str to Plan
        Eight plans of 100 m; all but the first with 62 slaves.

    Examples
    --------
    >>> plans = allowed_plans()
    >>> [name for name, plan in plans.items() if not keeps_all_rules(plan)]
    []
    """
    growing = np.arange(1, SLAVES + 1)
    return {
        "100 m and a slave at its end": line(100, [100]),
        "90 m and a star of 62": trunk_and_star(),
        "star, legs as long as the master's": star(100 / 63, [100 / 63] * SLAVES),
        "star, unequal legs": star(1, (99 * growing / growing.sum()).tolist()),
        "62 along a line, evenly": line(100, SLAVES, supply=50),
        "62 along a line, unevenly": line(100, (100 * (growing / SLAVES) ** 2).tolist(), supply=50),
        "mixture": star(70, [1.5] * 20, along=42, supply=35),
        "passive ring": ring(100, SLAVES),
    }


def keeps_all_rules(plan: Plan) -> bool:
    """Return whether a plan passes every rule."""
    return plan.check().ok is True


def trunk_and_star(leg: float = 10 / SLAVES) -> Plan:
    """Return 90 m of cable, then a star of 62 slaves with the supply at its hub."""
    return star(90, [leg] * SLAVES, supply=90)


@check("icn2007-003", counter={"leg": 2.0})
def trunk_and_star_is_allowed(*, leg: float = 10 / SLAVES) -> bool:
    """Whether 90 m and 62 legs of this length [m] keep every rule."""
    return keeps_all_rules(trunk_and_star(leg))


@check("icn2007-004", counter={"length": 101.0})
def slave_at_end(*, length: float = 100.0) -> bool:
    """Whether a cable of this length with a slave at its end keeps every rule."""
    return keeps_all_rules(line(length, [length]))


@check("icn2007-048", counter={"supply": 0.0})
def structures_are_allowed(*, supply: float = 50.0) -> bool:
    """Whether all structures keep every rule, with the supply of the even line in this place."""
    plans = {**allowed_plans(), "evenly": line(100, SLAVES, supply=supply)}
    return all(keeps_all_rules(plan) for plan in plans.values())


@check("icn2007-027", counter={"user_bits": 4})
def best_of_buses(*, user_bits: int = 64) -> bool:
    """Whether AS-i is the most efficient of three buses for this many bits each way."""
    return bool(bus_efficiencies(user_bits).iloc[0].idxmax() == "as_i")
