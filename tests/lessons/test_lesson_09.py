"""Lesson 9: its right answers by a second route."""

from itertools import pairwise

import numpy as np
import pytest

from shipnet.exercises.exercise import exercise
from tests.lessons.students import solved


def right(key, **numbers):
    return solved(key, **numbers).value


def printed(FP, OP, MC, OT, VPos, DVPos):
    """Return the codes that hold, from the table as the article prints it."""
    table = {
        "G1": FP > 120 and MC == 0,
        "P1": FP > 120 and MC > 2.5,
        "P2": FP < 2.5 and 0 < MC < 2.5,
        "V1": FP > 120 and OP >= 2.5,
        "V2": 0 < OP < 2.5 and DVPos == 0,
        "S1": MC == 0 and VPos > 100,
        "S2": MC == 0 and VPos < 0,
        "O1": OT >= 90,
        "Pos1": 0 < OP < 2.5 and MC == 0 and VPos > 100,
        "Pos2": 0 < OP < 2.5 and MC == 0 and VPos < 0,
        "Pos3": VPos > 100,
        "Pos4": VPos < 0,
    }
    return {code for code, holds in table.items() if holds}


def test_everybodys_readings_fire_two_rules_or_more():
    for readings in exercise("ex-09-1").draws["readings"]:
        codes = right("ex-09-1", readings=readings)
        assert codes == printed(**readings)
        assert len(codes) >= 2


def test_the_strength_is_read_off_the_ramps_of_the_figure():
    draws = exercise("ex-09-2").draws
    for FP in draws["FP"]:
        for OP in draws["OP"]:
            ramps = np.interp(FP, [115, 125], [0, 1]), np.interp(OP, [2, 3], [0, 1])
            (row,) = right("ex-09-2", FP=FP, OP=OP)
            assert row["ramps"] == pytest.approx(min(ramps), rel=1e-12)
            assert row["printed"] == (FP > 120 and OP >= 2.5) == (row["ramps"] >= 0.5)
            assert abs(ramps[0] - ramps[1]) > 0.04  # each mistake gives another number


def test_persistence_is_a_moving_sum():
    persistent = solved("ex-09-3").value
    rng = np.random.default_rng(2026)
    for k, n in ((1, 1), (2, 3), (3, 5), (5, 5), (4, 9)):
        fires = rng.integers(0, 2, 40)
        sums = np.convolve(fires, np.ones(n, int))[: fires.size]
        assert persistent("".join(map(str, fires)), k, n) == "".join(
            map(str, (sums >= k).astype(int))
        )


def test_the_smallest_k_is_one_more_than_the_worst_window_contains():
    draws = exercise("ex-09-4").draws
    for burst in draws["burst"]:
        for period in draws["period"]:
            rows = right("ex-09-4", burst=burst, period=period, step=100)
            for row in rows:
                # A window that begins with a burst is the worst: whole periods, then the rest.
                whole, rest = divmod(row["n"], period)
                worst = whole * burst + min(rest, burst)
                assert (row["k"], row["delay"]) == (worst + 1, 100 * worst)
            assert all(a["delay"] < b["delay"] for a, b in pairwise(rows))
