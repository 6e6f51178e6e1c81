"""Proposals for a plan, differences between plans, and the noise margin."""

from dataclasses import replace
from itertools import combinations, product

import numpy as np
import pytest

from shipnet import asi, datasets
from shipnet.__main__ import main
from shipnet.asi.emc.error_rates import noise_margin
from shipnet.asi.plan import Plan
from shipnet.asi.receiver import RECEIVERS, Receiver
from shipnet.asi.segment import CableRun, Repeater, Supply, Terminator
from shipnet.errors import ArgumentError


def plan_of(cables, slaves, supplies=("a",), **more):
    return Plan(
        [CableRun(*cable) for cable in cables],
        [asi.Master(node="a")],
        [Supply(node) for node in supplies],
        [asi.Slave(str(n), node=node, **more) for n, node in enumerate(slaves, 1)],
    )


# The search against all plans ---------------------------------------------------------------------


def divided(plan):
    """Yield every plan in which one more repeater divides the cables at a node."""
    nodes = sorted({node for run in plan.cables for node in (run.a, run.b)})
    for node in nodes:
        at = [n for n, run in enumerate(plan.cables) if node in (run.a, run.b)]
        new = f"new {len(plan.repeaters)}"
        for size in range(1, len(at)):
            for moved in combinations(at, size):
                cables = list(plan.cables)
                for n in moved:
                    a, b = (new if end == node else end for end in (cables[n].a, cables[n].b))
                    cables[n] = CableRun(a, b, cables[n].length)
                try:
                    yield replace(
                        plan, cables=cables, repeaters=[*plan.repeaters, Repeater(node, new)]
                    )
                except ArgumentError:
                    continue


def supplied(plan):
    """Yield every plan in which each segment without a supply has one, at any of its nodes."""
    bare = [segment for segment in plan.segments if not segment.supplies]
    nodes = [sorted({n for run in s.cables for n in (run.a, run.b)}) for s in bare]
    for chosen in product(*nodes):
        yield replace(plan, supplies=[*plan.supplies, *map(Supply, chosen)])


def fewest(plan, most=2):
    """Return the smallest number of devices that makes a plan legal, by trying all plans."""
    plans = [plan]
    for repeaters in range(most + 1):
        for one in plans:
            for full in supplied(one):
                if full.check().ok:
                    return repeaters + len(full.supplies) - len(plan.supplies)
        plans = [further for one in plans for further in divided(one)]
    return None


SMALL = {
    "legal": plan_of([("a", "b", 60)], ["b"]),
    "no supply": plan_of([("a", "b", 60)], ["b"], ()),
    "two supplies": plan_of([("a", "b", 40), ("b", "c", 40)], ["c"], ("a", "c")),
    "too long": plan_of([("a", "b", 60), ("b", "c", 60)], ["b", "c"]),
    "too long, two supplies": plan_of([("a", "b", 60), ("b", "c", 60)], ["c"], ("a", "c")),
    "supply at the far end": plan_of([("a", "b", 60), ("b", "c", 60)], ["c"], ("c",)),
    "three in a row": plan_of([("a", "b", 90), ("b", "c", 90), ("c", "d", 90)], ["b", "d"]),
    "four in a row": plan_of([(*"ab", 90), (*"bc", 90), (*"cd", 90), (*"de", 90)], ["e"]),
    "star": plan_of([("a", "m", 30), ("m", "b", 45), ("m", "c", 45)], ["b", "c"]),
    "star of two pairs": plan_of(
        [("a", "m", 40), ("m", "b", 50), ("m", "c", 50), ("m", "d", 50)], ["b", "c", "d"]
    ),
    "slave at the branch": plan_of([("a", "m", 55), ("m", "b", 50), ("m", "c", 45)], ["m", "c"]),
    "low voltage": plan_of([("a", "b", 45), ("b", "c", 45)], ["b", "c"], current=1.1),
    "one long cable": plan_of([("a", "b", 130)], ["b"]),
}


@pytest.mark.parametrize("name", SMALL)
def test_no_legal_plan_has_fewer_added_devices(name):
    plan, found = SMALL[name], SMALL[name].improve()
    least = fewest(plan)
    assert (None if not found.plan.check().ok else len(found.added)) == least
    if least is not None:
        devices = len(found.plan.repeaters) + len(found.plan.supplies)
        assert devices - len(plan.repeaters) - len(plan.supplies) == least
        assert found.verdict.endswith("every rule is met")
        assert {s.label: s.node for s in found.plan.slaves} == {
            s.label: s.node for s in plan.slaves
        }
        assert sum(run.length for run in found.plan.cables) == sum(
            run.length for run in plan.cables
        )
    else:
        assert found.plan == plan


