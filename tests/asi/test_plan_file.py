import re
from dataclasses import replace
from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from shipnet import datasets
from shipnet.asi.master import Master
from shipnet.asi.plan import Plan, read_plan
from shipnet.asi.plan_file import COLUMNS
from shipnet.asi.profile import Profile
from shipnet.asi.segment import Repeater, Supply, Terminator
from shipnet.asi.slave import Slave
from shipnet.asi.topologies import line
from shipnet.errors import ArgumentError, InputError
from shipnet.fields import declared
from shipnet.line import CABLES
from shipnet.line.network import CableRun
from tests.asi.lines import renamed

SMALL = """kind,node,to,length_m,cable,address,profile,current_ma,voltage_v,rating_a
master,bridge,,,,,,100,,
supply,bridge,,,,,,,30.5,4
cable,bridge,deck,60.25,as-i 2.5,,,,,
slave,deck,,,,12A,S-0.A,20,,
"""
PLAN = Plan(
    [CableRun("bridge", "deck", 60.25, "as-i 2.5")],
    [Master(node="bridge", current=0.1)],
    [Supply("bridge", 30.5, 4.0)],
    [Slave("12A", "S-0.A", node="deck", current=0.02)],
)


@pytest.fixture
def load(tmp_path):
    def load(content):
        file = tmp_path / "plan.csv"
        file.write_bytes(content if isinstance(content, bytes) else content.encode())
        return read_plan(file)

    return load


def faults(load, content):
    with pytest.raises(InputError) as caught:
        load(content)
    return list(caught.value.faults)


def test_a_small_plan_is_read(load):
    assert load(SMALL) == PLAN


def shuffled(text):
    rows = [row.split(",") for row in text.splitlines()]
    return "\n".join(",".join(row[i] for i in (8, 1, 0, 3, 2, 9, 5, 4, 7, 6)) for row in rows)


@pytest.mark.parametrize(
    "content",
    [
        shuffled(SMALL),
        SMALL.replace(",", ";"),
        SMALL.replace(",", "\t"),
        SMALL.replace(",", ";").replace("60.25", "60,25").replace("30.5", "30,5"),
        SMALL.replace(",", "\t").replace("60.25", "60,25").replace("30.5", "30,5"),
        "sep=;\n" + SMALL.replace(",", ";"),
        SMALL.replace("kind,node", "Kind, NODE"),
        SMALL.replace("slave,", "Slave ,").replace("12A", "12a").replace("S-0.A", "s-0.a"),
        "\n\n,,,\n" + SMALL.replace("\n", "\n,,,,,,,,,\n\n"),
        SMALL.replace("\n", "\r\n"),
        SMALL.replace("\n", "\r"),
        SMALL.replace("\n", ",,\n"),
        re.sub("(?m)^(\\w+),", r"\1,,", SMALL),
        b"\xef\xbb\xbf" + SMALL.encode(),
        SMALL.encode("utf-16"),
        SMALL.replace("\n", ",remark, with comma\n")
        .replace("rating_a,remark", "rating_a,note")
        .replace(", with comma", ""),
        SMALL.rstrip("\n"),
        SMALL.replace("60.25", "6025e-2").replace("deck", '"deck"'),
    ],
)
def test_spreadsheets_of_all_sorts_write_the_same_plan(load, content):
    assert load(content) == PLAN


def test_empty_cells_mean_the_default(load):
    plan = load(
        "kind,node,to,length_m,address\ncable,a,b,5,\nslave,b,,,7\nrepeater,b,c,,\n"
        "cable,c,d,6,\nterminator,d,,,\nsupply,a,,,\n"
    )
    assert plan.slaves == (Slave("7", node="b"),)
    assert (plan.repeaters, plan.terminators) == ((Repeater("b", "c"),), (Terminator("d"),))
    assert (plan.cables[0].cable, plan.supplies[0].voltage) == ("as-i 1.5", 30.0)


