"""Typical wrong answers, drawn up before the hints were written: six ways for each exercise.

`WRONG` maps an exercise to rows of what went wrong and the answer that it gives; `m` holds the
student's numbers, and `right` the right answer. `in_other_words` gives right answers in another
notation.
"""

from functools import partial
from itertools import combinations, pairwise
from math import ceil, log, log2, log10
from statistics import mean

import numpy as np
import pandas as pd

from shipnet import ballast, can
from shipnet.design import Plant
from shipnet.exercises.answers import Bits, Bytes, Number, Table, Whole, Words

FLIP = str.maketrans("01", "10")
ENDS = ("open end", "above 100 ohm", "100 ohm", "below 100 ohm", "short circuit")


def coded(bits, zero="10", one="01"):
    return "".join(one if bit == "1" else zero for bit in bits)


def differential(bits):
    level, out = 0, ""
    for bit in bits:
        level ^= bit == "0"
        out += f"{level}{1 - level}"
    return out


def named(echoes, name):
    return [name(echo) for echo in echoes]


def by_sign(echo, zero="100 ohm"):
    return zero if not echo else "above 100 ohm" if echo > 0 else "below 100 ohm"


def parity(bits):
    return str(bits.count("1") % 2)


def remainder(row, generator):
    width, left = len(generator) - 1, int(row, 2)
    for place in reversed(range(len(row) - width)):
        if left >> (place + width) & 1:
            left ^= int(generator, 2) << place
    return f"{left:0{width}b}"


def apart(one, other):
    return sum(a != b for a, b in zip(one, other, strict=True))


def pairs(words):
    return [apart(one, other) for one, other in combinations(words, 2)]


def stuffed(bits, after=5, only="01", opposite=True, reset=1):
    out, run, last = "", 0, ""
    for bit in bits:
        run = run + 1 if bit == last else 1
        out, last = out + bit, bit
        if run == after and bit in only:
            last = bit.translate(FLIP) if opposite else bit
            out, run = out + last, reset
    return out


def ids(m):
    return [f"{int(number, 16):011b}" for number in m["ids"]]


def wait_ms(m, blocking=1.08, stops=1, own=True):
    yours = (55 + 10 * m["n_bytes"]) / 125
    return blocking + stops * 0.52 + 0.76 + own * yours


def slack_of(m, order):
    messages = can.MessageSet.parse(m["messages"])
    names = order(messages)
    responses = can.response_times(messages.ordered(names), 125_000)
    return 1e3 * min(one.message.deadline - one.response for one in responses)


def sent(m, first=-1, function=3, order="big", quantity=0):
    numbers = (m["number"] + first, m["quantity"] + quantity)
    body = b"".join(number.to_bytes(2, order) for number in numbers)
    return (bytes([m["unit"], function]) + body).hex(" ")


def scan(n, registers, rate, size=13, bits=11, silences=2, data=2):
    silence = 3.5 * bits / rate if rate <= 19200 else 1.75e-3
    return n * ((size + data * registers) * bits / rate + silences * silence)


def valves(m, alive=21, dead=8, silences=2, extra=1, think=True):
    character = 11 / m["rate"]
    each = alive * character + silences * 1.75e-3 + think * m["think_ms"] / 1e3
    return extra + int((2 - dead * character - m["timeout_ms"] / 1e3) / each)


def free(m, waiting=True, bits=10):
    needed = waiting * m["waiting"] + m["rate"] / bits * m["pause_ms"] / 1e3
    return 2 ** ceil(log2(needed)) - needed


def news(m, extra=2, repeated=None, tail=10):
    repeated = m["repetitions"] if repeated is None else repeated
    kept = [n for n in range(32) if ((n + extra + repeated) * 26 + tail) * 6e-3 <= m["limit"]]
    return kept[-1] if kept else 0


def V1(right, ramps):
    return [right[0] | {"ramps": ramps}]


def gap(m, tries=1, request=9.17e-3, period=1.0):
    tried = (tries + m["retries"]) * (request + m["timeout"] / 1e3)
    return m["age"] + m["period"] * period + tried


def windows(fires, n, shift=1, least=0):
    return [fires[max(least, i + shift - n) : max(0, i + shift)] for i in range(len(fires))]


def bits(found):
    return "".join(str(int(one)) for one in found)


