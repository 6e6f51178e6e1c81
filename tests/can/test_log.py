import struct
import sys
import zlib
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from shipnet.can import (
    Log,
    Message,
    MessageSet,
    compare,
    example,
    read_log,
    read_messages,
    response_times,
    simulate,
)
from shipnet.can.lengths import measure_frames
from shipnet.errors import ArgumentError, InputError


def random_log(number, rng, channels=("can0", "can1")):
    extended, remote = rng.random((2, number)) < [[0.4], [0.1]]
    dlc = rng.integers(0, 9, number)
    data = rng.integers(0, 256, (number, 8))
    data[(np.arange(8) >= dlc[:, np.newaxis]) | remote[:, np.newaxis]] = 0
    ids = np.where(extended, rng.integers(0, 1 << 29, number), rng.integers(0, 1 << 11, number))
    return Log(
        np.cumsum(rng.integers(1, 10**6, number)) / 1e6 + 1.7e9,
        rng.choice(np.array(channels), number),
        ids,
        extended,
        remote,
        dlc.astype(np.uint8),
        data.astype(np.uint8),
    )


def assert_same(a, b):
    for name, one, other in zip(Log.__dataclass_fields__, a.columns, b.columns, strict=False):
        assert np.array_equal(one, other), name
        assert one.dtype.kind == other.dtype.kind, name


def test_a_candump_log_comes_back_as_it_was_written(tmp_path):
    log = random_log(2000, np.random.default_rng(1))
    # A length code above 8 stands for 8 bytes.
    log = replace(log, dlc=np.where((log.dlc == 8) & ~log.remote, 11, log.dlc).astype(np.uint8))
    log.save(tmp_path / "bus.log")
    back = read_log(tmp_path / "bus.log")
    assert_same(back, log)
    assert back.faults == ()


def write_with(can, path, log):
    with can.Logger(path) as logger:
        for time, channel, number, long, asks, dlc, data in zip(*log.columns, strict=True):
            logger(
                can.Message(
                    timestamp=float(time),
                    channel=channel,
                    arbitration_id=int(number),
                    is_extended_id=bool(long),
                    is_remote_frame=bool(asks),
                    dlc=int(dlc),
                    data=None if asks else bytes(data[:dlc]),
                )
            )


def test_our_reader_and_python_can_agree_on_candump_logs(tmp_path):
    can = pytest.importorskip("can")
    log = random_log(500, np.random.default_rng(2))
    write_with(can, tmp_path / "theirs.log", log)
    mine = read_log(tmp_path / "theirs.log")
    # python-can does not store the DLC of a remote frame.
    assert_same(mine, replace(log, dlc=np.where(log.remote, 0, log.dlc).astype(np.uint8)))
    log.save(tmp_path / "ours.log")
    with can.LogReader(tmp_path / "ours.log") as reader:
        theirs = [
            (m.timestamp, m.arbitration_id, m.is_extended_id, m.is_remote_frame, m.dlc, m.data)
            for m in reader
        ]
    columns = (column.tolist() for column in log.columns)
    assert theirs == [
        (time, number, extended, remote, dlc, b"" if remote else bytes(data[:dlc]))
        for time, _, number, extended, remote, dlc, data in zip(*columns, strict=True)
    ]


@pytest.mark.parametrize("suffix", [".asc", ".blf", ".csv", ".trc"])
def test_other_formats_are_read_like_python_can_wrote_them(tmp_path, suffix):
    can = pytest.importorskip("can")
    log = random_log(200, np.random.default_rng(3), channels=("1",))
    log = replace(log, remote=np.zeros(200, dtype=bool))
    path = tmp_path / f"bus{suffix}"
    write_with(can, path, replace(log, channel=np.zeros(200, int).astype(str)))
    back = read_log(path)
    for name in ("arbitration_id", "extended", "remote", "dlc", "data"):
        assert np.array_equal(getattr(back, name), getattr(log, name)), name
    # A TRC file has steps of 0.1 ms, the others of 1 us or finer.
    assert np.diff(back.time) == pytest.approx(
        np.diff(log.time), abs=2e-4 if suffix == ".trc" else 2e-6
    )


