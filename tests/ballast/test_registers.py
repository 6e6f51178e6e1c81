import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from shipnet.ballast.registers import SCALES, Code, RegisterMap, command_codes
from shipnet.ballast.rule_table import rule_base
from shipnet.errors import ArgumentError, FieldError

MAPS = st.builds(RegisterMap, st.sampled_from(["table 2", "table 3"]))
#: A valve that has received no command.
REST = {"close": False, "open": False}
BYTES, STEPS = st.integers(0, 255), st.integers(0, 254)


@given(
    map_=MAPS,
    rows=st.lists(st.tuples(*[STEPS] * 5), min_size=1, max_size=4),
    flags=st.tuples(*[st.booleans()] * 3),
    fault=st.integers(0, 12),
    ticks=BYTES,
)
def test_decoded_statuses_equal_the_encoded_ones(map_, rows, flags, fault, ticks):
    steps = np.array([scale.step for scale in SCALES])
    readings = (np.array(rows) * steps).T
    auto, close, opened = flags
    packed = map_.encode(
        readings, auto=auto, close=close, open=opened, fault=fault, operating_time=ticks * 0.1
    )
    assert not packed.saturated.any()
    status = map_.decode(packed.registers)
    assert status.readings == pytest.approx(readings)
    assert (status.auto == auto).all()
    assert (status.close == close).all()
    assert (status.open == opened).all()
    assert (status.fault == fault).all()
    assert status.operating_time == pytest.approx(ticks * 0.1)


@given(words=st.lists(st.integers(0, 0xFFFF), min_size=4, max_size=4), map_=MAPS)
def test_any_registers_can_be_read(words, map_):
    status = map_.decode([words])
    known = status.readings[~np.isnan(status.readings)]
    assert ((known >= 0) & (known <= 254)).all()
    whole = [words[0] >> 8, *(byte for word in words[2:] for byte in divmod(word, 256))]
    assert np.isnan(status.readings).sum() == whole.count(255)


def test_each_byte_is_where_table_3_prints_it():
    readings = np.array([[1.0], [0.2], [0.3], [4.0], [5.0]])
    words = RegisterMap().encode(readings, close=True, open=False, operating_time=0.6).registers[0]
    assert [f"{word:04x}" for word in words] == ["0518", "0006", "0401", "0302"]
    words = RegisterMap("table 2").encode(readings, close=True, open=False, fault=12).registers[0]
    assert f"{words[0]:04x}" == "05c6"


def test_values_out_of_range_are_flagged_and_clipped():
    readings = np.array([[300, 90], [np.nan, 2], [-0.2, 1.2], [50, 50], [-5, 305]])
    packed = RegisterMap().encode(readings, **REST, operating_time=25.5)
    assert packed.saturated.tolist() == [
        [True, True, True, False, True, False],
        [False, False, False, False, True, False],
    ]
    late = RegisterMap().encode(readings, **REST, operating_time=25.6)
    assert late.saturated[:, 5].all()
    read = RegisterMap().decode(packed.registers).readings
    assert read[:, 0] == pytest.approx([254, np.nan, 0, 50, 0], nan_ok=True)
    assert read[4, 1] == 254
    long = RegisterMap("table 2").encode(readings[:, 1:], **REST, operating_time=6000.0)
    assert not long.saturated[0, 5]


def test_a_dead_sensor_fires_no_rule_after_the_registers():
    base, rest = rule_base(), [90.0, 2.0, 1.2, 50.0, 40.0]
    for k, name in enumerate(["FP", "OP", "MC", "OT", "VPos"]):
        dead = np.array(rest)
        dead[k] = np.nan
        packed = RegisterMap().encode(dead[:, np.newaxis], **REST)
        read = RegisterMap().decode(packed.registers).readings[:, 0]
        assert np.isnan(read).nonzero()[0].tolist() == [k]
        samples = dict(zip(["FP", "OP", "MC", "OT", "VPos"], read, strict=True))
        fired = base.fire(samples).strength
        assert fired.max() == 0, name
    assert (RegisterMap().table()["missing"] == 255).all()


def test_no_reading_is_off_by_more_than_the_largest_error_of_the_table():
    table = RegisterMap().table()
    rng = np.random.default_rng(2024)
    for k, scale in enumerate(SCALES):
        values = rng.uniform(0, min(100.0, table["highest"].iloc[k]), 400)
        readings = np.zeros((5, 400))
        readings[k] = values
        back = RegisterMap().decode(RegisterMap().encode(readings, **REST).registers)
        worst = np.abs(back.readings[k] - values).max()
        assert 0.45 * scale.step < worst <= scale.step / 2 + 1e-9
        assert worst < table["largest_error"].iloc[k] + 1e-9


def test_decoded_commands_equal_the_encoded_ones():
    for code in Code:
        position = 40 if code.name.startswith("POSITION") else 0
        value = RegisterMap().command(code, position)
        assert RegisterMap().decode_command(value) == (code, position)
    assert command_codes("decimal")[Code.POSITION_OPEN] == 10
    assert command_codes("hexadecimal")[Code.POSITION_OPEN] == 0x10
    with pytest.raises(FieldError, match="code is 7; it must be one of 1, 2, 4, 8, 6, 10"):
        RegisterMap().decode_command(7)


@given(value=st.integers(0, 0xFFFF), map_=MAPS)
def test_any_command_is_understood_or_refused_by_name(value, map_):
    try:
        code, position = map_.decode_command(value)
    except FieldError:
        return
    assert map_.command(code, position) & 0xFF == value & 0xFF
    assert 0 <= position <= 100


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: RegisterMap("table 1"), "status is 'table 1'"),
        (lambda: RegisterMap().encode(np.zeros((4, 1)), **REST), "shape"),
        (lambda: RegisterMap().encode(np.zeros((5, 1)), **REST, fault=13), "fault is 13"),
        (lambda: RegisterMap().decode([[0, 0, 0]]), "rows of four"),
        (lambda: RegisterMap().decode([[0, 0, 0, 65536]]), r"0\.\.65535"),
        (lambda: RegisterMap().command(Code.POSITION_OPEN, 101), "position is 101"),
        (lambda: RegisterMap().command(Code.OPEN, 40), r"position is 40.*0\.\.0 for Open"),
        (lambda: RegisterMap().decode_command(65536), "value is 65536"),
    ],
)
def test_arguments_out_of_range_are_named(make, message):
    with pytest.raises(ArgumentError, match=message):
        make()
