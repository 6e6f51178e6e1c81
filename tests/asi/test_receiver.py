import re
from functools import cache
from itertools import combinations, product

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from scipy import signal

from shipnet.asi.batch import NONE
from shipnet.asi.modulation import CLASSES, HALF_BIT, SEND_CURRENT, Modulation, Pulses, ramp
from shipnet.asi.receiver import matched_filter, receive
from shipnet.errors import ArgumentError, FrameError, SilenceError, name_of
from tests.asi.lines import REQUESTS, RESPONSES

GRIDS = [25e-9, 50e-9, 100e-9, 250e-9, 400e-9, 500e-9]


def slots_of(bits):
    """Return the pulses of telegrams with the two silent slots after them."""
    pulses = Modulation(bits).pulses.signs
    return np.concatenate([pulses, np.zeros_like(pulses[..., :2])], axis=-1)


@cache
def ternary(n):
    """Return all rows of n signs."""
    signs = np.array([-1, 0, 1], dtype=np.int8)
    return np.stack(np.meshgrid(*[signs] * n, copy=False), axis=-1).reshape(-1, n)


def ideal(bits, dt, *, start=0.0, height=2.4, duration=64e-6):
    """Return the voltage of an ideal inductor: sin^2 pulses in closed form."""
    x = (np.arange(round(duration / dt)) * dt - start) / HALF_BIT
    pulses = Modulation(bits).pulses.signs
    shapes = x - np.arange(pulses.shape[-1])[:, np.newaxis]
    shapes = np.where((shapes > 0) & (shapes < 1), np.sin(np.pi * shapes) ** 2, 0)
    return height * (pulses @ shapes)


FINE = 12.5e-9


@cache
def supply_step():
    """Return the voltage of 78 ohm || 100 uH while the current rises once, at `FINE`."""
    t = np.arange(0, 100e-6, FINE)
    supply = ([-78 * 100e-6, 0], [100e-6, 78])
    return signal.lsim(supply, SEND_CURRENT * ramp(t / HALF_BIT), t)[1]


def supplied(bits, dt, *, start=3e-6, duration=64e-6):
    """Return the voltage across the supply: steps of current, superposed."""
    u = np.zeros(round(duration / FINE))
    for j, step in enumerate(Modulation(bits).steps):
        begin = round((start + j * HALF_BIT) / FINE)
        u[begin:] += step * supply_step()[: u.size - begin]
    return u[:: round(dt / FINE)]


# The checks on pulses.


@pytest.mark.parametrize("words", [RESPONSES, REQUESTS], ids=["16 responses", "2048 requests"])
def test_every_telegram_is_decoded_from_its_pulses(words):
    bits, error = Pulses(slots_of(words)).check()
    assert (bits == words).all()
    assert not error.any()
    assert not Pulses(slots_of(words)).violations.any()
    one = Pulses(slots_of(words[-1]))
    assert (one.broken, one.error, one.count) == ((), "ok", np.count_nonzero(one))


def test_no_other_row_of_pulses_is_a_response():
    # All 3**16 rows of 16 slots, by their first two.
    slots = np.empty((3**14, 16), dtype=np.int8)
    slots[:, 2:] = ternary(14)
    accepted = []
    for pair in ternary(2):
        slots[:, :2] = pair
        for part in np.array_split(slots, 81):  # small enough for a core's cache
            accepted.append(part[Pulses(part).check()[1] == 0])
    accepted = np.concatenate(accepted)
    assert sorted(accepted.tolist()) == sorted(slots_of(RESPONSES).tolist())


