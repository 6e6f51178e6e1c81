"""Typical wrong answers, drawn up before the hints were written: two ways for each exercise.

`WRONG` maps an exercise to what went wrong and the answer that it gives; `m` holds the student's
numbers, and `right` the right answer. `in_other_words` gives right answers in another notation.
"""

from functools import partial
from itertools import combinations, pairwise
from math import ceil, log2, log10

import numpy as np
import pandas as pd

from shipnet import ballast, can
from shipnet.design import Plant
from shipnet.exercises.answers import Bits, Bytes, Number, Table, Whole, Words


def differential(bits):
    level, out = 0, ""
    for bit in bits:
        level ^= bit == "0"
        out += f"{level}{1 - level}"
    return out


def by_sign(echo):
    return "100 ohm" if not echo else "above 100 ohm" if echo > 0 else "below 100 ohm"


def remainder(row, generator):
    width, left = len(generator) - 1, int(row, 2)
    for place in reversed(range(len(row) - width)):
        if left >> (place + width) & 1:
            left ^= int(generator, 2) << place
    return f"{left:0{width}b}"


def distances(pairs):
    return [sum(a != b for a, b in zip(*pair, strict=True)) for pair in pairs]


def wait_ms(m, blocking=1.08, stops=1):
    return blocking + stops * 0.52 + 0.76 + (55 + 10 * m["n_bytes"]) / 125


def slack_of(m, order):
    messages = can.MessageSet.parse(m["messages"])
    responses = can.response_times(messages.ordered(order(messages)), 125_000)
    return 1e3 * min(one.message.deadline - one.response for one in responses)


def request(m, first=-1, order="big"):
    numbers = (m["number"] + first, m["quantity"])
    return (bytes([m["unit"], 3]) + b"".join(n.to_bytes(2, order) for n in numbers)).hex(" ")


def scan(n, registers, rate, bits=11, silences=2):
    silence = 3.5 * bits / rate if rate <= 19200 else 1.75e-3
    return n * ((13 + 2 * registers) * bits / rate + silences * silence)


def valves(m, silences=2, processing=1):
    character = 11 / m["rate"]
    each = 21 * character + silences * 1.75e-3 + processing * m["think_ms"] / 1e3
    return 1 + int((2 - 8 * character - m["timeout_ms"] / 1e3) / each)


def free(m, waiting=1, bits=10):
    needed = waiting * m["waiting"] + m["rate"] / bits * m["pause_ms"] / 1e3
    return 2 ** ceil(log2(needed)) - needed


def most_slaves(m, extra=2, repeated=None):
    repeated = m["repetitions"] if repeated is None else repeated
    fit = [n for n in range(32) if ((n + extra + repeated) * 26 + 10) * 6e-3 <= m["limit"]]
    return fit[-1] if fit else 0


def gap(m, tries=1, request=9.17e-3):
    waits = (tries + m["retries"]) * (request + m["timeout"] / 1e3)
    return m["age"] + m["period"] + waits


def ring_emptied(events, size):
    waiting = lost = 0
    for event in events:
        if event == "r":
            waiting = max(0, waiting - 1)
        elif waiting == size:
            waiting, lost = 1, lost + size
        else:
            waiting += 1
    return lost


def persistent(fires, n, is_active):
    windows = (fires[max(0, i + 1 - n) : i + 1] for i in range(len(fires)))
    return "".join("1" if is_active(window) else "0" for window in windows)


def rows(m, row):
    pattern = ([1] * m["burst"] + [0] * (m["period"] - m["burst"])) * 10
    most = {n: max(sum(pattern[i : i + n]) for i in range(m["period"])) for n in (5, 10, 20)}
    return [
        dict(zip(("n", "k", "delay"), row(n, k, m["step"]), strict=True)) for n, k in most.items()
    ]


def costs(modules, spacing, distance):
    plant = Plant(modules, contacts=2, distance=distance, spacing=spacing)
    return [one.quantities()["total_cost_eur"] for one in (plant.hardwired, plant.on_asi)]


def saved(m, spacing):
    wired, bus = costs(m["modules"], spacing, m["distance"])
    return 100 * (1 - bus / wired)


def crossing(m, spacing, per=20):
    (a, b), (c, d) = (costs(m["modules"], spacing, distance) for distance in (10, 30))
    return 10 + (b - a) / ((c - a - d + b) / per)


def choosing(is_good):
    def choose(options, limit):
        good = [name for name, row in options.items() if is_good(*row, limit)]
        return min(good, key=lambda name: options[name][0], default="none")

    return choose


