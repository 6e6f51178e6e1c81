"""Rates of telegrams lost to white noise, down to 1e-9, by importance sampling.

The noise of nearly every lost telegram satisfies a set of linear inequalities: a pulse is below the
level, or a gap is above it. Noise is drawn around the weakest noise that satisfies each set, its
*design point*. The weight of a loss is the probability density with which its telegram and noise
occur, divided by that with which they are drawn.
"""

from __future__ import annotations

import itertools
from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from functools import cached_property, lru_cache
from hashlib import sha256
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
from scipy import special
from scipy.optimize import nnls

from shipnet.arrays import Floats
from shipnet.asi.emc.error_rates import checked_densities, decided_on
from shipnet.asi.modulation import HALF_BIT
from shipnet.asi.receiver import Receiver, Reception, Waveform, receive
from shipnet.errors import ArgumentError
from shipnet.fields import check_kind, check_whole
from shipnet.lazy import pd
from shipnet.parallel import Workers, spread

#: Fraction of the noise that is drawn without a shift; it limits the weight of a loss.
_PLAIN = 0.1

#: Telegrams per task, per pilot run, and per batch that fits into a core's own cache.
_PART, _PILOT, _BATCH = 5000, 4000, 1000

#: Maximum number of different telegrams in a wave: each has about 100 design points.
_WORDS = 64

#: Spacing of the samples that the inequalities use [s].
_GRID = 250e-9

#: Largest shift of the peak of a weakened first pulse, and largest distance from the undisturbed
#: peak at which the voltage is required to be lower than at the shifted peak [steps of `_GRID`].
_SLIPS, _AROUND = 3, 7

#: Spacing of the points before a telegram at which noise may pass for its first pulse [s].
_AHEAD = 0.5e-6

#: Fraction of the shifted draws spread evenly over the design points, regardless of pilot runs.
_SPREAD = 0.1

#: Limits for a sound rate: effective losses, fraction due to one loss, fraction due to noise drawn
#: too rarely, and distance of the mean weight from 1 in standard errors.
_EFFECTIVE, _LARGEST, _FAR, _LEAN = 1000, 0.02, 0.05, 4


@dataclass(frozen=True, eq=False)
class _Case:
    """Telegrams without noise, a receiver, and the standard deviation of the noise samples."""

    bits: npt.NDArray[np.integer]
    u: Floats
    dt: float
    receiver: Receiver
    sigma: float

    def __hash__(self) -> int:
        return hash(self._key)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _Case) and self._key == other._key

    @cached_property
    def _key(self) -> bytes:
        """Key by which a worker recognises a case from an earlier task."""
        arrays = self.bits.astype(np.int8).tobytes() + self.u.tobytes()
        parameters = f"{self.dt!r} {self.sigma!r} {asdict(self.receiver)}"
        return sha256(arrays + parameters.encode()).digest()

    def received(self, u: Floats, **changes: Any) -> Reception:
        """Return what the receiver reads from filtered voltages."""
        settings = {**asdict(self.receiver), "matched": False, **changes}
        return receive(u, self.dt, self.bits.shape[1], **settings)

    def filtered(self, u: Floats) -> Floats:
        """Return the voltages that the receiver uses."""
        return decided_on(u, self.dt, self.receiver.matched)


class _Proposal(NamedTuple):
    """The points around which noise is drawn, and the fraction of the draws for each."""

    shift: Floats  # shape (n_words, n_points, n_t) [V]
    square: Floats  # squared length of each shift
    share: Floats  # fraction of draws for each point; the rest is drawn unshifted
    words: Floats  # fraction of draws for each telegram


class _Sets:
    """Sets of inequalities a n >= b on the noise n of one telegram, and their design points."""

    def __init__(self, gain: Floats, y: Floats, receiver: Receiver) -> None:
        self._gain, self._y, self._receiver = gain, y, receiver
        self.points: list[Floats] = []

    def above(self, i: int, sign: float) -> tuple[Floats, float]:
        """Return the condition that `sign` times sample i exceeds the minimum."""
        return sign * self._gain[i], self._receiver.minimum - sign * self._y[i]

    def over(self, i: int, sign: float, p: int, first: float) -> tuple[Floats, float]:
        """Return the condition that `sign` times sample i exceeds the threshold set by sample p."""
        part = self._receiver.threshold * first
        gain = sign * self._gain[i] - part * self._gain[p]
        return gain, part * self._y[p] - sign * self._y[i]

    def higher(self, p: int, i: int, first: float) -> tuple[Floats, float]:
        """Return the condition that `first` times sample p exceeds `first` times sample i."""
        return first * (self._gain[p] - self._gain[i]), first * (self._y[i] - self._y[p])

    def add(self, *ways: list[tuple[Floats, float]]) -> None:
        """Add the weakest of the design points of several sets, if any set can be satisfied."""
        points = [point for sides in ways if (point := _design_point(sides)) is not None]
        if points:
            self.points.append(min(points, key=lambda point: float(point @ point)))