def rows(m, change):
    rows = []
    pattern = ([1] * m["burst"] + [0] * (m["period"] - m["burst"])) * 10
    for n in (5, 10, 20):
        most = max(sum(pattern[i : i + n]) for i in range(m["period"]))
        rows.append(change(n, most, m["step"]))
    return rows


def row(n, k, delay):
    return {"n": n, "k": k, "delay": delay}


def plant(m, spacing=4, distance=None):
    return Plant(m["modules"], contacts=2, distance=distance or m["distance"], spacing=spacing)


def costs(one):
    return [each.quantities()["total_cost_eur"] for each in (one.hardwired, one.on_asi)]


def crossing(m, near=10, far=30, spacing=None):
    spacing = spacing or m["spacing"]
    (a, b), (c, d) = (costs(plant(m, spacing, place)) for place in (near, far))
    return a, b, c, d


def choosing(good, key=lambda row: row[0]):
    def choose(options, limit):
        kept = [name for name, row in options.items() if good(*row, limit)]
        return min(kept, key=lambda name: key(options[name]), default="none")

    return choose


def membership(m):
    return (m["FP"] - 115) / 10, m["OP"] - 2


def fuzzy(readings):
    base = ballast.rule_base()
    return zip(base.codes, base.fire(readings).strength, strict=True)


def crisp(m, change):
    return list(change(ballast.diagnose(m["readings"], method="crisp").codes()))