@pytest.mark.parametrize("seed", range(8))
def test_random_trees_need_no_fewer_devices(seed):
    rng = np.random.default_rng(seed)
    nodes = "abcde"
    cables = [
        (nodes[rng.integers(n)], nodes[n], float(rng.integers(20, 70)))
        for n in range(1, len(nodes))
    ]
    plan = plan_of(cables, [str(n) for n in rng.choice(list("bcde"), 2)])
    found, least = plan.improve(), fewest(plan)
    # All plans are tried with at most two repeaters, and so with at most four devices.
    enough = found.plan.check().ok and len(found.added) <= 4
    assert (len(found.added) if enough else None) == least


def test_the_300_m_plan_without_its_repeaters_gets_them_back():
    plan = asi.read_plan(datasets.path("synthetic_asi_plan_300m.csv"))
    joined = {one.b: one.a for one in plan.repeaters}
    bare = Plan(
        [replace(r, a=joined.get(r.a, r.a), b=joined.get(r.b, r.b)) for r in plan.cables],
        plan.masters,
        plan.supplies[:1],
        plan.slaves,
    )
    found = bare.improve()
    assert found.plan.check().ok
    assert [one.a for one in found.plan.repeaters] == [one.a for one in plan.repeaters]
    assert len(found.plan.supplies) == len(plan.supplies)


@pytest.mark.parametrize(
    ("rule", "high", "verdict"),
    [
        ("cable_length", np.nan, "no device to add; every rule is met"),
        ("cable_length", 0, "no device to add; stays: cable length at segment at a"),
        ("repeaters_in_series", np.nan, "add repeater b"),
    ],
)
def test_limits_may_be_absent_or_zero(rule, high, verdict):
    limits = asi.rule_limits()
    limits.loc[rule, "high"] = high
    plan = plan_of([("a", "b", 60), ("b", "c", 60)], ["b", "c"])
    found = plan.improve(limits=limits)
    assert found.verdict.startswith(verdict)


def test_limits_that_lack_a_rule_are_refused():
    with pytest.raises(ArgumentError, match="limits lack supplies"):
        plan_of([("a", "b", 9)], ["b"]).improve(limits=asi.rule_limits().drop(index="supplies"))


def test_what_no_device_cures_stays_and_is_named():
    found = plan_of([("a", "b", 130)], ["b"]).improve()
    assert found.verdict == "no device to add; stays: cable length at segment at a"
    doubled = plan_of([("a", "b", 60), ("b", "c", 60)], ["b", "c"])
    slaves = [replace(one, label="7") for one in doubled.slaves]
    found = replace(doubled, slaves=slaves).improve()
    assert len(found.added) == 2
    assert "cures cable length; stays: sharing at slave 7" in found.verdict
    weak = replace(doubled, supplies=[Supply("a", voltage=24)])
    assert "supply voltage" in weak.improve().verdict
    headless = replace(doubled, masters=[])
    assert headless.improve().plan == headless
    ring = asi.ring(130, 4)
    assert ring.improve().plan == ring


def test_own_limits_and_terminators_count():
    plan = plan_of([("a", "b", 60), ("b", "c", 60)], ["b", "c"])
    limits = asi.rule_limits()
    limits.loc["cable_length", "high"] = 120
    before = limits.copy()
    assert plan.improve(limits=limits).added.empty
    assert limits.equals(before)
    assert replace(plan, terminators=[Terminator("c")]).improve().added.empty


def test_a_hopeless_plan_ends_after_a_bounded_search():
    found = asi.line(100, 40, current=0.9).improve()
    assert found.verdict.startswith("no device to add found in 2000 tries; stays: ")


def test_reasons_are_notes_of_the_saved_plan_and_old_notes_stay(tmp_path):
    plan = plan_of([("a", "b", 60), ("b", "c", 60)], ["b", "c"])
    plan = replace(plan, notes={("cable", "a", "b"): "tray 4"})
    found = plan.improve()
    found.plan.save(tmp_path / "better.csv")
    again = asi.read_plan(tmp_path / "better.csv")
    assert again == found.plan
    assert sorted(again.notes.values()) == ["added: cable length", "added: supplies", "tray 4"]
    assert found.added["because of"].tolist() == ["cable length", "supplies"]


def test_the_command_writes_the_proposal(tmp_path, capsys):
    path, better = tmp_path / "plan.csv", tmp_path / "better.csv"
    plan_of([("a", "b", 60), ("b", "c", 60)], ["b", "c"]).save(path)
    assert main(["check", str(path), "--improve", str(better)]) == 1
    assert "proposal: add repeater b | b (2), supply at b" in capsys.readouterr().out
    assert main(["check", str(better)]) == 0
    assert main(["check", str(path), str(path), "--improve", str(better)]) == 2
    assert "--improve requires one file" in capsys.readouterr().err


# A doubled address --------------------------------------------------------------------------------


