import pandas as pd
import pytest

from shipnet import datasets

INPUTS = ["FP", "OP", "MC", "OT"]
VPOS_LIMITS = {"OPEN": 100, "CLOSE": 0}


def read(what):
    return pd.read_csv(datasets.path(f"kim2014_{what}.csv"), dtype=str, keep_default_na=False)


def fired(rules, state):
    return [
        row.code
        for row in rules[rules.antecedent_corrected != ""].itertuples()
        if eval(row.antecedent_corrected, {}, state)
    ]


def state_of(row, vpos, dvpos):
    values = {name: float(row[f"{name.lower()}_printed"] or "nan") for name in INPUTS}
    return values | VPOS_LIMITS | {"VPos": float(vpos or "nan"), "DVPos": float(dvpos or "nan")}


@pytest.fixture
def rules():
    return read("rule_table")


def test_function_codes():
    table = read("function_codes")
    assert not table.duplicated(["function_code", "message", "position"]).any()
    for _, message in table.groupby(["function_code", "message"]):
        assert message.position.astype(int).tolist() == list(range(1, len(message) + 1))
    registers = table.groupby("function_code").register_printed.unique().str.join(" ")
    assert registers.to_dict() == {"0x04": "0x4020~0x4023", "0x06": "0x4001"}
    fixed = table.length_fixed_byte.astype(int)
    keys = [table.function_code, table.message]
    assert fixed.groupby(keys).sum().to_dict() == {
        ("0x06", "query"): 5,
        ("0x06", "response"): 5,
        ("0x06", "error"): 2,
        ("0x04", "query"): 5,
        ("0x04", "response"): 2,
        ("0x04", "error"): 2,
    }
    per_register = table[table.length_per_register_byte != "0"]
    assert per_register.field_printed.tolist() == ["Input Register"]
    assert per_register.length_per_register_byte.tolist() == ["2"]
    low = table.value_low[table.value_low != ""].map(lambda v: int(v, 0))
    high = table.value_high[table.value_high != ""].map(lambda v: int(v, 0))
    assert len(low) == 15 and (low <= high).all()
    full = 256 ** fixed[high.index] - 1
    assert (high <= full).all()
    addressed = table.field_corrected.isin(["register address", "register value"])
    assert (high[addressed] == full[addressed]).all()


def test_function_codes_numbers_match_their_text():
    for row in read("function_codes").itertuples():
        length = {"0": f"{row.length_fixed_byte} Byte"}.get(row.length_per_register_byte)
        assert row.length_printed == (length or f"N*x{row.length_per_register_byte}Byte")
        text = row.value_printed.replace(" ", "").removesuffix("(N*)")
        if "," in text:
            assert text == "01,02,03,04"
            text = "0x01~0x04"
        if row.field_corrected == "byte count":
            assert text == "2xN*"
            text = "0x02~0xFA"
        printed = text.split("~")
        assert (row.value_low, row.value_high) == (printed[0], printed[-1])


def test_function_codes_follow_modbus():
    table = read("function_codes")
    errors = table[table.field_printed == "Error code"]
    for row in errors.itertuples():
        assert int(row.value_printed, 0) == int(row.function_code, 0) | 0x80
    quantity = table.set_index("field_corrected").loc["quantity of input registers"]
    most = int(quantity.value_high, 0)
    assert most == (253 - 2) // 2
    byte_count = table.set_index("field_corrected").loc["byte count"]
    assert byte_count.field_printed == "Register Address"
    assert int(byte_count.value_high, 0) == 2 * most


@pytest.mark.parametrize("what", ["table2_write_register", "table3_read_registers"])
def test_frames_are_contiguous(what):
    for _, frame in read(what).groupby("message"):
        first = frame.offset_first_byte.astype(int)
        last = frame.offset_last_byte.astype(int)
        assert first.iloc[0] == 0
        assert (first.iloc[1:].values == last.iloc[:-1].values + 1).all()
        assert (last - first + 1 == frame.length_byte.astype(int)).all()
        labelled = (frame.label_printed != "") & (frame.field_printed != "pre")
        assert (frame.label_printed[labelled].astype(int) == last[labelled]).all()
        length_field = frame[frame.field_printed == "below Data Qty"].iloc[0]
        after = frame[first > int(length_field.offset_last_byte)]
        assert after.length_byte.astype(int).sum() == int(length_field.value_printed)
        standard = after[after.in_standard == "yes"]
        assert standard.length_byte.astype(int).sum() == int(length_field.value_corrected)


