import sys

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st

from shipnet.can.bus import simulate
from shipnet.can.files import Log, load_from_log, read_dbc, read_log, write_dbc, write_log
from shipnet.errors import ArgumentError, InputError


def random_log(number, rng, channels=("can0", "can1")):
    extended, remote = rng.random((2, number)) < [[0.4], [0.1]]
    error = (rng.random(number) < 0.02) & ~extended & ~remote
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
        error,
        dlc.astype(np.uint8),
        data.astype(np.uint8),
    )


def assert_same(a, b):
    for name, one, other in zip(Log._fields[:8], a, b, strict=False):
        assert np.array_equal(one, other), name
        assert one.dtype.kind == other.dtype.kind, name


def test_a_candump_log_comes_back_as_it_was_written(tmp_path):
    log = random_log(2000, np.random.default_rng(1))
    write_log(tmp_path / "bus.log", log)
    back = read_log(tmp_path / "bus.log")
    assert_same(back, log)
    assert back.faults == ()


def write_with(can, path, log):
    with can.Logger(path) as logger:
        for time, channel, number, long, asks, error, dlc, data in zip(*log[:8], strict=True):
            logger(
                can.Message(
                    timestamp=float(time),
                    channel=channel,
                    arbitration_id=int(number),
                    is_extended_id=bool(long),
                    is_remote_frame=bool(asks),
                    is_error_frame=bool(error),
                    dlc=int(dlc),
                    data=None if asks else bytes(data[:dlc]),
                )
            )


def test_our_reader_and_python_can_agree_on_candump_logs(tmp_path):
    can = pytest.importorskip("can")
    log = random_log(500, np.random.default_rng(2))
    log = log._replace(error=np.zeros(500, dtype=bool))
    write_with(can, tmp_path / "theirs.log", log)
    mine = read_log(tmp_path / "theirs.log")
    # python-can does not store the DLC of a remote frame.
    assert_same(mine, log._replace(dlc=np.where(log.remote, 0, log.dlc).astype(np.uint8)))
    write_log(tmp_path / "ours.log", log)
    with can.LogReader(tmp_path / "ours.log") as reader:
        theirs = list(reader)
    assert [m.timestamp for m in theirs] == log.time.tolist()
    assert [m.arbitration_id for m in theirs] == log.arbitration_id.tolist()
    assert [m.is_extended_id for m in theirs] == log.extended.tolist()
    assert [m.is_remote_frame for m in theirs] == log.remote.tolist()
    assert [m.dlc for m in theirs] == log.dlc.tolist()
    assert [bytes(m.data) for m in theirs] == [
        b"" if asks else bytes(row[:dlc])
        for row, dlc, asks in zip(log.data, log.dlc, log.remote, strict=True)
    ]


@pytest.mark.parametrize("suffix", [".asc", ".blf", ".csv"])
def test_other_formats_are_read_through_python_can(tmp_path, suffix):
    can = pytest.importorskip("can")
    rng = np.random.default_rng(3)
    log = random_log(200, rng, channels=("1", "2"))
    log = log._replace(error=np.zeros(200, dtype=bool), remote=np.zeros(200, dtype=bool))
    if suffix == ".blf":
        log = log._replace(channel=log.channel.astype("U1"))
    path = tmp_path / f"bus{suffix}"
    with can.Logger(path) as logger:
        for time, channel, number, long, _, _, dlc, data in zip(*log[:8], strict=True):
            logger(
                can.Message(
                    timestamp=float(time),
                    channel=int(channel) - 1,
                    arbitration_id=int(number),
                    is_extended_id=bool(long),
                    data=bytes(data[:dlc]),
                )
            )
    back = read_log(path)
    for name in ("arbitration_id", "extended", "remote", "dlc", "data"):
        assert np.array_equal(getattr(back, name), getattr(log, name)), name
    assert np.diff(back.time) == pytest.approx(np.diff(log.time), abs=2e-6)


