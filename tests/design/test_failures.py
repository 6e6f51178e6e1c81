"""Single failures of planned designs, compared with one graph search per failure."""

from dataclasses import replace

import networkx as nx
import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from shipnet.design.designs import Design
from shipnet.design.failures import FAILURES, Reach, lost, single_failures, worst
from shipnet.design.iolist import IoList
from shipnet.design.layout import Site, frame
from shipnet.design.planning import OPTIONS, plan
from shipnet.design.settings import Settings
from shipnet.errors import ArgumentError
from tests.design.lists import ship, small_loop

JOINS = {"cabinet", "master"}


def searched(design, cut=(), dead=(), needs=None):
    """Walk from the cabinet and from each supply, one line at a time in each bus.

    An AS-i line carries telegrams only where it is powered; `needs` contains the devices that
    do not work without power.
    """
    devices = {row.device: row for row in design.devices.itertuples()}
    kind = {name: row.kind for name, row in devices.items()}
    dead = set(dead)
    while True:
        shells = [name for name in dead if kind[name] in ("box", "cabinet")]
        more = {name for name, row in devices.items() if row.at in shells} - dead
        if not more:
            break
        dead |= more
    if design.cabinet in dead:
        return set()
    graph, power, auxiliary = nx.Graph(), nx.Graph(), nx.Graph()
    auxiliary.add_nodes_from(kind)
    lines_of_as_i = []
    unfed = set()
    for each in (graph, power):
        each.add_nodes_from((name, line) for name in kind for line in "AB")
    for name in (name for name in kind if kind[name] in JOINS):
        graph.add_edge((name, "A"), (name, "B"))
    blocked = {name for name in dead if kind[name] in JOINS | {"box", "repeater"}}

    def join(graph, a, b, lines):
        if not {a, b} & blocked:
            graph.add_edges_from([((a, line), (b, line)) for line in lines])

    wires = []
    buses = dict(zip(design.segments["segment"], design.segments["bus"], strict=True))
    for run in design.cables.itertuples():
        if run.kind in ("drop", "home run"):
            wires.append((run.a, run.b, run.run))
            continue
        if run.run in cut:
            continue
        ends = {kind[run.a], kind[run.b]}
        asi, lines = buses.get(run.segment) == "AS-i", run.line or "AB"
        if asi and run.kind == "trunk":
            lines_of_as_i.append((run.a, run.b, lines))
        elif run.kind == "trunk":
            join(graph, run.a, run.b, lines)
        if asi and run.kind == "trunk" and kind[run.b] != "repeater":
            join(power, run.a, run.b, lines)
        if run.kind == "feeder" and not asi and "cabinet" not in ends:
            join(power, run.a, run.b, lines)
        mains = bool(ends & {"cabinet", "supply"})
        if run.kind == "feeder" and asi and not mains and not {run.a, run.b} & blocked:
            auxiliary.add_edge(run.a, run.b)
    for run in design.cables.itertuples():
        if run.kind == "feeder" and run.run in cut and design.cabinet in (run.a, run.b):
            unfed |= {name for name in (run.a, run.b) if kind[name].endswith("supply")}
    for name, row in devices.items():
        hangs_on = row.at
        if not hangs_on:
            continue
        if row.kind in ("supply", "repeater"):
            line = ("master", row.segment, row.line)
            masters = [d.device for d in devices.values() if (d.kind, d.segment, d.line) == line]
            if hangs_on == design.cabinet and masters:
                hangs_on = masters[-1]
        beside = (row.kind, kind[hangs_on]) == ("repeater", "master")
        if beside and buses.get(devices[hangs_on].segment) == "AS-i":
            lines_of_as_i.append((name, hangs_on, "AB"))
        else:
            join(graph, hangs_on, name, "AB")
        if row.kind == "supply":
            join(power, hangs_on, name, "AB")
    supplied = set()
    live = kind.keys() - dead - unfed
    for name in (name for name in live if kind[name] == "supply"):
        for line in "AB":
            supplied |= {n for n, _ in nx.node_connected_component(power, (name, line))}
    for a, b, lines in lines_of_as_i:
        end = a if kind[b] == "repeater" else b
        if end in supplied or needs is None or end not in needs:
            join(graph, a, b, lines)
    reached = {name for name, _ in nx.node_connected_component(graph, (design.cabinet, "A"))}
    alive = reached - dead
    outputs = set()
    for name in (name for name in live if kind[name] == "auxiliary supply"):
        outputs |= nx.node_connected_component(auxiliary, name)
    return alive, supplied, outputs, wires


