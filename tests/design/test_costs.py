from collections import Counter
from dataclasses import replace
from fractions import Fraction
from math import ceil

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import triang

from shipnet import datasets
from shipnet.design.catalogue import Assumptions, cables, values_at
from shipnet.design.costs import (
    CABLE_RANGES,
    FIGURES,
    Model,
    bill_table,
    conductors_at_cabinet,
    draw,
    quantities,
    tornado,
)
from shipnet.design.designs import Design
from shipnet.design.iolist import IoList, read_iolist
from shipnet.design.layout import Site, frame
from shipnet.design.planning import OPTIONS as OPTIONS_OF_A_PLAN
from shipnet.design.planning import plan
from shipnet.design.plant import Plant
from shipnet.design.settings import Settings
from shipnet.errors import ArgumentError
from shipnet.signals import hardwired_conductors
from tests.design.lists import rows_of, small_loop

PLANT = Plant(modules=20, contacts=3, lines=2, distance=40, spacing=3)
OPTIONS = {"hardwired": PLANT.hardwired, "AS-i": PLANT.on_asi}
COSTS = ["cable_cost_eur", "hardware_cost_eur", "labour_cost_eur"]


def mixed():
    """Return a design with every kind of device, and points of both types on every bus."""
    kinds = {"hardwired": "box", "AS-i": "module", "CAN": "station", "Modbus RTU": "station"}
    iolist = Plant(modules=5, contacts=2).iolist
    points = iolist.points.assign(type=["AI", "DI", "AO", "DO", "AO", "DI", "AI", "DI", "AI", "DI"])
    rows, devices, segments = [], ["cabinet,cabinet,"], []
    for tag, bus in zip(points["tag"], np.repeat([*kinds, ""], 2), strict=True):
        device = f"{kinds[bus]} of {bus}" if bus else ""
        rows.append(f"{tag},{bus},{bus.removeprefix('hardwired')},{device},,1.0,{bus != ''}")
    for bus, kind in kinds.items():
        more = ("master", "supply", "repeater", "terminator") if kind != "box" else ()
        segment = "" if kind == "box" else bus
        devices += [f"{one} of {bus},{one},{segment}" for one in (kind, *more)]
        segments += [f"{bus},{bus}"] * (kind != "box")
    runs = "one,cabinet,box of hardwired,trunk,5,True\n"
    runs += f"two,box of hardwired,{points['tag'][0]},drop,3,False"
    fixed = dict.fromkeys(
        ("bus_time", "capacity_used", "response_ms", "slowest_update_ms", "length_m"), 1.0
    )
    return Design(
        "mixed",
        replace(iolist, points=points),
        Site((0, 0, 0)),
        rows_of("points", "tag,bus,segment,device,address,response_ms,fits\n" + "\n".join(rows)),
        rows_of("devices", "device,kind,segment\n" + "\n".join(devices), x_m=0, y_m=0, z_m=0),
        rows_of(
            "cables",
            f"run,a,b,kind,used,at_cabinet\n{runs}",
            cable="MI4P075",
            segment="",
            route_m=8.0,
            length_m=10.0,
            line="",
            conductors=8,
        ),
        rows_of("segments", "segment,bus\n" + "\n".join(segments), points=2, devices=1, **fixed),
        frame("reasons"),
    )


MIXED = mixed()
SIZES = pd.read_csv(datasets.path("estimated_cables.csv"), index_col="cable_id")
SIZES = SIZES[["diameter_mm", "height_mm"]]


def priced(design, **ranges):
    """Return a design with other prices, hours or factors."""
    return design.priced(design.settings.replace({"assumptions": ranges}))