GOOD = "(1.000000) can0 123#0102\n"
RAW = "23:59:59.900 R 09F80105 FF 01\n00:00:00.100 T 19F51323 20 0E FF FF FF FF FF FF\n"
PYTHON_CAN = "timestamp,arbitration_id,extended,remote,error,dlc,data\n"
SAVVYCAN = "Time Stamp,ID,Extended,Dir,Bus,LEN,D1,D2,D3,D4,D5,D6,D7,D8\n"
ASC = """date Sun Nov 22 08:00:00.000 am 2026
base hex timestamps absolute
internal events logged
Begin Triggerblock Sun Nov 22 08:00:00.000 am 2026
   0.100000 1 123 Rx d 2 01 2A
{}
   0.300000 1 18FEF100x Rx d 1 07
   0.400000 1 Statistic: D 2 R 0 XD 0 XR 0 E 0 O 0 B 0.1%
End TriggerBlock
"""
TRC = """;$FILEVERSION=2.1
;$STARTTIME=0
;$COLUMNS=N,O,T,B,I,d,R,L,D
      1       100.000 DT 1     0123 Rx -  2    01 2A
{}
      3       300.000 DT 1 18FEF100 Rx -  1    07
"""
LOGS = {
    "candump": GOOD + "{}\n(3.0) can0 123#\n",
    "raw": RAW + "{}\n",
    "python-can": PYTHON_CAN + "{}\n1.5,0x123,0,0,0,2,ASo=\n",
    "savvycan": SAVVYCAN + "{}\n1,0123,false,Rx,0,0\n",
    "asc": ASC,
    "trc": TRC,
}


