"""Settings of a comparison, by name: read from a file, and reported if they are changed."""

import re
import subprocess
import sys
import tomllib
from dataclasses import fields, is_dataclass

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from shipnet.__main__ import main
from shipnet.design.catalogue import Assumptions, Range
from shipnet.design.iolist import IoList
from shipnet.design.settings import Settings, kind_of, legal, names
from shipnet.errors import ArgumentError, InputError
from shipnet.toml_file import shown

LIST = "tag,signal,x,y,z\n" + "".join(f"LS-{n},contact,{10 + 3 * n},{n % 3},1\n" for n in range(6))
EVERY = st.sampled_from(names())


def test_every_value_has_a_name_and_every_name_a_value():
    settings = Settings()
    expected = {f"assumptions.{name}" for name in Assumptions()}
    for setting in (
        setting for setting in fields(settings) if setting.name not in ("assumptions", "reading")
    ):
        part = getattr(settings, setting.name)
        inner = (
            [f"{setting.name}.{field.name}" for field in fields(part)] if is_dataclass(part) else []
        )
        expected |= set(inner) or {setting.name}
    assert set(names()) == expected and len(names()) == len(expected)
    basis = Settings()
    assert basis["asi.length"] == settings.asi.length and basis["detour"] == basis.detour
    assert basis["assumptions.gland"] == Assumptions()["gland"]


@pytest.mark.parametrize("name", names())
def test_every_value_has_a_meaning_and_a_legal_range(name):
    assert len(kind_of(name).help) > 5 and not re.search("`|]_", kind_of(name).help)
    assert len(legal(name)) > 3
    # An illegal value is refused in the same words.
    _, faults = Settings().tried({name: "no such thing"})
    assert faults == [f"{name} is 'no such thing'; it must be {legal(name)}"]


#: Another legal value for each setting.
OTHERS = {
    "detour": 1.3,
    "tails": 0,
    "host_time": 0.25,
    "spare": 0.5,
    "update": 2,
    "fed": False,
    "feeder": "MI1P075",
    "can.bit_rates": [125_000],
    "modbus.bit_rates": [9600],
    "modbus.character": "8N2",
    "asi.cable": "ASI_FLAT",
    "can.cable": "N2K_MID",
    "modbus.cable": "RS485_9843",
    "assumptions.labour_rate": [55, 60.5, 70],
}


def other(name):
    if name in OTHERS:
        return OTHERS[name]
    value = Settings()[name]
    if isinstance(value, bool):
        return not value
    if isinstance(value, Range):
        return [value.nominal, value.nominal, value.high + 1]
    if isinstance(value, int):
        return value - 1 if value > 1 else value + 1
    return 0.9 * value


def test_printed_settings_are_read_back_unchanged():
    default = Settings().text()
    assert Settings.parse(default) == Settings()
    everything = Settings({name: other(name) for name in names()})
    assert everything.changes().index.tolist() == list(names())
    text = everything.text()
    again = Settings.parse(text)
    assert again == everything and again.text() == text
    # The file has whole tables, which any TOML reader accepts.
    tables = tomllib.loads(text)
    assert tables["asi"]["length"] == everything.asi.length
    assert tables["assumptions"]["labour_rate"] == [55, 60.5, 70]
    for name in names():
        assert f"Default {shown(Settings()[name])}." in text
        assert legal(name).split(",")[0] in text
    assert "Default" not in default
    assert max(map(len, text.splitlines())) < 160


@given(st.dictionaries(EVERY, st.booleans()).map(list))
def test_any_selection_of_values_survives_a_file(chosen):
    basis = Settings({name: other(name) for name in chosen})
    assert Settings.parse(basis.text()) == basis
    assert set(basis.changes().index) == set(chosen)


def test_a_price_may_be_one_number_and_is_then_the_users_own():
    basis = Settings.parse("[assumptions]\nasi_module = 118\n")
    assert basis.assumptions["asi_module"] == Range(118, 118, 118)
    entry = basis.assumptions.entry("asi_module")
    assert (entry.status, entry.unit) == ("given", "EUR")
    assert basis.assumptions.entry("gland").status == "assumed"


FAULTY = """\
detour = 0.5
spare = "much"
tials = 3
host_time = 61
feeder = "ROPE"
update = nan

[asi]
length = 20_000
inputs = 2.5
shared = 1
lenght = 90

[can]
bit_rates = [500_000, 10]

[modbus]
character = "7E1"
bit_rates = []

[assumptions]
gland = [9, 8, 20]
box = [1, 2]
labour_rate = -1
supply = true
crew = 4
"""