def test_both_slaves_of_a_doubled_address_are_named():
    plan = plan_of([("a", "b", 30), ("b", "c", 30)], ["b", "c"])
    plan = replace(plan, slaves=[replace(one, label="7") for one in plan.slaves])
    (line,) = [line for line in plan.check().broken if line.startswith("sharing")]
    assert "slave 7 at b" in line
    assert "slave 7 at c" in line


# Differences --------------------------------------------------------------------------------------


def changes(old, new):
    return sorted(map(tuple, old.diff(new).to_numpy().tolist()))


def test_a_difference_names_what_was_added_removed_moved_and_changed():
    old = plan_of([("a", "b", 30), ("b", "c", 30)], ["b", "c"])
    assert changes(old, old) == []
    one, two = old.slaves
    moved = replace(old, slaves=[replace(one, node="c"), two])
    assert changes(old, moved) == [("slave 1 at b", "changed", "node b -> c")]
    readdressed = replace(old, slaves=[replace(one, label="9"), two])
    assert changes(old, readdressed) == [("slave 1 at b", "changed", "label 1 -> 9")]
    longer = replace(old, cables=[CableRun("a", "b", 45), old.cables[1]])
    assert changes(old, longer) == [("cable a - b", "changed", "length 30.0 -> 45.0")]
    supply = replace(old, supplies=[Supply("c", rating=4)])
    assert changes(old, supply) == [("supply at a", "changed", "node a -> c, rating 8.0 -> 4.0")]
    fewer = replace(old, slaves=[one])
    assert changes(old, fewer) == [("slave 2 at c", "removed", "")]
    assert changes(fewer, old) == [("slave 2 at c", "added", "")]
    swapped = replace(old, slaves=[replace(one, node="c"), replace(two, node="b")])
    assert changes(old, swapped) == [
        ("slave 1 at b", "changed", "node b -> c"),
        ("slave 2 at c", "changed", "node c -> b"),
    ]
    doubled = replace(old, slaves=[one, two, two])
    assert changes(old, doubled) == [("slave 2 at c", "added", "")]


# The noise margin ---------------------------------------------------------------------------------

WAVE = asi.line(100, slaves=(5, 100)).waveform()


@pytest.mark.parametrize("name", ["noise-proof", "unfiltered"])
def test_noise_below_the_margin_changes_no_decision_and_noise_above_it_does(name):
    # Without a filter, the worst noise can be added to the samples on which the receiver decides.
    one = replace(RECEIVERS[name], matched=False, window=0.0)
    margin = noise_margin(WAVE, one)
    bits, u = WAVE.records
    received = one.receive(replace(WAVE, u=u, bits=bits, names=()))
    half = round(3e-6 / WAVE.dt)
    first = np.rint(received.start / WAVE.dt).astype(int) + half + half // 2

    def wrong(amplitude):
        lost = 0
        for row in range(len(u)):
            for slot in range(bits.shape[1] * 2 + 1):
                for signs in product((-1, 1), repeat=2):
                    noisy = u[row] - u[row].mean()
                    at = first[row] + slot * half
                    for place, sign in zip((first[row], at), signs, strict=True):
                        if place < len(noisy):
                            noisy[place] += sign * amplitude
                    heard = one.receive(
                        replace(WAVE, u=noisy[None], bits=bits[row : row + 1], names=())
                    )
                    lost += bool(heard.error[0]) or (heard.bits[0] != bits[row]).any()
        return lost

    assert 0 < margin < one.minimum
    assert wrong(0.97 * margin) == 0
    assert wrong(1.05 * margin) > 0


def test_a_false_start_limits_the_margin_of_a_sensitive_receiver():
    one = replace(RECEIVERS["sensitive"], matched=False, window=0.0)
    bits, u = WAVE.records
    for factor, errors in ((0.95, 0), (1.1, len(u))):
        noisy = u - u.mean(axis=1, keepdims=True)
        noisy[:, 8] += factor * noise_margin(WAVE, one)
        heard = one.receive(replace(WAVE, u=noisy, bits=bits, names=()))
        assert np.count_nonzero((heard.error != 0) | (heard.bits != bits).any(axis=1)) == errors


def test_the_margin_by_hand_and_its_limits():
    table = asi.line(100, slaves=(5, 100)).error_rates(0.3e-3)
    for (_, name), row in table.iterrows():
        assert 0 < row["margin_V"] <= row["minimum_V"] == RECEIVERS[name].minimum
    assert noise_margin(WAVE, Receiver(minimum=0.45)) == 0.45
    least = min(
        noise_margin(replace(WAVE, u=u, names=()), RECEIVERS["noise-proof"]) for u in WAVE.u
    )
    assert noise_margin(WAVE, RECEIVERS["noise-proof"]) == least
    with pytest.raises(ArgumentError, match="without an error"):
        noise_margin(WAVE, Receiver(minimum=5.0))