@pytest.mark.parametrize(
    ("faults", "patterns", "undetected"),
    [(1, 480, 0), (2, 6720, 0), (3, 58240, 0), (4, 349440, 32)],
)
def test_faults_in_fewer_than_four_slots_are_found(faults, patterns, undetected):
    good = slots_of(RESPONSES)
    bad = []
    for places in combinations(range(1, 16), faults):
        for turns in product((1, 2), repeat=faults):
            slots = good.copy()
            slots[:, places] = (slots[:, places] + 1 + turns) % 3 - 1
            bad.append(slots)
    bad = np.concatenate(bad)
    assert (bad != np.tile(good, (len(bad) // 16, 1))).sum() == faults * len(bad)
    assert len(bad) == patterns
    assert (Pulses(bad).check()[1] == 0).sum() == undetected


# The response 0-+-0+-+0-+-0+00, 0011001, with one fault each.
BROKEN = {
    "start": ("0+-+0-+-0+-+0-00", "slot 1 has +; the start bit's pulse must be -"),
    "alternation": ("0-+-0+++0-+-0+00", "slot 6 has + like slot 5"),
    "pause": ("0-+-0+-+000-0+00", "slots 8 and 9 are both empty"),
    "information": ("0-+-+0-+0-+-0+00", "slot 5, the middle of bit 2, is empty"),
    "parity": ("0-+-0+-+0-0+-+00", "slots 1 to 11 contain 001101, with 3 ones"),
    "end": ("0-+-0+-+0-+-+-00", "slot 13 has -; the end bit's pulse must be +"),
    "length": ("0-+-0+-+0-+-0+-0", "slot 14 has -; the line must be silent after slot 13"),
}


@pytest.mark.parametrize("name", CLASSES)
def test_every_error_class_is_recognised(name):
    row, message = BROKEN[name]
    slots = ["-0+".index(sign) - 1 for sign in row]
    kind = CLASSES[name]
    assert Pulses(slots).check()[1] == kind.code
    assert (Pulses(slots).broken[0], Pulses(slots).error) == (name, kind.__name__)
    fails = Pulses(slots).violations
    assert list(CLASSES)[fails.argmax()] == name
    with pytest.raises(kind, match=re.escape(message)):
        Pulses(slots).decode()


@pytest.mark.parametrize("name", CLASSES)
def test_every_error_class_is_recognised_on_the_line(name):
    slots = np.array(["-0+".index(sign) - 1 for sign in BROKEN[name][0]])
    t = np.arange(256) * 250e-9
    x = (t - 4e-6) / HALF_BIT - np.arange(16)[:, np.newaxis]
    u = 2 * slots @ np.where((x > 0) & (x < 1), np.sin(np.pi * x) ** 2, 0)
    for matched in (True, False):
        received = receive(u, 250e-9, 7, matched=matched)
        assert name_of(int(received.error)) == CLASSES[name].__name__
        assert (received.slots == slots).all()


@pytest.mark.parametrize("n_bits", [7, 14])
def test_the_scalar_code_agrees_on_random_rows(n_bits):
    rng = np.random.default_rng(2024)
    words = RESPONSES if n_bits == 7 else REQUESTS
    slots = slots_of(words[rng.integers(0, len(words), 3000)])
    hit = rng.random(slots.shape) < rng.choice([0.02, 0.1, 0.7], size=(3000, 1))
    slots[hit] = rng.integers(-1, 2, hit.sum())
    bits, error = Pulses(slots).check()
    fails = Pulses(slots).violations
    codes = np.array([kind.code for kind in CLASSES.values()])
    assert (np.where(fails.any(-1), codes[fails.argmax(-1)], 0) == error).all()
    for row, word, code in zip(slots, bits, error, strict=True):
        try:
            assert Pulses(row).decode() == "".join(map(str, word))
            assert code == 0
        except FrameError as fault:
            assert fault.code == code


@pytest.mark.parametrize(
    ("slots", "message"),
    [
        ([0] * 15, "there are 15 half-bits; a response has 14 and a request 28, plus two"),
        *((wrong, "they must be -") for wrong in ([0.0] * 16, "0-x", "", 1.5)),
        ([2] + [0] * 15, "they must be -"),
        (np.full(16, -128, dtype=np.int8), "they must be -"),
    ],
)
def test_illegal_rows_of_slots_are_refused(slots, message):
    for function in (Pulses.check, lambda pulses: pulses.violations):
        with pytest.raises(ArgumentError, match=message):
            function(Pulses(slots))


def test_one_telegram_is_decoded_at_a_time():
    for read in (Pulses.decode, lambda pulses: pulses.broken):
        with pytest.raises(ArgumentError, match=r"pulses have shape \(1, 16\); give one"):
            read(Pulses([[0] * 16]))


# The receiver on the line.


@pytest.mark.parametrize("matched", [True, False])
@pytest.mark.parametrize("dt", GRIDS)
def test_ideal_pulses_are_received(dt, matched):
    for words in (RESPONSES, REQUESTS[::50]):
        for start in (0.0, 4.07e-6):
            u = ideal(words, dt, start=start, duration=100e-6)
            received = receive(u, dt, words.shape[1], matched=matched)
            assert not received.error.any()
            assert (received.bits == words).all()
            assert (received.slots == slots_of(words)).all()
            assert received.start == pytest.approx(start, abs=dt / 50)
            assert received.amplitude == pytest.approx(2.4, rel=0.07)
            assert received.within_tolerance.all()


@pytest.mark.parametrize("matched", [True, False])
@pytest.mark.parametrize("dt", GRIDS)
def test_pulses_shaped_by_a_power_supply_are_received(dt, matched):
    for word in RESPONSES:
        received = receive(supplied(word, dt), dt, 7, matched=matched)
        assert received.error == 0
        assert (received.bits == word).all()
        # At the supply: 2.3 to 2.4 V, and a peak later than that of an ideal inductor.
        assert received.amplitude == pytest.approx(2.3, rel=0.04)
        assert 0.5e-6 < received.start - 3e-6 < 0.9e-6
        assert received.within_tolerance


@pytest.mark.parametrize("matched", [True, False])
@pytest.mark.parametrize("height", [0.3, 1.5, 4.0, 8.0])
@pytest.mark.parametrize("offset", [0.0, 30.0, -30.0])
def test_height_offset_and_unit_do_not_matter(height, offset, matched):
    u = ideal(RESPONSES, 250e-9, start=6.3e-6, height=height) + offset
    received = receive(u, 250e-9, 7, matched=matched, minimum=0.02)
    assert not received.error.any()
    assert (received.bits == RESPONSES).all()
    assert received.amplitude == pytest.approx(height, rel=0.02)
    single = receive(u.astype(np.float32), 250e-9, 7, matched=matched, minimum=0.02)
    assert (single.bits == RESPONSES).all()


def test_the_start_moves_with_the_telegram_between_the_samples():
    starts = np.linspace(2e-6, 4e-6, 41)
    u = np.stack([ideal("0011001", 250e-9, start=start) for start in starts])
    for matched in (True, False):
        measured = receive(u, 250e-9, 7, matched=matched).start
        assert measured == pytest.approx(starts, abs=5e-9)


def test_silence_has_an_error_and_no_numbers():
    received = receive(np.full((2, 300), 30.0), 250e-9, 7)
    assert (received.error == SilenceError.code).all()
    assert (received.bits == NONE).all()
    assert not received.slots.any()
    for field in (received.start, received.amplitude, received.weakest, received.ringing):
        assert np.isnan(field).all()
    assert not received.within_tolerance.any()


@pytest.mark.parametrize("end", [20e-6, 33e-6, 40e-6])
def test_a_telegram_cut_off_is_an_error(end):
    u = ideal("0011001", 250e-9)[: round(end / 250e-9)]
    for matched in (True, False):
        assert receive(u, 250e-9, 7, matched=matched).error > 0


def test_weak_pulses_and_ringing_are_measured():
    u = np.tile(ideal("0011001", 250e-9, start=5e-6), (4, 1))
    t = np.arange(256) * 250e-9
    # Slot 7 weaker; then a pulse in slot 8, which should be empty and so weakens its neighbours.
    seventh, eighth = (abs(t - 5e-6 - (slot + 0.5) * HALF_BIT) < 1.5e-6 for slot in (7, 8))
    u[1, seventh] *= 0.7
    u[2, seventh] *= 0.6
    shape = np.sin(np.pi * ((t - 5e-6) / HALF_BIT - 8)) ** 2
    u[3, eighth] = 0.4 * 2.4 * shape[eighth]
    for matched in (True, False):
        received = receive(u, 250e-9, 7, matched=matched)
        assert received.weakest == pytest.approx([1, 0.7, 0.6, 1], abs=0.03)
        assert received.ringing == pytest.approx([0, 0, 0, 0.4], abs=0.03)
        assert received.within_tolerance.tolist() == [True, True, False, False]
        assert not receive(u, 250e-9, 7, matched=matched).error.any()
        lost = receive(u, 250e-9, 7, matched=matched, threshold=0.65)
        assert [name_of(code) for code in lost.error] == ["ok", "ok", "AlternationError", "ok"]


def test_below_the_minimum_nothing_counts():
    u = ideal("0011001", 250e-9, height=1.0)
    assert receive(u, 250e-9, 7, minimum=0.9).error == 0
    assert receive(u, 250e-9, 7, minimum=1.1).error == SilenceError.code
    # What is larger than half of the first pulse but below the minimum is not a pulse.
    middle = round(4.5 * HALF_BIT / 250e-9)
    u[middle - 2 : middle + 3] = 0.6
    assert receive(u, 250e-9, 7, minimum=0.8, matched=False).error == 0
    assert receive(u, 250e-9, 7, minimum=0.5, matched=False).error > 0


def test_the_threshold_follows_the_first_pulse_not_the_largest():
    u = ideal("0011001", 250e-9, start=5e-6)
    u[np.arange(256) * 250e-9 < 11e-6] *= 0.4
    for matched in (True, False):
        assert receive(u, 250e-9, 7, matched=matched).error == 0
    # It also keeps its sign next to a larger spike.
    u = np.zeros(256)
    u[50:52] = [-1, 3]
    received = receive(u, 250e-9, 7, matched=False, window=0.5)
    assert received.slots[1] == -1
    assert received.amplitude == pytest.approx(1 + u.mean())


def test_leading_axes_stay_and_large_batches_agree_with_single_telegrams():
    rng = np.random.default_rng(2024)
    u = ideal(RESPONSES[rng.integers(0, 16, (5, 200))], 250e-9, start=5e-6)
    u += rng.normal(0, 0.5, u.shape)
    received = receive(u, 250e-9, 7)
    assert received.bits.shape == (5, 200, 7)
    assert received.start.shape == (5, 200)
    assert received.slots.shape == (5, 200, 16)
    for index in [(0, 0), (2, 77), (4, 199)]:
        alone = receive(u[index], 250e-9, 7)
        for many, one in zip(received, alone, strict=True):
            np.testing.assert_allclose(many[index], one, rtol=1e-9)


@pytest.mark.parametrize("dt", [*GRIDS, 1e-6, 170e-9])
def test_the_filter_keeps_a_pulse_and_removes_dc(dt):
    u = ideal("0011001", dt, start=20e-6, duration=80e-6) + 30
    assert abs(matched_filter(u, dt)).max() == pytest.approx(2.4, rel=0.03 if dt < 3e-7 else 0.2)
    # The same sum, written out, with noise up to the ends of the record.
    u += np.random.default_rng(2024).normal(0, 1, u.size)
    half = int(HALF_BIT / dt / 2)
    shape = np.cos(np.pi * np.arange(-half, half + 1) * dt / HALF_BIT) ** 2
    expected = np.convolve(u - u.mean(), shape * 8 / 3 * dt / HALF_BIT, mode="same")
    assert matched_filter(u, dt) == pytest.approx(expected, abs=1e-12)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"dt": 0}, r"dt is 0 s; it must be 1e-09\.\.1e-06 s"),
        ({"dt": -1e-6}, "dt is -1e-06 s"),
        ({"dt": 1.1e-6}, "dt is 1.1e-06 s; .* three samples or more per half-bit"),
        ({"dt": np.nan}, "dt is nan s"),
        ({"u": [0, np.nan, 1]}, "u has nan at sample 1 of a row"),
        ({"u": [[0, 1], [0, -np.inf]]}, "u has -inf at sample 1 of a row"),
        ({"u": [1e308, 1e308]}, r"u has 1e\+308 at sample 0 .* their sum must be finite"),
        ({"u": []}, r"u has shape \(0,\); its last axis must not be empty"),
        ({"u": np.zeros((3, 0))}, r"u has shape \(3, 0\)"),
        ({"u": 1.0}, r"u has shape \(\)"),
        ({"u": ["a"]}, "u must be real voltages, but its dtype is <U1"),
        ({"u": [1j]}, "dtype is complex128"),
        ({"n_bits": 8}, r"n_bits is 8; it must be 7 \(a response\) or 14 \(a request\)"),
        ({"threshold": 0}, "threshold is 0.0; it must be between 0 and 1"),
        ({"threshold": 1}, "threshold is 1.0; it must be between 0 and 1"),
        ({"threshold": np.nan}, "threshold is nan"),
        ({"window": 0.6}, r"window is 0.6 half-bits; it must be 0\.\.0\.5"),
        ({"minimum": -1}, r"minimum is -1 V; it must be 0\.\.1e\+09 V"),
        ({"minimum": np.inf}, "minimum is inf V; it must be"),
    ],
)
def test_bad_arguments_are_named(change, message):
    arguments = {"u": np.zeros(256), "dt": 250e-9, "n_bits": 7} | change
    for matched in (True, False):
        with pytest.raises(ArgumentError, match=message):
            receive(**arguments, matched=matched)
    if "u" in change or "dt" in change:
        with pytest.raises(ArgumentError, match=message):
            matched_filter(arguments["u"], arguments["dt"])