def test_all_faults_are_reported_with_row_column_and_value(load):
    content = """kind,node,to,length_m,cable,address,profile,current_ma,voltage_v,rating_a
master,,,,,,,,,
supply,a,,,,,,,"30,5",nan

cable,a,b,-3,as-i 1.5,,,,,
cable,a,b,5 m,cat 5,12,,,,
cable,c,c,5,,,,,,
slave,b,,,,32,S-0.A,1_0,,
slave,b,,,,5C,7.A,,,
slave,b,,,,,,,,
sensor,b,,,,,,,,
cable,b,c,5,,,,,,,extra
"""
    assert faults(load, content) == [
        "row 2, column node (B): is empty; expected a value; a master needs it",
        "row 3, column rating_a (J): 'nan'; expected a number 0.01..100 A",
        "row 5, column length_m (D): '-3'; expected a number 0.01..10000 m",
        f"row 6, column cable (E): 'cat 5'; expected one of {', '.join(CABLES)}",
        "row 6, column address (F): '12'; expected an empty cell; a cable has no address",
        "row 7, cable c - c ends where it begins; its two nodes must differ",
        "row 8, column address (F): '32'; expected 0 to 31, followed by A or B for an A/B slave",
        "row 8, column current_ma (H): '1_0'; expected a number 0..10000 mA",
        "row 9, column address (F): '5C'; expected 0 to 31, followed by A or B for an A/B slave",
        "row 9, column profile (G): '7.A'; expected a profile such as S-7.A.E or S-0.F",
        "row 10, column address (F): is empty; expected a value; a slave needs it",
        "row 11, column kind (A): 'sensor'; expected one of master, supply, cable, repeater, "
        "terminator, slave",
        "row 12 has 11 cells; expected 10",
    ]


def test_structure_and_cell_faults_are_reported_together_if_all_cables_are_legal(load):
    content = SMALL + "slave,hold,,,,3,,,,\nslave,deck,,,,x,,,,\ncable,deck,bridge,9,,,,,,\n"
    assert [fault.split(";")[0] for fault in faults(load, content)] == [
        "row 6: slave 3 at hold: no cable reaches its node hold",
        "row 7, column address (F): 'x'",
        "row 8: cable deck - bridge joins two nodes that another cable already joins",
    ]
    # If a cable cannot be read, what is connected to it is not reported as loose.
    broken = SMALL.replace("60.25", "far")
    assert [fault.split(";")[0] for fault in faults(load, broken)] == [
        "row 4, column length_m (D): 'far'"
    ]


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("", "is empty"),
        ("\n,,\n", "is empty"),
        ('"",""\n', "is empty"),
        ("kind,node\n", "has no elements; expected one per row"),
        ("kind,node\nmaster,a\n", "has no row of kind cable"),
        ("kind;length [ft]\n", "row 1: title 'length [ft]' has the unit 'ft'; expected m, mm, cm"),
        ("kind;length\n", "row 1: no column node"),
        ("kind,node,node\n", "row 1: 'node' and 'node' both mean node"),
        ("node,kind,to\na,,b\n", "row 2, column kind (B): is empty; expected one of master"),
        ("kind,node,\nmaster,a,x\n", "row 2 has 3 cells; expected 2"),
        (b"kind\0node", "is not text"),
        ('kind,node\nmaster,"a\nb"\n', "a node is 'a\\nb'"),
        (
            "kind,node\nmaster," + 200_000 * "a" + "\n",
            "is not a CSV file: field larger than field limit (131072), in row 2",
        ),
        (
            "kind;node;to;length_m\ncable;a;b;1.500\ncable;b;c;7\n",
            "row 2, column length_m (D): '1.500'; expected a number 0.01..10000 m; it may be 1.5 "
            "or 1500",
        ),
    ],
)
def test_files_that_are_not_plans_are_refused(load, content, message):
    assert any(message in fault for fault in faults(load, content)), faults(load, content)


def test_a_file_that_is_not_there(tmp_path):
    with pytest.raises(InputError, match=r"none\.csv: cannot be read: No such file"):
        read_plan(tmp_path / "none.csv")
    with pytest.raises(InputError, match="cannot be read"):
        read_plan(tmp_path)


NAMES = st.text(st.characters(codec="utf-8"), min_size=1, max_size=8).filter(
    lambda name: name == name.strip() and name.isprintable()
)


