"""Find the causes of a line's faults from its impedance and its slaves' responses.

The spectrum of the voltage, divided by that of an undistorted telegram, is the magnitude of the
line's impedance relative to an inductance. A passive impedance has minimum phase, so this magnitude
determines a filter that restores the pulses. The restored requests and the recorded voltage give
the impedance at the master, modelled as one resistance, inductance and capacitance in parallel.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cache
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from shipnet.arrays import Floats, Integers
from shipnet.asi.bursts import Sampling, find_telegrams, resample
from shipnet.asi.modulation import Modulation
from shipnet.asi.receiver import receive
from shipnet.asi.segment import POWER_SUPPLY
from shipnet.asi.slave import DEVICE
from shipnet.asi.telegram import REQUEST_BITS, RESPONSE_BITS, RESPONSES, frame
from shipnet.lazy import pd

if TYPE_CHECKING:
    from shipnet.asi.plan import Plan

#: Longest part of a record that is analysed, and shortest record that can be analysed [s].
_LONGEST, _SHORTEST = 40e-3, 0.5e-3

#: Length of the intervals for spectra, and longest delay of an echo that is removed [s].
_STRETCH, _MEMORY = 128e-6, 40e-6

#: Frequency band of telegrams [Hz].
_BAND = 25e3, 550e3

#: Time from the start of a window to its request [s], window length [s], and damping [nepers].
_BEFORE, _WINDOW, _DAMPING = 5e-6, 100e-6, 3.0

#: Minimum and maximum number of requests from which the impedance is measured.
_FEWEST, _MOST = 3, 64

#: Trial delays [s] of the restored telegrams, for fitting the impedance.
_LATE = np.arange(0.5e-6, 1.5e-6, 50e-9)


class Impedance(NamedTuple):
    """Impedance at the master: resistance [ohm], inductance [H] and capacitance [F] in parallel.

    `misfit` is the fraction of the voltage that this model does not explain, such as echoes.
    `stray` is the fraction of the power during requests that is noise or interference.
    """

    resistance: float
    inductance: float
    capacitance: float
    misfit: float
    stray: float


@cache
def _requests() -> Modulation:
    """Return the signals of every seventh possible request, as a sample of all requests."""
    return Modulation([frame(f"{k:011b}") for k in range(0, 2**11, 7)])


def without_cable(x: Floats, step: float, requests: Floats) -> Floats:
    """Restore the pulses of a record from the spectrum of its requests.

    `requests` has the times at which they begin [s]; if it is empty, the spectrum of the whole
    record is used.
    """
    n = 2 * round(_STRETCH / step / 2)
    if len(requests):
        begin = np.clip((requests - _BEFORE) / step, 0, len(x) - n).astype(int)
        taper = (np.arange(n) * step < _WINDOW).astype(float)
    else:
        begin, taper = np.arange(0, len(x) - n, n // 2), np.hanning(n)
    stretches = np.lib.stride_tricks.sliding_window_view(x, n)[begin] * taper
    f, power = np.fft.rfftfreq(n, step), (np.abs(np.fft.rfft(stretches)) ** 2).mean(axis=0)
    inside = (f > _BAND[0]) & (f < _BAND[1])
    s = 2j * np.pi * f[inside]
    meant = (np.abs(s * _requests().transform(s)) ** 2).mean(axis=0)
    received = np.maximum(power[inside], 1e-6 * power[inside].max() + 1e-30)
    gain = np.empty(f.size)
    gain[inside] = np.log(meant / received) / 2
    low, high = np.flatnonzero(inside)[[0, -1]]
    gain[:low], gain[high + 1 :] = gain[low], gain[high] - 2.5
    # Minimum-phase filter: fold the cepstrum, with a weight that falls to 0 at `_MEMORY`.
    lag = np.arange(n)
    fold = np.where(lag == 0, 1.0, np.where(lag < n // 2, 2.0, 0.0))
    fold *= 0.5 + 0.5 * np.cos(np.pi * np.minimum(lag * step / _MEMORY, 1))
    taps = np.fft.irfft(np.exp(np.fft.rfft(np.fft.irfft(gain, n) * fold)), n)
    whole = len(x) + n
    return np.fft.irfft(np.fft.rfft(x, whole) * np.fft.rfft(taps, whole), whole)[: len(x)]


class Restored(NamedTuple):
    """The first part of a record, and the requests that can be read after restoring its pulses."""

    #: Resampled voltage minus its median [V], its start time [s] and its sampling interval [s].
    x: Floats
    since: float
    step: float
    #: Start time [s] and word of each request.
    start: Floats
    words: Integers
    inverted: bool
    #: Restored pulses, as high as the voltage; empty if nothing was gained.
    pulses: Floats
    #: Number of bad requests and other bursts among the restored pulses.
    unread: int = 0

    @property
    def short(self) -> bool:
        """True if the record is too short to measure the line's impedance."""
        return len(self.x) * self.step < _SHORTEST