def _below(side: tuple[Floats, float]) -> tuple[Floats, float]:
    return -side[0], -side[1]


def _design_point(sides: list[tuple[Floats, float]]) -> Floats | None:
    """Return the shortest n with a n >= b for all `sides`, or None if there is none.

    Least distance programming by non-negative least squares: C. L. Lawson and R. J. Hanson,
    "Solving Least Squares Problems", 1974, chapter 23.
    """
    system = np.vstack([np.transpose([a for a, _ in sides]), [b for _, b in sides]])
    target = np.zeros(len(system))
    target[-1] = 1
    residual = system @ nnls(system, target, maxiter=1000)[0] - target
    return None if residual[-1] > -1e-12 else np.asarray(-residual[:-1] / residual[-1])


@lru_cache(8)
def _points_of(case: _Case) -> Floats:
    """Return the design points of each telegram, shape (n_words, n_points, n_t) [V]."""
    dt, receiver = case.dt, case.receiver
    n_t, n_bits = case.u.shape[1], case.bits.shape[1]
    columns = case.filtered(np.eye(n_t))
    gain = (columns - columns.mean(axis=1, keepdims=True)).T
    # The last bits of a matrix product depend on its number of threads, those of `einsum` do not.
    y = np.einsum("ij,kj->ik", case.u, gain)
    got = case.received(y, window=0.0)
    if got.error.any() or (got.bits != case.bits).any():
        raise ArgumentError("telegrams must be received without an error when there is no noise")
    half, stride = HALF_BIT / dt, max(1, round(_GRID / dt))
    reach = int(receiver.window * half + 1e-9)
    slips, around = ([stride * d for d in range(-n, n + 1)] for n in (_SLIPS, _AROUND))
    words = []
    for row, start, signs in zip(y, got.start, got.slots, strict=True):
        at = np.rint((start + 1.5 * HALF_BIT) / dt + half * np.arange(2 * n_bits + 1)).astype(int)
        at = at[at < len(gain)]
        first, s = int(at[0]), float(np.sign(row[at[0]]))
        sets = _Sets(gain, row, receiver)
        sets.add([_below(sets.above(first, s))])
        # Noise before the telegram; noise of the other sign may be closer to the first pulse.
        ends = {s: first - round(1.25 * half), -s: first - round(half / 2)}
        for sign, end in ends.items():
            for i in range(0, end, max(1, round(_AHEAD / dt))):
                sets.add([sets.above(i, sign)])
        for slot, i in enumerate(map(int, at[1:]), 2):
            if sign := float(signs[slot]):
                sets.add([_below(sets.over(i, sign, first, s))])
                sets.add([_below(sets.above(i, sign))])
                continue
            for sign in (1.0, -1.0):
                sets.add([sets.over(i, sign, first, s), sets.above(i, sign)])
            for slip in slips:
                p = first + slip
                top = [sets.higher(p, first + d, s) for d in around if d != slip]
                near = range(i + slip - reach, min(i + slip + reach + 1, len(gain)), stride)
                ways = itertools.product(near, (1.0, -1.0))
                sets.add(*([*top, sets.over(k, x, p, s), sets.above(k, x)] for k, x in ways))
        words.append(sets.points)
    most = max(map(len, words))
    # The points that pad a shorter row are so far away that they are never drawn.
    return np.array([[*points, *[50 * points[0]] * (most - len(points))] for points in words])


@lru_cache(8)
def _proposal(case: _Case) -> _Proposal:
    """Return the proposal distribution for a case; pilot runs find where telegrams are lost."""
    shift = _points_of(replace(case, sigma=1.0))
    square = (shift**2).sum(axis=-1)
    likely = special.ndtr(-np.sqrt(square) / case.sigma) + 1e-300
    kept = likely.max(axis=0) > 1e-4 * likely.max()
    shift, square, likely = shift[:, kept], square[:, kept], likely[:, kept]
    share = (1 - _PLAIN) * likely / likely.sum(axis=1, keepdims=True)
    n_words, n_points = share.shape
    proposal = _Proposal(shift, square, share, np.full(n_words, 1 / n_words))
    for pilot in range(2):
        credit = np.zeros_like(share)
        _draw(case, proposal, _PILOT, np.random.default_rng(pilot), credit)
        if not credit.any():
            continue
        of_word = credit / np.maximum(credit.sum(axis=1, keepdims=True), 1e-300)
        both = of_word + credit.sum(axis=0) / credit.sum()
        both /= both.sum(axis=1, keepdims=True)
        share = (1 - _PLAIN) * ((1 - _SPREAD) * both + _SPREAD / n_points)
        words = 0.8 * credit.sum(axis=1) / credit.sum() + 0.2 / n_words
        proposal = _Proposal(shift, square, share, words)
    return proposal


