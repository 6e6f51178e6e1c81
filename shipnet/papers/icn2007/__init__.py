"""What icn2007 prints, recomputed: the AS-Interface communication system.

"AS-Interface communication system for field networks (2)", ICN magazine, July 2007: sections 4 and
5 and the data link layer. `shipnet.papers.kim2023` registers most claims that both papers make.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import numpy.typing as npt

from shipnet.arrays import Floats
from shipnet.asi.faults import DeadSlave, LostReply, MasterFailure, TelegramErrors
from shipnet.asi.master import Master
from shipnet.asi.modulation import HALF_BIT, Modulation, Signs, ramp_spectrum
from shipnet.asi.plan import Plan
from shipnet.asi.profile import Profile
from shipnet.asi.segment import telegram_voltages
from shipnet.asi.simulation import Standby, simulate
from shipnet.asi.slave import WATCHDOG, RunningSlave, Slave
from shipnet.asi.telegram import RESPONSES, Call, Half, Request, Response
from shipnet.asi.timing import Transaction, cycle_time
from shipnet.asi.topologies import line, ring, star
from shipnet.errors import ArgumentError
from shipnet.lazy import pd
from shipnet.line.cable import CABLES, Cable
from shipnet.line.network import Load, Network
from shipnet.papers.kim2023.protocol import (
    ADDRESSES,
    five_slaves,
    reach,
)
from shipnet.papers.kim2023.ship import margin_of
from shipnet.papers.registry import check, is_legal, numeric

__all__ = ["allowed_plans", "arriving_share", "bus_efficiencies", "consumer_drop", "pulse_height"]
__all__ += ["modulation_table", "open_end_distortion", "rate_table", "share_above"]


@numeric("icn2007-035")
def leg_length(*, total: int = 100, trunk: int = 90, slaves: int = 62) -> float:
    """Length of each leg of a star behind a trunk [m]."""
    return (total - trunk) / slaves


@numeric("icn2007-015")
def extra_pause() -> float:
    """Largest extra delay of a slave that sometimes misses a request [bit]."""
    disturbed = TelegramErrors("3", request=0.1)
    run = simulate(five_slaves(), cycles=100, faults=disturbed, rng=2024)
    return float(np.ptp(run.events()["master_pause_bit"].dropna()))


@check("icn2007-018", counter={"data": 0xA})
def example_for_21a(*, data: int = 0xE) -> bool:
    """Whether the example's request is also a request to slave 21A with data 6."""
    bits = Request.data_exchange(21, data).bits
    return Request.parse(bits, extended=True) == Request.data_exchange(21, 0x6, "A")


@numeric("icn2007-044", profile="S-7.F")
@numeric("icn2007-020", profile="S-7.A")
def output_bits(*, profile: str) -> int:
    """Number of output bits in a request to a slave with this profile."""
    return Profile.parse(profile).output_bits


@check("icn2007-045", counter={"asked": True})
def same_answer(
    *, halves: tuple[Half | None, Half | None] = (None, "A"), asked: bool = False
) -> bool:
    """Whether a standard and an A slave send equal responses or, if `asked`, get equal requests."""
    requests = [Request.data_exchange(21, 0x6, half) for half in halves]
    telegrams = [request if asked else request.answer(0x6) for request in requests]
    return telegrams[0].bits == telegrams[1].bits


@check("icn2007-025", counter={"rate": 55e3})
def net_rate_is_possible(*, rate: float = 53.5e3) -> float:
    """Margin by which this rate is between those with the longest and the shortest slave pause."""
    slowest, fastest = (Transaction(2, pause).net_rate for pause in (2.0, 1.5))
    return min(rate / slowest - 1, 1 - rate / fastest)


@numeric("icn2007-026")
def efficiency(*, pause: float = 2) -> float:
    """Percentage of a transaction's bit times that carry user bits."""
    return 100 * float(Transaction(pause, 2).efficiency())


@check("icn2007-029", counter={"call": Call.RESET})
def not_acknowledged(*, call: Call = Call.BROADCAST_RESET) -> bool:
    """Whether this call has no response."""
    return not is_legal(Response, 0, call)


