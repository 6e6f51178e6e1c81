"""Evidence for verdicts against kim2014 that need more than the claim's own function."""

import numpy as np
import pytest
from pymodbus.client import ModbusTcpClient, ModbusUdpClient
from pymodbus.exceptions import ModbusIOException
from pymodbus.framer import FramerSocket
from pymodbus.pdu import DecodePDU
from pymodbus.transport import CommType

from shipnet import datasets
from shipnet.ballast.plant import Plant
from shipnet.ballast.registers import SCALES, Code, RegisterMap, command_codes
from shipnet.ballast.rule_table import rule_vectors
from shipnet.ballast.sensors import CHANNELS
from shipnet.ballast.slave import valve_slaves
from shipnet.errors import ArgumentError, LengthError
from shipnet.modbus.faults import Break, Short
from shipnet.modbus.frame import rtu_frame
from shipnet.modbus.pdu import Request, Response, decode
from shipnet.modbus.redundancy import Loop
from shipnet.modbus.uart import SerialLine
from shipnet.modbus.udp import LossyPath, compare
from shipnet.papers.kim2014 import faults as k_faults
from shipnet.papers.kim2014 import line as k_line
from shipnet.papers.kim2014 import registers as k_regs
from shipnet.papers.kim2014.line import switch_table
from shipnet.papers.kim2014.registers import (
    STANDARD,
    answer_table,
    code_table,
    printed_adu,
    survival_table,
)
from shipnet.papers.registry import REGISTRY
from tests.ballast.nominal import normal_values

READ = Request.read_input_registers(0x4020, 4)
PRINTED = rule_vectors("printed")


# Addresses.


def test_ids_above_247_are_refused():
    assert k_line.slaves_of_a_master() == 247
    for unit in (248, 250, 255):
        with pytest.raises(ArgumentError, match=r"0\.\.247"):
            rtu_frame(unit, READ.pdu)
        with pytest.raises(ArgumentError):
            Loop(unit, k_line.status_poll())


def test_256_ids_count_the_broadcast_and_the_reserved_ones():
    verdicts = switch_table()["verdict"].value_counts()
    assert verdicts["legal"] == 247
    in_a_byte = verdicts["legal"] + verdicts["reserved"] + verdicts["the broadcast"]
    assert in_a_byte == k_line.selectable_ids() == 256
    assert verdicts.sum() == 400 > 256


# Messages.


def theirs(adu):
    """What pymodbus makes of a response over TCP."""
    used, pdu = FramerSocket(DecodePDU(False)).handleFrame(adu, 1, 0)
    assert used == len(adu)
    return pdu


def test_the_second_byte_is_a_count():
    for n in (1, 4, 125):
        assert Response(4, registers=[0] * n).pdu[1] == 2 * n
    assert not k_regs.names_a_register()


def test_the_printed_error_cannot_be_read():
    with pytest.raises(LengthError):
        Response.parse(decode(printed_adu("write error"), "tcp").pdu)
    error = Response.parse(decode(STANDARD["write error"], "tcp").pdu)
    assert (error.function, error.exception) == (6, 1)
    assert theirs(STANDARD["write error"]).exception_code == 1
    # The same bytes but one.
    differ = [
        (a, b)
        for a, b in zip(printed_adu("write error"), STANDARD["write error"], strict=True)
        if a != b
    ]
    assert differ == [(0x06, 0x86)]


def test_the_printed_read_response_is_refused():
    ours, printed = STANDARD["read response"], printed_adu("read response")
    assert (ours[5], printed[5]) == (11, 14)
    assert Response.parse(decode(ours, "tcp").pdu, READ).registers == (0, 0, 0, 0)
    assert theirs(ours).registers == [0, 0, 0, 0]
    with pytest.raises(LengthError):
        Response.parse(decode(printed, "tcp").pdu, READ)
    with pytest.raises(ModbusIOException):
        theirs(printed)
    # The paper's own first table gives the PDU of the standard.
    assert k_regs.table_1()["read response"] == len(ours) - 7 == 10 == len(printed) - 10


def test_table_3_has_two_readings_in_a_register():
    registers = [scale.register for scale in SCALES]
    assert len(set(registers)) == 3 < len(registers) == len(CHANNELS) == REGISTRY["kim2014-023"]()
    assert k_regs.registers_in_order(
        contents=("Position", "operating time", "motor temperature & pressure PP", "pressure OP")
    )