def _sample(task: tuple[_Case, int, np.random.SeedSequence]) -> dict[str, float]:
    """Draw some telegrams of a case, and return the sums of their weights."""
    case, n, seed = task
    return _draw(case, _proposal(case), n, np.random.default_rng(seed))


def _draw(
    case: _Case, how: _Proposal, n: int, rng: np.random.Generator, credit: Floats | None = None
) -> dict[str, float]:
    """Draw telegrams; return sums of their weights, and add the losses of each point to `credit`.

    `w` sums the weights of all telegrams, `x` those of the lost ones.
    """
    totals = dict.fromkeys(("n", "w", "ww", "x", "xx", "lost", "far", "largest"), 0.0)
    n_words, n_points = how.share.shape
    batches: list[tuple[int, Floats, Floats]] = []
    disturbed: list[Floats] = []
    for word, count in enumerate(rng.multinomial(n, how.words)):
        shift, share = how.shift[word], how.share[word]
        for begin in range(0, int(count), _BATCH):
            size = min(_BATCH, int(count) - begin)
            noise = case.sigma * rng.standard_normal((size, case.u.shape[1]))
            point = rng.choice(n_points + 1, size, p=[*share, 1 - share.sum()])
            moved = point < n_points
            noise[moved] += shift[point[moved]]
            power = (np.einsum("ij,kj->ik", noise, shift) - how.square[word] / 2) / case.sigma**2
            each = share * np.exp(np.minimum(power, 600.0))
            # Probability density of this noise as drawn, divided by that of the noise as it occurs.
            ratio = 1 - share.sum() + each.sum(axis=1)
            batches.append((word, each, ratio))
            disturbed.append(case.u[word] + noise)
    sizes = [len(ratio) for *_, ratio in batches]
    bits = case.bits[np.repeat([word for word, *_ in batches], sizes)]
    got = case.received(case.filtered(np.concatenate(disturbed)))
    wrong = (got.error != 0) | (got.bits != bits).any(axis=1)
    losses = np.split(wrong, np.cumsum(sizes)[:-1])
    for (word, each, ratio), lost in zip(batches, losses, strict=True):
        weight = 1 / (ratio * n_words * how.words[word])
        x = np.where(lost, weight, 0.0)
        if credit is not None:
            credit[word] += (x / ratio) @ each
        new = {
            "n": len(lost),
            "w": weight.sum(),
            "ww": weight @ weight,
            "x": x.sum(),
            "xx": x @ x,
            "lost": lost.sum(),
            "far": x[ratio < 1].sum(),
        }
        for name, value in new.items():
            totals[name] += float(value)
        totals["largest"] = max(totals["largest"], float(x.max()))
    return totals


def _summary(parts: list[dict[str, float]]) -> dict[str, float | bool]:
    """Return the rate found by several tasks, its interval, and whether the rate is sound."""
    t = {name: sum(part[name] for part in parts) for name in parts[0]}
    n, rate = t["n"], t["x"] / t["n"]
    if not t["lost"]:
        # None of the telegrams drawn without a shift was lost either, which limits the rate.
        none = {"rate": 0.0, "rate_low": 0.0, "rate_high": min(1.0, -np.log(0.025) / (_PLAIN * n))}
        return {"telegrams": int(n), **none, "effective": 0.0, "sound": False}
    error = np.sqrt(max(t["xx"] / n - rate**2, 0.0) / n) / rate
    effective = t["x"] ** 2 / t["xx"]
    # The sum of the weights has a skewed distribution; that of its logarithm is less skewed.
    factor = float(np.exp(special.stdtrit(max(effective - 1, 1.0), 0.975) * error))
    mean = t["w"] / n
    lean = abs(mean - 1) / np.sqrt(max(t["ww"] / n - mean**2, 0.0) / n + 1e-30)
    largest = max(part["largest"] for part in parts) / t["x"]
    believed = largest <= _LARGEST and t["far"] / t["x"] <= _FAR and lean <= _LEAN
    return {
        "telegrams": int(n),
        "rate": rate,
        "rate_low": rate / factor,
        "rate_high": min(1.0, rate * factor),
        "effective": effective,
        "sound": bool(effective >= _EFFECTIVE and believed),
    }