@given(
    u=hnp.arrays(
        st.sampled_from([np.float64, np.float32, np.int16]),
        hnp.array_shapes(min_dims=1, max_dims=3, max_side=40),
    ),
    dt=st.sampled_from([1e-9, 25e-9, 250e-9, 300e-9, 1e-6]),
    n_bits=st.sampled_from([7, 14]),
    matched=st.booleans(),
    minimum=st.sampled_from([0.0, 0.45, 1e9]),
    window=st.sampled_from([0.0, 0.1, 0.5]),
)
@example(np.array([5e-324, -5e-324, 1e-310]), 1e-6, 7, False, 0.0, 0.5)
@example(np.array([1e150, -1e150, 1e-310]), 1e-6, 7, True, 0.0, 0.5)
def test_any_numbers_give_a_result(u, dt, n_bits, matched, minimum, window):
    arguments = {"matched": matched, "minimum": minimum, "window": window}
    try:
        received = receive(u, dt, n_bits, **arguments)
    except ArgumentError:
        assert not (np.abs(u.astype(float)) < 1e150).all()
        return
    assert received.bits.shape == (*u.shape[:-1], n_bits)
    # 40 samples cannot contain a telegram unless they are a microsecond apart.
    if dt < 1e-6:
        assert received.error.all()
    audible = received.error != SilenceError.code
    assert (received.amplitude[audible] >= 0).all()
    for ratio in (received.weakest, received.ringing):
        assert ((ratio[audible] >= 0) & (ratio[audible] <= 1)).all()
    assert np.isnan(received.start[~audible]).all()


