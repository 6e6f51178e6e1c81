import struct

import pytest

from shipnet import datasets
from shipnet.asi import Request, Response, Transaction
from shipnet.errors import ArgumentError
from shipnet.papers.icn2007 import bus_efficiencies, rate_table

PRINTED = datasets.read("icn2007_numbers.csv").set_index("parameter")["value"]


def test_the_papers_numbers_and_the_assumption_behind_them():
    transaction = Transaction(2, 2)
    assert round(1e-3 / transaction.bit_time) == float(PRINTED["gross rate"])
    assert round(100 * float(transaction.efficiency())) == float(PRINTED["efficiency"])
    # The printed net rate needs a pause of 1.92 bit times; it is not the product of the others.
    printed = float(PRINTED["net rate, highest"])
    assert (rate_table()["net_kbit_per_s"].round(1) != printed).all()
    assert 8 / (printed * 1e3) / 6e-6 == pytest.approx(24.92, abs=5e-3)
    assert round(0.32 * 167, 1) == 53.4


def test_rates_of_other_assumptions():
    table = rate_table()
    assert table.loc["26 bit", "efficiency_percent"] == pytest.approx(30.77, abs=5e-3)
    assert table.loc["26 bit", "net_kbit_per_s"] == pytest.approx(51.28, abs=5e-3)
    assert table.loc["25 bit, whole cycle", "net_kbit_per_s"] == pytest.approx(50.10, abs=5e-3)
    bits = table["transaction_bit"]
    assert bits[:5].round(2).tolist() == [24.5, 25, 25.5, 25.67, 26]


def test_user_bits_counted_on_the_line():
    request, response = Request.data_exchange(21, 0xE).bits, Response(6).bits
    line = len(request) + 2 + len(response) + 2
    table = rate_table()["efficiency_percent"]
    assert table["25 bit"] == pytest.approx(100 * 8 / line)
    cycle = [(line, 8)] * 31 + [(line, 0)] * 2
    bits, user = (sum(column) for column in zip(*cycle, strict=True))
    assert table["25 bit, whole cycle"] == pytest.approx(100 * user / bits)


def test_modbus_frames_have_the_length_that_is_counted():
    values = range(5)
    data = struct.pack(">5H", *values)
    request = struct.pack(">BBHHHHB", 1, 23, 0, 5, 0, 5, len(data)) + data + b"\0\0"
    response = struct.pack(">BBB", 1, 23, len(data)) + data + b"\0\0"
    characters = len(request) + len(response) + 2 * 3.5
    efficiency = bus_efficiencies(5 * 16).loc[80, "modbus_rtu"]
    assert efficiency == pytest.approx(2 * 80 / (11 * characters))


def test_can_frames_have_the_length_that_is_counted():
    fields = {
        "sof": 1,
        "identifier": 11,
        "rtr": 1,
        "ide": 1,
        "r0": 1,
        "dlc": 4,
        "crc": 15,
        "crc delimiter": 1,
        "ack": 2,
        "eof": 7,
        "intermission": 3,
    }
    empty = sum(fields.values())
    table = bus_efficiencies([64, 72])
    assert table.loc[64, "can"] == pytest.approx(128 / (2 * (empty + 64)))
    # 9 bytes take two frames.
    assert table.loc[72, "can"] == pytest.approx(144 / (2 * (2 * empty + 72)))


def test_as_i_leads_only_while_data_are_small():
    table = bus_efficiencies(range(4, 1937, 4))
    leader = table.idxmax(axis=1)
    assert leader[4] == "as_i"
    assert leader.ne("as_i").idxmax() == 24
    assert leader.iloc[-1] == "modbus_rtu"


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: bus_efficiencies(0), "user_bits is 0"),
        (lambda: bus_efficiencies([4, 1937]), "1..1936"),
        (lambda: bus_efficiencies([4.0]), "whole numbers"),
    ],
)
def test_bad_arguments(call, message):
    with pytest.raises(ArgumentError, match=message):
        call()