def by_hand(design, level):
    """Add up the figures cable by cable and device by device, independently of the bill."""
    assumed = {name: getattr(one, level) for name, one in Assumptions().items()}
    catalogue = cables()
    total = dict.fromkeys(
        [*COSTS, "cable_mass_kg", "cable_volume_l", "labour_h", "cross_section_cm2"], 0.0
    )
    for run in design.cables.itertuples():
        cable = catalogue[run.cable]
        length = run.length_m * assumed["laid_length"]
        width, height = SIZES.loc[run.cable] / 1e3
        area = np.pi / 4 * width**2 if np.isnan(height) else width * height
        area *= assumed["cable_diameter"] ** 2
        total["cable_mass_kg"] += length * getattr(cable.mass, level)
        total["cable_volume_l"] += 1000 * length * area
        total["cross_section_cm2"] += 1e4 * area * run.at_cabinet
        total["cable_cost_eur"] += length * getattr(cable.price, level)
        total["labour_h"] += length * getattr(cable.lay, level)
        total["labour_h"] += 2 * run.used * getattr(cable.termination, level)
        total["labour_h"] += 2 * assumed["gland_time"]
        total["hardware_cost_eur"] += 2 * assumed["gland"]
    types = dict(zip(design.points["tag"], design.iolist.points["type"], strict=True))
    channels = Counter()
    for point in design.points.itertuples():
        kind = "digital" if types[point.tag][0] == "D" else "analogue"
        where = {"hardwired": "plc", "CAN": "station", "Modbus RTU": "station"}.get(point.bus)
        if where:
            channels[f"{where}_{kind}_channel"] += 1
    spare = Fraction(str(design.settings.spare))
    for name, used in channels.items():
        total["hardware_cost_eur"] += ceil(used * (1 + spare)) * assumed[name]
    bus_of = dict(zip(design.segments["segment"], design.segments["bus"], strict=True))
    words = {"AS-i": "asi", "CAN": "can", "Modbus RTU": "modbus"}
    for device in design.devices.itertuples():
        kind, bus = device.kind, words.get(bus_of.get(device.segment))
        if kind == "cabinet":
            continue
        price = f"{bus}_{kind}" if kind in ("module", "station", "master") else kind
        if kind == "supply" and bus == "asi":
            price = "asi_supply"
        if kind == "module":
            ends = set(design.cables.loc[design.cables["a"] == device.device, "b"])
            ends |= set(design.points.loc[design.points["device"] == device.device, "tag"])
            types_at_run = [types[tag] for tag in ends & types.keys()]
            price = "asi_analogue_module" if {"AI", "AO"} & set(types_at_run) else price
        price = "supply" if kind == "auxiliary supply" else price
        total["hardware_cost_eur"] += assumed[price]
        reached = {
            r.line
            for r in design.cables.itertuples()
            if r.kind == "trunk" and device.device in (r.a, r.b)
        }
        if kind == "station" and {"A", "B"} <= reached:
            total["hardware_cost_eur"] += assumed["second_interface"]
        slow = {
            "box": "box",
            "module": "module",
            "station": "station",
            "master": "master",
        }.get(kind, "part")
        total["labour_h"] += assumed[f"{slow}_time"]
    total["labour_cost_eur"] = total["labour_h"] * assumed["labour_rate"]
    return total | {"total_cost_eur": sum(total[cost] for cost in COSTS)}


@pytest.mark.parametrize("level", ["low", "nominal", "high"])
@pytest.mark.parametrize("design", [*OPTIONS.values(), MIXED], ids=lambda n: n.name)
def test_every_figure_is_the_sum_over_single_cables_and_devices(design, level):
    table = quantities(design).figures
    for figure, value in by_hand(design, level).items():
        assert table.loc[figure, level] == pytest.approx(value, rel=1e-12), figure


@pytest.fixture(scope="module")
def ship():
    """Every sixth point of the example ship."""
    iolist = read_iolist(datasets.path("synthetic_iolist_ship.csv"))
    return replace(iolist, points=iolist.points.iloc[::6].reset_index(drop=True))


@pytest.mark.parametrize("option", OPTIONS_OF_A_PLAN)
def test_planned_networks_are_summed_in_the_same_way(ship, option):
    design = plan(ship, Site((22.0, 0.0, 14.0)), option)
    table = quantities(design).figures
    for figure, value in by_hand(design, "high").items():
        assert table.loc[figure, "high"] == pytest.approx(value, rel=1e-12), figure
    if option in ("home runs", "junction boxes"):
        wired = hardwired_conductors(ship.counts)
        assert table.loc["conductors_at_cabinet", "nominal"] == wired