# Lost responses, dead slaves and the standby master --------------------------------------------


#: A request to slave 3, one to slave 4, one with a wrong parity bit, and one of no call of the
#: standard: control bit 1, address 3, information 10111.
OWN, OTHER = (Request(Call.READ_ID, address).bits for address in (3, 4))
DAMAGED, UNKNOWN = OWN[:-2] + str(1 - int(OWN[-2])) + OWN[-1], "01000111011111"


@check("icn2007-028", requests=(DAMAGED,), counter={"requests": (OWN,)})
@check("icn2007-052", requests=(OTHER, UNKNOWN), counter={"requests": (OWN,)})
def is_silent(*, requests: tuple[str, ...]) -> bool:
    """Whether slave 3, if synchronous, responds to none of these requests."""
    return all(answer_to(bits) == "silence" for bits in requests)


def answer_to(*telegrams: str) -> str:
    """Return the response of slave 3, which is synchronous, to the last of these telegrams.

    An empty telegram is a pause.
    """
    slave, answer = RunningSlave(Slave("3")), None
    for telegram in ("", *telegrams):
        if telegram:
            answer = slave.hear(telegram)
        else:
            slave.pause()
    return str(answer or "silence")


@check("icn2007-034", counter={"lost": 0})
def repeats_what_was_done(*, lost: int = 1) -> bool:
    """Whether the master repeats a request that was executed but whose response was lost."""
    faults = [LostReply("3", start=0.02, count=lost)] if lost else []
    run = simulate(five_slaves(), cycles=20, faults=faults)
    rows = run.events()
    done = rows.index[rows["executed_but_lost"]]
    return bool(len(done)) and bool((rows["attempt"][done + 1] == 1).all())


@check("icn2007-039", counter={"standby": False})
def standby_takes_over(*, standby: bool = True) -> float:
    """Margin of the time until a standby master takes over, within a slave's watchdog time.

    It is -1 if some slave exchanges no data afterwards.
    """
    master = Master({str(address): "S-0.F.F" for address in ADDRESSES})
    second = Standby(master) if standby else None
    run = simulate(
        five_slaves(), master, until=0.2, faults=MasterFailure(start=0.1), standby=second
    )
    later = run.events().query("time_s > 0.15 and call == 'DATA_EXCHANGE' and outcome == 'ok'")
    if set(later["slave"]) != {str(address) for address in ADDRESSES}:
        return -1.0
    first = run.events().query("standby")["time_s"].min()
    return float(1 - (first - 0.1) / WATCHDOG)


# Rates under every assumption ------------------------------------------------------------------

#: Bits of a CAN data frame with an 11-bit identifier, including the intermission but not data and
#: stuff bits, ISO 11898-1: 1 + 11 + 3 + 4 + 15 + 1 + 2 + 7 + 3; and its maximum data length [byte].
CAN_FRAME, CAN_BYTES = 47, 8

#: Modbus function 23, which writes and reads registers at once: bytes of request and response
#: other than data, silences before both [character], bits per character, maximum data bytes per
#: direction. Modbus Application Protocol V1.1b3, section 6.17; Modbus over Serial Line V1.02.
MODBUS_BYTES, MODBUS_SILENCE, MODBUS_CHARACTER, MODBUS_MOST = 13 + 5, 2 * 3.5, 11, 242


def rate_table() -> pd.DataFrame:
    """Return net rate and efficiency for each assumed length of a transaction."""
    pauses = {
        "24.5 bit": (2.0, 1.5, "shortest pauses in the papers: 2 and 1.5 bit times"),
        "25 bit": (2.0, 2.0, "both pauses 2 bit times: 150 us (Siemens)"),
        "153 us": (2.5, 2.0, "25.5 bit times (Bihl+Wiedemann)"),
        "154 us": (3.0, 154 / 6 - 24, "25.7 bit times (OMRON, p. 21)"),
        "26 bit": (3.0, 2.0, "pauses of 3 and 2 bit times: 156 us (OMRON, p. 5; Schneider)"),
    }
    rows = {}
    for name, (*pair, says) in pauses.items():
        rows[name] = (*_rates(Transaction(*pair)), says)
    for name in ("25 bit", "26 bit"):
        one = Transaction(*pauses[name][:2])
        used = 31 * one.duration / float(cycle_time(31, transaction=one))
        says = "31 of 33 transactions carry user data"
        rows[f"{name}, whole cycle"] = (*_rates(one, used), says)
    columns = ["transaction_bit", "net_kbit_per_s", "efficiency_percent", "assumption"]
    return pd.DataFrame.from_dict(rows, orient="index", columns=columns)