def test_a_damaged_other_format_names_its_line_or_frame(tmp_path):
    can = pytest.importorskip("can")
    log = random_log(50, np.random.default_rng(4), channels=("1",))
    path = tmp_path / "bus.csv"
    write_with(can, path, log._replace(error=np.zeros(50, dtype=bool)))
    lines = path.read_text().splitlines()
    lines[20] = "not,a,frame"
    path.write_text("\n".join(lines) + "\n")
    with pytest.raises(InputError, match=r"bus\.csv: line 21: "):
        read_log(path)
    kept = read_log(path, keep=True)
    assert len(kept.time) == 19
    assert len(kept.faults) == 1
    blf = tmp_path / "bus.blf"
    blf.write_bytes(b"LOGGnothing")
    with pytest.raises(InputError, match=r"bus\.blf: behind frame 0: "):
        read_log(blf)


GOOD = "(1.000000) can0 123#0102\n"


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("nonsense", "line 2: 'nonsense' is no frame; expected"),
        ("(2.0) can0 123##0112", "line 2: "),
        ("(2.0) can0 1234#00", "line 2: "),
        ("(2.0) can0 123#012", "line 2: "),
        ("(2.0) can0 123#010203040506070809", "line 2: "),
        ("(2.0) can0 123#0102 X", "line 2: "),
        ("(nan) can0 123#01", "line 2: "),
        ("(2.0) can0 800#01", "line 2: the identifier 800 is above 7FF"),
        ("(2.0) can0 40000000#01", "line 2: the identifier 40000000 is above 1FFFFFFF"),
        ("(2.0) can0 \xff#01", "line 2: "),
    ],
)
def test_a_bad_line_is_named_and_the_rest_kept_on_request(tmp_path, line, message):
    path = tmp_path / "bus.log"
    path.write_text(GOOD + line + "\n" + GOOD, encoding="latin-1")
    with pytest.raises(InputError) as caught:
        read_log(path)
    assert str(caught.value).startswith(f"{path}: {message}")
    assert "\n" not in str(caught.value)
    kept = read_log(path, keep=True)
    assert kept.time.tolist() == [1, 1]
    assert len(kept.faults) == 1


def test_all_faults_are_told_in_the_order_of_the_file(tmp_path):
    path = tmp_path / "bus.log"
    path.write_text("(1.0) can0 FFF#00\n" + "x\n" * 3 + "(1.0) can0 900#00\n" + "y\n" * 2000)
    with pytest.raises(InputError) as caught:
        read_log(path)
    assert [int(fault.split()[1][:-1]) for fault in caught.value.faults[:6]] == [1, 2, 3, 4, 5, 6]
    assert "lines 6 to 1000: 'y' is no frame" in str(caught.value)
    assert str(caught.value).endswith("and 1005 more")
    assert len(read_log(path, keep=True).faults) == 1000


def test_lines_are_counted_over_the_blocks_of_a_long_file(tmp_path, monkeypatch):
    monkeypatch.setattr("shipnet.can.files.log._BLOCK", 100)
    path = tmp_path / "bus.log"
    path.write_text(GOOD * 50 + "\r\n" + GOOD * 50 + "x\n")
    with pytest.raises(InputError, match="line 102: 'x'"):
        read_log(path)
    assert len(read_log(path, keep=True).time) == 100


@given(st.binary(max_size=200), st.booleans())
def test_any_bytes_are_read_or_refused(tmp_path_factory, content, prefixed):
    path = tmp_path_factory.getbasetemp() / "any.log"
    path.write_bytes(b"(1.0) can0 123#" * prefixed + content)
    log = read_log(path, keep=True)
    assert len({len(column) for column in log[:8]}) == 1
    if log.faults:
        with pytest.raises(InputError):
            read_log(path)


def test_a_file_without_frames_and_one_that_is_not_there(tmp_path):
    path = tmp_path / "empty.log"
    path.write_text("")
    assert read_log(path).data.shape == (0, 8)
    load = load_from_log(path, bit_rate=125e3, lengths=lambda ids, *_: ids + 1)
    assert load.total.empty
    assert load.windows.empty
    with pytest.raises(InputError, match=r"none\.log: cannot be read: No such file"):
        read_log(tmp_path / "none.log")
    with pytest.raises(InputError, match=r"its suffix is '\.pdf'; it must be one of \.log, \.asc"):
        read_log(tmp_path / "bus.pdf")
    with pytest.raises(ArgumentError, match=r"its suffix must be \.log"):
        write_log(tmp_path / "bus.asc", read_log(path))


