"""Message sets: what a message may be, the order of arbitration, tables and files."""

import csv
import math
from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from shipnet.can import Message, MessageSet, bus_load, example, read_messages
from shipnet.can.dbc import parse_dbc
from shipnet.can.messages import COLUMNS
from shipnet.errors import ArgumentError, InputError

REFERENCE = Path(__file__).parents[1] / "reference" / "can"


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("name", ""),
        ("name", "a\nb"),
        ("name", " a"),
        ("arbitration_id", -1),
        ("arbitration_id", 0x800),
        ("dlc", 9),
        ("extended", 1),
        ("period", 0),
        ("deadline", 0.0),
        ("jitter", -1e-9),
        ("offset", -1),
        ("bits", 46),
        ("bits", 161),
    ],
)
def test_a_message_refuses_values_out_of_range(field, value):
    right = {"name": "A", "arbitration_id": 1, "dlc": 8, "period": 0.1}
    with pytest.raises(ArgumentError, match=f"^{field} is "):
        Message(**right | {field: value})


def test_the_smallest_and_the_largest_message():
    Message("A", 0, 0, 1e-6, 1e-6, 0, 0, bits=47)
    Message("A", 2**29 - 1, 8, 1e5, 1e5, 1e5, 1e5, True, "node", 160)
    assert Message("A", np.int64(3), np.uint8(2), np.float32(0.5)).deadline == 0.5
    # Times are stored to the nanosecond.
    assert Message("A", 1, 8, 1 / 3).period == 0.333333333


def test_messages_are_sorted_in_the_order_of_arbitration():
    def bits(message):
        """Return the arbitration field as it is sent; 0 is dominant."""
        if not message.extended:
            return f"{message.arbitration_id:011b}" + "00"
        number = f"{message.arbitration_id:029b}"
        return number[:11] + "11" + number[11:] + "0"

    rng = np.random.default_rng(2024)
    base = rng.integers(0, 8, size=60)
    messages = [Message(f"s{b}", int(b), 8, 1.0) for b in np.unique(base)]
    messages += [
        Message(f"x{k}", int(b << 18 | rng.integers(2**18)), 8, 1.0, extended=True)
        for k, b in enumerate(base)
    ]
    expected = sorted(messages, key=bits)
    assert list(MessageSet(rng.permutation(np.array(messages, dtype=object)))) == expected


def test_a_set_names_all_duplicates():
    with pytest.raises(ArgumentError) as caught:
        MessageSet(
            [
                Message("A", 1, 8, 1.0),
                Message("A", 2, 8, 1.0),
                Message("B", 1, 8, 1.0),
                Message("B", 1, 8, 1.0),
                Message("C", 1, 8, 1.0, extended=True),
            ]
        )
    assert str(caught.value).split("; ") == [
        "name 'A' is taken",
        "arbitration_id 0x001 of 'B' is taken by 'A'",
        "name 'B' is taken",
        "arbitration_id 0x001 of 'B' is taken by 'A'",
    ]


def test_a_set_is_a_sequence():
    a, b = Message("A", 1, 8, 1.0), Message("B", 2, 8, 1.0)
    messages = MessageSet([b, a])
    assert (messages[0], messages[-1], messages["B"], messages[:1]) == (a, b, b, (a,))
    assert len({messages, MessageSet([a, b])}) == 1
    assert messages != MessageSet([a])
    assert repr(messages) == "MessageSet(2 messages: A, B)"
    assert messages.periods.tolist() == [1.0, 1.0]
    with pytest.raises(ArgumentError, match="name is 'C'; the messages are A, B"):
        messages["C"]


def test_another_order_keeps_the_identifiers_or_numbers_mixed_formats():
    messages = MessageSet([Message(n, i, 8, 1.0) for n, i in (("A", 5), ("B", 7), ("C", 9))])
    turned = messages.ordered(["C", "A", "B"])
    assert [(m.name, m.arbitration_id) for m in turned] == [("C", 5), ("A", 7), ("B", 9)]
    mixed = MessageSet([*messages, Message("X", 2**28, 8, 1.0, extended=True)])
    for order in (["X", "C", "B", "A"], ["A", "X", "C", "B"]):
        turned = mixed.ordered(order)
        assert list(turned.names) == order
        assert [m.extended for m in turned] == [name == "X" for name in order]
    for wrong in (["A", "B"], ["A", "B", "B"], ["A", "B", "D"]):
        with pytest.raises(ArgumentError, match="each must occur once: A, B, C"):
            messages.ordered(wrong)