def test_all_faults_are_reported_at_once_with_name_value_and_legal_range(tmp_path):
    path = tmp_path / "own.toml"
    path.write_text(FAULTY, encoding="utf-8")
    with pytest.raises(InputError) as error:
        Settings.read(path)
    price = "it must be [low, nominal, high] in this order, or one number; 0 or more and finite"
    rates = "it must be one or more whole numbers 1000..1000000"
    assert error.value.faults == (
        "detour is 0.5; it must be 1..10",
        "spare is 'much'; it must be 0..10",
        "there is no setting 'tials'; the nearest is tails",
        "host_time is 61; it must be 0..60 s",
        f"feeder is 'ROPE'; it must be {legal('feeder')}",
        "update is nan; it must be 0.0001..3600 s",
        "asi.length is 20000; it must be 1..10000 m",
        "asi.inputs is 2.5; it must be a whole number 1..4",
        "asi.shared is 1; it must be true or false",
        "there is no setting 'asi.lenght'; the nearest is asi.length",
        f"can.bit_rates is [500000, 10]; {rates}",
        "modbus.character is '7E1'; it must be one of '8E1', '8E2', '8O1', '8O2', '8N1', '8N2'",
        f"modbus.bit_rates is []; {rates}",
        f"assumptions.gland is [9, 8, 20]; {price}",
        f"assumptions.box is [1, 2]; {price}",
        f"assumptions.labour_rate is -1; {price}",
        f"assumptions.supply is true; {price}",
        "there is no setting 'assumptions.crew'; see shipnet design --show-settings",
    )
    assert str(error.value).startswith(f"{path}: detour is 0.5") and "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("text", "fault"),
    [
        ("detour = 1.2\ndetour = 1.3", "is not a TOML file: Cannot overwrite a value"),
        ("detour 1.2", "is not a TOML file: "),
        ("[asi", "is not a TOML file: "),
        ("a = " + "[" * 100_000, "nests values more than 8 deep"),
        ("asi.length" + ".a" * 3000 + " = 1", "nests values more than 8 deep"),
        ("detour = " + "{a = " * 9 + "1" + "}" * 9, "nests values more than 8 deep"),
        ("[" + "a." * 200_000 + "b]", "nests values more than 8 deep"),
        ("# " + "x" * 1_000_000, "has 1000002 characters; at most 1000000 are allowed"),
        ("detour = " + "9" * 10_000, "is not a TOML file: "),
        ("asi = 5", "there is no setting 'asi'"),
        ("detour = 0x" + "f" * 10_000, "detour is a very large number; it must be"),
        ("detour = 1e999", "detour is inf; it must be"),
        ("detour = 1979-05-27", "detour is datetime.date(1979, 5, 27); it must be"),
        ("detour.a = 1", "there is no setting 'detour.a'; see shipnet design --show-settings"),
        ("feeder = '[[[[[[[[[[' # a.b.c.d.e.f.g.h.i.j", "feeder is '[[[[[[[[[['; it must be"),
        ("feeder = [[1]]", "feeder is [[1]]; it must be one of"),
        ("[assumptions.gland]\nlow = 1", "assumptions.gland is {'low': 1}; it must be [low"),
        ("spare = '" + "x" * 1000 + "'", "...; it must be 0..10"),
    ],
)
def test_files_that_are_not_settings_are_refused_in_one_line(text, fault):
    with pytest.raises(InputError) as error:
        Settings.parse(text)
    assert fault in str(error.value)
    assert len(str(error.value)) < 400 and "\n" not in str(error.value)


WORDS = "detour asi [asi] [assumptions] gland length . 1.5 true {} nan -1 # '".split()
WORDS += ["[1, 2, 3]", '"8E1"', "[[can]]", '"""', " = ", "\n", "\\", "\r", "\0"]


@given(st.lists(st.sampled_from(WORDS), max_size=12).map("".join) | st.text(max_size=40))
@example("\ufeffdetour = 1.5")
def test_any_text_is_read_as_settings_or_raises_an_input_error(text):
    try:
        basis = Settings.parse(text)
    except InputError as error:
        assert "\n" not in str(error)
        return
    assert Settings.parse(basis.text()) == basis


def test_any_encoding_and_line_ending_of_an_editor_is_read(tmp_path):
    path = tmp_path / "own.toml"
    for data in (
        "detour = 1.5\r\ntails = 3\r\n".encode("utf-8-sig"),
        "detour=1.5\ntails=3".encode("utf-16"),
    ):
        path.write_bytes(data)
        assert Settings.read(path) == Settings({"detour": 1.5, "tails": 3})


def test_values_may_come_from_an_array():
    grid = np.array([1.25, 1.5])
    assert [Settings({"detour": value}).detour for value in grid] == [1.25, 1.5]
    rates = Settings({"can.bit_rates": np.array([125_000, 250_000])})
    assert rates.can.bit_rates == (125_000, 250_000)
    assert Settings({"asi.inputs": np.int64(2)}).asi.inputs == 2


def test_wrong_parts_of_settings_are_named():
    for made, fault in (
        (lambda: Settings({"detour": 0.9}), "detour is 0.9; it must be 1..10"),
        (lambda: Settings({"host_time": -1}), "host_time is -1; it must be 0..60 s"),
        (lambda: Settings()["x"], "there is no setting 'x'"),
        (lambda: kind_of("x"), "there is no setting 'x'"),
        (lambda: legal("x"), "there is no setting 'x'"),
        (lambda: Settings({"x": 1, "spare": 99}), "there is no setting 'x'.*; spare is 99"),
    ):
        with pytest.raises(ArgumentError, match=fault):
            made()