def restored(
    u: Floats, dt: float, requests: Floats, start: Floats, words: Integers, inverted: bool
) -> Restored:
    """Restore up to 40 ms of a record, from 1 ms before its first request (at `requests[0]` [s]).

    If fewer requests can be read afterwards than before, keep the earlier `start` [s] and `words`.
    """
    low = max(0, int((requests[0] - 1e-3) / dt)) if len(requests) else 0
    sampling = Sampling.of(dt)
    x = resample(u[low : low + round(_LONGEST / dt)], sampling).astype(float)
    # Each resampled value is the mean of several samples, so its time is the mean of theirs.
    since, step = (low + (sampling.mean - 1) / 2) * dt, sampling.step
    middle = np.median(x) if len(x) else 0.0
    best = Restored(x - middle, since, step, start, words, inverted, x[:0])
    requests = requests - since
    requests = requests[(requests > _BEFORE) & (requests < len(x) * step - _STRETCH)]
    # Fall back on the whole record, although responses of distant slaves have a different spectrum.
    for times in (requests, requests[:0]):
        if best.short:
            break
        pulses = without_cable(best.x, step, times)
        decoded = find_telegrams(pulses, step, 0.5)
        every = decoded.telegrams
        good = every[(every.error == 0) & (every.length == REQUEST_BITS)]
        if len(good) >= len(best.start):
            begin = since + good.start
            best = best._replace(start=begin, words=good.word, inverted=decoded.inverted)
            if len(good):
                scale = np.quantile(np.abs(best.x), 0.99) / np.quantile(np.abs(pulses), 0.99)
                bad = int(((every.error > 0) & (every.length == REQUEST_BITS)).sum())
                best = best._replace(pulses=scale * pulses, unread=bad + decoded.disturbances)
        if len(good) > 0.8 * len(times) > 0:
            break
    return best