@pytest.mark.parametrize(
    ("kind", "line", "why"),
    [
        ("candump", "nonsense", "'nonsense' is not a frame; expected"),
        ("candump", "(2.0) can0 1234#00", "'(2.0) can0 1234#00' is not a frame"),
        ("candump", "(2.0) can0 123#012", "'(2.0) can0 123#012' is not a frame"),
        ("candump", "(2.0) can0 123#010203040506070809", "'(2.0) can0 123#0102030405060708"),
        ("candump", "(2.0) can0 123#0102 X", "'(2.0) can0 123#0102 X' is not a frame"),
        ("candump", "(2.0) can0 \xff#01", "'(2.0) can0"),
        ("candump", "(nan) can0 123#01", "the time is 'nan'; it must be a number of seconds or"),
        ("candump", "(2.0) can0 800#01", "the identifier is 0x800; it must be 0..0x7ff"),
        ("candump", "(2.0) can0 40000000#01", "the identifier is 0x40000000; it must be 0..0x1ff"),
        ("candump", "(2.0)  can0  123   [3]  11 22", "it has 2 bytes of data, but its data length"),
        ("candump", "(2.0)  can0  123   [9]  11", "it has 1 bytes of data, but its data length"),
        (
            "candump",
            "(2.0)  can0  123   [2]  11 2",
            "expected data bytes such as 01 2A, got '11 2'",
        ),
        ("candump", "(0.5)  can0  123   [0]", "the time 0.5 s is out of order on can0"),
        ("candump", "  can0  010   [1]  01", "it has no time, but others do"),
        (
            "raw",
            "00:00:01.000 R 19F5132 20",
            "'00:00:01.000 R 19F5132 20' is not a frame; expected",
        ),
        ("raw", "00:00:61.000 R 19F51323 20", "'00:00:61.000 R 19F51323 20' is not a frame"),
        ("raw", "00:00:01.000 R 19F51323" + 9 * " 20", "it has 9 bytes of data; it must have 0..8"),
        ("raw", "00:00:01.000 R 39F51323 20", "the identifier is 0x39f51323"),
        ("raw", "(1.0) can0 123#01", "'(1.0) can0 123#01' is not a frame; expected hh:mm:ss.mmm R"),
        ("python-can", "nan,0x1,0,0,0,1,AQ==", "column timestamp is 'nan'; expected a number"),
        ("python-can", "1,0x40000000,1,0,0,1,AQ==", "the identifier is 0x40000000"),
        ("python-can", "1,0x1,0,0,0,300,AQ==", "the data length code is 300; it must be 0..15"),
        ("python-can", "1,0x1,0,0,0,8,AAECAwQFBgcICQ==", "it has 10 bytes of data; it must have"),
        ("python-can", "1,0x1,0,0,0,1,AQI=", "it has 2 bytes of data, but its data length code"),
        ("python-can", "1,0x1,0,0,0,1,?", "column data is '?'; expected base64"),
        ("savvycan", "-5,0123,false,Rx,0,0", "column timestamp is '-5'; expected a number"),
        ("savvycan", "1,4123,false,Rx,0,0", "the identifier is 0x4123; it must be 0..0x7ff"),
        ("savvycan", "1,012G,false,Rx,0,0", "column id is '012G'"),
        ("savvycan", "1,0123,perhaps,Rx,0,0", "column extended is 'perhaps'; expected 0 or 1"),
        ("savvycan", "1,0123,false,Rx,0,9,1,2,3,4,5,6,7,8", "column len is 9; expected 0..8"),
        ("savvycan", "1,0123,false,Rx,0,3,1,2", "column d3 is ''; expected a number"),
        ("savvycan", "1,0123,false,Rx,0,1,1FF", "the data are '1FF'; expected bytes"),
        ("asc", "   0.2 1 12G Rx d 1 01", "invalid literal for int"),
        ("asc", "   0.2 1 123 Rq d 1 01", "'0.2 1 123 Rq d 1 01' is not an ASC frame"),
        ("asc", "   0.2 1 123 Rx d 4 01 02", "it has 2 bytes of data, but its data length"),
        ("asc", "   0.2 1 900 Rx d 1 01", "the identifier is 0x900"),
        ("asc", "   0.05 1 123 Rx d 1 01", "the time 0.05 s is out of order on 0"),
        ("trc", "      2       200.000 DT 1     0123 Rx -  2    01", "it has 1 bytes of data"),
        (
            "trc",
            "      2       200.000 DT 1     0123 Rx",
            "'2       200.000 DT 1     0123 Rx' is not",
        ),
        ("trc", "      2       200.000 DT 1     01G3 Rx -  1    01", "invalid literal for int"),
        ("trc", "      2       nan DT 1     0123 Rx -  1    01", "it has no time, but others do"),
    ],
)
def test_a_bad_record_is_named_and_the_others_are_kept_on_request(tmp_path, kind, line, why):
    if kind in ("asc", "trc"):
        pytest.importorskip("can")
    path, text = tmp_path / "bus.log", LOGS[kind]
    path.write_text(text.format(line), encoding="latin-1")
    with pytest.raises(InputError) as caught:
        read_log(path)
    place = 1 + text.split("{}")[0].count("\n")
    assert str(caught.value).startswith(f"{path}: line {place}: {why}")
    assert "\n" not in str(caught.value)
    kept = read_log(path, keep=True)
    assert len(kept.faults) == 1
    path.write_text(text.format(""), encoding="latin-1")
    assert_same(kept, read_log(path))


def test_all_faults_are_reported_in_the_order_of_the_file(tmp_path):
    path = tmp_path / "bus.log"
    path.write_text("(1.0) can0 FFF#00\n" + "x\n" * 3 + "(1.0) can0 900#00\n" + "y\n" * 2000)
    with pytest.raises(InputError) as caught:
        read_log(path)
    assert [int(fault.split()[1][:-1]) for fault in caught.value.faults[:6]] == [1, 2, 3, 4, 5, 6]
    assert "lines 6 to 1000: 'y' is not a frame" in str(caught.value)
    assert str(caught.value).endswith("and 1005 more")
    assert len(read_log(path, keep=True).faults) == 1000


def test_lines_are_counted_in_any_form(tmp_path):
    path = tmp_path / "bus.log"
    path.write_text(GOOD * 50 + "\r\n" + GOOD * 50 + "x\n")
    with pytest.raises(InputError, match="line 102: 'x'"):
        read_log(path)