def test_a_station_with_two_lines_costs_a_second_interface(ship):
    one, two = (plan(ship, Site((22.0, 0.0, 14.0)), way) for way in ("CAN", "CAN doubled"))
    stations = int((two.devices["kind"] == "station").sum())
    assert Model(two).items["second_interface"] == stations > 1
    assert "second_interface" not in Model(one).items
    table = quantities(two).figures
    for figure, value in by_hand(two, "low").items():
        assert table.loc[figure, "low"] == pytest.approx(value, rel=1e-12), figure


def test_the_planner_wires_the_plants_of_the_papers_with_as_many_conductors():
    for plant, wired in ((Plant(62, 4), 496), (Plant(190, 1, 14), 380)):
        planned = plan(plant.iolist, Site((0.0, 0.0, 0.0)), "home runs")
        assert conductors_at_cabinet(planned) == wired
        assert planned.cables["length_m"].sum() == pytest.approx(
            plant.hardwired.cables["length_m"].sum()
        )


def test_counts_are_exact_and_have_no_range():
    table = quantities(MIXED).figures
    assert list(table.index) == list(FIGURES)
    assert table["unit"].to_dict() == {name: unit for name, (_, unit) in FIGURES.items()}
    counts = {"conductors_at_cabinet": 5, "conductors_laid": 16, "cables": 2, "terminations": 16}
    for figure, count in counts.items():
        assert table.loc[figure, ["low", "nominal", "high"]].tolist() == [count] * 3
    others = table.drop(index=list(counts))
    assert (others["low"] < others["nominal"]).all()
    assert (others["nominal"] < others["high"]).all()


def test_points_that_are_left_out_are_reported():
    result = quantities(MIXED)
    assert result.unconnected == 2
    assert "2 points not connected" in repr(result)
    assert "not connected" not in repr(quantities(PLANT.on_asi))


def test_only_assumptions_in_use_are_listed_with_their_sources():
    used = quantities(PLANT.hardwired).assumptions
    of_cable = ["cable mass", "cable price", "laying time", "termination time"]
    others = "labour_rate laid_length cable_diameter gland gland_time plc_digital_channel".split()
    assert used["name"].tolist() == [*(f"{name} of MI1P075" for name in of_cable), *others]
    assert used[["source", "status", "unit"]].map(bool).all(axis=None)
    # Every listed assumption changes a figure, and no other does.
    model = Model(PLANT.hardwired)
    base = model.figures()
    moving = {
        name
        for name in [*CABLE_RANGES, *model.assumptions]
        if model.figures({name: "high"}) != base
    }
    assert moving == set(model.names)


def test_a_network_without_anything_costs_nothing():
    empty = replace(
        MIXED,
        iolist=replace(PLANT.iolist, points=PLANT.iolist.points.iloc[:0]),
        points=frame("points"),
        devices=MIXED.devices[MIXED.devices["kind"] == "cabinet"],
        cables=frame("cables"),
        segments=frame("segments"),
    )
    result = quantities(empty)
    assert (result.figures[["low", "nominal", "high"]] == 0).all(axis=None)
    assert result.by_cable.empty
    assert str(tornado({"empty": empty})).endswith("no assumption")
    assert (draw({"empty": empty}, rng=np.random.default_rng(1), draws=3) == 0).all(axis=None)


def test_the_catalogue_is_used(monkeypatch):
    types = {name: cable for name, cable in cables().items() if name != "MI1P075"}
    monkeypatch.setattr("shipnet.design.costs.catalogue", lambda: types)
    with pytest.raises(ArgumentError, match="has no cable MI1P075"):
        quantities(PLANT.hardwired)


