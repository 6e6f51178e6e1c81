from shipnet import datasets
from shipnet.asi.modulation import Modulation

TABLE2 = datasets.read("kim2023_table2_emc.csv")
TABLE5 = datasets.read("kim2023_table5_requests.csv")


def test_table1_has_seven_kinds_of_sensor():
    table = datasets.read("kim2023_table1_sensors.csv")
    assert len(table) == 7
    assert table["Category"].is_unique
    for category, explanation in zip(table["Category"], table["Explanation"], strict=True):
        word = category.split()[0].lower()
        assert word in explanation.lower() or word == "accelerometer", category


def test_the_printed_rows_have_the_values_of_the_transcribed_tables():
    rows = datasets.read("kim2023_table2_printed.csv")
    assert rows["Environmental_impact"].tolist() == TABLE2["phenomenon_printed"].unique().tolist()
    for row in TABLE2.itertuples():
        printed = rows.set_index("Environmental_impact").loc[row.phenomenon_printed]
        assert row.value in printed["Test_level"].replace("5/50ns", "5 / 50 ns")
        assert row.rating == printed["Reference_Rating"]
        assert row.standard == printed["Standard_Specifications"]
    for number, name in ((4, "request"), (6, "response")):
        fields = datasets.read(f"kim2023_table{number}_{name}_fields.csv")["symbol"]
        printed = datasets.read(f"kim2023_table{number}_printed.csv")["Category"]
        assert [text.partition("(")[2][:-1] for text in printed] == fields.tolist()


def test_table2_levels():
    assert TABLE2["phenomenon_printed"].nunique() == 5
    assert len(TABLE2) == 20
    levels = TABLE2.set_index(["standard", "parameter"])["value"]
    assert levels["EN 61000-4-2", "contact voltage"] == "4"
    assert levels["EN 61000-4-2", "contactless voltage"] == "8"
    assert levels["EN61000-4-6", "source impedance"] == "150"
    amplitude = TABLE2[TABLE2["phenomenon_printed"].str.endswith("amplitude modulation")]
    assert amplitude["value"].tolist() == ["80", "1000", "10", "80"]
    pulse = TABLE2[TABLE2["phenomenon_printed"].str.endswith("pulse modulation")]
    assert pulse["value"].tolist() == ["900", "5", "10", "50", "200"]
    burst = TABLE2[TABLE2["standard"] == "EN 61000-4-4"]
    assert burst["value"].tolist() == ["2", "5", "50", "5"]
    ratings = TABLE2.groupby("phenomenon_printed", sort=False)["rating"].unique()
    assert [list(rating) for rating in ratings] == [["B"], ["A"], ["A"], ["B"], ["A"]]


def test_table3_has_six_steps_in_order():
    table = datasets.read("kim2023_table3_apm_steps.csv").set_index("step")["what_happens"]
    assert table.index.tolist() == list("123456")
    # The Manchester rule of step 2, read as the encoder applies it.
    assert "from high to low for a 0" in table["2"]
    assert Modulation("0").levels.tolist() == [1, 0]
    assert "a rising current gives a negative pulse" in table["4"]
    assert Modulation("0").pulses.signs[1] == -1


def test_tables_4_and_6_add_up_to_the_telegrams():
    for name, bits in [("table4_request", 14), ("table6_response", 7)]:
        table = datasets.read(f"kim2023_{name}_fields.csv")
        assert table["length_bit"].astype(int).sum() == bits
        assert table["symbol"].is_unique


def test_table5_has_twelve_requests_of_fourteen_bits():
    bits = TABLE5.columns[2:]
    assert len(bits) == 14
    assert len(TABLE5) == 1 + 12
    assert (TABLE5.loc[1:, "ST"] == "0").all()
    assert (TABLE5.loc[1:, "PB"] == "PB").all()
    assert (TABLE5.loc[1:, "EB"] == "1").all()
    assert TABLE5.loc[1:, "CB"].tolist() == ["0"] * 3 + ["1"] * 9


def test_table5_address_columns():
    names = ["A4", "A3", "A2", "A1", "A0"]
    free = TABLE5[~TABLE5["call"].isin(["HEADER", "ASSIGN_ADDRESS", "BROADCAST_RESET"])]
    assert (free[names] == names).all(axis=None)
    assert TABLE5.loc[0, names].tolist() == ["A4", "A4", "A3", "A1", "A0"]


def test_table5_requests_differ_in_their_fixed_bits():
    columns = ["CB", "A4", "I4", "I3", "I2", "I1", "I0"]
    assert not TABLE5.loc[1:].duplicated(columns).any()


def test_table7_has_sixteen_codes_of_four_ports():
    table = datasets.read("kim2023_table7_io_codes.csv")
    assert table["code"].tolist() == list("0123456789ABCDEF")
    assert set(table[["D0", "D1", "D2", "D3"]].to_numpy().ravel()) == {"IN", "OUT", "I/O", "TRI"}


def test_captions_and_references_are_one_apart():
    items = datasets.read("figures_tables.csv").query("paper == 'kim2023'")
    captions = items.set_index("item")["caption"]
    tables = captions[captions.index.str.startswith("Table")]
    assert tables.index[tables.str.contains("EMC")].tolist() == ["Table 2"]
    assert tables.index[tables.str.contains("steps")].tolist() == ["Table 3"]
    assert tables.index[tables.str.contains("detail")].tolist() == ["Table 5"]
    assert tables.index[tables.str.contains("Slave data")].tolist() == ["Table 6"]
    assert tables.index[tables.str.contains("configuration")].tolist() == ["Table 7"]
    assert tables["Table 3"].endswith("AMP")


def test_examples_have_the_length_of_their_telegrams():
    for paper in ("kim2023", "icn2007"):
        bits = datasets.read(f"{paper}_examples.csv").set_index("name")["bits"]
        assert {name: len(word) for name, word in bits.items()} == {"request": 14, "response": 7}
    assert datasets.read("kim2023_examples.csv")["bits"].tolist() == (
        datasets.read("icn2007_examples.csv")["bits"].tolist()
    )
    frames = datasets.read("asi_datasheet_frames.csv")["bits"]
    assert sorted(frames.str.len()) == [7, 7, 14]