WRONG = {
    "ex-01-1": [
        ("a 0 rises, a 1 falls", lambda m, right: coded(m["bits"], "01", "10")),
        ("plain levels, each twice", lambda m, right: coded(m["bits"], "00", "11")),
        ("differential Manchester", lambda m, right: differential(m["bits"])),
        ("one level per bit", lambda m, right: m["bits"]),
        ("last bit first", lambda m, right: coded(m["bits"][::-1])),
        ("a slip in the last bit", lambda m, right: right[:-2] + right[-2:][::-1]),
    ],
    "ex-01-2": [
        ("in ms", lambda m, right: m["n_bits"] / m["rate"]),
        ("in s", lambda m, right: m["n_bits"] / m["rate"] / 1e3),
        ("times the rate", lambda m, right: m["n_bits"] * m["rate"]),
        ("upside down", lambda m, right: m["rate"] / m["n_bits"]),
        ("bits taken for bytes", lambda m, right: 8 * right),
        ("the bit time of AS-i", lambda m, right: 6 * m["n_bits"]),
    ],
    "ex-01-3": [
        ("two pulses per bit", lambda m, right: lambda bits: 2 * len(bits)),
        ("counts ones", lambda m, right: lambda bits: bits.count("1")),
        (
            "between different bits",
            lambda m, right: lambda bits: len(bits) + sum(a != b for a, b in pairwise(bits)),
        ),
        (
            "between equal bits only",
            lambda m, right: lambda bits: sum(a == b for a, b in pairwise(bits)),
        ),
        (
            "the range ends one early",
            lambda m, right: (
                lambda bits: len(bits) + sum(bits[k] == bits[k + 1] for k in range(len(bits) - 2))
            ),
        ),
        (
            "only pairs of zeros",
            lambda m, right: lambda bits: len(bits) + sum(a == b == "0" for a, b in pairwise(bits)),
        ),
    ],
    "ex-01-4": [
        ("the limit", lambda m, right: m["limit"]),
        ("half-bit taken for bit", lambda m, right: m["limit"] / 2),
        ("halved once more", lambda m, right: m["limit"] / 8),
        ("times two", lambda m, right: 2 * m["limit"]),
        ("in bit/s", lambda m, right: 1e3 * right),
        ("the half-bit in us", lambda m, right: 2e3 / m["limit"]),
    ],
    "ex-02-1": [
        ("signs turned round", lambda m, right: named(m["echoes"], lambda e: by_sign(-e))),
        (
            "open for every positive",
            lambda m, right: named(
                m["echoes"],
                lambda e: "open end" if e > 0 else "short circuit" if e < 0 else "100 ohm",
            ),
        ),
        (
            "nothing comes from an open end",
            lambda m, right: [
                {"100 ohm": "open end", "open end": "100 ohm"}.get(name, name) for name in right
            ],
        ),
        (
            "short circuit taken for open",
            lambda m, right: [
                {"short circuit": "open end", "open end": "short circuit"}.get(n, n) for n in right
            ],
        ),
        ("last echo first", lambda m, right: list(right)[::-1]),
        ("all by sign only", lambda m, right: named(m["echoes"], by_sign)),
    ],
    "ex-02-2": [
        ("one way", lambda m, right: right / 2),
        ("in ns", lambda m, right: 1e3 * right),
        ("as fast as light", lambda m, right: 2 * (m["length"] - m["place"]) / 300),
        ("from the receiver", lambda m, right: 2 * m["length"] * m["delay"] / 1e3),
        ("when it arrives", lambda m, right: (2 * m["length"] - m["place"]) * m["delay"] / 1e3),
        ("twice there and back", lambda m, right: 2 * right),
    ],
    "ex-02-3": [
        ("sign turned round", lambda m, right: lambda v, r, z: v * (z - r) / (z + r)),
        ("the factor", lambda m, right: lambda v, r, z: (r - z) / (r + z)),
        ("both waves", lambda m, right: lambda v, r, z: v * (1 + (r - z) / (r + z))),
        ("divider", lambda m, right: lambda v, r, z: v * r / (r + z)),
        ("without sign", lambda m, right: lambda v, r, z: abs(v * (r - z) / (r + z))),
        ("divided by z0", lambda m, right: lambda v, r, z: v * (r - z) / z),
    ],
    "ex-02-4": [
        ("first length out", lambda m, right: right + 10),
        ("the rule", lambda m, right: 100),
        ("echo within a pulse", lambda m, right: round(3e3 / m["delay"] / 2)),
        ("150 m of the lesson", lambda m, right: 150 if right != 150 else 140),
        ("there and back", lambda m, right: 2 * right),
        ("scaled by the delay the wrong way", lambda m, right: round(150 * m["delay"] / 6.5, -1)),
    ],
    "ex-03-1": [
        ("odd parity", lambda m, right: right[:5] + right[5].translate(FLIP) + "1"),
        ("start bit 1", lambda m, right: "1" + right[1:]),
        ("data reversed", lambda m, right: "0" + m["bits"][::-1] + right[5:]),
        ("no end bit", lambda m, right: right[:-1]),
        ("parity before the data", lambda m, right: "0" + right[5] + m["bits"] + "1"),
        ("end bit 0", lambda m, right: right[:-1] + "0"),
    ],
    "ex-03-2": [
        ("no room made", lambda m, right: remainder(m["bits"], m["generator"])),
        (
            "generator reversed",
            lambda m, right: remainder(m["bits"] + "0000", m["generator"][::-1]),
        ),
        (
            "divided with carries",
            lambda m, right: f"{(int(m['bits'], 2) << 4) % int(m['generator'], 2):04b}",
        ),
        ("remainder reversed", lambda m, right: right[::-1]),
        ("generator of the text", lambda m, right: remainder(m["bits"] + "000", "1011")),
        ("a slip in one bit", lambda m, right: right[:-1] + right[-1].translate(FLIP)),
    ],
    "ex-03-3": [
        ("the largest", lambda m, right: lambda words: max(pairs(words))),
        (
            "first against the others",
            lambda m, right: lambda words: min(apart(words[0], other) for other in words[1:]),
        ),
        (
            "sorted neighbours",
            lambda m, right: lambda words: min(apart(a, b) for a, b in pairwise(sorted(words))),
        ),
        ("neighbours", lambda m, right: lambda words: min(apart(a, b) for a, b in pairwise(words))),
        ("the mean", lambda m, right: lambda words: mean(pairs(words))),
        ("what is found, one less", lambda m, right: lambda words: min(pairs(words)) - 1),
    ],
    "ex-03-4": [
        ("rounded down", lambda m, right: right - 1),
        ("a bit for safety", lambda m, right: right + 1),
        ("one year", lambda m, right: ceil(log2(365 * m["hits"]))),
        ("digits", lambda m, right: ceil(log10(365 * m["hits"] * m["years"]))),
        ("natural logarithm", lambda m, right: ceil(log(365 * m["hits"] * m["years"]))),
        ("not rounded", lambda m, right: log2(365 * m["hits"] * m["years"])),
    ],
    "ex-04-1": [
        ("no second pause", lambda m, right: 6 * (21 + m["master_pause"])),
        ("no first pause", lambda m, right: 6 * (21 + m["slave_pause"])),
        ("in ms", lambda m, right: right / 1e3),
        ("in bit times", lambda m, right: right / 6),
        ("pauses of the figure", lambda m, right: 156 if abs(right - 156) > 1 else 150),
        ("two requests", lambda m, right: right + 84),
    ],
    "ex-04-2": [
        ("slaves only", lambda m, right: m["slaves"] * m["bits"] * 6e-3),
        ("one more", lambda m, right: (m["slaves"] + 1) * m["bits"] * 6e-3),
        ("in us", lambda m, right: 1e3 * right),
        ("all 31 addresses", lambda m, right: 33 * m["bits"] * 6e-3),
        ("in bit times", lambda m, right: right / 6e-3),
        (
            "exchanges of 26 or 25",
            lambda m, right: (m["slaves"] + 2) * (25 if m["bits"] != 25 else 26) * 6e-3,
        ),
    ],
    "ex-04-3": [
        ("a share", lambda m, right: lambda u, p, q: u / (21 + p + q)),
        ("no pauses", lambda m, right: lambda u, p, q: 100 * u / 21),
        ("always eight", lambda m, right: lambda u, p, q: 800 / (21 + p + q)),
        ("one pause", lambda m, right: lambda u, p, q: 100 * u / (21 + p)),
        ("upside down", lambda m, right: lambda u, p, q: (21 + p + q) / u if u else 0),
        ("user bits twice", lambda m, right: lambda u, p, q: 200 * u / (21 + p + q)),
    ],
    "ex-04-4": [
        ("no management", lambda m, right: news(m, extra=0)),
        ("no repetitions", lambda m, right: news(m, repeated=0)),
        ("rounded up", lambda m, right: right + 1),
        ("one repetition", lambda m, right: news(m, repeated=1)),
        ("every address", lambda m, right: 31),
        ("one short", lambda m, right: right - 1),
    ],
    "ex-05-1": [
        ("with the start of frame", lambda m, right: "0" + right),
        ("one bit short", lambda m, right: right[:-1]),
        ("the loser's bits", lambda m, right: right[:-1] + "1"),
        ("the whole id of the winner", lambda m, right: min(ids(m))),
        ("12 bits of the hex", lambda m, right: "0" + min(ids(m))),
        ("last bit first", lambda m, right: min(ids(m))[::-1][: len(right)]),
    ],
    "ex-05-2": [
        ("after four", lambda m, right: lambda bits: stuffed(bits, 4)),
        ("after six", lambda m, right: lambda bits: stuffed(bits, 6)),
        (
            "replace",
            lambda m, right: (
                lambda bits: bits.replace("00000", "000001").replace("11111", "111110")
            ),
        ),
        ("zeros only", lambda m, right: lambda bits: stuffed(bits, only="0")),
        ("the same bit", lambda m, right: lambda bits: stuffed(bits, opposite=False)),
        (
            "not behind the last bit",
            lambda m, right: lambda bits: stuffed(bits[:-1]) + bits[-1] if bits else "",
        ),
    ],
    "ex-05-3": [
        ("no blocking", lambda m, right: wait_ms(m, 0)),
        ("stop once", lambda m, right: wait_ms(m)),
        ("stop three times", lambda m, right: wait_ms(m, stops=3)),
        ("own frame as blocking", lambda m, right: wait_ms(m, (55 + 10 * m["n_bytes"]) / 125, 2)),
        ("the wait", lambda m, right: right - (55 + 10 * m["n_bytes"]) / 125),
        ("in bits", lambda m, right: 125 * right),
    ],
    "ex-05-4": [
        ("by deadline", lambda m, right: slack_of(m, lambda s: s.deadline_monotonic().names)),
        ("as listed", lambda m, right: slack_of(m, lambda s: s.names)),
        ("alphabetical", lambda m, right: slack_of(m, lambda s: sorted(s.names))),
        (
            "shortest frame first",
            lambda m, right: slack_of(
                m, lambda s: [one.name for one in sorted(s, key=lambda one: one.dlc)]
            ),
        ),
        (
            "longest deadline first",
            lambda m, right: slack_of(m, lambda s: list(s.deadline_monotonic().names)[::-1]),
        ),
        ("in s", lambda m, right: right / 1e3),
    ],
    "ex-06-1": [
        ("the manual's number", lambda m, right: sent(m, 0)),
        ("function 4", lambda m, right: sent(m, function=4)),
        ("low byte first", lambda m, right: sent(m, order="little")),
        ("one below too far", lambda m, right: sent(m, -2)),
        ("one byte for the quantity", lambda m, right: sent(m)[:11] + f" {m['quantity']:02x}"),
        ("bytes for registers", lambda m, right: sent(m, quantity=m["quantity"])),
    ],
    "ex-06-2": [
        ("bits of a byte", lambda m, right: right * 8 / 11),
        ("ten bits", lambda m, right: right * 10 / 11),
        ("one byte per register", lambda m, right: 11e3 * (5 + m["registers"]) / m["rate"]),
        ("no frame", lambda m, right: 22e3 * m["registers"] / m["rate"]),
        ("in s", lambda m, right: right / 1e3),
        ("a silence too", lambda m, right: right + 38.5e3 / m["rate"]),
    ],
    "ex-06-3": [
        ("in ms", lambda m, right: lambda *case: 1e3 * scan(*case)),
        ("one silence", lambda m, right: lambda *case: scan(*case, silences=1)),
        ("ten bits", lambda m, right: lambda *case: scan(*case, bits=10)),
        ("response only", lambda m, right: lambda *case: scan(*case, size=5)),
        (
            "fixed silence always",
            lambda m, right: lambda n, k, rate: n * ((13 + 2 * k) * 11 / rate + 3.5e-3),
        ),
        ("one slave", lambda m, right: lambda n, k, rate: scan(1, k, rate)),
    ],
    "ex-06-4": [
        ("the living ones", lambda m, right: right - 1),
        ("rounded up", lambda m, right: right + 1),
        (
            "the dead one thinks and is silent too",
            lambda m, right: (
                lambda c: (
                    1
                    + int(
                        (2 - 8 * c - 3.5e-3 - (m["think_ms"] + m["timeout_ms"]) / 1e3)
                        / (21 * c + 3.5e-3 + m["think_ms"] / 1e3)
                    )
                    - 2
                )
            )(11 / m["rate"]),
        ),
        ("no silence", lambda m, right: valves(m, silences=0)),
        ("no thinking", lambda m, right: valves(m, think=False)),
        (
            "3.5 characters",
            lambda m, right: (
                lambda c: (
                    1 + int((2 - 8 * c - m["timeout_ms"] / 1e3) / (28 * c + m["think_ms"] / 1e3))
                )
            )(11 / m["rate"]),
        ),
    ],
    "ex-07-1": [
        ("the distance", lambda m, right: m["ring"]["no"] - m["ring"]["get_no"]),
        ("turned round", lambda m, right: m["ring"]["get_no"] - m["ring"]["no"]),
        ("modulo 127", lambda m, right: right - 1),
        ("both ends counted", lambda m, right: right + 1),
        ("modulo 256", lambda m, right: right + 128),
        ("up to the end only", lambda m, right: 128 - m["ring"]["get_no"]),
    ],
    "ex-07-2": [
        ("full", lambda m, right: right / 2),
        ("8 bits", lambda m, right: 0.8 * right),
        ("11 bits", lambda m, right: 1.1 * right),
        ("in s", lambda m, right: right / 1e3),
        ("a place less", lambda m, right: 1e4 * (2 * m["places"] - 1) / m["rate"]),
        ("bytes per second", lambda m, right: 2e3 * m["places"] / m["rate"]),
    ],
    "ex-07-3": [
        ("unread", lambda m, right: lambda e, size: max(0, e.count("w") - e.count("r"))),
        ("writes beyond size", lambda m, right: lambda e, size: max(0, e.count("w") - size)),
        (
            "all at the end",
            lambda m, right: lambda e, size: max(0, e.count("w") - e.count("r") - size),
        ),
        ("a full ring is emptied", lambda m, right: ring_emptied),
        ("lost when just full", lambda m, right: lambda e, size: ring_limit(e, size - 1)),
        ("never lost", lambda m, right: lambda e, size: 0),
    ],
    "ex-07-4": [
        ("nothing waits", lambda m, right: free(m, False)),
        ("8 bits", lambda m, right: free(m, bits=8)),
        ("the size", lambda m, right: right + m["waiting"] + m["rate"] * m["pause_ms"] // 10000),
        (
            "the bytes that need room",
            lambda m, right: m["waiting"] + m["rate"] * m["pause_ms"] // 10000,
        ),
        ("one place kept free", lambda m, right: right - 1),
        (
            "the next size",
            lambda m, right: (
                right + 2 ** ceil(log2(m["waiting"] + m["rate"] * m["pause_ms"] / 1e4))
            ),
        ),
    ],
    "ex-08-1": [
        ("both valves counted", lambda m, right: right + 1),
        ("none of them", lambda m, right: right - 1),
        ("as a line", lambda m, right: m["n"] - m["first"]),
        ("behind the second", lambda m, right: m["n"] - m["second"]),
        ("up to the second", lambda m, right: m["second"]),
        ("what is left", lambda m, right: m["n"] - right),
    ],
    "ex-08-2": [
        ("no first try", lambda m, right: gap(m, 0)),
        ("no requests", lambda m, right: gap(m, request=0)),
        ("no period", lambda m, right: gap(m, period=0)),
        ("in ms", lambda m, right: 1e3 * right),
        ("the answer added", lambda m, right: right + 32.08e-3),
        ("the gap alone", lambda m, right: right - m["age"]),
    ],
    "ex-08-3": [
        ("a line", lambda m, right: lambda n, cuts: n - min(cuts) if cuts else 0),
        (
            "first two",
            lambda m, right: lambda n, cuts: abs(cuts[1] - cuts[0]) if len(cuts) > 1 else 0,
        ),
        ("last less first", lambda m, right: lambda n, cuts: cuts[-1] - cuts[0] if cuts else 0),
        (
            "both ends counted",
            lambda m, right: lambda n, cuts: max(cuts) - min(cuts) + 1 if len(cuts) > 1 else 0,
        ),
        ("one per cut", lambda m, right: lambda n, cuts: len(cuts)),
        ("no empty list", lambda m, right: lambda n, cuts: max(cuts) - min(cuts)),
    ],
    "ex-08-4": [
        ("one wait", lambda m, right: 2 * right + 9.17),
        ("no request", lambda m, right: right + 9.17),
        ("no round", lambda m, right: 1e3 - 9.17),
        ("in s", lambda m, right: right / 1e3),
        ("a request for each valve", lambda m, right: (2000 - m["n"] * 9.17) / 2 - 9.17),
        ("three waits", lambda m, right: (2000 - m["n"] * 32.08) / 3 - 9.17),
    ],
    "ex-09-1": [
        ("first only", lambda m, right: crisp(m, lambda codes: codes[:1])),
        ("one too few", lambda m, right: crisp(m, lambda codes: codes[1:])),
        ("healthy added", lambda m, right: crisp(m, lambda codes: [*codes, "G1", "Pos2"])),
        (
            "with ramps",
            lambda m, right: [code for code, w in fuzzy(m["readings"]) if w > 0],
        ),
        ("none", lambda m, right: []),
        ("all", lambda m, right: list(ballast.rule_base().codes)),
    ],
    "ex-09-2": [
        ("product", lambda m, right: V1(right, membership(m)[0] * membership(m)[1])),
        ("mean", lambda m, right: V1(right, mean(membership(m)))),
        ("larger", lambda m, right: V1(right, max(membership(m)))),
        ("in percent", lambda m, right: V1(right, 100 * right[0]["ramps"])),
        ("distance from full", lambda m, right: V1(right, 1 - right[0]["ramps"])),
        ("either is enough", lambda m, right: [right[0] | {"printed": 1 - right[0]["printed"]}]),
    ],
    "ex-09-3": [
        (
            "more than k",
            lambda m, right: lambda f, k, n: bits(w.count("1") > k for w in windows(f, n)),
        ),
        ("in a row", lambda m, right: lambda f, k, n: bits("1" * k in w for w in windows(f, n))),
        (
            "without this one",
            lambda m, right: lambda f, k, n: bits(w.count("1") >= k for w in windows(f, n, 0)),
        ),
        (
            "negative start",
            lambda m, right: (
                lambda f, k, n: bits(f[i + 1 - n : i + 1].count("1") >= k for i in range(len(f)))
            ),
        ),
        (
            "only full windows",
            lambda m, right: (
                lambda f, k, n: bits(
                    i + 1 >= n and f[i + 1 - n : i + 1].count("1") >= k for i in range(len(f))
                )
            ),
        ),
        (
            "n and k swapped",
            lambda m, right: lambda f, k, n: bits(w.count("1") >= n for w in windows(f, k)),
        ),
    ],
    "ex-09-4": [
        ("k one too small", lambda m, right: rows(m, lambda n, k, s: row(n, k, k * s))),
        (
            "one burst per window",
            lambda m, right: rows(m, lambda n, k, s: row(n, m["burst"] + 1, m["burst"] * s)),
        ),
        ("delay of k steps", lambda m, right: rows(m, lambda n, k, s: row(n, k + 1, (k + 1) * s))),
        ("delay in readings", lambda m, right: rows(m, lambda n, k, s: row(n, k + 1, k))),
        (
            "delay of the window",
            lambda m, right: rows(m, lambda n, k, s: row(n, k + 1, (n - 1) * s)),
        ),
        ("all of the window", lambda m, right: rows(m, lambda n, k, s: row(n, n, (n - 1) * s))),
    ],
    "ex-10-1": [
        ("saved", lambda m, right: 100 - right),
        ("a share", lambda m, right: right / 100),
        ("one wire per contact", lambda m, right: 2 * right),
        ("one line", lambda m, right: right / m["lines"]),
        ("times fewer", lambda m, right: m["contacts"] / m["lines"]),
        ("a thousandth", lambda m, right: right / 10),
    ],
    "ex-10-2": [
        ("left", lambda m, right: 100 - right),
        ("a share", lambda m, right: right / 100),
        ("of the bus", lambda m, right: (lambda a, b: 100 * (a / b - 1))(*costs(plant(m)))),
        ("spacing 1", lambda m, right: (lambda a, b: 100 * (1 - b / a))(*costs(plant(m, 1)))),
        (
            "one contact",
            lambda m, right: (lambda a, b: 100 * (1 - b / a))(
                *costs(Plant(m["modules"], contacts=1, distance=m["distance"], spacing=4))
            ),
        ),
        ("in EUR", lambda m, right: (lambda a, b: a - b)(*costs(plant(m)))),
    ],
    "ex-10-3": [
        ("from 10 m", lambda m, right: right - 10),
        ("from 30 m", lambda m, right: right + 20),
        (
            "other spacing",
            lambda m, right: (lambda a, b, c, d: 10 + (b - a) / ((c - a - d + b) / 20))(
                *crossing(m, spacing=3 - m["spacing"])
            ),
        ),
        (
            "not divided by 20",
            lambda m, right: (lambda a, b, c, d: 10 + (b - a) / (c - a - d + b))(*crossing(m)),
        ),
        ("middle", lambda m, right: 20),
        (
            "hardwired alone",
            lambda m, right: (lambda a, b, c, d: 10 + (b - a) / ((c - a) / 20))(*crossing(m)),
        ),
    ],
    "ex-10-4": [
        ("cheapest", lambda m, right: choosing(lambda cost, lost, faults, limit: True)),
        (
            "no faults looked at",
            lambda m, right: choosing(lambda cost, lost, faults, limit: lost <= limit),
        ),
        (
            "no limit looked at",
            lambda m, right: choosing(lambda cost, lost, faults, limit: not faults),
        ),
        (
            "less than the limit",
            lambda m, right: choosing(
                lambda cost, lost, faults, limit: lost < limit and not faults
            ),
        ),
        (
            "fewest points",
            lambda m, right: choosing(
                lambda cost, lost, faults, limit: lost <= limit and not faults, lambda row: row[1]
            ),
        ),
        (
            "dearest",
            lambda m, right: choosing(
                lambda cost, lost, faults, limit: lost <= limit and not faults, lambda row: -row[0]
            ),
        ),
    ],
}


def ring_limit(events, size):
    waiting = lost = 0
    for event in events:
        if event == "r":
            waiting = max(0, waiting - 1)
        elif waiting < size:
            waiting += 1
        else:
            lost += 1
    return lost


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
