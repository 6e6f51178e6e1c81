from dataclasses import replace

import numpy as np
import pytest

from shipnet.can import Frame, decode
from shipnet.crc import CAN, MODBUS, Crc
from shipnet.engine.class_rules import Description, Redundancy, check
from shipnet.engine.points import read_points
from shipnet.errors import ArgumentError
from shipnet.modbus.pdu import Request
from shipnet.modbus.polling import Poll
from shipnet.modbus.uart import SerialLine

POINTS = read_points()
SLOW = Poll(Request.read_holding_registers(0, 99), SerialLine(600), timeout=10, retries=2)
#: A description that passes every rule.
GOOD = Description(
    POINTS,
    cpus=2,
    supplies=2,
    power_switch_over=2.0,
    volatile=False,
    protocols=("CAN", "Modbus RTU"),
    links={"1": ("JB1",), "2": ("JB3",)},
    routes={"1": ("port",), "2": ("starboard",)},
    poll=Poll(Request.read_holding_registers(0, 99), SerialLine(9600), retries=1),
    retries_known=True,
)


def verdicts(system):
    table = check(system).table()
    return dict(zip(table.rule, table.verdict, strict=True))


def test_the_printed_system_fails_by_its_single_cpu_and_leaves_five_rules_open():
    found = verdicts(Description.printed())
    assert [rule for rule, verdict in found.items() if verdict == "violated"] == ["CPU duplicated"]
    assert [rule for rule, verdict in found.items() if verdict == "not verified"] == [
        "supply duplicated",
        "supply changes over",
        "memory",
        "links routed apart",
        "retransmission",
    ]
    computed = check(Description.printed()).table().set_index("rule").value
    # Request, silence and 5 + 2 x 99 bytes: the poll of a whole box without the final silence.
    assert computed["answer"] == pytest.approx((8 + 3.5 + 203) * 11 / 9600)


def test_what_is_not_described_is_not_verified():
    assert set(verdicts(Description(POINTS)).values()) == {"not verified"}
    assert check(Description(POINTS)).table().value.isna().all()


def test_a_good_system_passes_every_rule():
    assert set(verdicts(GOOD).values()) == {"met"}


@pytest.mark.parametrize(
    ("change", "rule"),
    [
        ({"cpus": 1}, "CPU duplicated"),
        ({"supplies": 1}, "supply duplicated"),
        ({"power_switch_over": 2.0001}, "supply changes over"),
        ({"volatile": True}, "memory"),
        ({"links": {"1": ("JB1",), "2": ("JB1",)}}, "links duplicated"),
        ({"links": {"1": ("JB1",)}, "routes": {"1": ("port",)}}, "links duplicated"),
        ({"routes": {"1": ("port", "tray"), "2": ("tray",)}}, "links routed apart"),
        ({"poll": SLOW}, "answer"),
        ({"poll": replace(GOOD.poll, retries=0)}, "retransmission"),
    ],
)
def test_each_rule_alone_can_fail(change, rule):
    found = verdicts(replace(GOOD, **change))
    assert found.pop(rule) == "violated"
    assert "violated" not in {v for name, v in found.items() if name != "links routed apart"}


def test_a_protocol_without_a_standard_violates_two_rules():
    found = verdicts(replace(GOOD, protocols=("CAN", "homemade")))
    failed = [rule for rule, verdict in found.items() if verdict == "violated"]
    assert failed == ["standard protocol", "CRC"]
    assert verdicts(replace(GOOD, protocols=("CAN",), poll=None))["retransmission"] == "met"
    assert verdicts(replace(GOOD, retries_known=False))["retransmission"] == "not verified"


def test_a_box_as_printed_fails_with_its_supply_and_with_its_processor():
    failures = Redundancy(POINTS).table()
    assert sorted(failures["dead"].str.split().str[0].value_counts()) == [3, 3]
    assert (failures["boxes_lost"] != "").all()


def test_two_separate_links_of_three_meet_the_rule():
    links = {"1": ("JB1",), "2": ("JB1", "JB3"), "3": ("JB3",)}
    routes = dict.fromkeys(links, ("a",))
    table = check(replace(GOOD, links=links, routes=routes)).table().set_index("rule")
    assert table.value["links duplicated"] == 2
    assert table.why["links duplicated"] == "shared: JB1, JB3"
    assert table.verdict["links routed apart"] == "violated"


def test_the_answer_is_judged_at_the_limit():
    # A response that takes exactly two seconds still passes.
    poll = Poll(Request.read_holding_registers(0, 99), SerialLine(9600), timeout=10)
    line = poll.line.frame_time(8) + poll.shortest_timeout
    for extra, verdict in ((-1e-6, "met"), (1e-6, "violated")):
        late = replace(poll, processing=2 - line + extra)
        assert verdicts(replace(GOOD, poll=late))["answer"] == verdict


#: A frame in which two wrong bits remove one stuff bit and create another.
STUFFED = Frame(0x1F3, bytes.fromhex("00F0FFFF00647B0F"))


def test_two_wrong_bits_after_bit_stuffing_can_pass_the_crc_of_can():
    wrong = list(STUFFED.bits)
    for place in (39, 85):
        wrong[place] = "10"[int(wrong[place])]
    assert decode("".join(wrong)).data.hex() == "00f0bbff80323d8f"
    # Without bit stuffing, the CRC detects every such error.
    assert CAN.undetected(payload=8) == 0


def test_a_useless_crc_violates_its_rule(monkeypatch):
    monkeypatch.setattr(
        Crc, "of", lambda crc, rows: np.zeros(np.shape(rows)[:1], np.int64) if np.ndim(rows) else 0
    )
    assert MODBUS.undetected(flips=1) == 48
    assert verdicts(GOOD)["CRC"] == "violated"


def test_lists_of_names_become_tuples():
    listed = Description(POINTS, protocols=["CAN"], links={"1": ["JB1"], "2": ["JB3"]})
    assert listed.protocols == ("CAN",)
    assert listed.links == {"1": ("JB1",), "2": ("JB3",)}
    assert hash(listed) == hash(Description(POINTS, protocols=("CAN",)))


def test_wrong_descriptions_are_refused():
    for action, message in (
        (lambda: Description(POINTS, protocols="CAN"), "protocols is 'CAN'"),
        (lambda: Description(POINTS, protocols=()), r"protocols is \(\)"),
        (lambda: Description(POINTS, routes={"1": ("a",)}), "routes and links must name"),
        (lambda: Redundancy(POINTS, cpus=5), "cpus is 5"),
        (lambda: Description(POINTS, links={"1": "JB1"}), "each link must have a tuple"),
        (lambda: Description(POINTS, links={}), r"links is \{\}"),
        (lambda: Description(POINTS, routes={"1": "port"}), "each link must have a tuple"),
    ):
        with pytest.raises(ArgumentError, match=message):
            action()