def quantities(element, name):
    known = declared(element)[name]
    return st.floats(known.low, known.high)


@st.composite
def plans(draw):
    nodes = draw(st.lists(NAMES, min_size=2, max_size=6, unique=True))
    runs = [
        CableRun(a, b, draw(st.floats(0.01, 10e3)), draw(st.sampled_from([*CABLES])))
        for a, b in pairwise(nodes)
    ]
    at = st.sampled_from(nodes)
    current = quantities(Slave, "current")
    profile = st.builds(
        Profile, st.integers(0, 15), st.integers(0, 15), st.none() | st.integers(0, 15)
    )
    label = st.builds("{}{}".format, st.integers(1, 31), st.sampled_from(["", "A", "B"]))
    slave = st.builds(Slave, label, profile, node=at, current=current)
    supply = st.builds(Supply, at, quantities(Supply, "voltage"), quantities(Supply, "rating"))
    return Plan(
        runs,
        draw(st.lists(st.builds(Master, node=at, current=current), max_size=2)),
        draw(st.lists(supply, max_size=2)),
        draw(st.lists(slave, max_size=4)),
        (),
        draw(
            st.lists(
                st.builds(
                    Terminator,
                    at,
                    quantities(Terminator, "resistance"),
                    quantities(Terminator, "inductance"),
                ),
                max_size=2,
            )
        ),
    )


@given(plans(), quantities(Repeater, "delay"))
def test_a_saved_plan_is_read_back_exactly(tmp_path_factory, plan, delay):
    other = renamed(line(7.7), "\N{WAVE DASH}")
    both = Plan(
        [*plan.cables, *other.cables],
        plan.masters,
        plan.supplies,
        plan.slaves,
        [Repeater(plan.cables[0].a, other.cables[0].a, delay)],
        plan.terminators,
    )
    file = tmp_path_factory.getbasetemp() / "round.csv"
    both.save(file)
    assert read_plan(file) == both


@given(st.binary(max_size=300) | st.text(f"{SMALL}\"'", max_size=300).map(str.encode))
def test_any_file_is_a_plan_or_an_input_error(tmp_path_factory, content):
    file = tmp_path_factory.getbasetemp() / "any.csv"
    file.write_bytes(SMALL.encode()[: len(content)] + content)
    try:
        assert isinstance(read_plan(file), Plan)
    except InputError as error:
        assert error.faults


def test_only_columns_in_use_are_written(tmp_path):
    line(100, 1).save(tmp_path / "plan.csv")
    header = (tmp_path / "plan.csv").read_text().splitlines()[0]
    unused = ("channels", "conversion_ms", "delay_us", "resistance_ohm", "inductance_uh")
    assert header.split(",") == [c for c in COLUMNS if c not in unused]


def test_a_module_for_values_keeps_its_channels_and_conversion(load, tmp_path):
    rows = "kind,node,to,length_m,address,profile,channels,conversion_ms\ncable,a,b,5,,,,\n"
    plan = load(rows + "slave,b,,,7,S-7.3,4,22.5\nslave,b,,,8,,,\n")
    assert (plan.slaves[0].channels, plan.slaves[0].conversion) == (4, 0.0225)
    plan.save(tmp_path / "saved.csv")
    assert read_plan(tmp_path / "saved.csv") == plan
    for cell in ("5", "1.5", "x"):
        with pytest.raises(InputError, match="channels"):
            load(rows + f"slave,b,,,7,S-7.3,{cell},\n")


def test_a_custom_cable_cannot_be_saved(tmp_path):
    with pytest.raises(ArgumentError, match="has a custom cable"):
        line(100, cable=CABLES["as-i 1.5"]).save(tmp_path / "plan.csv")


# The plans that come with the package.


def with_slaves(plan, slaves):
    return Plan(plan.cables, plan.masters, plan.supplies, slaves, plan.repeaters)


def test_the_300_m_of_kim2023():
    far = line(100, [100] * 62, supply=100)
    far = with_slaves(far, [replace(slave, profile="S-0.A") for slave in far.slaves])
    plan = line(100).with_repeater("100 m", line(100), prefix="2: ")
    plan = plan.with_repeater("2: 100 m", far, prefix="3: ")
    assert read_plan(datasets.path("synthetic_asi_plan_300m.csv")) == plan
    assert {segment.reach for segment in plan.segments if segment.slaves} == {300}
    assert (len(plan.slaves), len(plan.repeaters)) == (62, 2)
    assert plan.check().ok