# Tables and files.


def times(low):
    return st.integers(low, 10**14).map(lambda ns: ns / 1e9)


@st.composite
def sets(draw):
    names = draw(
        st.lists(
            st.text(st.characters(codec="utf-8"), min_size=1, max_size=6).filter(
                lambda name: name == name.strip() and name.isprintable()
            ),
            min_size=1,
            max_size=5,
            unique=True,
        )
    )
    return MessageSet(
        Message(
            name,
            k + (2**20 if extended else 0),
            draw(st.integers(0, 8)),
            draw(times(1000)),
            draw(times(1000)),
            draw(times(0)),
            draw(times(0)),
            extended,
            draw(st.sampled_from(["", "JB1", 'a;b, "c"'])),
            draw(st.none() | st.integers(47, 160)),
        )
        for k, name in enumerate(names)
        for extended in [draw(st.booleans())]
    )


@settings(max_examples=40)
@given(sets())
def test_a_saved_set_is_read_back_to_the_nanosecond(tmp_path_factory, messages):
    file = tmp_path_factory.getbasetemp() / "set.csv"
    messages.save(file)
    assert read_messages(file) == messages
    assert MessageSet.parse(messages.text) == messages


@settings(max_examples=40)
@given(sets())
def test_a_table_has_the_fields_of_each_message(messages):
    table = messages.table()
    parts = ["priority", "pgn", "source", "destination"] if table["extended"].any() else []
    assert [table.index.name, *table.columns] == [*COLUMNS[:2], *parts, *COLUMNS[2:-1]]
    assert {c.removesuffix("_ms") for c in COLUMNS} == {field.name for field in fields(Message)}
    assert table.index.tolist() == [message.name for message in messages]
    assert table["dlc"].tolist() == [message.dlc for message in messages]
    assert table["period_ms"].tolist() == [round(m.period * 1e9) / 1e6 for m in messages]


def load(tmp_path, content):
    file = tmp_path / "set.csv"
    file.write_bytes(content if isinstance(content, bytes) else content.encode())
    return read_messages(file)


def test_files_in_the_form_of_a_spreadsheet_are_read(tmp_path):
    content = (
        "\ufeffName;Arbitration_ID;Extended;DLC;Period_ms;Deadline_ms;Jitter_ms;Note;\r\n"
        "oil;0x1F;no;8;100;50.5;.25;fast;\r\n;;;;;;;;\r\ngas;300;YES;0;1e3;;;;\r\n"
    )
    assert load(tmp_path, content) == MessageSet(
        [Message("oil", 31, 8, 0.1, 0.0505, 0.00025), Message("gas", 300, 0, 1.0, extended=True)]
    )
    latin = "name,arbitration_id,dlc,period_ms\n\xd6ldruck,1,8,10\n".encode("cp1252")
    assert load(tmp_path, latin).names == ("\xd6ldruck",)