def rare_error_rates(
    waves: Waveform | Mapping[str, Waveform],
    noise_density: npt.ArrayLike,
    n_telegrams: int = 100_000,
    *,
    receiver: Receiver | None = None,
    seed: int = 2024,
    workers: Workers = 1,
) -> pd.DataFrame:
    """Estimate the rate of telegrams lost to white noise, down to 1e-9, by importance sampling.

    Parameters
    ----------
    waves : Waveform or mapping of str to Waveform
        Noise-free voltages of at most 64 equally likely telegrams, or several such waves by
        name.
    noise_density : float or array_like of float, shape (n,)
        One-sided density at the receiver, above 0 and up to 1e6 [V per root hertz]; `Noise.density`
        computes it from a standard deviation.
    n_telegrams : int, default 100000
        Number of telegrams drawn for each rate, 1000 or more.
    receiver : Receiver, optional
        The receiver.
    seed : int, default 2024
        Seed of the random numbers, 0..2^63 - 1.
    workers
        As in `shipnet.ballast.write_fleet`; the rates do not depend on it.

    Returns
    -------
    pandas.DataFrame
        One row per wave and density: ``wave``, ``silence_s``, the silence before a telegram, in
        which noise may cause a false start, ``noise_density``, ``telegrams``; the ``rate`` with its
        95 % interval ``rate_low`` and ``rate_high``; ``effective``, the number of losses of
        equal weight that would be as precise; and ``sound``. If ``sound`` is False, do not trust
        the interval: draw more telegrams, or count with `count_errors`.

    Notes
    -----
    Noise can corrupt a telegram in about 100 ways: it hides or imitates the first pulse, lowers
    another pulse, or fills a gap; it may also move the peak of a weakened first pulse by up to 0.75
    us. For each way, noise is drawn around the weakest noise that has this effect; a tenth of all
    noise is drawn without a shift, which limits the weight of a loss. A rate is ``sound`` if it has
    at least 1000 effective losses, if at most 2 % of it comes from one loss and at most 5 % from
    noise that is drawn less often than it occurs, and if the mean weight is within four standard
    errors of 1. These checks may miss another way to lose a telegram: compare with `count_errors`
    at a higher density.

    Examples
    --------
    With noise of 0.3 V in 2 MHz, about six in 10^9 responses are lost:

    >>> from shipnet import asi
    >>> wave = asi.line(100, slaves=(5, 100)).waveform(node="5 m")
    >>> proof, density = asi.RECEIVERS["noise-proof"], asi.emc.Noise().density(0.3)
    >>> row = rare_error_rates(wave, density, 40_000, receiver=proof).iloc[0]
    >>> f"{row['rate']:.1e}", bool(row["sound"])
    ('5.8e-09', True)
    """
    receiver = receiver or Receiver()
    named = waves if isinstance(waves, Mapping) else {"": waves}
    if not named:
        raise ArgumentError("waves is empty; it must contain at least one wave")
    densities = checked_densities(noise_density).tolist()
    count = check_whole("n_telegrams", n_telegrams, 1000, 2**31)
    seed = check_whole("seed", seed, 0, 2**63 - 1)
    sizes = [min(_PART, count - begin) for begin in range(0, count, _PART)]
    rows, parts = [], []
    for name, wave in named.items():
        bits, u = check_kind("waves", wave, Waveform).records
        if len(u) > _WORDS:
            raise ArgumentError(f"a wave has {len(u)} telegrams; it may have at most {_WORDS}")
        u = np.ascontiguousarray(u, float)
        for density in densities:
            case = _Case(bits, u, wave.dt, receiver, density / (2 * wave.dt) ** 0.5)
            rows.append({"wave": name, "silence_s": -wave.start, "noise_density": density})
            parts += [(case, size) for size in sizes]
    _points_of(replace(parts[0][0], sigma=1.0))  # raise errors before workers start
    seeds = np.random.SeedSequence(seed).spawn(len(parts))
    tasks = [(*part, child) for part, child in zip(parts, seeds, strict=True)]
    sums = spread(_sample, tasks, workers, step="parts of telegrams")
    each = [sums[begin : begin + len(sizes)] for begin in range(0, len(sums), len(sizes))]
    return pd.DataFrame([row | _summary(part) for row, part in zip(rows, each, strict=True)])
