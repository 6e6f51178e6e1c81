import itertools
import sys
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from matplotlib.figure import Figure

from shipnet.can import Frame, Log, Message, MessageSet, example, read_log, read_messages, simulate
from shipnet.can.lengths import measure_frames
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
    for name, one, other in zip(Log.__dataclass_fields__, a.columns, b.columns, strict=False):
        assert np.array_equal(one, other), name
        assert one.dtype.kind == other.dtype.kind, name


def test_a_candump_log_comes_back_as_it_was_written(tmp_path):
    log = random_log(2000, np.random.default_rng(1))
    log.save(tmp_path / "bus.log")
    back = read_log(tmp_path / "bus.log")
    assert_same(back, log)
    assert back.faults == ()


def write_with(can, path, log):
    with can.Logger(path) as logger:
        for time, channel, number, long, asks, error, dlc, data in zip(*log.columns, strict=True):
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
    log = replace(log, error=np.zeros(500, dtype=bool))
    write_with(can, tmp_path / "theirs.log", log)
    mine = read_log(tmp_path / "theirs.log")
    # python-can does not store the DLC of a remote frame.
    assert_same(mine, replace(log, dlc=np.where(log.remote, 0, log.dlc).astype(np.uint8)))
    log.save(tmp_path / "ours.log")
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
    log = replace(log, error=np.zeros(200, dtype=bool), remote=np.zeros(200, dtype=bool))
    if suffix == ".blf":
        log = replace(log, channel=log.channel.astype("U1"))
    path = tmp_path / f"bus{suffix}"
    with can.Logger(path) as logger:
        for time, channel, number, long, _, _, dlc, data in zip(*log.columns, strict=True):
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
    write_with(can, path, replace(log, error=np.zeros(50, dtype=bool)))
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
    with pytest.raises(InputError, match=r"bus\.blf: after frame 0: "):
        read_log(blf)


GOOD = "(1.000000) can0 123#0102\n"


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("nonsense", "line 2: 'nonsense' is not a frame; expected"),
        ("(2.0) can0 123##0112", "line 2: "),
        ("(2.0) can0 1234#00", "line 2: "),
        ("(2.0) can0 123#012", "line 2: "),
        ("(2.0) can0 123#010203040506070809", "line 2: "),
        ("(2.0) can0 123#0102 X", "line 2: "),
        ("(nan) can0 123#01", "line 2: "),
        ("(2.0) can0 800#01", "line 2: the identifier is 0x800; it must be 0..0x7ff"),
        ("(2.0) can0 40000000#01", "line 2: the identifier is 0x40000000; it must be 0..0x1ff"),
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


def test_all_faults_are_reported_in_the_order_of_the_file(tmp_path):
    path = tmp_path / "bus.log"
    path.write_text("(1.0) can0 FFF#00\n" + "x\n" * 3 + "(1.0) can0 900#00\n" + "y\n" * 2000)
    with pytest.raises(InputError) as caught:
        read_log(path)
    assert [int(fault.split()[1][:-1]) for fault in caught.value.faults[:6]] == [1, 2, 3, 4, 5, 6]
    assert "lines 6 to 1000: 'y' is not a frame" in str(caught.value)
    assert str(caught.value).endswith("and 1005 more")
    assert len(read_log(path, keep=True).faults) == 1000


def test_lines_are_counted_over_the_blocks_of_a_long_file(tmp_path, monkeypatch):
    monkeypatch.setattr("shipnet.can.log._BLOCK", 100)
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
    assert len({len(column) for column in log.columns}) == 1
    if log.faults:
        with pytest.raises(InputError):
            read_log(path)


def test_a_file_without_frames_and_one_that_is_not_there(tmp_path):
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
    with pytest.raises(InputError, match=r"its suffix is '\.pdf'; it must be one of \.log, \.asc"):
        read_log(tmp_path / "bus.pdf")
    with pytest.raises(ArgumentError, match=r"its suffix must be \.log"):
        read_log(path).save(tmp_path / "bus.asc")


def test_a_missing_library_is_named_with_the_line_that_installs_it(tmp_path, monkeypatch):
    (tmp_path / "ship.dbc").write_text('VERSION ""')
    for module, call in (
        ("can", lambda: read_log(tmp_path / "bus.asc")),
        ("cantools", lambda: read_messages(tmp_path / "ship.dbc")),
    ):
        monkeypatch.setitem(sys.modules, module, None)
        with pytest.raises(ImportError, match=r'is not installed; .*pip install "shipnet\[bus\]"'):
            call()


def exact(log, chosen):
    """Return the lengths of some frames of a log."""
    _, _, ids, extended, remote, _, dlc, data = (column[chosen] for column in log.columns)
    return measure_frames(ids, data, dlc, extended=extended, remote=remote).length.astype(int)


def test_the_load_is_that_of_a_loop_over_windows():
    log = random_log(400, np.random.default_rng(5))
    load = log.load(250e3, window=5.0)
    windows, table = load.windows(), load.table()
    for channel in ("can0", "can1"):
        mine = (log.channel == channel) & ~log.error
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