@given(st.binary(max_size=200), st.booleans())
def test_any_bytes_are_read_or_refused(tmp_path_factory, content, prefixed):
    path = tmp_path_factory.getbasetemp() / "any.log"
    path.write_bytes(b"(1.0) can0 123#" * prefixed + content)
    log = read_log(path, keep=True)
    assert len({len(column) for column in log.columns}) == 1
    if log.faults:
        with pytest.raises(InputError):
            read_log(path)


def test_empty_and_missing_files_are_reported(tmp_path):
    path = tmp_path / "empty.log"
    path.write_text("")
    assert read_log(path).data.shape == (0, 8)
    load = read_log(path).load(125e3)
    assert load.total().empty
    assert load.windows().empty
    assert repr(load) == "LogLoad(no frames)"
    assert read_log(path).table().empty
    with pytest.raises(InputError, match=r"none\.log: cannot be read: No such file"):
        read_log(tmp_path / "none.log")
    with pytest.raises(ArgumentError, match=r"its suffix must be \.log"):
        read_log(path).save(tmp_path / "bus.asc")


def test_a_missing_library_is_named_with_the_command_that_installs_it(tmp_path, monkeypatch):
    (tmp_path / "ship.dbc").write_text('VERSION ""')
    (tmp_path / "bus.asc").write_text("base hex timestamps absolute")
    (tmp_path / "bus.blf").write_bytes(b"LOGG")
    for module, package, call in (
        ("can", "python-can", lambda: read_log(tmp_path / "bus.asc")),
        ("can", "python-can", lambda: read_log(tmp_path / "bus.blf")),
        ("cantools", "cantools", lambda: read_messages(tmp_path / "ship.dbc")),
    ):
        monkeypatch.setitem(sys.modules, module, None)
        with pytest.raises(ImportError, match=f"is not installed; .*pip install {package}$"):
            call()


def exact(log, chosen):
    """Return the lengths of some frames of a log."""
    _, _, ids, extended, remote, dlc, data = (column[chosen] for column in log.columns)
    return measure_frames(ids, data, dlc, extended=extended, remote=remote)


def test_the_load_equals_that_of_a_loop_over_windows():
    log = random_log(400, np.random.default_rng(5))
    load = log.load(250e3, window=5.0)
    windows, table = load.windows(), load.table()
    for channel in ("can0", "can1"):
        mine = log.channel == channel
        time, bits = log.time[mine], exact(log, mine)
        expected = [
            sum(b for t, b in zip(time, bits, strict=True) if now - 5 + 1e-7 <= t <= now) / 1.25e6
            for now in time
        ]
        seen = windows[windows["channel"] == channel]
        assert seen["load"].tolist() == pytest.approx(expected, rel=1e-12)
        total = load.total().loc[channel]
        assert total["frames"] == mine.sum()
        assert total["peak_load"] == pytest.approx(max(expected))
        parts = table[table["channel"] == channel]
        assert parts["bits"].sum() == bits.sum()
        assert parts["load"].sum() == pytest.approx(total["load"])
        assert (parts["peak_load"] <= total["peak_load"] + 1e-12).all()


def test_an_impossible_frame_is_refused_in_a_log():
    log = random_log(5, np.random.default_rng(6), channels=("can0",))
    short = np.zeros(5, dtype=bool)
    for change, why in (
        ({"arbitration_id": np.full(5, 0x800), "extended": short}, "the identifier is 0x800; it"),
        ({"arbitration_id": np.full(5, -1)}, "the identifier is -0x1; it"),
        ({"arbitration_id": np.full(5, 1 << 29)}, "the identifier is 0x20000000; it"),
        ({"dlc": np.full(5, 32, np.uint8)}, "the data length code is 32"),
        ({"time": np.array([np.nan, 1, 2, 3, 4])}, "the time is nan"),
        ({"time": np.full(5, np.inf)}, "the time is inf"),
    ):
        with pytest.raises(ArgumentError, match=f"frame 1 of the log: {why}"):
            replace(log, **change)
    for change, why in (
        ({"time": log.time[:3]}, "numbers of rows .* must agree"),
        ({"data": log.data[:, :7]}, "data must have 8 columns"),
        ({"dlc": log.dlc.astype(float)}, "dlc is .*; it must be a column of a log"),
        ({"channel": None}, "channel is .*; it must be a column of a log"),
        ({"data": log.data[0]}, "data is .*; it must be a column of a log"),
    ):
        with pytest.raises(ArgumentError, match=why):
            replace(log, **change)


