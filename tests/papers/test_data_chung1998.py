import pandas as pd
import pytest

from shipnet import datasets


def read(what):
    return pd.read_csv(
        datasets.path(f"chung1998_{what}.csv"), dtype=str, keep_default_na=False, encoding="utf-8"
    )


@pytest.fixture(scope="module")
def packet():
    return read("packet_format").set_index("field")


@pytest.fixture(scope="module")
def parameters():
    return read("parameters")


@pytest.fixture(scope="module")
def value(parameters):
    def number(text):
        return int(text, 16) if text.startswith("0x") else float(text)

    return dict(zip(parameters.parameter, parameters.value.map(number), strict=True))


@pytest.fixture(scope="module")
def states():
    return read("ring_states").set_index("case")


def cases_reached(states, leads, size):
    case_of = {
        (row.ring_flags == "same", row.no_against_get_no == "<"): case
        for case, row in states.iterrows()
    }

    def pointer_case(written, taken):
        same_flag = written // size % 2 == taken // size % 2
        return case_of[same_flag, written % size < taken % size]

    return {pointer_case(taken + lead, taken) for lead in leads for taken in range(2 * size)}


def test_packet_fields_in_printed_order(packet):
    assert packet.order.astype(int).tolist() == [1, 2, 3, 4, 5, 6]
    assert packet.index.tolist() == [
        "packet_start",
        "data_start",
        "number",
        "low",
        "high",
        "packet_end",
    ]
    assert (packet.length_byte == "1").all()


def test_packet_data_are_number_low_high(packet):
    assert packet.index[packet.kind == "data"].tolist() == ["number", "low", "high"]


def test_packet_flags_are_repeated_nibbles_and_data_have_no_fixed_value(packet):
    flags = packet[packet.kind == "flag"].value
    assert flags.to_dict() == {"packet_start": "0xCC", "data_start": "0xDD", "packet_end": "0xEE"}
    assert all(flag[2] == flag[3] for flag in flags)
    assert (packet[packet.kind == "data"].value == "").all()


def test_packet_agrees_with_parameters(packet, value):
    for field in ("packet_start", "data_start", "packet_end"):
        assert int(packet.value[field], 16) == value[f"{field}_flag"]
    for part in ("low", "high"):
        assert int(packet.length_bit[part]) == value[f"{part}_part"] == 8
        assert int(packet.ring_offset[part]) == value[f"{part}_offset"]
        steps = int(packet.order[part]) - int(packet.order["number"])
        assert steps == value[f"{part}_offset"]


@pytest.mark.parametrize(
    ("reading", "once", "per_datum", "ten"), [("a", 3, 3, 33), ("b", 2, 4, 42), ("c", 0, 6, 60)]
)
def test_packet_length_of_each_reading(packet, value, reading, once, per_datum, ten):
    repeat = packet[f"repeat_reading_{reading}"]
    assert ((repeat == "1").sum(), (repeat == "n").sum()) == (once, per_datum)
    assert once + per_datum * value["data_count"] == ten < value["ring_size"]


def test_parameters_are_unique_and_placed(parameters):
    assert len(parameters) == 53
    assert parameters.parameter.is_unique
    places = parameters["where"].str.split("; ").explode()
    assert places.str.fullmatch(r"Abstract|[1-5](\.[1-3])?|Fig [1-9](\([ab]\))?").all()


def test_units_are_from_a_short_list(parameters):
    counted = "subsystems|IRQ lines|(interrupt|timer) controllers|chips|rings|index|ticks|misses"
    counted += "|variables|cases|places|data|segments|events|presses|bit number"
    assert parameters.unit.str.fullmatch(f"|s|bit|byte|bit/s|{counted}").all()


def test_baud_rates_halve(value):
    rates = [value[f"baud_rate_{k}"] for k in range(1, 6)]
    assert rates == [9600 / 2**k for k in range(5)]


def test_failure_time_is_thresholds_times_tick(value):
    product = value["tick"] * value["count_threshold"] * value["miss_threshold"]
    assert product == pytest.approx(value["failure_time"])


def test_counts_that_follow_from_others(value):
    assert value["txrdy_mask"] == 1 << int(value["txrdy_bit"])
    assert value["chips_8251"] == value["subsystems"] - 1
    assert value["chips_8259"] == value["proposed_interrupt_controllers"]
    assert value["chips_8253"] == value["proposed_timer_controllers"]
    assert value["virtual_rings"] == value["ring_flag_max"] - value["ring_flag_min"] + 1
    assert value["high_shift"] == value["low_part"]
    assert value["pointer_variables"] == 4


def test_ring_size_splits_into_halves(value):
    half = int(value["ring_size"]) >> int(value["half_ring_shift"])
    assert value["ring_size"] == 2**7 == value["half_ring_cases"] * half


def test_counters_and_flags_move_by_one(value):
    steps = {name: number for name, number in value.items() if name.endswith("_step")}
    assert steps == dict.fromkeys(["no_step", "count_step", "miss_step", "get_no_step"], 1)
    assert (value["comm_f_transmit"], value["comm_f_receive"]) == (0, 1)
    assert (value["no_after_ring_end"], value["ring_f_after_first_ring_end"]) == (0, 1)
    assert value["txrdy_ready"] == value["write_size"] == value["physical_rings"] == 1


def test_compared_product_needs_more_hardware(value):
    assert value["norcon_subsystems"] == value["subsystems"]
    lines, timers = value["norcon_8259_irq_lines"], value["norcon_timer_controllers"]
    assert (lines, timers) == (2, 3)
    assert lines > value["proposed_interrupt_controllers"]
    assert timers > value["proposed_timer_controllers"]
    assert value["norcon_cpu_width"] == value["low_part"] + value["high_part"]


def test_reported_events(value):
    assert value["abnormal_events_without_parameter_change"] == 0
    assert value["abnormal_events_with_enter_presses"] == 1
    assert value["enter_presses_min"] == 10


def test_four_ring_states_in_printed_order(states, value):
    assert states.order.tolist() == ["1", "2", "3", "4"]
    assert len(states) == value["pointer_cases"]
    pairs = list(zip(states.ring_flags, states.no_against_get_no, strict=True))
    assert pairs == [("same", "<"), ("same", ">="), ("different", ">="), ("different", "<")]
    assert (states.ring_group == states.ring_flags + " ring").all()


def test_normal_states_are_those_of_a_lead_below_one_ring(states, value):
    size = int(value["ring_size"])
    normal = set(states.index[states.paper_class == "normal"])
    assert cases_reached(states, range(size), size) == normal == {"b", "d"}


def test_abnormal_states_are_those_of_a_lead_of_one_to_two_rings(states, value):
    size = int(value["ring_size"])
    abnormal = set(states.index[states.paper_class == "abnormal"])
    assert cases_reached(states, range(size, 2 * size), size) == abnormal == {"a", "c"}


def test_each_ring_state_is_handled_in_the_figure_of_its_ring(states):
    figure = states.handled_in.str.extract(r"(Fig 8\([ab]\))")[0]
    assert figure.to_dict() == {"a": "Fig 8(a)", "b": "Fig 8(a)", "c": "Fig 8(b)", "d": "Fig 8(b)"}
    assert states.index[states.handled_in.str.contains("Fig 9")].tolist() == ["c"]
    treatment = states.paper_treatment
    assert states.index[treatment.str.contains("comm_f")].tolist() == ["a"]
    assert states.index[treatment.str.contains("dropped")].tolist() == ["c"]
    assert states.index[treatment.str.startswith("normal")].tolist() == ["b", "d"]