def test_all_faults_of_a_file_are_named_at_once(tmp_path):
    content = (
        "name,arbitration_id,dlc,period_ms,deadline_ms,jitter_ms,extended,bits\n"
        "A,0x800,8,10,,,,\n"
        "B,2,1786,0,,-1,maybe,12\n"
        ",3,8,nan,0,,,\n"
        "C,4,8,10,,,,\n"
        "C,4,8,10,,,,\n"
        "D,5,8,10,,,,,,7\n"
        "E,5.5,8,inf,1e999,,,\n"
    )
    with pytest.raises(InputError) as caught:
        load(tmp_path, content)
    assert sorted(caught.value.faults) == sorted(
        [
            "row 7 has 10 cells; expected 8",
            "row 2, arbitration_id is 2048; it must be a whole number 0..2047",
            "row 3, column dlc (C): '1786'; expected a whole number 0..1785",
            "row 3, column period_ms (D): '0'; expected a number 0.001..1e+08 ms",
            "row 3, column jitter_ms (F): '-1'; expected a number 0..1e+08 ms",
            "row 3, column extended (G): 'maybe'; expected yes or no",
            "row 3, column bits (H): '12'; expected a whole number 47..160",
            "row 4, column name (A): is empty; expected a value",
            "row 4, column period_ms (D): 'nan'; expected a number 0.001..1e+08 ms",
            "row 4, column deadline_ms (E): '0'; expected a number 0.001..1e+08 ms",
            "row 6: name 'C' is taken",
            "row 6: arbitration_id 0x004 of 'C' is taken by 'C'",
            "row 8, column arbitration_id (B): '5.5'; expected an identifier 0..0x7FF, or "
            "0x1FFFFFFF if extended",
            "row 8, column period_ms (D): 'inf'; expected a number 0.001..1e+08 ms",
            "row 8, column deadline_ms (E): '1e999'; expected a number 0.001..1e+08 ms",
        ]
    )


def test_an_identifier_may_have_leading_zeros():
    for number, expected in (("002", 2), ("0070000", 70000), ("0x002", 2)):
        messages = MessageSet.parse(f"name,arbitration_id,dlc,period_ms\nA,{number},8,10\n")
        assert messages["A"].arbitration_id == expected
        assert messages["A"].extended is (expected > 0xFFFF)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("", "is empty"),
        ("\n;;\n", "is empty"),
        ("name,arbitration_id,dlc,period_ms\n", "has no message"),
        (
            "name,id,dlc,Cycle\nA,1,8,1\n",
            "row 2, column Cycle (D): '1'; expected a unit in the title, such as period_ms or [ms]",
        ),
        ("name,dlc,every\nA,8,1\n", "unknown titles: every; columns= or --column TITLE=NAME may"),
        ("name,dlc,period\nA,8,1\n", "no column arbitration_id"),
        ("id,can-id,name,dlc,period_ms\n", "row 1: 'id' and 'can-id' both mean arbitration_id"),
        ("name,name,arbitration_id,dlc,period_ms\n", "row 1: 'name' and 'name' both mean name"),
        (b"name\0", "is not text"),
        (
            "name,dlc\n" + 200_000 * "a" + ",1\n",
            "is not a CSV file: field larger than field limit (131072), in row 2",
        ),
    ],
)
def test_what_is_not_a_message_set_is_refused(tmp_path, content, message):
    with pytest.raises(InputError) as caught:
        load(tmp_path, content)
    assert any(message in fault for fault in caught.value.faults)


CELLS = [*'A 1 0x10 8 " - 1,5 nan Ext =1+1 12_ms name id dlc period_ms'.split(), "9" * 5000, ""]


@given(st.lists(st.lists(st.sampled_from(CELLS), max_size=8), max_size=6))
def test_any_table_gives_a_set_or_an_input_error(tmp_path_factory, rows):
    file = tmp_path_factory.getbasetemp() / "table.csv"
    with file.open("w", newline="", encoding="utf-8") as stream:
        csv.writer(stream, delimiter=";").writerows([["name", "id", "dlc", "period_ms"], *rows])
    try:
        assert len(read_messages(file)) >= 1
    except InputError as error:
        assert error.faults


@given(st.binary(max_size=200) | st.text("name,dlc;period_ms\n\"'0123x.-", max_size=200))
def test_any_file_gives_a_set_or_an_input_error(tmp_path_factory, content):
    head = b"name,arbitration_id,dlc,period_ms\nA,1,8,10\n"
    file = tmp_path_factory.getbasetemp() / "any.csv"
    file.write_bytes(head + (content if isinstance(content, bytes) else content.encode()))
    try:
        assert len(read_messages(file)) >= 1
    except InputError as error:
        assert error.faults


# Load.


def engine():
    return example("lee2012")