@pytest.mark.parametrize(
    ("name", "figure"),
    [
        ("mass", "cable_mass_kg"),
        ("price", "cable_cost_eur"),
        ("lay", "labour_h"),
        ("termination", "labour_h"),
    ],
)
def test_the_figures_of_a_type_of_cable_can_be_set(name, figure):
    design = PLANT.hardwired
    assert set(design.cables["cable"]) == {"MI1P075"}
    setting = f"assumptions.{name}_MI1P075"
    base = Settings({"spare": 0})
    twice = base.replace({setting: [2 * end for end in base[setting]]})
    metres = design.cables["length_m"].sum()
    number = 2 * design.cables["used"].sum() if name == "termination" else metres
    before, after = (design.priced(one).quantities() for one in (base, twice))
    assert after[figure] - before[figure] == pytest.approx(number * base[setting].nominal)
    other = base.replace({f"assumptions.{name}_MI37P075": 9})
    assert design.priced(other).quantities()[figure] == before[figure]
    bill = design.priced(twice).tables()["bill"]
    assert bill["cost_eur"].sum() == pytest.approx(after["total_cost_eur"])
    used = after.assumptions.set_index("name")["status"]
    assert (used[used.index.str.endswith("of MI1P075")] == "given").sum() == 1


def test_the_price_of_copper_changes_each_cable_by_its_copper():
    design, base = PLANT.hardwired, Settings({"spare": 0})
    per_metre = 2 * 0.75e-6 * 8960  # kg: two conductors of 0.75 mm2, 8960 kg/m3
    dear = base.replace({"assumptions.copper_price": 18})
    before, after = (design.priced(one).quantities() for one in (base, dear))
    more = 9 * per_metre * design.cables["length_m"].sum()
    for level in ("low", "nominal", "high"):
        laid = base["assumptions.laid_length"][["low", "nominal", "high"].index(level)]
        change = after.figures.loc["cable_cost_eur", level]
        change -= before.figures.loc["cable_cost_eur", level]
        assert change == pytest.approx(laid * more)
    assert "copper_price" in set(after.assumptions["name"]) - set(before.assumptions["name"])
    free = base.replace({"assumptions.copper_price": 0, "assumptions.price_MI1P075": 0.01})
    assert design.priced(free).quantities()["cable_cost_eur"] == 0


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: quantities(PLANT.on_asi)["mass"], "figure is 'mass'"),
        (lambda: tornado(OPTIONS, "mass"), "figure is 'mass'"),
        (lambda: draw(OPTIONS, rng=np.random.default_rng(1), draws=0), "draws is 0"),
        (lambda: Plant(modules=0, contacts=1), "modules is 0"),
        (lambda: Plant(modules=2, contacts=1, lines=3), "lines is 3"),
        (lambda: Plant(modules=2, contacts=1, distance=float("nan")), "distance is nan"),
    ],
)
def test_values_out_of_range_are_refused(call, message):
    with pytest.raises(ArgumentError, match=message):
        call()


def test_the_assumptions_file_is_in_order_and_every_row_is_used():
    table = datasets.read("synthetic_design_assumptions.csv").set_index("name")
    assert table.index.is_unique
    assert table.map(lambda cell: cell != "").all(axis=None)
    assert set(table["status"]) == {"assumed", "derived"}
    assert set(table["unit"]) == {"EUR", "EUR/h", "EUR/kg", "h", "1"}
    # The mixed plant has every device and every channel; the others have a digital module, stations
    # with two lines, and a barrier.
    safe = IoList.parse("tag,signal,x,y,z\nA,4-20mA Ex ia,1,0,0").plan("home runs", (0, 0, 0))
    redundant = small_loop(redundant=True)
    others = (Model(design).names for design in (PLANT.on_asi, redundant, safe))
    # Without the user's price, that of copper changes nothing.
    assert {*table.index} - {"copper_price"} <= set(Model(MIXED).names).union(*others)
    # The range of the laid length, from the detours and tails given in the row.
    low, nominal, high = ((k * 40 + tail) / 51 for k, tail in [(1.05, 3), (1.15, 5), (1.3, 8)])
    laid = Assumptions()["laid_length"]
    assert laid == pytest.approx((low, nominal, high), abs=0.005)