def test_frame_values_are_corrected_only_where_stated():
    table = pd.concat(
        {n: read(w) for n, w in [(2, "table2_write_register"), (3, "table3_read_registers")]},
        names=["table"],
    ).reset_index("table")
    assert (table.value_printed[table.field_printed == "pre"] == "0.0.0.0").all()
    assert (table.value_printed[table.field_printed == "Slave ID"] == "0x01").all()
    code = table[table.field_printed == "Func. Code"].groupby("table").value_printed.unique()
    assert [list(c) for c in code] == [["0x06"], ["0x04"]]
    kept = table[table.in_standard == "yes"]
    corrected = kept[kept.value_printed != kept.value_corrected]
    assert corrected[["table", "message", "value_printed", "value_corrected"]].values.tolist() == [
        [2, "query", "Position 0-100%", "0-100"],
        [2, "response", "Position 0-100%", "0-100"],
        [2, "error", "0x06", "0x86"],
        [3, "query", "0x0", "0x00"],
        [3, "response", "14", "11"],
    ]


def test_table2_write_register():
    table = read("table2_write_register").set_index(["message", "field_printed"])
    assert table.groupby("message", sort=False).size().to_dict() == {
        "query": 8,
        "response": 8,
        "error": 5,
    }
    for message in ("query", "response"):
        frame = table.loc[message]
        high = int(frame.value_printed["Reg. Address(HiX)"], 0)
        low = int(frame.value_printed["Reg. Address(LoX)"], 0)
        assert (high << 8 | low) == 0x4001
    code = table.loc["error", "Err. Code"]
    function_code = int(table.loc["query", "Func. Code"].value_printed, 0)
    assert int(code.value_printed, 0) == function_code
    assert int(code.value_corrected, 0) == function_code | 0x80


def test_table2_command_codes():
    bits = read("table2_write_register_bits")
    codes = bits[bits.message == "query"].set_index("name_printed")
    assert codes.code_printed.tolist() == ["1", "2", "4", "8", "8", "10"]
    total = codes.code_flag_sum.astype(int)
    assert total.is_unique
    assert total["Position Close"] == total["Auto"] | total["Close"]
    assert total["Position Open"] == total["Auto"] | total["Open"]
    changed = codes[codes.code_printed != codes.code_flag_sum]
    assert changed.index.tolist() == ["Position Close"]
    footnotes = bits[bits.message == "footnote"]
    assert footnotes.code_printed.tolist() == ["6", "10", "8", "8", "10", "10"]
    status = bits[bits.message == "response"]
    for part in (codes, status):
        assert part.code_one_bit.astype(int).tolist() == [1 << n for n in range(6)]
    assert status.bit_printed.tolist() == [f"Bit{n}" for n in range(6)]
    assert status.name_printed.tolist() == [*codes.index[:4], "", ""]


def test_table3_read_registers():
    table = read("table3_read_registers")
    query = table[table.message == "query"].set_index("field_corrected").value_printed
    response = table[table.message == "response"].set_index("field_corrected")
    quantity = int(query["quantity low"], 0)
    assert quantity == 0x4023 - 0x4020 + 1
    for frame in (query, response.value_printed):
        high, low = (int(frame[f"register address {part}"], 0) for part in ("high", "low"))
        assert (high << 8 | low) == 0x4020
    assert int(response.value_printed["byte count"], 0) == 2 * quantity
    assert int(response.length_byte["input registers"]) == 2 * quantity
    extra = response[response.in_standard == "no"].length_byte.astype(int).sum()
    length = response.loc["length"]
    assert int(length.value_printed) - int(length.value_corrected) == extra == 3


def test_table3_bits_are_two_places_off_table2():
    read_bits = read("table3_read_registers_bits")
    write_bits = read("table2_write_register_bits")
    named = write_bits[(write_bits.message == "response") & (write_bits.name_printed != "")]
    printed = read_bits[read_bits.part == "bit"].set_index("name_printed").bit_printed
    for row in named.itertuples():
        assert int(printed[row.name_printed][3:]) == int(row.bit_printed[3:]) + 2
    bits = read_bits[read_bits.part == "bit"]
    assert bits.bit_printed.tolist() == [f"Bit{n}" for n in range(6)]
    assert bits.name_printed.tolist()[:2] == ["Input reg*2", "Input reg*2+1"]
    assert bits.register_corrected.tolist() == ["", "", *["0x4020"] * 4]
    assert bits.reading.tolist()[2:] == named.bit_printed.tolist()
    registers = read_bits[read_bits.part == "register"].register_corrected
    assert registers.tolist() == ["0x4020", "0x4021", "0x4022", "0x4023"]