def test_the_set_of_lee2012_has_the_frames_and_bits_of_the_reference():
    with (REFERENCE / "lee2012_jb_can_volume.csv").open() as stream:
        rows = {r["jb"]: r for r in csv.DictReader(stream) if r["bits_per_analog"] == "16"}
    for box in ("JB1", "JB2", "JB3"):
        part = MessageSet(m for m in engine() if m.sender == box)
        assert len(part) == int(rows[box]["can_frames"])
        assert sum(m.dlc for m in part) == int(rows[box]["payload_bytes"])
        for stuffing, column in (("none", "bits_nominal"), ("worst", "bits_worst_std")):
            # Once per second: the load at 1 kbit/s is the number of bits divided by 1000.
            bits = 1000 * bus_load(part, 1000, stuffing)
            assert bits == pytest.approx(int(rows[box][column]), rel=1e-12)
        long = MessageSet(replace(m, extended=True) for m in part)
        bits = 1000 * bus_load(long, 1000)
        assert bits == pytest.approx(int(rows[box]["bits_worst_ext"]), rel=1e-12)
    for rate in (125, 250, 500, 1000):
        busy = bus_load(engine(), 1000 * rate) * 1e3
        column = f"ms_{rate}k" if rate < 1000 else "ms_1M"
        assert busy == pytest.approx(float(rows["TOTAL"][column]), rel=1e-12)


def test_load_is_vectorised_over_bit_rates():
    messages = MessageSet(
        [Message("A", 1, 8, 5e-3), Message("B", 2, 0, 0.1, bits=60), Message("C", 3, 8, 1.0)]
    )
    rates = np.array([[125_000, 250_000, 1_000_000]])
    load = bus_load(messages, rates)
    assert load.shape == (1, 3)
    each = 135 / 5e-3 + 60 / 0.1 + 135 / 1.0
    assert load == pytest.approx(each / rates, rel=1e-12)
    assert type(bus_load(messages, 125e3)) is float
    # A length given by the message itself is used, however stuff bits are counted.
    alone = MessageSet([messages["B"]])
    assert len({bus_load(alone, 125e3, way) for way in ("none", "mean", "worst")}) == 1
    assert bus_load(MessageSet([]), [125_000]).tolist() == [0]


def test_a_message_is_replaced_by_name():
    messages = example().replace("speed", arbitration_id=0x700, period=0.02)
    assert messages.names[-1] == "speed"
    assert messages["speed"].deadline == 0.005
    # A deadline that equals the period changes with it.
    assert (
        example().replace("alarm", deadline=0.1).replace("alarm", period=0.2)["alarm"].deadline
        == 0.2
    )
    with pytest.raises(ArgumentError, match="name is 'sped'; the messages are shutdown"):
        messages.replace("sped", dlc=3)
    with pytest.raises(ArgumentError, match="taken by"):
        messages.replace("speed", arbitration_id=0x010)


@pytest.mark.parametrize("rate", [999, 1_000_001, math.nan, [125_000, 0]])
def test_wrong_arguments_of_a_load_and_an_example_are_refused(rate):
    with pytest.raises(ArgumentError, match="bit_rate is "):
        bus_load(engine(), rate)
    with pytest.raises(ArgumentError, match="stuffing is 'longest'; it must be one of 'none'"):
        bus_load(engine(), 125_000, "longest")
    with pytest.raises(ArgumentError, match="name is 'tanker'"):
        example("tanker")


def test_titles_can_be_named_and_a_period_given(tmp_path):
    file = tmp_path / "yard.csv"
    file.write_text("Name;Number;DLC;Every\noil;0x10;8;20\ngas;0x11;4;\n")
    columns = {"Number": "arbitration_id", "Every": "period_ms"}
    read = read_messages(file, columns=columns, period=0.5)
    assert read.periods.tolist() == [0.02, 0.5]
    with pytest.raises(InputError, match=r"row 3, column Every \(D\): is empty"):
        read_messages(file, columns=columns)
    with pytest.raises(InputError, match="no column 'cycle'; the titles are Name, Number"):
        read_messages(file, columns={"cycle": "period_ms"})


DBC = """VERSION ""

BU_: JB1 JB2

BO_ 256 Speed: 8 JB1
 SG_ Rpm : 0|16@1+ (0.125,0) [0|6000] "rpm" Vector__XXX

BO_ 2566844672 Valve: 3 JB2
 SG_ Position : 7|16@0+ (0.5,0) [0|100] "%" Vector__XXX

BA_DEF_ BO_ "GenMsgCycleTime" INT 0 65535;
BA_DEF_DEF_ "GenMsgCycleTime" 0;
BA_ "GenMsgCycleTime" BO_ 256 100;
"""