def test_a_comparison_and_its_report_show_changed_settings():
    iolist = IoList.parse(LIST)
    basis = Settings(
        {"detour": 1.4, "host_time": 0.25, "can.nodes": 8, "assumptions.can_station": 500}
    )
    comparison = iolist.compare((0, 0, 5), ["home runs", "CAN"], settings=basis)
    assert comparison.settings == basis
    changes = comparison.changes().set_index("name")
    assert set(changes["designs"]) == {"all"}
    assert changes["value"].to_dict() == {
        "detour": 1.4,
        "host_time": 0.25,
        "can.nodes": 8,
        "assumptions.can_station": Range(500, 500, 500),
    }
    assert changes["default"]["can.nodes"] == 50
    page = comparison.html()
    assert "Values that differ from the defaults." in page
    assert "<td>assumptions.can_station</td>" in page and "<td>[500, 500, 500]</td>" in page
    assert "1.4 times as long as its route, plus 5 m for both ends." in page
    assert "The time in the host, 0.25 s, is added to a response if the rule includes it." in page
    usual = iolist.compare((0, 0, 5), ["home runs"]).html()
    assert "Every limit, price and allowance has its default value." in usual
    assert "5 m for both ends (both assumed)." in usual


def test_the_command_takes_a_file_and_prints_one(tmp_path, capsys):
    points, settings_file, report = (
        tmp_path / name for name in ("list.csv", "own.toml", "report.html")
    )
    points.write_text(LIST, encoding="utf-8")
    assert main(["design", "--show-settings"]) == 0
    assert Settings.parse(capsys.readouterr().out) == Settings()
    settings_file.write_text("detour = 1.5\n[assumptions]\nlabour_rate = 70\n", encoding="utf-8")
    command = ["design", str(points), "--cabinet", "0,0,5", "--options", "HOME RUNS, can"]
    assert main(command) == 0
    usual = capsys.readouterr().out
    assert main([*command, "--settings", str(settings_file), "-o", str(report)]) == 0
    out = capsys.readouterr().out
    changed = "changed: detour 1.5 (default 1.15)\nchanged: assumptions.labour_rate [70, 70, 70]"
    assert changed in out and "changed: " not in usual
    assert "1.5 times as long as its route" in report.read_text(encoding="utf-8")
    (longer,), (shorter,) = (
        [float(line.split()[-1]) for line in text.splitlines() if line.startswith("cable length")]
        for text in (out, usual)
    )
    assert longer > 1.2 * shorter
    assert (
        main(["design", "--settings", str(settings_file), "--show-settings", "--set", "fed=false"])
        == 0
    )
    expected = Settings({"detour": 1.5}).replace({"fed": False, "assumptions.labour_rate": 70})
    assert Settings.parse(capsys.readouterr().out) == expected


def test_the_settings_are_printed_without_docstrings_too():
    command = [sys.executable, "-OO", "-m", "shipnet", "design", "--show-settings"]
    assert subprocess.check_output(command, text=True) == Settings().text()


def test_settings_are_equal_by_their_values():
    settings = Settings({"tails": 2.0})
    assert settings != Settings() and settings.replace({"tails": 5}) == Settings()
    assert hash(settings.replace({"tails": 5})) == hash(Settings())
    assert Settings({"asi": {"length": 60}}) == Settings({"asi.length": 60})
    assert str(Settings()) == "all defaults" and len(Settings().changes()) == 0
    table = settings.table()
    assert table.index.tolist() == list(names()) and table.loc["tails", "value"] == 2.0
    assert table.loc["asi.length", ["unit", "legal"]].tolist() == ["m", "1..10000 m"]


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("[assumptions]\ngland = 8\ndetour = 1.3", "no setting 'assumptions.detour'; use detour$"),
        ("labour_rate = 60", "no setting 'labour_rate'; use assumptions.labour_rate$"),
        ("length = 60", "no setting 'length'; use asi.length or modbus.length$"),
        ("[can]\nlenght = 60", "no setting 'can.lenght'; see shipnet design --show-settings$"),
    ],
)
def test_a_name_in_the_wrong_table_is_reported_with_its_right_place(text, said):
    with pytest.raises(InputError, match=said):
        Settings.parse(text)


@pytest.mark.parametrize("text", ["spare = 0.3\ndetour = 1,3", "[boxes]\nreach=10,5  # m"])
def test_a_decimal_comma_in_settings_is_named(text):
    with pytest.raises(
        InputError, match=r"is not a TOML file: .*; 10?,[35] has a comma instead of a point$"
    ):
        Settings.parse(text)
    with pytest.raises(InputError) as refusal:
        Settings.parse("spare =")
    assert "comma" not in str(refusal.value)
