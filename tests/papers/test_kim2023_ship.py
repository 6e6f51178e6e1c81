"""Why a ship should use AS-i, and the price of it, by other routes."""

import pytest

from shipnet import datasets
from shipnet.design import Plant, compare, read_iolist
from shipnet.papers.kim2023.ship import PLANTS, needs_less, price_table, wiring

SHIP = read_iolist(datasets.path("synthetic_iolist_ship.csv"))


@pytest.mark.parametrize("plant", PLANTS.values(), ids=list(PLANTS))
def test_a_cut_cable_loses_its_line(plant):
    lost = wiring(plant)["lost_by_cable"]
    per_line = -(-plant.modules // plant.lines) * plant.contacts
    assert lost.to_dict() == {"hardwired": 1, "AS-i": per_line}


def test_the_saving_holds_for_a_whole_ship_too():
    table = SHIP.compare((26, 6, 14), ["home runs", "AS-i"]).table()
    left = table.loc["AS-i"] / table.loc["home runs"]
    assert left["total_cost_eur"] == pytest.approx(0.54, abs=0.005)
    assert left["labour_h"] == pytest.approx(0.48, abs=0.005)
    assert table["lost_by_cable"].tolist() == [1, 119]


def test_the_saving_holds_over_the_range_of_our_prices():
    plant = Plant(62, contacts=4, distance=300)
    table = compare([plant.hardwired, plant.on_asi]).table()
    assert table.loc["AS-i", "total_cost_high_eur"] < table.loc["hardwired", "total_cost_low_eur"]


def test_the_saving_falls_as_the_plant_gets_smaller_and_nearer():
    costs = [needs_less(quantity="total_cost_eur", distance=metres) for metres in (300, 60, 10)]
    assert costs == sorted(costs, reverse=True) and costs[-1] > 0
    assert (price_table()["cost_left_percent"] > 0).all()
    assert price_table()["cost_left_percent"].iloc[-1] > 300