def test_the_crc_has_16_bits_and_a_frame_the_sizes_of_the_note():
    for size in (2, 5, 10, 253):
        assert len(rtu_frame(1, bytes(size))) - size - 1 == k_regs.crc_bits() // 8
    sizes = {name: size + 3 for name, size in k_regs.table_1().items()}
    assert sizes["read response"] == REGISTRY["kim2014-080"]() == 13
    assert [sizes[f"write {what}"] for what in ("query", "response", "error")] == [8, 8, 5]
    assert sizes["read query"] == 8
    with pytest.raises(LengthError):
        decode(bytes(3))


# Codes, status bits, registers.


def test_two_readings_distinguish_all_commands():
    unique = code_table().apply(lambda codes: codes.is_unique)
    assert unique[unique].index.tolist() == ["flag sum", "one bit"]
    codes = command_codes("flag sum")
    assert codes[Code.POSITION_CLOSE] == codes[Code.AUTO] + codes[Code.CLOSE] == 6
    assert codes[Code.POSITION_OPEN] == codes[Code.AUTO] + codes[Code.OPEN] == 10


def test_an_echo_has_the_bits_that_table_2_prints_for_a_response():
    (valve,) = valve_slaves(Plant()).values()
    bits = datasets.read("kim2014_table2_write_register_bits.csv").query("message == 'response'")
    printed = dict(zip(bits["name_printed"], bits["bit_printed"], strict=True))
    for name in ("Manual", "Auto", "Close", "Open"):
        value = RegisterMap().command(Code(name))
        command = Request.write_single_register(0x4001, value).pdu
        assert valve.answer(command) == command
        assert value == 1 << int(printed[name].removeprefix("Bit"))


def test_the_valve_still_moves_when_its_echo_arrives():
    assert k_regs.echo_means_completion(delay=20.0) and not k_regs.echo_means_completion(delay=5.0)


def test_an_illegal_value_is_refused_with_another_number_than_an_unknown_function():
    (valve,) = valve_slaves(Plant()).values()
    answers = [valve.answer(bytes([function, 0x40, 0x01, 0x00, 0x03])) for function in (6, 5)]
    assert answers == [b"\x86\x03", b"\x85\x01"]
    errors = [DecodePDU(False).decode(answer) for answer in answers]
    assert [error.exception_code for error in errors] == [3, 1]


def test_an_echo_differs_from_the_status_of_the_same_valve():
    # By hand: Open is 0x0008; 100 % with auto and open, Bit1 and Bit3, is 0x640A.
    assert RegisterMap().command(Code.OPEN) == 0x0008
    done = RegisterMap(status="table 2").encode(
        [[0], [0], [0], [50], [100]], close=False, open=True
    )
    assert done.registers[0, 0] == 0x640A


def test_status_bits_are_two_places_apart():
    words = [
        int(RegisterMap(status=t).encode([[0]] * 5, close=True, open=True).registers[0, 0])
        for t in ("table 2", "table 3")
    ]
    assert words[1] == words[0] << 2
    bits = datasets.read("kim2014_table2_write_register_bits.csv").query("message == 'response'")
    other = datasets.read("kim2014_table3_read_registers_bits.csv").query("part == 'bit'")
    first = bits.set_index("name_printed")["bit_printed"]
    second = other.set_index("name_printed")["bit_printed"]
    moved = {int(second[n][3:]) - int(first[n][3:]) for n in ("Manual", "Auto", "Close", "Open")}
    assert moved == {2}


def test_65536_is_truncated_to_thousands():
    assert REGISTRY["kim2014-044"]() // 1000 == 65 and round(REGISTRY["kim2014-044"](), -3) == 66000


# The line and the loop.


def test_one_break_loses_no_slave_but_two_or_a_short_circuit_do():
    ring = Loop(5, k_line.status_poll())
    table = ring.single_failures()["lost"]
    assert (table[[f"break {k}" for k in range(6)]] == 0).all()
    assert ring.reach([Break(1), Break(4)]).lost == [2, 3, 4]
    assert len(ring.reach([Short(2)]).lost) == 5
    assert not k_line.survives(breaks=2)


def test_a_late_reply_hides_the_sensors():
    table = answer_table(SerialLine(9600), 5, 10.0)
    assert table["answered"].tolist() == [True, False, True]
    assert table.loc["at the start", "polls_while_moving"] >= 60
    waited = table.loc["at the end, waited for"]
    assert waited["polls_while_moving"] == 0 and waited["scan_gap_s"] > 10


def test_udp_is_not_modbus_tcp():
    tcp, udp = (client("127.0.0.1") for client in (ModbusTcpClient, ModbusUdpClient))
    assert tcp.comm_params.comm_type == CommType.TCP != udp.comm_params.comm_type
    assert tcp.comm_params.port == 502
    # Lost datagrams are not sent again.
    lost = compare([1] * 200, LossyPath(lost=0.05), rng=1)
    assert (lost["timeouts"] > 0).all()