def test_a_missing_library_is_named_with_the_line_that_installs_it(tmp_path, monkeypatch):
    for module, call in (
        ("can", lambda: read_log(tmp_path / "bus.asc")),
        ("cantools", lambda: read_dbc(tmp_path / "ship.dbc")),
    ):
        monkeypatch.setitem(sys.modules, module, None)
        with pytest.raises(ImportError, match=r'is not installed; .*pip install "shipnet\[bus\]"'):
            call()


def counted(ids, dlc, data, extended, remote):
    """Return a stand-in for the exact lengths: no stuff bits."""
    assert data.shape == (len(ids), 8)
    return np.where(extended, 67, 47) + 8 * np.where(remote, 0, np.minimum(dlc, 8)).astype(int)


def test_the_load_is_that_of_a_loop_over_windows():
    log = random_log(400, np.random.default_rng(5))
    load = load_from_log(log, bit_rate=250e3, window=5.0, lengths=counted)
    for channel in ("can0", "can1"):
        mine = (log.channel == channel) & ~log.error
        time = log.time[mine]
        bits = counted(*(c[mine] for c in (log[2], log[6], log[7], log[3], log[4])))
        expected = [
            sum(b for t, b in zip(time, bits, strict=True) if now - 5 + 1e-7 <= t <= now) / 1.25e6
            for now in time
        ]
        seen = load.windows[load.windows["channel"] == channel]
        assert seen["load"].tolist() == pytest.approx(expected, rel=1e-12)
        (total,) = load.total[load.total["channel"] == channel].to_dict("records")
        assert total["frames"] == mine.sum()
        assert total["peak_load"] == pytest.approx(max(expected))
        parts = load.messages[load.messages["channel"] == channel]
        assert parts["bits"].sum() == bits.sum()
        assert parts["load"].sum() == pytest.approx(total["load"])
        assert (parts["peak_load"] <= total["peak_load"] + 1e-12).all()


def test_the_load_of_a_simulated_bus_is_found_in_its_log(tmp_path):
    table = {
        "arbitration_id": [0x10, 0x20, 0x30], "bits": 100, "period_ms": [4.0, 5.0, 20.0],
        "name": ["a", "b", "c"],
    }  # fmt: skip
    run = simulate(table, 20.0, 125e3)
    sent = run.transmissions.sort_values("end_ms")
    number = len(sent)
    ids = sent["message"].map({"a": 0x10, "b": 0x20, "c": 0x30}).astype(int).to_numpy()
    no = np.zeros(number, dtype=bool)
    time, dlc = sent["end_ms"].to_numpy() / 1e3, np.full(number, 5, dtype=np.uint8)
    data = np.zeros((number, 8), dtype=np.uint8)
    log = Log(time, np.full(number, "can0"), ids, no, no, no, dlc, data)
    write_log(tmp_path / "bus.log", log)
    load = load_from_log(
        tmp_path / "bus.log", bit_rate=125e3, lengths=lambda ids, *_: 0 * ids + 100
    )
    assert load.total["load"][0] == pytest.approx(run.load, rel=2e-3)
    assert load.total["load"][0] == pytest.approx(100 * (250 + 200 + 50) / 125e3, rel=2e-3)
    assert load.messages["frames"].tolist() == run.statistics["sent"].tolist()


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"bit_rate": 0}, "bit_rate is 0; it must be"),
        ({"window": 0}, "window is 0; it must be"),
        ({"window": np.nan}, "window is nan"),
        ({"lengths": lambda ids, *_: 0 * ids}, "it must return a positive number a frame"),
        ({"lengths": lambda *_: 1}, "it must return a positive number a frame"),
    ],
)
def test_a_load_needs_sensible_arguments(change, message):
    log = random_log(5, np.random.default_rng(6))
    with pytest.raises(ArgumentError, match=message):
        load_from_log(log, **{"bit_rate": 125e3, "lengths": counted, **change})