def measured(part: Restored) -> Impedance | None:
    r"""Fit :math:`1/Z = 1/R + 1/sL + sC` to three or more requests; None if fewer are read."""
    from scipy.optimize import nnls

    begin = part.start - part.since - _BEFORE
    inside = np.flatnonzero((begin > 0) & (begin < len(part.x) * part.step - _WINDOW))
    if len(inside) < _FEWEST:
        return None
    some = inside[np.unique(np.linspace(0, len(inside) - 1, _MOST).astype(int))]
    s = (_DAMPING + 2j * np.pi * np.arange(3, 61)) / _WINDOW
    t = np.arange(0, _WINDOW, part.step)
    rows = np.interp(begin[some, np.newaxis] + t, part.step * np.arange(len(part.x)), part.x)
    rows -= np.median(rows[:, t < 0.6 * _BEFORE], axis=1, keepdims=True)
    spectra = rows @ np.exp(-np.outer(t, s)) * part.step
    bits = np.array([[int(bit) for bit in f"{part.words[k]:0{REQUEST_BITS}b}"] for k in some])
    sent = (s if part.inverted else -s) * Modulation(bits).transform(s, start=_BEFORE)
    power = (np.abs(sent) ** 2).sum(0)
    cross = (spectra * sent.conj()).sum(0)
    z = cross / power
    explained, energy = np.abs(cross) ** 2 / power, (np.abs(spectra) ** 2).sum(0)
    stray = 1 - explained.sum() / energy.sum()
    # Frequencies at which interference prevails hardly count.
    weight = np.sqrt(power) * np.abs(z) * (explained / energy) ** 2
    unit = np.array([1 / 78.0, 1 / 100e-6, 5e-9])
    terms = weight[:, np.newaxis] * np.stack([s, s**0, s**2], axis=1) * unit
    target = np.concatenate([weight, 0 * weight])
    fits = []
    for late in _LATE:
        columns = (z * np.exp(-s * late))[:, np.newaxis] * terms
        fits.append(nnls(np.concatenate([columns.real, columns.imag]), target))
    values, residual = min(fits, key=lambda fit: fit[1])
    conductance, inverse, capacitance = np.maximum(values, 1e-6) * unit
    misfit = residual / np.linalg.norm(weight)
    return Impedance(*map(float, (1 / conductance, 1 / inverse, capacitance, misfit, stray)))


CABLE = "cable too long or a stub"
SECOND = "second supply"
INDUCTANCE = "supply inductance missing or wrong"
INTERFERENCE = "interference"
DUPLICATE = "duplicate address"
WEAK = "weak slave"
SILENT = "silent slave"
REVERSED = "reversed probe"
POWER = "power fail"
MISSING = "missing slave"
UNEXPECTED = "unexpected slave"

#: Largest legal capacitance [F]: 100 m at 80 nF/km (Lapp), 62 slaves and a master at 50 pF each.
_MOST_CAPACITANCE = 100 * 80e-12 + 63 * 50e-12

#: Largest `misfit` (echoes) and `stray` (interference) of a healthy line; see `Impedance`.
_ECHOES, _STRAY = 0.12, 0.1

#: Lowest and highest level of a healthy slave, relative to its usual level; see `usual_levels`.
WEAKER, _LOUDER = 0.65, 1.5

#: Smallest legal height of a telegram's first pulse [V].
_LEAST = 1.5

#: Largest voltage of a silent line [V]: 40 % of the smallest legal pulse. Noise with a standard
#: deviation of 0.2 V exceeds it for less than 1 % of the time.
_NOTHING = 0.6


class Found(NamedTuple):
    """A cause, its evidence, and the label of the slave concerned, or "" for the whole line."""

    cause: str
    evidence: str
    slave: str = ""


def ranked(causes: list[Found], broken: pd.DataFrame, inverted: bool) -> pd.DataFrame:
    """Return the causes as a table, sorted by the fraction of violated findings they explain."""
    rows = []
    for one in causes:
        explained = broken["object"] == f"slave {one.slave}"
        if one.cause == INTERFERENCE:
            explained = ~broken["rule"].str.contains("level|voltage")
        elif not one.slave:
            explained = (broken["rule"] != "supply voltage") | (one.cause == POWER)
        rows.append(
            (one.cause, one.slave, float(explained.mean()) if len(explained) else 0.0, one.evidence)
        )
    rows.sort(key=lambda row: -row[2])
    if inverted:  # it explains no other finding, but is certain
        rows.insert(1, (REVERSED, "", 0.0, "the first pulse of most telegrams is positive"))
    table = pd.DataFrame(rows, columns=["cause", "slave", "share", "evidence"])
    return table.drop_duplicates(["cause", "slave"]).set_index("cause")