def _rates(one: Transaction, used: float = 1.0) -> tuple[float, float, float]:
    """Return bits, net rate [kbit/s], efficiency [%] if this fraction of transactions has data."""
    return one.bits, 1e-3 * used * one.net_rate, 100 * used * float(one.efficiency())


def bus_efficiencies(user_bits: npt.ArrayLike) -> pd.DataFrame:
    r"""Return the efficiencies of three buses that exchange 1..1936 user bits each way.

    .. math:: \eta = \frac{2 n}{\text{bit times of all frames and silences}}

    The columns are ``as_i``, ``can`` and ``modbus_rtu``, with one row per number of bits.
    """
    n = np.atleast_1d(user_bits)
    if n.dtype.kind not in "iu" or not ((n >= 1) & (n <= 8 * MODBUS_MOST)).all():
        raise ArgumentError(
            f"user_bits is {user_bits!r}; it must contain whole numbers 1..{8 * MODBUS_MOST}"
        )
    octets = -(-n // 8)
    registers = -(-n // 16)
    can = 2 * (CAN_FRAME * -(-octets // CAN_BYTES) + 8 * octets)
    modbus = MODBUS_CHARACTER * (MODBUS_BYTES + MODBUS_SILENCE + 4 * registers)
    shares = {
        "as_i": Transaction(2, 2).efficiency(n),
        "can": 2 * n / can,
        "modbus_rtu": 2 * n / modbus,
    }
    return pd.DataFrame(shares, index=pd.Index(n, name="user_bits"))


#: Frequencies at which energies are summed [Hz].
FREQUENCIES = np.arange(0.5e3, 30e6, 1e3)


@check("icn2007-031", counter={"closed": False})
def ring_lowers_the_drop(*, closed: bool = True) -> bool:
    """Whether the voltage drop to a load is smaller if the cable returns to the supply."""
    return consumer_drop(closed=closed) < consumer_drop(closed=False)


def consumer_drop(*, closed: bool, place: float = 50.0, length: float = 100.0) -> float:
    """Return the voltage drop [V] from the supply to a load of 1 A on a line or a ring.

    If `closed`, the cable returns to the supply. It has two cores of 1.5 mm2; lengths are in m.
    """
    (segment,) = (ring if closed else line)(length, [place], current=1.0).segments
    voltage = segment.voltages
    return voltage[segment.supplies[0].node] - voltage[segment.slaves[0].node]


@check("icn2007-007", counter={"supply": {"r": 78.0}})
def no_direct_component(*, supply: dict[str, float] | None = None) -> float:
    """Margin within which the voltage of every response sums to 1 % of its absolute values.

    The sum is small because of the supply's inductor; the counter-example has a resistor instead.
    """
    plan = line(100, slaves=(5, 50, 100))
    network = plan.network
    if supply is not None:
        network = Network(plan.cables, {"0 m": Load(**supply)})
    nodes = [slave.node for slave in plan.slaves]
    (u,) = telegram_voltages(network, "0 m", nodes, RESPONSES, after=55e-6)
    return float(1 - (np.abs(u.sum(axis=-1)) / np.abs(u).sum(axis=-1)).max() / 1e-2)


@check("icn2007-032", counter={"length": 200.0})
def dense_pulses_change_more(*, length: float = 100.0) -> float:
    """Fraction by which an open end changes pulses 3 us apart more than pulses 6 us apart."""
    change = [
        abs(pulse_height(length, bits) / pulse_height(length, bits, terminator=100.0) - 1)
        for bits in ("0" * 16, "01" * 8)
    ]
    return float(change[0] / change[1] - 1)


def pulse_height(
    length: float, bits: str, *, place: float = 5.0, terminator: float | None = None
) -> float:
    """Return the height [V] of the highest pulse at the master, from 40 % to 80 % of a telegram.

    The pulses of equal bits are half a bit apart, those of alternating bits one bit. The sender is
    at `place` [m], master and supply at 0, and the `terminator` [ohm], if any, at the far end.
    """
    plan = line(length, slaves=(place,), terminator=terminator)
    dt, end = 50e-9, 2 * len(bits) * HALF_BIT
    node = plan.slaves[0].node
    (u,) = telegram_voltages(plan.network, "0 m", [node], bits, dt=dt, before=0, after=6.4e-6)
    t = dt * np.arange(u.shape[-1])
    return float(np.abs(u[..., (t > 0.4 * end) & (t < 0.8 * end)]).max())


def open_end_distortion(*, speed: float = 1.0, length: float = 100.0) -> tuple[float, float]:
    """Return how unevenly an open end changes the spectra of a request and of white noise.

    The request is sent at `speed` times the bit rate of AS-i; the noise goes up to 3 MHz. The
    measure is the standard deviation, divided by the mean, of the ratio of the amplitudes with open
    and with matched end at the master; both are weighted by the energy.
    """
    s = 2j * np.pi * FREQUENCIES[FREQUENCIES < 3e6]
    open_end, matched = (
        np.abs(line(length, slaves=(5.0,), terminator=ohm).network.transfer("0 m", s, to="5 m"))
        for ohm in (None, 100.0)
    )
    change = open_end / matched

    def unevenness(energy: Floats) -> float:
        mean = np.average(change, weights=energy)
        return float(np.sqrt(np.average((change / mean - 1) ** 2, weights=energy)))

    sent = Modulation(Request.data_exchange(21, 0xE).bits).transform(s / speed)
    return unevenness(np.abs(s * sent) ** 2), unevenness(np.ones(s.shape))


def arriving_share(length: float, *, cable: Cable = CABLES["as-i 1.5"]) -> float:
    """Return the fraction of the example request's energy that a matched cable transmits."""
    s = 2j * np.pi * FREQUENCIES
    energy = np.abs(s * Modulation(Request.data_exchange(21, 0xE).bits).transform(s)) ** 2
    passed = np.exp(-2 * cable.propagation(s).real * length)
    return float((passed * energy).sum() / energy.sum())


@check("icn2007-051", counter={"pulse": "rectangle"})
def pulse_is_narrow(*, pulse: str = "sin2") -> float:
    """Margin within which 0.1 % of a request's energy lies above two pulses per half bit."""
    return 1 - share_above(2 / HALF_BIT, pulse=pulse) / 1e-3


def share_above(frequency: float, *, pulse: str = "sin2") -> float:
    """Return the fraction of the example request's energy above a frequency [Hz].

    The `pulse` is ``"sin2"``, ``"half sine"`` or ``"rectangle"``, each half a bit long.
    """
    x = FREQUENCIES * HALF_BIT
    shape = {
        "sin2": np.abs(ramp_spectrum(2j * np.pi * FREQUENCIES)),
        "half sine": np.abs(np.cos(np.pi * x) / (1 - (2 * x) ** 2)),
        "rectangle": np.abs(np.sinc(x)),
    }[pulse]
    return _high_share(shape, Modulation(Request.data_exchange(21, 0xE).bits).steps, x, frequency)


def _high_share(shape: Floats, steps: Floats | Signs, x: Floats, frequency: float) -> float:
    """Return the fraction of energy above a frequency, for steps of the same shape.

    `x` is each frequency times the distance of the steps.
    """
    code = steps @ np.exp(-2j * np.pi * np.outer(np.arange(steps.size), x))
    energy = np.abs(shape * code) ** 2
    return float(energy[FREQUENCIES > frequency].sum() / energy.sum())


# Structures and buses --------------------------------------------------------------------------

SLAVES = 62


def allowed_plans() -> dict[str, Plan]:
    """Return the structures of section 4; all but the first have 62 slaves."""
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


def trunk_and_star(leg: float = 10 / SLAVES, supply: float = 90.0) -> Plan:
    """Return a plan of 90 m of cable, fed at `supply` [m], with 62 legs of `leg` [m] at its end."""
    return star(90, [leg] * SLAVES, supply=supply)


@check("icn2007-003", counter={"leg": 2.0})
@check("icn2007-056", counter={"supply": 0.0})
def star_behind_trunk(*, supply: float = 90.0, leg: float = 10 / SLAVES) -> float:
    """Smallest margin of 90 m of cable, fed at `supply` [m], and a star of legs of this length."""
    return margin_of(trunk_and_star(leg, supply))


@check("icn2007-004", counter={"length": 101.0})
def line_is_allowed(*, length: float = 100.0) -> float:
    """Smallest margin of a line of this length [m] with a slave at its end."""
    return margin_of(line(length, [length]))


@check("icn2007-002", counter={"tap": 5.0})
def taps_count_too(*, tap: float = 4.0) -> bool:
    """Whether the rule for the length counts 60 m of trunk and ten taps, and is met."""
    rule = star(60, legs=[tap] * 10).check().table().set_index("rule").loc["cable_length"]
    return bool(np.isclose(rule["value"], 60 + 10 * tap) and rule["verdict"] == "met")


@check("icn2007-048", counter={"supply": 0.0})
def structures_are_allowed(*, supply: float = 50.0) -> float:
    """Smallest margin of all structures; the evenly spaced line is fed at `supply` [m]."""
    plans = {**allowed_plans(), "evenly": line(100, SLAVES, supply=supply)}
    return min(margin_of(plan) for plan in plans.values())


@check("icn2007-027", counter={"user_bits": 64})
def as_i_is_the_most_efficient(*, user_bits: int = 4) -> float:
    """Fraction by which AS-i is more efficient than the next best bus for this many user bits."""
    efficiency = bus_efficiencies(user_bits).iloc[0]
    return float(efficiency["as_i"] / efficiency.drop("as_i").max() - 1)


# Further statements of sections 4 and 5 and of the data link layer ------------------------------


@check("icn2007-055", counter={"quantity": "characteristic impedance"})
def impedance_rises(*, quantity: str = "series impedance") -> float:
    """Margin by which this quantity of nominal cable is ten times larger at 667 kHz than at 1."""
    s = 2j * np.pi * np.array([1e3, 667e3])
    cable = CABLES["as-i 1.5"]
    series = cable.series_impedance(s)
    wave = np.sqrt(series / cable.shunt_admittance(s))
    low, high = np.abs(series if quantity == "series impedance" else wave)
    return float(high / low / 10 - 1)


@check("icn2007-057", counter={"longest": 200.0})
def robust_on_any_topology(*, longest: float = 100.0) -> bool:
    """Whether all responses are read on the structures of section 4 and on a line this long [m]."""
    plans = [*allowed_plans().values(), line(longest, [0.05 * longest, longest])]
    waves = [plan.waveform() for plan in plans]
    return all(bool((wave.receive().bits == wave.bits).all()) for wave in waves)


@check("icn2007-058", counter={"power": 1})
def current_is_the_integral(*, power: int = 2) -> float:
    """Margin of the send current's slope from pulses of sin**`power` within 0.1 % of the peak."""
    bits = Request.data_exchange(21, 0xE).bits
    t = np.arange(0.0, 2 * HALF_BIT * len(bits) + 2e-6, 20e-9)
    slope = np.gradient(Modulation(bits).current(t), t)
    x = np.clip(t / HALF_BIT - np.arange(2 * len(bits))[:, np.newaxis], 0, 1)
    pulses = Modulation(bits).steps @ np.sin(np.pi * x) ** power
    return float(1 - np.abs(slope / np.abs(slope).max() - pulses).max() / 1e-3)


@check("icn2007-059", counter={"lost": 0})
def only_one_telegram_is_repeated(*, lost: int = 1) -> bool:
    """Whether a cycle with this many lost responses has one request more than the others."""
    faults = [LostReply("3", start=0.02, count=lost)] if lost else []
    run = simulate(five_slaves(), cycles=30, faults=faults).events().query("time_s > 0.015")
    requests = run.groupby("cycle").size()
    return bool(requests.max() == requests.median() + 1)


@check("icn2007-060", counter={"dead": True})
def response_time_is_guaranteed(*, dead: bool = False) -> float:
    """Margin of every slave's interval within the cycle time; if `dead`, slave 3 fails."""
    faults = [DeadSlave("3", start=0.25, stop=0.3)] if dead else []
    run = simulate([Slave(f"{address}") for address in range(1, 32)], until=0.4, faults=faults)
    done = run.events().query("call == 'DATA_EXCHANGE' and outcome == 'ok' and time_s > 0.2")
    longest = done.groupby("slave")["time_s"].apply(lambda times: times.diff().max())
    return float(cycle_time(31)) / float(longest.max()) - 1


@check("icn2007-067", counter={"lengths": (100, 90, 80)})
def longer_needs_more_repeaters(*, lengths: tuple[int, ...] = (100, 200, 300)) -> bool:
    """Whether each of these networks [m] needs more repeaters than the one before."""
    needed = [next(k for k in range(3) if reach(repeaters=k) >= length) for length in lengths]
    return all(more > fewer for fewer, more in pairwise(needed))


#: Modulations that were in use before AS-i.
MODULATIONS = ("NRZ", "Manchester", "AMI", "FSK")


def levels_of(bits: str, modulation: str) -> Floats:
    """Return four levels per bit: NRZ, Manchester, AMI, or FSK with one or two periods per bit."""
    values = np.array([int(bit) for bit in bits])
    marks = values * (1 - 2 * (np.cumsum(values) % 2))  # a mark has the opposite sign of the last
    steady = np.ones((len(bits), 4))
    levels = {
        "NRZ": (2 * values - 1)[:, np.newaxis] * steady,
        "Manchester": (2 * values - 1)[:, np.newaxis] * [-1, -1, 1, 1],
        "AMI": marks[:, np.newaxis] * steady,
        "FSK": np.where(values[:, np.newaxis] == 1, [1, -1, 1, -1], [1, 1, -1, -1]),
    }
    return np.asarray(levels[modulation], dtype=float).ravel()


def modulation_table() -> pd.DataFrame:
    """Return the DC component of responses, and the energy of a request above 667 kHz.

    The DC component is the largest mean of a response's levels, relative to its amplitude.
    """
    bits, x, limit = Request.data_exchange(21, 0xE).bits, FREQUENCIES * HALF_BIT / 2, 2 / HALF_BIT
    rows = {"APM": (0.0, share_above(limit))}
    for name in MODULATIONS:
        high = _high_share(np.sinc(x), levels_of(bits, name), x, limit)
        means = [abs(levels_of(Response(data).bits, name).mean()) for data in range(16)]
        rows[name] = (float(max(means)), high)
    columns = ["dc_share", "energy_above_667_khz"]
    return pd.DataFrame.from_dict(rows, orient="index", columns=columns)


@check("icn2007-068", counter={"names": ("APM",)})
def none_meets_both(*, names: tuple[str, ...] = MODULATIONS) -> bool:
    """Whether none of these is free of DC and has under 0.1 % of its energy above 667 kHz."""
    table = modulation_table().loc[list(names)]
    return not ((table["dc_share"] < 1e-3) & (table["energy_above_667_khz"] < 1e-3)).any()


@check("icn2007-069", counter={"pause": False})
def reads_the_next_request(*, pause: bool = True) -> bool:
    """Whether a slave that heard a damaged request answers its own next one."""
    telegrams = [DAMAGED, "", OWN] if pause else [DAMAGED, OWN]
    return answer_to(*telegrams) != "silence"