def test_rule_table_shape(rules):
    assert rules.no.astype(int).tolist() == list(range(13))
    faults = rules.iloc[1:]
    assert faults.code.tolist() == "G1 P1 P2 V1 V2 S1 S2 O1 Pos1 Pos2 Pos3 Pos4".split()
    assert faults.antecedent_corrected.is_unique
    assert faults.flag_printed.str.endswith(" = 1").all()
    vpos = faults.vpos_corrected_percent
    assert set(vpos[vpos.str.isdigit() | vpos.str.startswith("-")]) == {"105", "-5"}
    assert faults.flag_corrected.nunique() == 7
    assert (faults.flag_corrected == "PosFault").sum() == 6
    misspelt = faults[faults.flag_printed.str.removesuffix(" = 1") != faults.flag_corrected]
    assert misspelt.code.tolist() == ["O1"]


def test_rule_table_corrected_antecedents_say_what_is_printed(rules):
    words = {"GT": ">", "LT": "<", "GE": ">=", "EQ": "=="}
    for row in rules.iloc[1:].itertuples():
        text = row.antecedent_printed.replace(" && ", " ").split()
        printed = {(n, words[o], v) for n, o, v in zip(*[iter(text)] * 3, strict=True)}
        corrected = set()
        for part in row.antecedent_corrected.split(" and "):
            t = part.split()
            if len(t) == 5:
                corrected |= {(t[2], ">", t[0]), (t[2], t[3], t[4])}
            else:
                corrected.add(tuple(t))
        assert corrected == printed


def test_rule_table_has_one_term_per_condition(rules):
    for row in rules.iloc[1:].itertuples():
        parts = row.antecedent_corrected.split(" and ")
        for part, term in zip(parts, row.terms.split(" & "), strict=True):
            assert part.removeprefix("0 < ").startswith(term.split(".")[0])


def test_rule_table_inputs_match_their_text(rules):
    for _, row in rules.iterrows():
        text = row.inputs_printed.replace("pos val", "VPos").replace("=", "").replace(",", "")
        words = text.replace("0 or 100", "0_or_100").split()
        printed = dict(zip(words[::2], words[1::2], strict=True))
        columns = {name: row[f"{name.lower()}_printed"] for name in [*INPUTS, "VPos"]}
        columns = {k: v.replace(" ", "_") for k, v in columns.items() if v != ""}
        assert columns == printed


def test_rule_table_corrected_inputs_fire_their_rule(rules):
    for _, row in rules.iloc[1:].iterrows():
        for vpos in row.vpos_corrected_percent.split(" or "):
            assert row.code in fired(rules, state_of(row, vpos, row.dvpos_corrected_percent_per_s))


def test_rule_table_printed_inputs_miss_three_rules(rules):
    missed = [
        row.code
        for _, row in rules.iloc[1:].iterrows()
        for vpos in row.vpos_printed.split(" or ")[:1]
        if row.code not in fired(rules, state_of(row, vpos, ""))
    ]
    assert missed == ["V2", "S2", "Pos2"]


@pytest.mark.parametrize(("speed", "codes"), [("10", []), ("0", ["V2"])])
def test_rule_table_normal_row(rules, speed, codes):
    for vpos in ("0", "100"):
        assert fired(rules, state_of(rules.iloc[0], vpos, speed)) == codes


def test_specifications():
    table = read("specifications")
    assert not table.duplicated(["controller", "parameter"]).any()
    assert len(table) == 39
    spec = table.set_index(["controller", "parameter"]).value
    slave, master = spec["slave"], spec["master"]
    sensors = table[table.unit == "sensors"].value.astype(int)
    assert sensors.sum() == int(slave["adc channels"])
    both = ["cpu word", "adc resolution", "adc channels", "transmission"]
    both += ["bit rate min", "bit rate max"]
    assert slave[both].tolist() == master[both].tolist()
    assert int(slave["bit rate max"]) == 48 * int(slave["bit rate min"])
    assert int(slave["selectable ids"]) == 1 << 8 == int(slave["rs485 transceiver nodes"])
    switch_codes = 10 ** int(slave["id decimal switches"]) * 2 ** int(slave["id dip pins"])
    assert switch_codes == 400
    assert 247 < int(master["max slaves"]) < int(master["slaves named in the text"])
    assert (1 << 16) - 1000 < int(master["lcd colours"]) < 1 << 16
    assert int(master["tcp/ip port"]) == 502
    assert int(master["lcd width"]) * 3 == int(master["lcd height"]) * 5
    assert int(master["com ports"]) == 2 * int(slave["com ports"])