def line_causes(
    part: Restored, rows: pd.DataFrame, answering: int, bursts: int, supply: float
) -> list[Found]:
    """Return causes that affect every sender: the cable or the supply, and interference.

    `rows` is the table of transactions, `answering` the number of slaves that respond, `bursts` the
    number of bursts that are not telegrams, and `supply` the supply voltage [V], NaN if unknown.
    """
    impedance = measured(part)
    unread = bursts + int((~rows["request_error"].isin(["ok", "", "cut off"])).sum())
    if impedance is None:
        level = np.quantile(np.abs(part.x), 0.99) if len(part.x) else 0.0
        if level > _NOTHING and unread >= 2 * _FEWEST:
            evidence = f"{unread} telegrams cannot be read, even with the cable's echoes removed"
            return [Found(CABLE, f"{evidence}; strong interference looks the same")]
        silent = level < _NOTHING and not (rows["response_error"] == "ok").any()
        if silent and not np.isnan(supply) and not part.short:
            evidence = (
                f"{supply:.0f} V, but no pulse exceeds {_NOTHING} V: an ordinary supply without "
                "decoupling short-circuits all signals (a silent master looks the same)"
            )
            return [Found(INDUCTANCE, evidence)]
        return []
    r, inductance, c, misfit, stray = impedance
    nominal = [float(part) for part in POWER_SUPPLY.shunt[:2]]
    devices = [(answering + 1) * float(part) for part in DEVICE.shunt[:2]]
    # Number of parallel supplies, estimated from the resistance and from the inductance.
    damped, fed = (1 / r - devices[0]) / nominal[0], (1 / inductance - devices[1]) / nominal[1]
    seen = f"the line has {r:.0f} ohm in parallel with {inductance * 1e6:.0f} uH"
    usual = f"one supply has {1 / nominal[0]:.0f} ohm and {1e6 / nominal[1]:.0f} uH"
    # A distant second supply changes the impedance less, but it lowers the signal levels.
    low = rows["response_amplitude_V"].median() < _LEAST
    alike = 0.6 < damped / fed < 1.6
    cause, evidence = "", f"{seen}; {usual}"
    if fed > 2.5:
        cause = INDUCTANCE
    elif alike and fed > (1.15 if low else 1.4):
        cause, evidence = SECOND, f"{evidence}; a supply with half these values looks the same"
    elif fed > 1.4:
        cause = INDUCTANCE
    elif misfit > _ECHOES + 2 * stray or c > _MOST_CAPACITANCE:
        cause, evidence = (
            CABLE,
            f"the line has {c * 1e9:.0f} nF; a legal line of 100 m has at most ",
        )
        evidence += f"{_MOST_CAPACITANCE * 1e9:.0f} nF; echoes are {misfit:.0%} of the requests"
        unread = part.unread if len(part.pulses) else unread
        if unread > len(part.start) / 4:
            evidence += f"; {unread} telegrams stay unreadable without them: echoes are too strong "
            evidence += "to remove, or there is interference, too"
    elif damped < 0.3:
        rings = 1 / (2 * np.pi * np.sqrt(inductance * c)) / 1e3
        cause, evidence = INDUCTANCE, f"{seen} and rings at {rings:.0f} kHz; {usual}"
    elif max(damped, fed) < 0.65:
        cause, evidence = CABLE, f"{evidence}, so the supply is at the end of a long cable"
    elif fed < 0.65:
        tail = inductance / r * 1e6
        cause, evidence = INDUCTANCE, f"{seen}, so pulses decay in {tail:.1f} us; {usual}"
    causes = [Found(cause, evidence)] if cause else []
    if stray > _STRAY:
        noise = f"{stray:.0%} of the power during requests is noise or interference"
        causes.insert(int(fed > 2.5), Found(INTERFERENCE, noise))
    return causes


def usual_levels(slaves: pd.DataFrame, plan: Plan | None) -> pd.Series:
    """Return the level at which each slave is expected [V]: the median of all slaves' levels.

    With a plan, the levels are proportional to those that the plan gives at the master. Slaves
    behind a repeater count as average.
    """
    level = slaves["amplitude_V"]
    planned = pd.Series(1.0, level.index)
    for segment in plan.only_line("a capture") if plan is not None else ():
        if segment.masters and segment.slaves:
            names = [slave.label for slave in segment.slaves]
            nodes = [slave.node for slave in segment.slaves]
            (wave,) = segment.waveforms(nodes, RESPONSES, dt=250e-9, before=5e-6, after=20e-6)
            heights = receive(wave.u, wave.dt, RESPONSE_BITS).amplitude
            at_master = pd.Series(np.median(heights, axis=1), names).groupby(level=0).max()
            planned = at_master.reindex(level.index).fillna(at_master.median())
    return planned * (level / planned).median()