MESSAGES = MessageSet(
    [Message("a", 0x10, 8, 4e-3), Message("b", 0x20, 8, 5e-3), Message("c", 0x30, 8, 20e-3)]
)


def test_the_load_of_a_simulated_bus_is_found_in_its_log(tmp_path):
    run = simulate(MESSAGES, 125e3, until=20.0)
    log = run.log(payload=lambda name, number: b"\x55" * 8)
    log.save(tmp_path / "bus.log")
    load = read_log(tmp_path / "bus.log").load(125e3)
    bits = exact(log, slice(None)).mean()
    assert load.total()["load"]["can0"] == pytest.approx(bits * (250 + 200 + 50) / 125e3, rel=2e-3)
    assert load.table()["frames"].tolist() == run.table()["sent"].tolist()
    assert "load" in repr(load)


def test_a_log_without_payloads_has_frames_as_long_as_their_messages():
    longest = [replace(m, bits=Frame(m.arbitration_id, bytes(m.dlc)).length) for m in example()]
    run = simulate(MessageSet(longest), 125e3, until=2.0)
    log = run.log()
    bits = log.load(125e3).table()["bits"].sum()
    assert bits == pytest.approx(run.load * 2.0 * 125e3, rel=1e-9)
    assert log.compare(run.system).ok


def test_the_load_over_time_is_drawn_with_a_line_per_bus():
    load = random_log(400, np.random.default_rng(5)).load(250e3)
    ax = load.plot(Figure().subplots())
    assert [line.get_label() for line in ax.get_lines()] == ["can0", "can1"]
    assert max(line.get_ydata().max() for line in ax.get_lines()) == pytest.approx(
        100 * load.total()["peak_load"].max()
    )


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"bit_rate": 0}, "bit_rate is 0 bit/s; it must be"),
        ({"window": 0}, "window is 0 s; it must be"),
        ({"window": np.nan}, "window is nan"),
    ],
)
def test_a_load_needs_sensible_arguments(change, message):
    log = random_log(5, np.random.default_rng(6))
    with pytest.raises(ArgumentError, match=message):
        log.load(**{"bit_rate": 125e3, **change})


def test_a_frame_that_cannot_be_has_no_length():
    log = random_log(5, np.random.default_rng(6), channels=("can0",))
    short = np.zeros(5, dtype=bool)
    for change, why in (
        ({"arbitration_id": np.full(5, 0x800), "extended": short}, "the identifier is 0x800; it"),
        ({"dlc": np.full(5, 32, np.uint8)}, "the data length code is 32"),
        ({"time": np.full(5, np.nan)}, "the time is nan"),
    ):
        with pytest.raises(ArgumentError, match=f"frame 1 of the log: {why}"):
            replace(log, **change).load(125e3)
    with pytest.raises(ArgumentError, match="log has columns of"):
        replace(log, time=log.time[:3])


def test_a_log_is_a_table_with_data_in_hexadecimal_digits():
    log = random_log(50, np.random.default_rng(7))
    table = log.table()
    assert len(table) == len(log) == 50
    for data, row, dlc, asks in zip(table["data"], log.data, log.dlc, log.remote, strict=True):
        assert data == ("" if asks else bytes(row[:dlc]).hex())
    assert repr(log) == f"Log(50 frames in {np.ptp(log.time):.3g} s)"


def recorded(messages, until=2.0):
    return simulate(messages, 125e3, until=until).log()


def test_a_log_of_the_messages_is_as_they_should_be():
    found = recorded(example(), 10.0).compare(example())
    assert found.ok
    assert set(found.table()["rule"]) == {"sent", "interval", "time of all frames", "length"}


def test_missing_unknown_late_or_longer_frames_are_named():
    log = recorded(example())
    other = MessageSet(
        [
            *(m for m in example() if m.name not in ("speed", "alarm", "load limit")),
            Message("speed", 0x020, 4, 0.002, deadline=0.001),
            Message("load limit", 0x040, 3, 0.02),
            Message("new", 0x700, 8, 0.1),
        ]
    )
    wrong = log.compare(other).violated().set_index(["rule", "object"])
    assert set(wrong.index) == {
        ("interval", "speed"),
        ("length", "load limit"),
        ("sent", "new"),
        ("known", "0x080"),
    }
    assert wrong.loc[("known", "0x080"), "value"] == 20
    fast = log.compare(example().replace("speed", period=0.1, deadline=0.1)).violated()
    assert fast["rule"].tolist() == ["time of all frames"]