def test_identifier_zero_holds_on_a_path_that_keeps_time():
    units = np.tile(np.arange(1, 6), 200)

    def mixed(late):
        path = LossyPath(late=late, lateness=0.6)
        return compare(units, path, rng=2024)["mismatched"]

    assert (mixed(0.0) == 0).all()
    mixed_fleet = mixed(0.02)
    assert mixed_fleet["nothing"] > 100 and mixed_fleet["transaction id"] == 0


# Names.


def test_flags_of_the_pump_begin_with_pp():
    table = datasets.read("kim2014_rule_table.csv").set_index("code")
    flags = table.loc[["P1", "P2"], "flag_printed"]
    assert flags.str.startswith("Pp").all()
    assert table.loc[["P1", "P2"], "antecedent_printed"].str.startswith("FP").all()


# Rules and their test inputs.


@pytest.mark.parametrize(
    ("code", "fired"),
    [
        ("G1", "G1"),
        ("P1", "P1"),
        ("P2", "P2"),
        ("V1", "V1"),
        ("O1", "O1"),
        ("S1", "S1 Pos3"),
        ("Pos1", "Pos1 S1 Pos3"),
        ("Pos3", "Pos3"),
        ("Pos4", "Pos4"),
        ("normal", ""),
    ],
)
def test_what_fires_beside_the_headline(code, fired):
    row = k_faults.BASE.check(PRINTED.loc[[code]], "crisp").iloc[0]
    # The normal row does not print the speed, which alone could exclude V2.
    assert (row["fired"], row["top"]) == (fired, "undetermined" if code == "normal" else code)


@pytest.mark.parametrize(
    ("reading", "version", "missed"),
    [
        ("held", "printed", {"S2", "Pos2"}),
        ("held", "corrected", set()),
        ("absent", "printed", {"S2", "Pos2", "V2"}),
        ("absent", "corrected", set()),
    ],
)
def test_which_rows_do_not_fire_their_own_rule(reading, version, missed):
    fired = k_faults.fired(k_faults.row_inputs(version, reading))
    assert {code for code, codes in fired.items() if not k_faults.is_right(code, codes)} == missed


def test_normal_values_meet_v2_at_standstill():
    assert 0 < normal_values()["OP"] < 2.5
    still = k_faults.row_inputs().loc[["normal"]].assign(DVPos=0.0)
    assert k_faults.fired(still).tolist() == ["V2"]


def test_positions_as_printed_are_off_the_scale():
    printed = k_faults.fired(k_faults.row_inputs("printed", "absent"))
    assert (printed["S2"], printed["Pos2"]) == ("S1 Pos3", "")
    for code in ("S2", "Pos2"):
        assert k_faults.row_is_found(code=code, channel="VPos", value=-5.0)
    for code in ("S1", "Pos1", "Pos3"):
        assert all(
            k_faults.row_is_found(code=code, channel="VPos", value=v) for v in (105.0, 305.0)
        )
    positions = survival_table().query("channel == 'VPos' and not survives")["value"]
    assert set(positions) == {305.0, -5.0}


def test_a_threshold_of_a_half_is_a_table_of_comparisons():
    rng = np.random.default_rng(3)
    samples = {v.name: rng.uniform(v.low, v.high, 5000) for v in k_faults.BASE.variables}
    fuzzy = k_faults.BASE.fire(samples).decide().active
    crisp = k_faults.BASE.fire(samples, "midpoint").decide().active
    assert fuzzy.any() and (fuzzy == crisp).all()


def test_the_motor_temperature_has_no_lower_limit():
    limits = {v.name: [term.crisp for term in v.terms] for v in k_faults.BASE.variables}
    assert [one.high for one in limits["OT"]] == [np.inf]
    for name in ("FP", "OP", "MC"):
        assert {np.isinf(one.high) for one in limits[name]} == {True, False}
    assert [str(one) for one in limits["OP"]] == ["x >= 2.5", "0 < x < 2.5"]


def test_a_byte_has_no_position_below_closed():
    diagnoses = {code: k_faults.through_registers(code) for code in k_faults.BASE.codes}
    wrong = {code: headline for code, headline in diagnoses.items() if code != headline}
    assert set(wrong) == {"S2", "Pos2", "Pos4"}
    table = datasets.read("kim2014_rule_table.csv").set_index("code")
    assert "found by the slave" in table.loc["Pos1", "diagnosis_printed"]