def heard_by_hand(u, dt, n_bits, threshold, window, minimum):
    """Receive one row slot by slot; None if it is silent."""
    y = (u - u.mean()).tolist()
    samples, end = HALF_BIT / dt, len(y) - 1
    loud = [sample for sample, value in enumerate(y) if abs(value) > minimum]
    if not loud:
        return None
    sign = 1 if y[loud[0]] > 0 else -1
    near = range(loud[0], min(loud[0] + int(1.25 * samples), end) + 1)
    at = max(near, key=lambda sample: (sign * y[sample], -sample))
    peak = float(at)
    if 0 < at < end:
        left, right = sign * (y[at] - y[at - 1]), sign * (y[at] - y[at + 1])
        if left >= 0 and right >= 0 and left + right > 0:
            peak += 0.5 * (left - right) / (left + right)
    heights = [y[at]]
    for slot in range(1, 2 * n_bits + 1):
        middle, reach = round(peak + samples * slot), int(window * samples + 1e-9)
        around = [y[min(max(middle + k, 0), end)] for k in range(-reach, reach + 1)]
        largest = max(around) if max(around) > -min(around) else min(around)
        heights.append(largest if middle <= end else 0.0)
    least = max(threshold * abs(heights[0]), minimum)
    slots = [0, *((h > 0) - (h < 0) if abs(h) > least else 0 for h in heights)]
    filled = [abs(h) for h, slot in zip(heights, slots[1:], strict=True) if slot]
    between = [abs(h) for h, slot in zip(heights, slots[1:], strict=True) if not slot]
    reach = range(-int(samples / 4), int(samples / 4) + 1)
    amplitude = max(sign * y[min(max(at + k, 0), end)] for k in reach)
    start = peak * dt - 1.5 * HALF_BIT
    return slots, start, amplitude, min(filled) / max(filled), max(between, default=0) / max(filled)