def test_a_log_is_a_table_with_data_in_hexadecimal_digits():
    log = random_log(50, np.random.default_rng(7))
    table = log.table()
    assert len(table) == len(log) == 50
    for data, row, dlc, asks in zip(table["data"], log.data, log.dlc, log.remote, strict=True):
        assert data == ("" if asks else bytes(row[:dlc]).hex())
    assert repr(log) == f"Log(50 frames in {np.ptp(log.time):.3g} s)"


def candump(tmp_path, text, name="bus.log"):
    path = tmp_path / name
    path.write_text(text)
    return path


@pytest.mark.parametrize(
    "lines",
    [
        ["  can0  123   [2]  01 2A", "  can0  18FEF100   [3]  remote request"],
        [" (1.5)  can0  123   [2]  01 2A", " (2.0)  can0  18FEF100   [3]  remote request"],
        [
            " (1.5)  can0  RX - -  123   [2]  01 2A   '.*'",
            " (2.0) can0 18FEF100 [3] remote request",
        ],
        ["1: (1.5) can0 123#012A", "2: (2.0) can0 18FEF100#R3 # asks"],
        ["     1\t(1.5) can0 123#012A R", "     2\t(2.0) can0 18FEF100#R3 T"],
        ["# pump test", "(1.5) can0 123#012A  // on", "", "; off", "(2.0) can0 18FEF100#R3"],
        [
            " (1970-01-01 00:00:01.500000)  can0  123   [2]  01 2A",
            " (1970-01-01 00:00:02.000000)  can0  18FEF100   [3]  remote request",
        ],
    ],
)
@pytest.mark.parametrize("name", ["bus.log", "bus.txt", "bus.asc", "bus.csv"])
def test_output_of_candump_is_read_with_any_suffix(tmp_path, lines, name):
    log = read_log(candump(tmp_path, "\n".join(lines) + "\n", name))
    assert log.arbitration_id.tolist() == [0x123, 0x18FEF100]
    assert log.extended.tolist() == log.remote.tolist() == [False, True]
    assert log.dlc.tolist() == [2, 3]
    assert bytes(log.data[0, :2]) == b"\x01\x2a"
    assert set(log.channel) == {"can0"}
    if "(" in lines[-1]:
        assert log.time.tolist() == [1.5, 2.0]
    else:
        assert repr(log) == "Log(2 frames without times)"


def test_a_log_without_times_has_no_load_and_no_intervals(tmp_path):
    log = read_log(candump(tmp_path, "  can0  010   [1]  01\n" * 3))
    for use in (lambda: log.load(125e3), lambda: log.save(tmp_path / "again.log")):
        with pytest.raises(ArgumentError, match=r"the log has no time stamps; .* requires them"):
            use()
    found = compare(example(), log).table()["verdict"]
    assert found.pop("shutdown") == "as planned" and set(found) == {"missing"}
    assert compare(example().replace("shutdown", dlc=2), log).table()["verdict"].iloc[0] == (
        "other length"
    )


@pytest.mark.parametrize("name", ["bus.txt", "bus.csv", "bus.raw"])
def test_raw_logs_of_yacht_devices_are_read_across_midnight(tmp_path, name):
    log = read_log(candump(tmp_path, "\n" + RAW, name))
    assert log.time.tolist() == [86_399.9, 86_400.1]
    assert log.arbitration_id.tolist() == [0x09F80105, 0x19F51323] and log.extended.all()
    assert log.dlc.tolist() == [2, 8] and bytes(log.data[0, :2]) == b"\xff\x01"
    assert len(read_messages(candump(tmp_path, RAW, name))) == 2