def test_a_dbc_is_read():
    pytest.importorskip("cantools")
    assert list(parse_dbc(DBC, "ship.dbc", 0.05)) == [
        Message("Speed", 0x100, 8, 0.1, sender="JB1"),
        Message("Valve", 0x18FEF100, 3, 0.05, extended=True, sender="JB2"),
    ]
    with pytest.raises(InputError, match="'Valve' has no cycle time; give one with --period on"):
        parse_dbc(DBC, "ship.dbc")
    with pytest.raises(InputError, match="message 'Speed' has 64 bytes"):
        parse_dbc(DBC.replace("Speed: 8", "Speed: 64"), "ship.dbc", 0.05)


CYCLE = """BA_DEF_ BO_ "GenMsgCycleTime" INT 0 65535;
BA_DEF_DEF_ "GenMsgCycleTime" 100;
"""
OVERLAP = f"""VERSION ""

BU_: JB1

BO_ 256 Speed: 8 JB1
 SG_ Rpm : 0|16@1+ (0.125,0) [0|6000] "rpm" Vector__XXX
 SG_ Load : 8|16@1+ (1,0) [0|100] "%" Vector__XXX

BO_ 257 Long: 64 JB1

BO_ 258 Short: 1 JB1
 SG_ Wide : 0|16@1+ (1,0) [0|100] "%" Vector__XXX

{CYCLE}"""


def test_a_dbc_with_faults_is_read_without_strict_and_they_are_listed(tmp_path):
    pytest.importorskip("cantools")
    file = tmp_path / "ship.dbc"
    file.write_text(OVERLAP)
    faults = (
        "message 'Speed': The signals Load and Rpm are overlapping in message Speed.",
        "message 'Short': The signal Wide does not fit in message Short.",
        "message 'Long' has 64 bytes; a frame of classic CAN has at most 8",
    )
    with pytest.raises(InputError) as caught:
        read_messages(file)
    for fault in faults:
        assert fault in str(caught.value)
    assert "is not a DBC file" not in str(caught.value)
    assert "strict=False accepts the message" in str(caught.value)
    messages = read_messages(file, strict=False)
    assert messages.names == ("Speed", "Short")
    assert all(
        remark.startswith(fault) for remark, fault in zip(messages.overlooked, faults, strict=True)
    )
    assert repr(messages) == "MessageSet(2 messages: Speed, Short; 3 faults overlooked)"
    assert read_messages(file, strict=False) == messages.replace("Speed", dlc=8)


def test_a_cycle_time_that_is_text_is_read_or_refused():
    pytest.importorskip("cantools")
    text = DBC.replace("INT 0 65535", "STRING").replace('Time" 0;', 'Time" "";')
    messages = parse_dbc(text.replace("BO_ 256 100", 'BO_ 256 "100"'), "ship.dbc", 0.05)
    assert messages.periods.tolist() == [0.1, 0.05]
    with pytest.raises(InputError, match="'Speed': cycle time is 'fast'; it must be a number"):
        parse_dbc(text.replace("BO_ 256 100", 'BO_ 256 "fast"'), "ship.dbc", 0.05)


def test_any_exception_of_cantools_becomes_an_input_error(tmp_path, monkeypatch):
    cantools = pytest.importorskip("cantools")

    def fail(*given, **options):
        raise KeyError("BO_")

    monkeypatch.setattr(cantools.database, "load_string", fail)
    with pytest.raises(InputError, match="is not a DBC file: 'BO_'"):
        parse_dbc(DBC, "ship.dbc")