@pytest.mark.parametrize("dt", [250e-9, 500e-9, 1e-6])
@pytest.mark.parametrize("window", [0.0, 0.1, 0.5])
def test_the_receiver_agrees_with_a_loop_over_slots_on_small_integers(dt, window):
    # Integers of mean 0 give flat tops, pulses at both ends, and heights at the thresholds.
    rng = np.random.default_rng(2024)
    for size in (1, 2, 12, 90, 200):
        half = rng.integers(-4, 5, (200, size)) * (rng.random((200, size)) < rng.random((200, 1)))
        u = np.concatenate([half, -half], axis=1).astype(float)
        settings = {"threshold": 0.5, "window": window, "minimum": 1.0}
        reception = receive(u, dt, 7, matched=False, **settings)
        silent = reception.error == SilenceError.code
        for row, values in enumerate(u):
            expected = heard_by_hand(values, dt, 7, **settings)
            assert silent[row] == (expected is None)
            if expected:
                slots, *numbers = expected
                assert reception.slots[row].tolist() == slots
                names = ("start", "amplitude", "weakest", "ringing")
                measured = [getattr(reception, name)[row] for name in names]
                assert measured == pytest.approx(numbers, rel=1e-12, abs=1e-15)
    assert reception.slots.dtype == np.int8


@pytest.mark.parametrize("matched", [True, False])
@pytest.mark.parametrize("minimum", [0.0, 0.45])
@pytest.mark.parametrize("window", [0.0, 0.1, 0.5])
def test_rounding_decides_nothing(matched, minimum, window):
    # Without noise, silence is nearly 0, some samples are equal, and some peaks are between two.
    rng = np.random.default_rng(2024)
    for dt in (250e-9, 200e-9, 500e-9):
        for early in (0, dt / 2):
            u = np.tile(ideal(RESPONSES, dt, start=5e-6 - early), (20, 1))
            u += 1e-12 * rng.normal(size=u.shape)
            reception = receive(u, dt, 7, matched=matched, minimum=minimum, window=window)
            for field in (reception.bits, reception.error, reception.slots):
                assert (field.reshape(20, 16, -1) == field[:16].reshape(16, -1)).all()
            start = reception.start.reshape(20, 16)
            assert start == pytest.approx(np.broadcast_to(start[0], start.shape), abs=1e-12)