def submarine():
    """Return 14 lines, five of them with a repeater, and 190 slaves as evenly as possible."""
    lines = []
    for number in range(1, 15):
        n = 14 if number <= 8 else 13
        plan = line(6 * n, n)
        if number <= 5:
            aft = line(84, 7, supply=48)
            plan = line(84, 7).with_repeater("84 m", aft, prefix="aft ")
        lines.append(renamed(plan, f"L{number:02} "))
    kinds = ("cables", "masters", "supplies", "slaves", "repeaters")
    together = {kind: [e for plan in lines for e in getattr(plan, kind)] for kind in kinds}
    valves = Profile(7, 0xF)
    together["slaves"] = [replace(slave, profile=valves) for slave in together["slaves"]]
    return Plan(**together)


def test_the_submarine_of_kim2023():
    plan = read_plan(datasets.path("synthetic_asi_plan_submarine.csv"))
    assert plan == submarine()
    assert (len(plan.masters), len(plan.slaves), len(plan.repeaters)) == (14, 190, 5)
    assert len(plan.lines) == 14
    assert len(plan.segments) == 14 + 5
    # No address is shared, so every line is fast; 13.6 slaves per line need no A/B slave.
    # 15 transactions, the last a search; seven of them wait for a repeater.
    assert plan.check(wanted_cycle=2.6e-3).ok and not plan.check(wanted_cycle=2.5e-3).ok
    assert max(segment.reach for segment in plan.segments) == 168


def test_the_ballast_plan_as_a_user_would_write_it():
    plan = read_plan(datasets.path("synthetic_asi_plan_ballast.csv"))
    assert [slave.label for slave in plan.slaves] == ["1", "2", "3", "4", "5A", "5B"]
    assert plan.segments[0].length == 81
    assert plan.check(wanted_cycle=5e-3).ok


# Plans as yards write them.


@pytest.mark.parametrize(
    "content",
    [
        "HULL 1;;;;;;;;;\nAS-i line 1;;;;;;;;;\n" + SMALL.replace(",", ";"),
        SMALL.replace("length_m", "length [m]").replace("current_ma", "current [mA]"),
        SMALL.replace("length_m", "Length (mm)").replace("60.25", "60250"),
        SMALL.replace("length_m", "length").replace("60.25", "60.25 m").replace("20", "0.02 A"),
        SMALL.replace("cable,bridge", "FORE SHIP,,,,,,,,,\ncable,bridge"),
        SMALL.replace("master,", '"CABLES",,,,,,,,,\nmaster,'),
        SMALL.replace("\n", ",\n").replace("rating_a,", "rating [A],remark"),
        SMALL.replace("voltage_v,rating_a", "voltage,rating"),
        SMALL.replace("kind,node", "Element,Node").replace("cable,address", "cable type,address"),
        SMALL + SMALL.splitlines()[0] + "\n",
    ],
)
def test_a_plan_of_a_yard_is_read_like_a_plain_one(load, content):
    assert load(content) == PLAN


def test_what_is_left_out_of_a_plan_or_not_used_is_said(load):
    plan = load(
        SMALL.replace("rating_a", "rating_a,maker").replace("\ncable,", "\nFORE SHIP\ncable,")
    )
    assert plan.remarks == (
        "not used: maker",
        "left out, not an element: a subtitle, page header, page footer or note: 1 row (4)",
    )
    assert "not used: maker" in repr(plan)
    assert PLAN.remarks == ()


def test_a_unit_that_is_unknown_or_missing_is_refused(load):
    ft, bare = SMALL.replace("length_m", "length [ft]"), SMALL.replace("current_ma", "current")
    assert "has the unit 'ft'; expected m, mm, cm" in faults(load, ft)[0]
    assert (
        "'100'; expected a unit in the title, such as current_ma or [mA]" in faults(load, bare)[0]
    )
