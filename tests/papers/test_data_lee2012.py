"""Typing slips in the tables of lee2012 (ship engine, CAN and Modbus)."""

import math

import pandas as pd
import pytest

from shipnet import datasets

KW_PER_METRIC_HORSEPOWER = 0.73549875


@pytest.fixture
def engine():
    return pd.read_csv(datasets.path("lee2012_table1_engine.csv")).set_index("quantity")


@pytest.fixture
def modbus():
    return pd.read_csv(datasets.path("lee2012_table2_modbus.csv"))


@pytest.fixture
def sensors():
    return pd.read_csv(datasets.path("lee2012_table3_sensors.csv"))


@pytest.fixture
def frames():
    return pd.read_csv(datasets.path("lee2012_fig4_frames.csv"))


def test_engine_table_has_the_six_printed_rows(engine):
    assert list(engine.index) == [
        "model",
        "speed",
        "mean_effective_pressure",
        "specified_fuel_oil_consumption",
        "lubricating_oil_consumption",
        "cylinder_oil_consumption",
    ]
    assert engine.value_printed["model"] == "S50MC-C"
    assert engine.loc["model", ["value_low", "value_high", "unit"]].isna().all()
    assert list(engine.unit_printed.dropna()) == ["rpm", "bar", "g/kWh", "kg/crl.24h", "g/kwh"]
    assert list(engine.unit.dropna()) == ["r/min", "bar", "g/kWh", "kg/(cyl 24 h)", "g/kWh"]


def test_engine_numbers_are_the_printed_text(engine):
    numbers = engine.drop("model")
    ends = [text.split("-") for text in numbers.value_printed]
    assert [float(e[0]) for e in ends] == list(numbers.value_low)
    assert [float(e[-1]) for e in ends] == list(numbers.value_high)


def test_engine_speed_and_mep_give_the_l1_power(engine):
    # S50MC-C project guide, Fig. 1.02: bore 0.5 m, stroke 2.0 m, 8 cylinders 12640 kW at L1.
    swept_volume = math.pi / 4 * 0.5**2 * 2.0
    mep = engine.value_low["mean_effective_pressure"] * 1e5
    power = 8 * swept_volume * mep * engine.value_low["speed"] / 60
    assert power == pytest.approx(12640e3, rel=1e-3)


def test_engine_consumptions_match_the_guide_per_horsepower(engine):
    # Same figure of the guide: 126 g/BHPh fuel, at most 1.1 g/BHPh cylinder oil, 4-5 kg/cyl. 24 h.
    assert (
        round(126 / KW_PER_METRIC_HORSEPOWER) == engine.value_low["specified_fuel_oil_consumption"]
    )
    assert round(1.1 / KW_PER_METRIC_HORSEPOWER, 1) == engine.value_high["cylinder_oil_consumption"]
    assert engine.value_low["cylinder_oil_consumption"] == 0.7
    assert list(engine.loc["lubricating_oil_consumption", ["value_low", "value_high"]]) == [4, 5]


def test_modbus_character_has_11_bits_at_9600(modbus):
    value = modbus.set_index("parameter").value_printed
    parity_bits = {"None": 0, "Odd": 1, "Even": 1}[value["parity"]]
    bits = 1 + int(value["data_bits"]) + parity_bits + int(value["stop_bits"])
    assert bits == 11
    assert value["parity"] == "Even"
    assert int(value["baud_rate"]) in {1200, 2400, 4800, 9600, 19200, 38400, 57600, 115200}
    assert round(1e3 / int(value["baud_rate"]), 3) == 0.104
    assert list(modbus.unit.dropna()) == ["bit/s", "bit", "bit"]


def test_modbus_rows_and_protocol(modbus):
    assert list(modbus.printed_row) == [1, 2, 3, 4, 5, 6, 7, 8, 9, 9]
    value = modbus.set_index("parameter").value_printed
    assert value["serial_interface"] == "RS485"
    assert value["protocol"] == "MODBUS RTU standard"
    assert value["function_code"] == "03"


def test_modbus_addresses_are_distinct_and_leave_jb2_out(modbus):
    stations = modbus.dropna(subset="station")
    assert stations.set_index("station").value_printed.to_dict() == {
        "AMS": "01",
        "JB1": "02",
        "JB3": "03",
    }
    assert list(stations.parameter) == ["master_address", "slave_address", "slave_address"]