def codes(m, method):
    base = ballast.rule_base()
    strength = base.fire(m["readings"], method=method).strength
    return [code for code, one in zip(base.codes, strength, strict=True) if one > 0]


WRONG = {
    "ex-01-1": {
        "a 0 rises": lambda m, _: "".join("10" if bit == "1" else "01" for bit in m["bits"]),
        "differential Manchester": lambda m, _: differential(m["bits"]),
    },
    "ex-01-2": {
        "in ms": lambda m, _: m["n_bits"] / m["rate"],
        "upside down": lambda m, _: m["rate"] / m["n_bits"],
    },
    "ex-01-3": {
        "counts ones": lambda m, _: lambda bits: bits.count("1"),
        "between equal bits": lambda m, _: lambda bits: sum(a == b for a, b in pairwise(bits)),
    },
    "ex-01-4": {
        "half-bit taken for bit": lambda m, _: m["limit"] / 2,
        "in bit/s": lambda m, right: 1e3 * right,
    },
    "ex-02-1": {
        "signs turned round": lambda m, _: [by_sign(-echo) for echo in m["echoes"]],
        "by sign only": lambda m, _: [by_sign(echo) for echo in m["echoes"]],
    },
    "ex-02-2": {
        "as fast as light": lambda m, _: 2 * (m["length"] - m["place"]) / 300,
        "when it arrives": lambda m, _: (2 * m["length"] - m["place"]) * m["delay"] / 1e3,
    },
    "ex-02-3": {
        "sign turned round": lambda m, _: lambda v, r, z: v * (z - r) / (z + r),
        "both waves": lambda m, _: lambda v, r, z: v * (1 + (r - z) / (r + z)),
    },
    "ex-02-4": {
        "first length out": lambda m, right: right + 10,
        "echo within a pulse": lambda m, _: round(3e3 / m["delay"] / 2),
    },
    "ex-03-1": {
        "odd parity": lambda m, right: right[:5] + "10"[int(right[5])] + "1",
        "parity before the data": lambda m, right: "0" + right[5] + m["bits"] + "1",
    },
    "ex-03-2": {
        "no room made": lambda m, _: remainder(m["bits"], m["generator"]),
        "with carries": lambda m, _: f"{(int(m['bits'], 2) << 4) % int(m['generator'], 2):04b}",
    },
    "ex-03-3": {
        "the largest": lambda m, _: lambda words: max(distances(combinations(words, 2))),
        "neighbours": lambda m, _: lambda words: min(distances(pairwise(words))),
    },
    "ex-03-4": {
        "one year": lambda m, _: ceil(log2(365 * m["hits"])),
        "digits": lambda m, _: ceil(log10(365 * m["hits"] * m["years"])),
    },
    "ex-04-1": {
        "no second pause": lambda m, _: 6 * (21 + m["master_pause"]),
        "in ms": lambda m, right: right / 1e3,
    },
    "ex-04-2": {
        "slaves only": lambda m, _: m["slaves"] * m["bits"] * 6e-3,
        "all 31 addresses": lambda m, _: 33 * m["bits"] * 6e-3,
    },
    "ex-04-3": {
        "a fraction": lambda m, _: lambda user, p, q: user / (21 + p + q),
        "one pause": lambda m, _: lambda user, p, q: 100 * user / (21 + p),
    },
    "ex-04-4": {
        "no management": lambda m, _: most_slaves(m, extra=0),
        "no repetitions": lambda m, _: most_slaves(m, repeated=0),
    },
    "ex-05-1": {
        "one bit short": lambda m, right: right[:-1],
        "12 bits of the hex": lambda m, _: f"{min(int(number, 16) for number in m['ids']):012b}",
    },
    "ex-05-2": {
        "replace": lambda m, _: lambda b: b.replace(5 * "0", "000001").replace(5 * "1", "111110"),
        "the other bit after each": lambda m, _: lambda bits: bits + "0",
    },
    "ex-05-3": {
        "no blocking": lambda m, _: wait_ms(m, 0),
        "stop three times": lambda m, _: wait_ms(m, stops=3),
    },
    "ex-05-4": {
        "by deadline": lambda m, _: slack_of(m, lambda s: s.deadline_monotonic().names),
        "as listed": lambda m, _: slack_of(m, lambda s: s.names),
    },
    "ex-06-1": {
        "the manual's number": lambda m, _: request(m, 0),
        "low byte first": lambda m, _: request(m, order="little"),
    },
    "ex-06-2": {
        "one byte per register": lambda m, _: 11e3 * (5 + m["registers"]) / m["rate"],
        "a silence too": lambda m, right: right + 38.5e3 / m["rate"],
    },
    "ex-06-3": {
        "one silence": lambda m, _: lambda *case: scan(*case, silences=1),
        "ten bits": lambda m, _: lambda *case: scan(*case, bits=10),
    },
    "ex-06-4": {
        "no silence": lambda m, _: valves(m, silences=0),
        "no processing": lambda m, _: valves(m, processing=0),
    },
    "ex-07-1": {
        "the difference": lambda m, _: m["ring"]["no"] - m["ring"]["get_no"],
        "up to the end only": lambda m, _: 128 - m["ring"]["get_no"],
    },
    "ex-07-2": {
        "a place less": lambda m, _: 1e4 * (2 * m["places"] - 1) / m["rate"],
        "bytes per second": lambda m, _: 2e3 * m["places"] / m["rate"],
    },
    "ex-07-3": {
        "unread": lambda m, _: lambda e, size: max(0, e.count("w") - e.count("r")),
        "a full ring is emptied": lambda m, _: ring_emptied,
    },
    "ex-07-4": {
        "nothing waits": lambda m, _: free(m, waiting=0),
        "8 bits": lambda m, _: free(m, bits=8),
    },
    "ex-08-1": {
        "both valves counted": lambda m, right: right + 1,
        "as a line": lambda m, _: m["n"] - m["first"],
    },
    "ex-08-2": {
        "no first try": lambda m, _: gap(m, tries=0),
        "no requests": lambda m, _: gap(m, request=0),
    },
    "ex-08-3": {
        "last less first": lambda m, _: lambda n, cuts: cuts[-1] - cuts[0] if cuts else 0,
        "no empty list": lambda m, _: lambda n, cuts: max(cuts) - min(cuts),
    },
    "ex-08-4": {
        "a request for each valve": lambda m, _: (2000 - m["n"] * 9.17) / 2 - 9.17,
        "three waits": lambda m, _: (2000 - m["n"] * 32.08) / 3 - 9.17,
    },
    "ex-09-1": {
        "first only": lambda m, _: codes(m, "crisp")[:1],
        "with ramps": lambda m, _: codes(m, "fuzzy"),
    },
    "ex-09-2": {
        "product": lambda m, right: [right[0] | {"ramps": (m["FP"] - 115) / 10 * (m["OP"] - 2)}],
        "in percent": lambda m, right: [right[0] | {"ramps": 100 * right[0]["ramps"]}],
    },
    "ex-09-3": {
        "more than k": lambda m, _: lambda f, k, n: persistent(f, n, lambda w: w.count("1") > k),
        "in a row": lambda m, _: lambda f, k, n: persistent(f, n, lambda w: "1" * k in w),
    },
    "ex-09-4": {
        "k one too small": lambda m, _: rows(m, lambda n, k, step: (n, k, k * step)),
        "delay in readings": lambda m, _: rows(m, lambda n, k, step: (n, k + 1, k)),
    },
    "ex-10-1": {
        "one wire per contact": lambda m, right: 2 * right,
        "one line": lambda m, right: right / m["lines"],
    },
    "ex-10-2": {
        "spacing 1": lambda m, _: saved(m, spacing=1),
        "what is left": lambda m, _: 100 - saved(m, spacing=4),
    },
    "ex-10-3": {
        "other spacing": lambda m, _: crossing(m, 3 - m["spacing"]),
        "not divided by 20": lambda m, _: crossing(m, m["spacing"], per=1),
    },
    "ex-10-4": {
        "no faults looked at": lambda m, _: choosing(lambda cost, lost, _, limit: lost <= limit),
        "no limit looked at": lambda m, _: choosing(lambda cost, lost, faults, _: not faults),
    },
}


def in_other_words(right):
    """Yield an answer that is right in the notations that students use."""
    value = right.value
    if isinstance(right, Whole):
        yield from (float(value), np.int64(value), np.array(value))
    elif isinstance(right, Number):
        yield from (np.float64(value), np.array(value), np.array([value]), float(f"{value:.4g}"))
    elif isinstance(right, Bits):
        yield from (list(value), np.array([*map(int, value)]), " ".join(value))
    elif isinstance(right, Bytes):
        yield from (value.hex(), value.hex(" ").upper(), list(value), bytearray(value))
    elif isinstance(right, Table):
        rows = list(value)
        yield from (
            pd.DataFrame(rows),
            rows[::-1],
            tuple(rows),
            [{**row, "note": ""} for row in rows],
        )
    elif isinstance(right, Words):
        words = list(value)
        yield from (words, tuple(words), [word.upper() for word in words])
        if isinstance(value, frozenset):
            yield from (", ".join(words), set(words), words[::-1])
    else:
        yield lambda *case: value(*case)
        yield partial(value)