@pytest.mark.parametrize(
    ("length", "bits", "values", "said"),
    [
        ("8888888", "0|16", "1-2", "the length of a message in bytes is 8.88889e.06; .* most 1785"),
        ("\n // note\n1786", "0|16", "1-2", "the length of a message in bytes is 1786"),
        ("8", "9999999|16", "1-2", "the place of a signal in bits is 1e.07; .* most 14280"),
        ("8", "0|9999999", "1-2", "the place of a signal in bits"),
        ("8", "0|16", "0-9999999", "the number of multiplexer values is 1e.07; .* most 65536"),
        ("8", "0|16", "0-40000, 50000-90000", "the number of multiplexer values is 80000"),
        ("9" * 5000, "0|16", "1-2", "the length of a message in bytes is inf"),
        ("8", "0|16", "9-" + "9" * 5000, "the number of multiplexer values is inf"),
    ],
)
def test_a_dbc_with_huge_numbers_is_refused_before_it_costs_time(length, bits, values, said):
    pytest.importorskip("cantools")
    text = (
        f'BU_: A\nBO_ 145 S: {length} A\n SG_ m M : 0|8@1+ (1,0) [0|8] "" A\n'
        f' SG_ rpm m1 : {bits}@1+ (1,0) [0|8] "" A\nSG_MUL_VAL_ 145 rpm m {values};\n'
    )
    with pytest.raises(InputError, match=said):
        parse_dbc(text, "hostile.dbc", 1.0, strict=False)


@pytest.mark.parametrize(
    ("count", "signals", "why"),
    [
        (16_385, "", "the number of messages is 16385; it must be at most 16384"),
        (1, ' SG_ s : 0|14280@1+ (1,0) [0|8] "" A\n' * 281, "the length of all signals in bits"),
    ],
)
def test_a_dbc_with_too_many_messages_or_wide_signals_is_refused(count, signals, why):
    pytest.importorskip("cantools")
    messages = "".join(f"BO_ {number} M{number}: 8 A\n{signals}" for number in range(count))
    with pytest.raises(InputError, match=why):
        parse_dbc(f"BU_: A\n{messages}", "hostile.dbc", 1.0, strict=False)


def test_a_dbc_with_floats_and_multiplexers_is_read():
    pytest.importorskip("cantools")
    signals = ' SG_ Page M : 0|8@1+ (1,0) [0|1] "" A\n SG_ M m0 : 32|32@1- (1,0) [0|0] "m" A\n'
    text = f"BU_: A\nBO_ 256 Level: 8 A\n{signals}{CYCLE}SIG_VALTYPE_ 256 M : 1;\n"
    assert list(parse_dbc(text, "x.dbc")) == [Message("Level", 0x100, 8, 0.1, sender="A")]


def test_large_numbers_in_texts_and_comments_of_a_dbc_are_read():
    pytest.importorskip("cantools")
    text = 'VERSION "BO_ 1 S: 99999 A, 0-999999"\nBU_: A\n// : 99999|8\nBO_ 145 S: 8 A\n'
    assert parse_dbc(text, "good.dbc", 1.0).names == ("S",)


def test_a_file_that_is_not_a_dbc_is_refused(tmp_path):
    pytest.importorskip("cantools")
    with pytest.raises(InputError, match=r"none\.dbc: cannot be read"):
        read_messages(tmp_path / "none.dbc")
    bad = tmp_path / "bad.dbc"
    bad.write_text('VERSION ""\n\nBO_ 100 Speed: x JB1\n')
    with pytest.raises(InputError, match=r"bad\.dbc: is not a DBC file: .*line 3") as caught:
        read_messages(bad)
    assert "\n" not in str(caught.value)


# Lists as yards write them.