def test_the_first_form_of_candump_is_read(tmp_path):
    text = (
        "# BeagleBone\ninterface = can0, family = 29, type = 3, proto = 1\n"
        "<0x18eeff01> [8] 05 a0 be 1c 00 a0 a0 c0 \n<0x123> [2] 01 2A\n<0x123> [3] remote request\n"
    )
    log = read_log(candump(tmp_path, text, "bus.txt"))
    assert log.arbitration_id.tolist() == [0x18EEFF01, 0x123, 0x123]
    assert (log.extended.tolist(), log.remote.tolist()) == ([True, False, False], [0, 0, 1])
    assert log.dlc.tolist() == [8, 2, 3] and bytes(log.data[0]).hex() == "05a0be1c00a0a0c0"


@pytest.mark.parametrize("step", [1e-3, 1e-2])
def test_coarse_time_stamps_are_recognised_and_named(step):
    run = simulate(example(), 125e3, until=20.0)
    log = run.log()
    assert log.step <= 1e-5 and "steps" not in repr(log)
    coarse = replace(log, time=np.floor(log.time / step) * step + 1.7e9)
    assert coarse.step == step
    assert repr(coarse).endswith(f", time stamps in steps of {step * 1e3:g} ms)")
    found = compare(example(), coarse)
    assert found.verdict.endswith(f"; time stamps in steps of {step * 1e3:g} ms")
    # The frames of a single message may be regular; that does not make the stamps coarse.
    regular = Log(np.arange(20) / 10, *(column[:20] for column in log.columns[1:]))
    assert regular.step == 1e-6


def test_identifiers_in_tables_have_all_digits(tmp_path):
    messages = MessageSet(
        [Message("a", 0x2A, 8, 0.01), Message("b", 0x9F20001, 8, 0.01, extended=True)]
    )
    run = simulate(messages, 125e3, until=0.1)
    log, text = run.log(), ["0x02A", "0x09F20001"]
    for table in (
        messages.table(),
        run.table(),
        log.table().head(2),
        log.load(125e3).table(),
        compare(messages, log).table(),
        response_times(messages, 125e3).table(),
    ):
        assert table["arbitration_id"].tolist() == text
    assert log.messages().names == tuple(text)
    messages.save(tmp_path / "list.csv")
    assert "0x09F20001" in messages.text and read_messages(tmp_path / "list.csv") == messages


@pytest.mark.parametrize("name", ["bus.csv", "bus.log", "bus.txt"])
def test_tables_of_loggers_are_read_without_python_can(tmp_path, monkeypatch, name):
    monkeypatch.setitem(sys.modules, "can", None)
    theirs = read_log(candump(tmp_path, PYTHON_CAN + "1.5,0x123,0,0,0,2,ASo=\n", name))
    rows = "1500000,00000123,false,Rx,0,2,01,2A,\n1600000,18FEF100,true,Tx,1,8,1,2,3,4,5,6,7,FF,\n"
    savvy = read_log(candump(tmp_path, SAVVYCAN + rows, name))
    for log in (theirs, savvy):
        assert log.time[0] == 1.5
        assert log.arbitration_id[0] == 0x123
        assert bytes(log.data[0, :3]) == b"\x01\x2a\0"
    assert savvy.channel.tolist() == ["0", "1"]
    assert savvy.extended.tolist() == [False, True]
    assert bytes(savvy.data[1]) == b"\x01\x02\x03\x04\x05\x06\x07\xff"


@pytest.mark.parametrize(
    ("header", "frame"),
    [
        (";##########\n", "{}) {} 0123 {} {}\n"),
        (";$FILEVERSION=1.1\n", "{}) {}.0 Rx 0123 {} {}\n"),
        (";$FILEVERSION=1.3\n", "{}) {}.0 1 Rx 0123 - {} {}\n"),
    ],
    ids=["1.0", "1.1", "1.3"],
)
def test_bytes_beyond_the_length_code_of_an_old_trc_record_are_a_fault(tmp_path, header, frame):
    pytest.importorskip("can")
    full = " ".join(["AB"] * 8)
    records = [(1, 100, 0, ""), (2, 200, 1, "01 02"), (3, 300, 8, full), (4, 400, 2, "01 02")]
    path = tmp_path / "bus.trc"
    path.write_text(header + "".join(frame.format(*record) for record in records))
    log = read_log(path, keep=True)
    line = 2 + header.count("\n")
    why = "it has 2 bytes of data, but its data length code is 1"
    assert log.faults == (f"line {line}: {why}",)
    assert log.dlc.tolist() == [0, 8, 2]