ranges = st.lists(st.floats(0, 1e6), min_size=3, max_size=3).map(sorted)


@given(ranges, st.floats(0, 1))
def test_quantiles_are_those_of_the_triangular_distribution(row, u):
    low, nominal, high = row
    value = values_at([row], np.array([u]))[0, 0]
    assert low <= value <= high
    if high - low > 1e-6 * high:
        peak = (nominal - low) / (high - low)
        expected = triang.ppf(u, peak, loc=low, scale=high - low)
        assert value == pytest.approx(expected, rel=1e-6, abs=1e-6 * high)


def test_the_mean_of_the_draws_is_that_of_the_closed_form():
    # Each cost is a sum of products of independent assumptions, so its mean is the figure at their
    # means, (low + nominal + high) / 3. The tolerance is four standard errors of the mean.
    assumed = Assumptions()
    means = {name: np.mean(row) for name, row in assumed.items()}
    sample = draw(OPTIONS, rng=np.random.default_rng(2024), draws=40_000)
    for option, design in OPTIONS.items():
        expected = quantities(priced(design, **means))
        for figure in [*COSTS, "total_cost_eur", "labour_h", "cable_mass_kg", "cable_length_km"]:
            drawn = sample[option][figure]
            error = drawn.std() / np.sqrt(len(drawn))
            assert abs(drawn.mean() - expected[figure]) < 4 * error, (option, figure)


def test_another_option_does_not_change_the_draws_of_the_others():
    alone = draw({"AS-i": PLANT.on_asi}, rng=np.random.default_rng(5), draws=10)
    both = draw(OPTIONS, rng=np.random.default_rng(5), draws=10)
    pd.testing.assert_frame_equal(alone["AS-i"], both["AS-i"])
    twice = draw({"a": PLANT.on_asi, "b": PLANT.on_asi}, rng=np.random.default_rng(5), draws=10)
    pd.testing.assert_frame_equal(twice["a"], twice["b"])


def test_the_tornado_shows_the_effect_of_each_changed_assumption():
    result = tornado(OPTIONS)
    assumed = Assumptions()
    for name in result.every.index:
        for index, level in ((0, "low"), (2, "high")):
            names = (
                [f"{CABLE_RANGES[name]}_{id}" for id in cables()]
                if name in CABLE_RANGES
                else [name]
            )
            prices = {one: assumed[one][index] for one in names}
            ends = {
                o: quantities(priced(n, **prices))["total_cost_eur"] for o, n in OPTIONS.items()
            }
            for option, value in ends.items():
                assert result.every.loc[name, f"{option} at {level}"] == pytest.approx(value)
            first, second = (ends[option] for option in result.between)
            assert result.ends.loc[name, level] == pytest.approx(first - second)


def test_the_tornado_is_sorted_and_names_the_largest_swings():
    result = tornado(OPTIONS)
    assert repr(result) == f"<Tornado: {result}>" and "\n" not in repr(result)
    assert result.every["swing"].is_monotonic_decreasing
    assert result.between == ("AS-i", "hardwired")
    assert result.at_nominal < 0
    assert len(result.top()) == 3
    sentence = str(result)
    assert sentence.startswith("total cost of AS-i less that of hardwired is -")
    for name in result.top():
        assert name.replace("_", " ") in sentence
    turned = tornado(dict(reversed(OPTIONS.items())))
    assert turned.at_nominal == -result.at_nominal
    assert turned.top() == result.top()


def test_an_assumption_that_reverses_the_order_is_marked():
    near = Plant(modules=8, contacts=4, distance=10)
    both = {"hardwired": near.hardwired, "AS-i": near.on_asi}
    assert not tornado(OPTIONS).every["order changes"].any()
    result = tornado({name: priced(one, asi_module=(0, 10, 1000)) for name, one in both.items()})
    assert result.every.loc["asi_module", "order changes"]
    assert not result.every.loc["gland", "order changes"]