def points_reached(design, needs, cut=(), dead=()):
    found = searched(design, cut, dead, needs[0])
    if not found:
        return set()
    alive, supplied, auxiliary, wires = found
    points = design.iolist.points
    outputs = set(points.loc[points["type"] == "DO", "tag"])
    alive = {name for name in alive if name in supplied or name not in needs[0]}
    works = {run: device in alive and run not in cut for device, _, run in wires}
    fed = {run: device in auxiliary or device not in needs[1] for device, _, run in wires}
    return {tag for _, tag, run in wires if works[run] and (fed[run] or tag not in outputs)}


def random_network(rng, n_devices=9, n_points=12):
    """Return devices and cables at random: buses, boxes, repeaters, supplies, loops and gaps."""
    segments = ["s1", "s2", "s3"]
    buses = list(rng.choice(["AS-i", "CAN", "hardwired"], 3))
    every = [*"module station box master repeater supply".split(), "auxiliary supply"]
    kinds = rng.choice(every, n_devices, p=[0.25, 0.2, 0.1, 0.15, 0.1, 0.1, 0.1])
    devices = [{"device": "cabinet", "kind": "cabinet", "segment": "", "at": ""}]
    for n, kind in enumerate(kinds):
        housing = "cabinet" if kind in ("master", "supply") else devices[-1]["device"]
        row = {"device": f"d{n}", "kind": kind, "at": housing if rng.random() < 0.6 else ""}
        devices.append({**row, "segment": str(rng.choice(segments))})
    names = [device["device"] for device in devices]
    table = pd.DataFrame(devices).assign(x_m=0.0, y_m=0.0, z_m=0.0)
    runs = []
    for _ in range(int(rng.integers(n_devices, 2 * n_devices))):
        a, b = rng.choice(names, 2, replace=False)
        runs.append((str(a), str(b), str(rng.choice(["trunk", "trunk", "feeder"]))))
    tags = [f"p{n}" for n in range(n_points)]
    for tag in tags:
        runs += [(str(rng.choice(names)), tag, "drop") for _ in range(int(rng.integers(0, 3)))]
    table_of_runs = pd.DataFrame(runs, columns=["a", "b", "kind"]).assign(
        run=[f"r{n}" for n in range(len(runs))],
        cable="MI1P075",
        segment=rng.choice(segments, len(runs)),
        route_m=1.0,
        length_m=1.0,
        used=2,
        conductors=2,
        at_cabinet=False,
        line=rng.choice(["", "A", "B"], len(runs)),
    )
    points = pd.DataFrame({"tag": tags, "signal": ["contact", "solenoid"] * (n_points // 2)})
    iolist = IoList.from_table(
        points.assign(system=rng.choice(["x", "y"], n_points), home_run_m=1.0)
    )
    counts = dict.fromkeys(("points", "devices"), 0)
    unknown = dict.fromkeys(
        ("length_m", "bus_time", "capacity_used", "response_ms", "slowest_update_ms"), 0.0
    )
    wired = points[["tag"]].assign(bus="CAN", segment="s1", device="", address="", response_ms=1.0)
    return Design(
        "random",
        iolist,
        Site((0, 0, 0)),
        points=frame("points", wired.assign(fits=True)),
        devices=table,
        cables=frame("cables", table_of_runs),
        segments=frame("segments", {"segment": segments, "bus": buses, **counts, **unknown}),
        reasons=frame("reasons"),
    )


def shorted(design, name):
    """Return the runs disabled by a short of one of them, found by a walk from run to run."""
    runs = design.cables.set_index("run")
    kind = design.devices.set_index("device")["kind"]
    first = runs.loc[name]
    parts = {"repeater"} if first["kind"] == "trunk" else {"cabinet"}
    same = runs[
        (runs[["kind", "segment", "line"]] == first[["kind", "segment", "line"]]).all(axis=1)
    ]
    taken, waiting = {name}, [name]
    while waiting:
        ends = {end for end in runs.loc[waiting.pop(), ["a", "b"]] if kind[end] not in parts}
        more = set(same.index[same["a"].isin(ends) | same["b"].isin(ends)]) - taken
        taken |= more
        waiting += more
    return sorted(taken)


def masters_at(design, runs):
    """Return the AS-i masters to which some trunks are connected."""
    kind = design.devices.set_index("device")["kind"]
    buses = design.segments.set_index("segment")["bus"]
    own = design.cables[design.cables["run"].isin(runs) & (design.cables["kind"] == "trunk")]
    own = own[own["segment"].map(buses) == "AS-i"]
    return [name for name in {*own["a"], *own["b"]} if kind[name] == "master"]


@settings(max_examples=8)
@given(st.integers(0, 10**6))
def test_every_single_failure_costs_the_points_that_a_search_finds(seed):
    design = random_network(np.random.default_rng(seed))
    table = single_failures(design)
    needs = searched(design)[1:3]
    before = points_reached(design, needs)
    system = design.iolist.points.set_index("tag")["system"]
    for failure, names in (("cut", design.cables["run"]), ("device", design.devices["device"])):
        assert table.loc[table["failure"] == failure, "failed"].tolist() == names.tolist()
    for row in table.itertuples():
        together = shorted(design, row.failed) if row.failure == "short" else []
        cut = {"cut": [row.failed], "device": [], "short": together}[row.failure]
        dead = [row.failed] if row.failure == "device" else []
        if row.failure == "short":
            dead = masters_at(design, together)
        gone = before - points_reached(design, needs, cut, dead)
        assert set(row.tags) == gone, row
        assert row.points_lost == len(gone)
        assert set(row.systems) == {system[tag] for tag in gone}


@settings(max_examples=20)
@given(st.integers(0, 10**6))
def test_simultaneous_failures_cost_the_points_that_a_search_finds(seed):
    rng = np.random.default_rng(seed)
    design = random_network(rng)
    cut = list(rng.choice(design.cables["run"], 3, replace=False))
    dead = list(rng.choice(design.devices["device"], 1))
    needs = searched(design)[1:3]
    gone = points_reached(design, needs) - points_reached(design, needs, cut, dead)
    assert set(lost(design, cables=cut, devices=dead)) == gone


def mangled(design, rng):
    """Return a design with some cable ends moved and the kinds of some devices changed."""
    devices, cables = design.devices.copy(), design.cables.copy()
    for _ in range(rng.integers(0, 6)):
        device, cable, what = (rng.integers(n) for n in (len(devices), len(cables), 4))
        name = rng.choice(devices["device"])
        if what == 0 or (what == 1 and cables["kind"][cable] not in ("drop", "home run")):
            cables.loc[cable, "ab"[what]] = name
        elif what == 2:
            devices.loc[device, "at"] = name
        elif devices["kind"][device] != "cabinet":
            devices.loc[device, "kind"] = rng.choice(["box", "station", "master", "supply"])
    return replace(design, devices=devices, cables=cables)


@pytest.mark.parametrize("option", OPTIONS)
@settings(max_examples=3)
@given(seed=st.integers(0, 10**6))
def test_failures_computed_together_give_the_same_losses_as_alone(option, seed):
    """Failures of several areas are computed together."""
    rng = np.random.default_rng(seed)
    limits = Settings({"fed": bool(rng.integers(4))})
    site = Site((26.0, 6.0, 14.0))
    reach = Reach(mangled(plan(ship(60, seed), site, option, settings=limits), rng))
    failures = [((run,), ()) for run in range(len(reach.design.cables))]
    failures += [*reach.shorts(), *(((), (device,)) for device in range(len(reach.design.devices)))]
    alone = [reach.lost([failure])[0].tolist() for failure in failures]
    assert [points.tolist() for points in reach.lost(failures)] == alone


def test_a_short_costs_one_line_between_two_repeaters():
    design = small_loop()
    assert single_failures(design).query("failure == 'short'")["points_lost"].tolist() == [4]
    kinds = design.devices["kind"].where(design.devices["device"] != "JB1", "repeater")
    split = replace(design, devices=design.devices.assign(kind=kinds))
    shorts = single_failures(split).query("failure == 'short'")
    assert shorts["failed"].tolist() == ["trunk 1", "trunk 2"]
    assert shorts["points_lost"].tolist() == [4, 2]


def test_a_short_of_a_feeder_costs_all_stations_on_the_same_supply():
    iolist = IoList.parse(
        "tag,signal,x,y,z\n" + "\n".join(f"P-{n},contact,{20 * n},0,0" for n in range(1, 5))
    )
    for lines, (option, costs) in enumerate((("CAN", 4), ("CAN doubled", 0)), 1):
        design = plan(iolist, Site((0, 0, 0)), option)
        shorts = single_failures(design).query("failure == 'short' and kind == 'feeder'")
        assert shorts["points_lost"].tolist() == [costs] * lines
        cuts = single_failures(design).query("failure == 'cut' and kind == 'feeder'")
        assert cuts["points_lost"].max() == costs


def test_outputs_of_as_i_need_the_auxiliary_supply_and_inputs_do_not():
    iolist = IoList.parse("tag,signal,x,y,z\nV,solenoid,30,0,0\nP,contact,60,0,0")
    design = plan(iolist, Site((0, 0, 0)), "AS-i")
    assert lost(design, devices=["AS-i 1 auxiliary supply"]) == ("V",)
    table = single_failures(design)
    feeder = table[table["kind"] == "feeder"]
    assert feeder["failure"].tolist() == ["cut", "short"]
    assert feeder["tags"].tolist() == [("V",), ("V",)]


def test_an_as_i_line_without_current_costs_everything_downstream_too():
    """Master and repeaters are powered by the line on which they send, as in `shipnet.asi.plan`."""
    iolist = IoList.parse(
        "tag,signal,x,y,z\nA,contact,20,0,0\nB,contact,120,0,0\nC,contact,200,0,0"
    )
    design = plan(iolist, Site((0, 0, 0)), "AS-i")
    assert design.segments["repeaters"].tolist() == [2]
    supplies = design.devices.query("kind == 'supply'")["device"]
    assert [lost(design, devices=[supply]) for supply in supplies] == [
        ("A", "B", "C"),
        ("B", "C"),
        ("C",),
    ]
    feeders = single_failures(design).query("kind == 'feeder'")
    assert feeders["failure"].tolist() == ["cut", "cut", "short", "short"]
    assert feeders["tags"].tolist() == 2 * [("B", "C"), ("C",)]


def test_a_repeater_beside_the_master_fails_with_its_line():
    """The line leaves the master on one side; a repeater at its terminals serves the other."""
    iolist = IoList.parse("tag,signal,x,y,z\nA,contact,80,0,0\nB,contact,-80,0,0")
    design = plan(iolist, Site((0, 0, 0)), "AS-i")
    devices = design.devices.set_index("device")
    assert devices.query("kind == 'repeater' and at == 'cabinet'").index.tolist() == [
        "AS-i 1 repeater"
    ]
    assert "feeder" not in set(design.cables["kind"])  # its supply is in the cabinet too
    assert lost(design, devices=["AS-i 1 repeater"]) == ("A",)
    assert lost(design, devices=["AS-i 1 supply"]) == ("A", "B")
    shorts = single_failures(design).query("failure == 'short' and kind == 'trunk'")
    assert shorts["tags"].tolist() == [("A", "B"), ("A",)]


def test_two_lines_are_lost_only_if_both_are_cut():
    design = small_loop(redundant=True)
    table = single_failures(design)
    trunk = table[table["kind"] == "trunk"]
    assert set(trunk["failure"]) == {"cut", "short"}
    assert trunk["points_lost"].max() == 0
    assert lost(design, cables=["trunk 2A", "trunk 1B"]) == ("TT-3", "LS-4")
    assert lost(design, cables=["trunk 1A", "trunk 1B"]) == tuple(design.points["tag"])


def test_the_worst_failures_leave_out_the_cabinet():
    table = worst(single_failures(small_loop()))
    assert table["failure"].tolist() == list(FAILURES)
    assert table["points_lost"].tolist() == [4, 4, 4]
    assert table["failed"].tolist() == ["trunk 1", "trunk 1", "master"]
    assert "cabinet" not in set(table["kind"])


def test_unknown_cables_and_devices_are_refused():
    with pytest.raises(ArgumentError, match=r"no cable 'trunk 9', no device 'JB9'"):
        lost(small_loop(), cables=["trunk 9"], devices=["JB9"])


def test_a_network_without_points_or_cables_loses_nothing():
    design = small_loop()
    none = IoList(design.iolist.points.iloc[:0].reset_index(drop=True), "")
    empty = replace(design, iolist=none, points=frame("points"), cables=frame("cables"))
    table = single_failures(empty)
    assert table["failure"].unique().tolist() == ["device"]
    assert table["points_lost"].sum() == 0
    assert lost(empty) == ()