def plan_causes(broken: pd.DataFrame, named: Sequence[str]) -> list[Found]:
    """Return slaves that are in the plan but do not respond, and the other way round."""
    causes = []
    for name, count in broken.loc[broken["rule"] == "answers", ["object", "value"]].to_numpy():
        cause, evidence = MISSING, "it is in the plan, but the record contains no response"
        if count:
            cause, evidence = UNEXPECTED, f"it responds {count:.0f} times, but is not in the plan"
        causes.append(Found(cause, evidence, name.removeprefix("slave ")))
    return [one for one in causes if one.cause == UNEXPECTED or one.slave not in named]


def sender_causes(
    slaves: pd.DataFrame, usual: pd.Series, bursts: int, silences: Mapping[str, Sequence[int]]
) -> list[Found]:
    """Return causes that affect individual slaves, and intermittent interference.

    `usual` are the levels at which the slaves are expected. `silences` are the numbers of data
    exchanges that each slave leaves without a response before its first response, between two
    responses, and after its last one.
    """
    level = slaves["amplitude_V"]
    causes = []
    observed = slaves[(slaves["errors"] + slaves["answers"] > 1) & (slaves.index != "unknown")]
    for label, slave in observed.iterrows():
        height, normal = slave["amplitude_V"], usual[str(label)]
        evidence = f"its level is {height:.2f} V; {normal:.2f} V would be usual"
        others = level.drop([label]).max()
        if height > max(_LOUDER * normal, 1.35 * others):
            evidence += (
                f"; {int(slave['errors'])} of its responses are bad, as if two slaves responded"
            )
            causes.append(Found(DUPLICATE, evidence, str(label)))
        elif height < WEAKER * normal:
            causes.append(Found(WEAK, evidence, str(label)))
    bad = slaves["errors"] + slaves["bad_requests"]
    named = [one.slave for one in causes]
    bad = bad[(bad > 0) & ~bad.index.isin(named)]
    silent = slaves.index[(slaves["answers"] == 0) & (slaves["requests"] > 2)]
    # Each response that is too weak to be read leaves a burst.
    too_weak = len(silent) == 1 and 2 * bursts >= sum(silences.get(silent[0], ()))
    if bursts and not len(bad) and not causes and too_weak:
        evidence = f"none of its responses can be read; {bursts} bursts are not telegrams"
        return [Found(WEAK, evidence, str(silent[0]))]
    silent_causes = []
    for label, series in silences.items():
        if max(series) < 2 or label in named:
            continue
        if len(series) == 1:
            evidence = (
                f"none of its {series[0]} data exchanges has a response: dead or not connected"
            )
        elif series[-1] > 1:
            answered = len(series) - 1
            evidence = f"it responds to {answered} data exchanges, but not to the last {series[-1]}"
        elif len(bad) or bursts:  # interference explains it better
            continue
        else:
            evidence = f"{max(series)} data exchanges in a row have no response, but later ones do"
        silent_causes.append(Found(SILENT, evidence, label))
    one = bad.index[0] if len(bad) == 1 and bad.index[0] != "unknown" else ""
    if one and slaves["errors"][one] == bad[one] >= 3:
        evidence = (
            f"all {int(bad[one])} bad telegrams are its responses, as if two slaves responded"
        )
        causes.append(Found(DUPLICATE, evidence, str(one)))
    elif len(bad) or (bursts and not named):
        where = f"{int(bad.sum())} intermittent bad telegrams at {len(bad)} slaves"
        causes.append(Found(INTERFERENCE, f"{where}; {bursts} bursts that are not telegrams"))
    return silent_causes + causes