@pytest.mark.parametrize(
    "text",
    [
        "HULL 1;;;;\nName;CAN-ID;Length (bytes);Cycle time;Format\nMain engine;;;;\n"
        "oil;0x110;8;20 ms;Std\nrpm;0x18FEF100;4;1 s;Ext\n",
        "Name;CAN-ID (hex);DLC;Cycle [ms];Frame format\noil;110;8 bytes;20,0;11 bit\n"
        "rpm;18FEF100;4;1000;29 bit\n",
        "Message;CAN-ID (hex);DLC;Cycle time [ms];Node\noil;110;8;20;\nrpm;18FEF100;4;1000;\n",
        "Msg name\tID\tLength\tCycle time in s\tTransmitter\nrpm\t0x18FEF100\t4\t1\t\n"
        "oil\t0x110\t8\t0.02\t\n",
        "Name,Identifier,Data bytes,Interval (us),ECU,Remarks,Comment\noil,110h,8,20000,,a,b\n"
        "rpm,18FEF100h,4,1e6,,,\n",
        "name,COB-ID,size,period_s,29 bit,source\noil,272,8,.02,no,\nrpm,419361024,4,1.0,yes,\n",
        "Identification;;Data;\nName;CAN-ID;DLC;Cycle [s]\noil;110h;8;0,02\nrpm;18FEF100h;4;1\n",
        "supplier,Name,CAN-ID,DLC,Cycle [ms]\nACME,oil,272,8,20\nACME,rpm,0x18FEF100,4,1e3\n",
    ],
)
def test_a_list_of_a_yard_is_read_like_a_plain_one(tmp_path, text):
    expected = MessageSet(
        [Message("oil", 0x110, 8, 0.02), Message("rpm", 0x18FEF100, 4, 1.0, extended=True)]
    )
    assert load(tmp_path, text) == expected
    book = tmp_path / "set.xlsx"
    separator = next(mark for mark in ";\t," if mark in text)
    lines = [line.split(separator) for line in text.splitlines()]
    pd.DataFrame(lines).to_excel(book, index=False, header=False)
    assert read_messages(book) == expected


def test_what_is_left_out_of_a_list_or_not_used_is_said(tmp_path):
    text = "Name;CAN-ID;DLC;Cycle;Maker\nMain engine;;;;\noil;1;8;20 ms;A\ngas;2;;1 s;\n"
    messages = load(tmp_path, text.replace("2;;1", "2;do.;1"))
    assert messages["gas"].dlc == 8
    assert messages.remarks == (
        "not used: Maker",
        "left out, not a message: a subtitle, page header, page footer or note: 1 row (2)",
        "DLC: ditto marks filled from the row above: 1 row (4)",
    )
    assert "1 row (4)" in repr(messages)
    assert (
        read_messages(tmp_path / "set.csv", columns={"Maker": "note"}).remarks[0].startswith("le")
    )
    assert MessageSet(messages).remarks == example().remarks == ()


def test_a_column_of_frame_types_is_read_or_named(tmp_path):
    path = tmp_path / "list.csv"
    path.write_text("name;id;Std/Ext;dlc;period [ms]\nA;0x123;Ext;8;10\n")
    assert read_messages(path)["A"].extended
    path.write_text("name;id;Type;dlc;period [ms]\nA;0x123;Ext;8;10\n")
    assert read_messages(path).remarks == ("not used: Type",)


@pytest.mark.parametrize(
    ("title", "cell", "message"),
    [
        ("Cycle (h)", "1", "title 'Cycle (h)' has the unit 'h'; expected s, ms"),
        ("Cycle (m)", "1", "title 'Cycle (m)' has the unit 'm'; expected s, ms"),
        ("Cycle", "20", "'20'; expected a unit in the title, such as period_ms"),
        ("Cycle [ms]", "20 h", "'20 h'; expected a number 0.001..1e+08 ms"),
        ("Cycle [ms]", "1.000", "'1.000'; expected a number 0.001..1e+08 ms; it may be 1 or 1000"),
    ],
)
def test_a_time_without_a_clear_unit_or_number_is_refused(tmp_path, title, cell, message):
    with pytest.raises(InputError) as caught:
        load(tmp_path, f"name;id;dlc;{title}\nA;1;8;{cell}\n")
    assert any(message in fault for fault in caught.value.faults)


def test_the_unit_in_a_title_that_is_mapped_counts(tmp_path):
    file = tmp_path / "yard.csv"
    file.write_text("Name;id;dlc;Takt (s);Rest [s]\noil;1;8;2;3\n")
    for columns, expected in (
        ({"Takt (s)": "period_ms"}, (2.0, 2.0)),
        ({"Takt (s)": "period_s"}, (2.0, 2.0)),
        ({"Takt (s)": "period_ms", "Rest [s]": "deadline_ms"}, (2.0, 3.0)),
    ):
        message = read_messages(file, columns=columns)["oil"]
        assert (message.period, message.deadline) == expected
    with pytest.raises(ArgumentError, match="columns has 'perod'; it must be one of name"):
        read_messages(file, columns={"Takt (s)": "perod"})