def test_a_trc_file_whose_header_lacks_its_columns_ends(tmp_path):
    pytest.importorskip("can")
    path = candump(tmp_path, TRC.format("").replace(";$COLUMNS", ";"))
    with pytest.raises(InputError, match="lines 4 and 6: File has no column information"):
        read_log(path)
    path.write_text(";$FILEVERSION=2.1\n")
    with pytest.raises(InputError, match="line 1: File has no column information"):
        read_log(path)


def test_the_first_frame_of_an_asc_file_without_header_is_read(tmp_path):
    pytest.importorskip("can")
    log = read_log(candump(tmp_path, "0.1 1 123 Rx d C 1 2 3 4 5 6 7 8\n0.2 1 124 Rx d 0\n"))
    assert log.arbitration_id.tolist() == [0x123, 0x124]
    assert log.dlc.tolist() == [12, 0]


def mixed_message(can, k):
    """Return message k of a cycle: three classic frames, an error frame and a CAN FD frame."""
    kinds = ({}, {}, {"is_error_frame": True}, {}, {"is_fd": True})
    return can.Message(
        timestamp=0.1 * (k + 1),
        arbitration_id=0x100 + k,
        is_extended_id=False,
        channel=0,
        data=bytes(12 if k % 5 == 4 else 0 if k % 5 == 2 else 3),
        **kinds[k % 5],
    )


@pytest.mark.parametrize("suffix", [".log", ".asc", ".blf"])
@pytest.mark.parametrize("keep", [False, True])
def test_fd_and_error_frames_are_set_aside_and_counted(tmp_path, suffix, keep):
    can = pytest.importorskip("can")
    path = tmp_path / f"bus{suffix}"
    with can.Logger(path) as logger:
        for k in range(10):
            logger(mixed_message(can, k))
    log = read_log(path, keep=keep)
    assert len(log) == 6
    assert log.arbitration_id.tolist() == [0x100, 0x101, 0x103, 0x105, 0x106, 0x108]
    assert [kind for _, _, kind in log.skipped] == ["error frame", "CAN FD frame"] * 2
    assert np.diff([time for time, _, _ in log.skipped]) == pytest.approx([0.2, 0.3, 0.2])
    assert log.faults == ()
    assert repr(log).endswith("s, 2 error frames skipped, 2 CAN FD frames skipped)")
    load = log.load(250e3)
    assert (load.total()["frames"].sum(), load.left_out) == (6, 4)
    assert repr(load).endswith("; 6 frames; 4 left out)")


def test_fd_and_error_frames_in_tables_and_printed_logs_are_counted(tmp_path):
    pytest.importorskip("can")
    fd = ",".join(["00"] * 12)
    for text, kinds in (
        (f"{SAVVYCAN}1,0123,false,Rx,0,12,{fd}\n", ["CAN FD frame"]),
        (PYTHON_CAN + "1.5,0x0,0,0,1,0,\n", ["error frame"]),
        (
            "  can0  20000004   [8]  00 04 00 00 00 00 00 00   ERRORFRAME\n"
            "\tcontroller-problem{rx-overflow}\n",
            ["error frame"],
        ),
        ("(1.0)  can0  123  [12]  " + "00 " * 12 + "\n", ["CAN FD frame"]),
        (TRC.format("      2       200.000 ER 1 Rx -  2    01 2A"), ["error frame"]),
    ):
        assert [kind for _, _, kind in read_log(candump(tmp_path, text)).skipped] == kinds


def written_blf(can, path, number=3):
    with can.BLFWriter(path) as logger:
        logger.compression_level = 0
        for k in range(number):
            logger(
                can.Message(
                    timestamp=0.1 * (k + 1), arbitration_id=k, data=bytes(8), is_extended_id=False
                )
            )
    return bytearray(path.read_bytes())


def changed_blf(data, change):
    """Return a BLF file in which a frame, its second object of three, is changed."""
    at = data.index(b"LOBJ", data.index(b"LOBJ", data.index(b"LOBJ") + 1) + 1)
    return change(data, at)