def test_sensor_rows_per_junction_box(sensors):
    assert list(sensors.printed_row) == list(range(1, 15))
    assert sensors.groupby("jb").size().to_dict() == {"JB1": 6, "JB2": 3, "JB3": 5}
    assert not sensors.duplicated(["jb", "condition", "type", "range_low", "range_high"]).any()


def test_sensor_points_sum_to_99(sensors):
    points = sensors.pivot_table("quantity_points", "jb", "condition", "sum", fill_value=0)
    assert points.sum(axis=1).to_dict() == {"JB1": 43, "JB2": 18, "JB3": 38}
    assert points.sum().to_dict() == {"RTD": 62, "4~20mA": 18, "S/W": 19}
    assert points.to_numpy().sum() == 99


def test_sensor_points_fit_the_converters(sensors):
    # Section IV.1.b: up to 32 resistance inputs and 18 current inputs in one junction box.
    points = sensors.groupby(["condition", "jb"]).quantity_points.sum()
    assert points["RTD"].max() == 27 <= 32
    assert points["4~20mA"].max() == 17 <= 18


def test_sensor_points_by_range(sensors):
    ranged = sensors.dropna(subset="range_high")
    points = ranged.groupby(["jb", "range_low", "range_high", "range_unit"]).quantity_points.sum()
    assert points.to_dict() == {
        ("JB1", 0, 200, "degC"): 10,
        ("JB1", -50, 600, "degC"): 20,
        ("JB2", 0, 200, "degC"): 15,
        ("JB2", 0, 10, "kg/cm2"): 1,
        ("JB3", 0, 200, "degC"): 8,
        ("JB3", 0, 100, "degC"): 1,
        ("JB3", -50, 120, "degC"): 18,
    }


def test_only_the_jb1_pressures_have_four_ranges(sensors):
    several = sensors.dropna(subset="range_high_options")
    assert len(several) == 1
    row = several.iloc[0]
    assert (row.jb, row.condition, row.type) == ("JB1", "4~20mA", "pressure")
    assert (row.quantity_points, row.range_low) == (7, 0)
    assert [int(x) for x in row.range_high_options.split("/")] == [4, 6, 15, 40]
    assert math.isnan(row.range_high)


def test_sensor_units_follow_the_type(sensors):
    unit = {"temperature": "degC", "pressure": "kg/cm2", "low": "logic", "high": "logic"}
    assert list(sensors.range_unit) == [unit[t] for t in sensors.type]
    switch = sensors.condition == "S/W"
    assert list(switch) == list(sensors.range_unit == "logic")
    assert (
        sensors.loc[switch, ["range_low", "range_high", "range_high_options"]].isna().all(axis=None)
    )
    assert sensors.range_low[~switch].notna().all()
    assert sensors[switch].groupby(["jb", "type"]).quantity_points.sum().to_dict() == {
        ("JB1", "low"): 5,
        ("JB1", "high"): 1,
        ("JB2", "low"): 2,
        ("JB3", "low"): 3,
        ("JB3", "high"): 8,
    }


def test_sensor_types_keep_the_printed_spelling(sensors):
    spellings = sensors.groupby("type").type_printed.agg(set).to_dict()
    assert spellings == {
        "temperature": {"Temp."},
        "pressure": {"Press.", "Press"},
        "low": {"Low"},
        "high": {"High", "Hugh"},
    }
    odd = sensors.set_index("type_printed").jb
    assert (odd["Press"], odd["Hugh"]) == ("JB2", "JB3")


def test_frame_fields_in_printed_order(frames):
    fields = frames.groupby("frame").field_printed.agg(list)
    shared = [["Start", "Function", "Error Check (CRC)"]] * 2
    assert [[f[0], f[2], f[5]] for f in fields] == shared
    assert [[f[1], f[3], f[4]] for f in fields] == [
        ["Slave Address", "Starting Address", "No. of Registers"],
        ["Master Address", "Byte Count", "Data"],
    ]
    assert list(frames.position) == [1, 2, 3, 4, 5, 6] * 2


def test_frame_widths_as_printed(frames):
    start = frames.field_printed == "Start"
    assert list(frames.silence_min_char[start]) == [3.5, 3.5]
    assert frames.silence_min_char[~start].isna().all()
    assert frames.width_byte[start].isna().all()
    widths = frames[~start].groupby("frame").width_byte.agg(list).to_dict()
    assert widths == {"request": [1, 1, 2, 2, 2], "response": [1, 1, 2, 2, 2]}