def test_a_single_network_has_a_tornado_too():
    result = tornado({"AS-i": PLANT.on_asi}, "cable_mass_kg")
    assert result.top() == ["cable_mass", "laid_length"]
    assert result.subject == "cable mass of AS-i"
    assert result.at_nominal == pytest.approx(quantities(PLANT.on_asi)["cable_mass_kg"])


@settings(max_examples=20)
@given(st.integers(1, 60), st.integers(1, 16), st.integers(1, 5))
def test_networks_and_formulas_give_the_same_counts(modules, contacts, lines):
    plant = Plant(modules, contacts, min(lines, modules))
    assert conductors_at_cabinet(plant.hardwired) == (
        hardwired_conductors({"contact": modules * contacts})
    )
    assert conductors_at_cabinet(plant.on_asi) == 2 * plant.lines
    assert Model(plant.on_asi).items["asi_module"] == modules
    runs = plant.on_asi.cables
    assert (runs["kind"] == "trunk").sum() == modules
    assert set(plant.on_asi.points["device"]) == set(runs["a"][runs["kind"] == "drop"])


def test_each_line_is_a_chain_from_its_master():
    design = Plant(modules=7, contacts=1, lines=3).on_asi
    devices = design.devices.set_index("device")
    trunks = design.cables[design.cables["kind"] == "trunk"]
    assert sorted(trunks["b"]) == sorted(devices.index[devices["kind"] == "module"])
    assert trunks["a"].is_unique
    for run in trunks.itertuples():
        assert devices.loc[run.a, "segment"] == devices.loc[run.b, "segment"] == run.segment
        assert run.at_cabinet == (devices.loc[run.a, "kind"] == "master")
    assert trunks["at_cabinet"].sum() == 3


def test_a_long_line_pays_for_its_repeaters():
    assert "repeater" not in Model(Plant(modules=2, contacts=1, distance=50).on_asi).items
    far = Plant(modules=2, contacts=1, distance=240).on_asi
    # 240 m x 1.15 + 5 m and 1 m x 1.15 + 5 m: the 287 m of three segments.
    assert Model(far).items["repeater"] == 2


def test_seventy_percent_is_one_of_many_savings_that_a_plant_can_have():
    # kim2023-063: the saving depends on the plant and on what is counted; 0.7 is not a limit.
    def saved(**plant):
        return Plant(**plant).cost_saving(rng=np.random.default_rng(2024), draws=2000)

    near = saved(modules=5, contacts=2, distance=5, spacing=4)
    doors = saved(modules=10, contacts=2, distance=20, spacing=4)
    far = saved(modules=62, contacts=4, distance=300)
    all_of_it = "cable, labour and hardware"
    assert near.loc[all_of_it, "high"] < 0
    assert far["low"].min() > 0.7
    assert doors.loc[all_of_it, "high"] < 0.7 < doors.loc["cable", "low"]
    for table in (near, doors, far):
        assert (table["low"] <= table["median"]).all()
        assert (table["median"] <= table["high"]).all()
        # The more costs are counted, the smaller the fraction that AS-i saves.
        assert table["nominal"].is_monotonic_decreasing


def test_a_saving_is_computed_from_the_nominal_figures():
    table = PLANT.cost_saving(rng=np.random.default_rng(1), draws=10)
    wired, bus = (by_hand(design, "nominal") for design in OPTIONS.values())
    assert table.loc["cable", "nominal"] == pytest.approx(
        1 - bus["cable_cost_eur"] / wired["cable_cost_eur"]
    )
    assert table.loc["cable, labour and hardware", "nominal"] == pytest.approx(
        1 - bus["total_cost_eur"] / wired["total_cost_eur"]
    )


def test_a_bill_adds_up_to_the_total_cost():
    for design in (*OPTIONS.values(), MIXED):
        bill = bill_table(design)
        assert bill["cost_eur"].sum() == pytest.approx(design.quantities()["total_cost_eur"])
        assert set(bill["kind"]) == {"cable", "part", "work"}


def test_the_common_return_of_a_module_is_counted_once():
    plant = Plant(modules=5, contacts=4, signal="contact_common")
    assert plant.saving.hardwired == 5 * (4 + 1)