@pytest.mark.parametrize(
    ("column", "cell", "fault"),
    [
        (0, "nan", "the time is nan"),
        (1, "0x40000000", "the identifier is 0x40000000; it must be 0"),
        (5, "300", "the data length code is 300; it must be 0..15"),
        (6, "AAECAwQFBgcICQ==", "it has 10 bytes of data; it must have 0..8"),
    ],
)
def test_frames_of_other_formats_that_cannot_be_are_faults(tmp_path, column, cell, fault):
    can = pytest.importorskip("can")
    path = tmp_path / "bus.csv"
    log = random_log(3, np.random.default_rng(8), channels=("1",))
    write_with(can, path, replace(log, remote=np.zeros(3, dtype=bool)))
    lines = path.read_text().splitlines()
    cells = lines[2].split(",")
    cells[column] = cell
    path.write_text("\n".join([*lines[:2], ",".join(cells), *lines[3:]]) + "\n")
    with pytest.raises(InputError, match=f"frame 2: {fault}"):
        read_log(path)
    kept = read_log(path, keep=True)
    assert len(kept) == 2
    assert kept.load(250e3).total()["frames"].sum() == 2


def test_a_file_that_never_ends_is_refused(tmp_path, monkeypatch):
    can = pytest.importorskip("can")
    path = tmp_path / "bus.blf"
    path.write_bytes(b"LOGG")
    endless = itertools.repeat(can.Message(arbitration_id=1, data=b"", is_extended_id=False))
    monkeypatch.setattr(can, "BLFReader", lambda stream: endless)
    with pytest.raises(InputError, match="after frame 400: more than 400 frames in 4 bytes"):
        read_log(path)


# Played again.

TWO = MessageSet(
    [
        Message("alarm", 5, 8, 5e-3, bits=100),
        Message("level", 0x18FEF100, 8, 3e-3, extended=True, bits=100),
    ]
)


class Bus:
    """Remembers what is sent, and when by its clock."""

    def __init__(self, slow=0.0):
        self.now, self.slow, self.seen, self.slept = 100.0, slow, [], []

    def send(self, message):
        self.seen.append((self.now, message))
        self.now += self.slow

    def sleep(self, seconds):
        self.slept.append(seconds)
        self.now += seconds


def played():
    run = simulate(TWO, 125e3, until=0.03)
    return run, run.log(payload=lambda name, k: name.encode()[:3] + bytes([k]))


def test_a_run_becomes_a_log_in_the_order_of_the_line():
    run, log = played()
    assert np.all(np.diff(log.time) > 0)
    assert len(log.time) == run.table()["sent"].sum() == 16
    assert log.time.tolist() == sorted((run.events()["end_ms"] / 1e3).tolist())
    assert (log.extended == (log.arbitration_id == 0x18FEF100)).all()
    assert log.data[log.arbitration_id == 5, 3].tolist() == list(range(6))
    assert bytes(log.data[0, :3]) == b"ala"
    assert set(log.dlc) == {4}


def test_a_program_on_the_virtual_bus_reads_what_was_simulated():
    can = pytest.importorskip("can")
    _, log = played()
    with (
        can.Bus("shipnet-test", interface="virtual", preserve_timestamps=True) as ours,
        can.Bus("shipnet-test", interface="virtual", preserve_timestamps=True) as theirs,
    ):
        assert log.replay(ours) == 16
        seen = [theirs.recv(timeout=1) for _ in range(16)]
        assert theirs.recv(timeout=0) is None
    assert [m.timestamp for m in seen] == log.time.tolist()
    assert [m.arbitration_id for m in seen] == log.arbitration_id.tolist()
    assert [m.is_extended_id for m in seen] == log.extended.tolist()
    assert [bytes(m.data) for m in seen] == [bytes(row[:4]) for row in log.data]


@pytest.mark.parametrize(("speed", "slow"), [(1, 0.0), (2, 0.0), (1, 0.2e-3)])
def test_frames_come_when_they_are_due_and_delays_do_not_add_up(speed, slow):
    pytest.importorskip("can")
    _, log = played()
    bus = Bus(slow)
    log.replay(bus, speed=speed, clock=lambda: bus.now, sleep=bus.sleep)
    due = 100 + (log.time - log.time[0]) / speed
    assert [when for when, _ in bus.seen] == pytest.approx(due.tolist(), abs=1e-9)
    assert bus.slept


def test_without_a_speed_nothing_waits_and_error_reports_are_left_out():
    pytest.importorskip("can")
    _, log = played()
    bus = Bus()
    assert replace(log, error=log.extended).replay(bus, sleep=bus.sleep) == 6
    assert bus.slept == []
    assert Log(*(column[:0] for column in log.columns)).replay(bus) == 0


def test_what_cannot_be_played_is_refused():
    pytest.importorskip("can")
    run, log = played()
    with pytest.raises(ArgumentError, match="speed is 0; it must be positive"):
        log.replay(Bus(), speed=0)
    with pytest.raises(ArgumentError, match="speed is nan"):
        log.replay(Bus(), speed=float("nan"))
    with pytest.raises(ArgumentError, match="time of frame 2 of the log lies before"):
        replace(log, time=-log.time).replay(Bus())
    with pytest.raises(ArgumentError, match=r"payload of 'alarm' is .*; it must be 0..8 bytes"):
        run.log(payload=lambda name, k: bytes(9))