MESSAGES = pd.DataFrame(
    {
        "name": ["Speed", "Valve"],
        "arbitration_id": [0x100, 0x18FEF100],
        "extended": [False, True],
        "dlc": [8, 3],
        "period_ms": [100.0, np.nan],
        "sender": ["JB1", "JB2"],
    }
)
SIGNALS = pd.DataFrame(
    {
        "message": ["Speed", "Speed", "Valve"],
        "signal": ["Rpm", "Torque", "Position"],
        "start": [0, 16, 7],
        "length": [16, 12, 16],
        "byte_order": ["little_endian", "little_endian", "big_endian"],
        "signed": [False, True, False],
        "scale": [0.125, 1.0, 0.5],
        "offset": [0.0, -10.0, 0.0],
        "minimum": [0.0, np.nan, 0.0],
        "maximum": [6000.0, np.nan, 100.0],
        "unit": ["rpm", "", "%"],
    }
)


def test_a_dbc_comes_back_as_it_was_written(tmp_path):
    pytest.importorskip("cantools")
    write_dbc(tmp_path / "ship.dbc", MESSAGES, SIGNALS)
    back = read_dbc(tmp_path / "ship.dbc")
    pd.testing.assert_frame_equal(back.messages, MESSAGES, check_dtype=False)
    pd.testing.assert_frame_equal(back.signals, SIGNALS, check_dtype=False)


def test_cantools_decodes_by_the_dbc_that_we_write(tmp_path):
    cantools = pytest.importorskip("cantools")
    write_dbc(tmp_path / "ship.dbc", MESSAGES, SIGNALS)
    database = cantools.database.load_file(tmp_path / "ship.dbc")
    assert database.decode_message("Speed", bytes.fromhex("1027F60F00000000")) == {
        "Rpm": 0x2710 * 0.125, "Torque": -10 - 10,
    }  # fmt: skip
    assert database.decode_message(0x18FEF100, bytes.fromhex("003200")) == {"Position": 25.0}
    assert database.get_message_by_name("Speed").cycle_time == 100
    assert [node.name for node in database.nodes] == ["JB1", "JB2"]


def test_the_messages_of_a_dbc_go_into_a_simulation(tmp_path):
    pytest.importorskip("cantools")
    write_dbc(tmp_path / "ship.dbc", MESSAGES.assign(period_ms=[10, 20]))
    run = simulate(read_dbc(tmp_path / "ship.dbc").messages, 0.1, 125e3)
    assert run.statistics["sent"].tolist() == [10, 5]


def test_what_is_no_dbc_or_makes_none_is_refused(tmp_path):
    pytest.importorskip("cantools")
    with pytest.raises(InputError, match=r"none\.dbc: cannot be read"):
        read_dbc(tmp_path / "none.dbc")
    bad = tmp_path / "bad.dbc"
    bad.write_text('VERSION ""\n\nBO_ 100 Speed: x JB1\n')
    with pytest.raises(InputError, match=r"bad\.dbc: is no DBC file: .*line 3") as caught:
        read_dbc(bad)
    assert "\n" not in str(caught.value)
    path = tmp_path / "ship.dbc"
    for messages, signals, message in (
        (MESSAGES.drop(columns="dlc"), None, "messages have no column 'dlc'"),
        (MESSAGES, SIGNALS.drop(columns="start"), "signals have no column 'start'"),
        (MESSAGES, SIGNALS.assign(message="Other"), "signal 'Rpm' belongs to no message"),
        (MESSAGES.assign(period_ms=0.5), None, "period_ms of message 'Speed' is 0.5"),
        (MESSAGES, SIGNALS.assign(length=64), "messages make no DBC file"),
        (MESSAGES.assign(arbitration_id=0x800), None, "messages make no DBC file"),
    ):
        with pytest.raises(ArgumentError, match=message):
            write_dbc(path, messages, signals)
    assert not path.exists()