@pytest.mark.parametrize("keep", [False, True])
@pytest.mark.parametrize(
    ("change", "why"),
    [
        (lambda data, at: b"LOGGnothing", "frame 1: unpack requires"),
        (lambda data, at: data[:-50], r"it has only \d+ of \d+ bytes; it is cut off"),
        (lambda data, at: data + b"LOBJ" * 5, "an object has an illegal length of"),
        (lambda data, at: data + b"x" * 40, r"no object begins at byte \d+"),
        *(
            (lambda data, at, size=size: put(data, at + 8, size), f"an illegal length of {size}")
            for size in (0, 4, 15, 2**31)
        ),
        (lambda data, at: put(put(data, at + 8, 0), at + 12, 200), "an illegal length of 0"),
        (lambda data, at: put(data, at + 6, 3, 2), "only 2 of 3 frames can be read"),
        (lambda data, at: put(data, 160, 7, 2), r"a container is cut off, packed by an unknown"),
    ],
)
def test_a_damaged_blf_file_is_refused_in_any_case(tmp_path, change, why, keep):
    can = pytest.importorskip("can")
    path = tmp_path / "bus.blf"
    path.write_bytes(changed_blf(written_blf(can, path), change))
    if keep and "frame" in why:
        assert len(read_log(path, keep=True).faults) == 1
    else:
        with pytest.raises(InputError, match=why):
            read_log(path, keep=keep)


def put(data, at, number, size=4):
    return data[:at] + number.to_bytes(size, "little") + data[at + size :]


def test_a_blf_frame_with_an_illegal_length_code_costs_no_other_frame(tmp_path):
    can = pytest.importorskip("can")
    path = tmp_path / "bus.blf"
    data = written_blf(can, path, 20)
    # The DLC of the first frame, after the 32 bytes of its object's header.
    at = data.index(b"LOBJ", data.index(b"LOBJ") + 1) + 35
    path.write_bytes(put(data, at, 5, 1))
    assert read_log(path).dlc.tolist() == [5] + [8] * 19
    path.write_bytes(put(data, at, 200, 1))
    with pytest.raises(InputError, match="frame 1: the data length code is 200"):
        read_log(path)
    assert len(read_log(path, keep=True)) == 19


def test_a_blf_file_that_unpacks_to_far_more_bytes_is_refused(tmp_path, monkeypatch):
    pytest.importorskip("can")
    monkeypatch.setattr("shipnet.can.log_files._LARGEST", 1 << 16)
    packed = zlib.compress(bytes(1 << 22))
    container = b"LOBJ" + struct.pack("<HHII", 16, 1, 32 + len(packed), 10)
    container += struct.pack("<H14x", 2) + packed
    head = (b"LOGG" + struct.pack("<I", 144)).ljust(144, b"\0")
    (tmp_path / "bus.blf").write_bytes(head + container)
    with pytest.raises(InputError, match="unpacks to more than 20 times the size of the file"):
        read_log(tmp_path / "bus.blf")


def test_as_few_frames_as_possible_are_left_out_to_restore_the_order(tmp_path):
    times = [1, 2, 900, 3, 4, 3.5, 5]
    text = "".join(f"({time:.1f}) can0 123#\n(9.0) can1 124#\n" for time in times)
    path = candump(tmp_path, text)
    with pytest.raises(
        InputError, match=r"line 5: the time 900.0 s is out of order on can0; line 11"
    ):
        read_log(path)
    kept = read_log(path, keep=True)
    assert kept.time[kept.channel == "can0"].tolist() == [1, 2, 3, 4, 5]
    assert (kept.channel == "can1").sum() == 7
    assert len(kept.faults) == 2


def test_formats_that_are_not_read_are_named(tmp_path):
    path = tmp_path / "bus.mf4"
    path.write_bytes(b"MDF     4.10    " + bytes(50))
    for keep in (False, True):
        with pytest.raises(InputError, match=r"an MDF \(MF4\) file, which cannot be read; convert"):
            read_log(path, keep=keep)


# The log of a run.
