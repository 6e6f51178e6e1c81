import numpy as np
import pytest

from shipnet.can.bus import simulate
from shipnet.can.files import Log
from shipnet.can.replay import log_from_run, replay
from shipnet.errors import ArgumentError

TABLE = {
    "name": ["alarm", "level"], "arbitration_id": [5, 0x18FEF100], "extended": [False, True],
    "bits": 100, "period_ms": [5.0, 3.0],
}  # fmt: skip


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


def recorded():
    run = simulate(TABLE, 0.03, 125e3)
    return run, log_from_run(run, payload=lambda name, k: name.encode()[:3] + bytes([k]))


def test_a_run_becomes_a_log_in_the_order_of_the_line():
    run, log = recorded()
    assert np.all(np.diff(log.time) > 0)
    assert len(log.time) == run.statistics["sent"].sum() == 16
    assert log.time.tolist() == sorted((run.transmissions["end_ms"] / 1e3).tolist())
    assert (log.extended == (log.arbitration_id == 0x18FEF100)).all()
    assert log.data[log.arbitration_id == 5, 3].tolist() == list(range(6))
    assert bytes(log.data[0, :3]) == b"ala"
    assert set(log.dlc) == {4}


def test_a_program_on_the_virtual_bus_reads_what_was_simulated():
    can = pytest.importorskip("can")
    _, log = recorded()
    with (
        can.Bus("shipnet-test", interface="virtual", preserve_timestamps=True) as ours,
        can.Bus("shipnet-test", interface="virtual", preserve_timestamps=True) as theirs,
    ):
        assert replay(log, ours) == 16
        seen = [theirs.recv(timeout=1) for _ in range(16)]
        assert theirs.recv(timeout=0) is None
    assert [m.timestamp for m in seen] == log.time.tolist()
    assert [m.arbitration_id for m in seen] == log.arbitration_id.tolist()
    assert [m.is_extended_id for m in seen] == log.extended.tolist()
    assert [bytes(m.data) for m in seen] == [bytes(row[:4]) for row in log.data]


@pytest.mark.parametrize(("speed", "slow"), [(1, 0.0), (2, 0.0), (1, 0.2e-3)])
def test_frames_come_when_they_are_due_and_delays_do_not_add_up(speed, slow):
    pytest.importorskip("can")
    _, log = recorded()
    bus = Bus(slow)
    replay(log, bus, speed=speed, clock=lambda: bus.now, sleep=bus.sleep)
    due = 100 + (log.time - log.time[0]) / speed
    assert [when for when, _ in bus.seen] == pytest.approx(due.tolist(), abs=1e-9)
    assert bus.slept


def test_without_a_speed_nothing_waits_and_error_reports_are_left_out():
    pytest.importorskip("can")
    _, log = recorded()
    bus = Bus()
    assert replay(log._replace(error=log.extended), bus, sleep=bus.sleep) == 6
    assert bus.slept == []
    empty = Log._make([*(column[:0] for column in log[:8]), ()])
    assert replay(empty, bus) == 0


def test_what_cannot_be_played_is_refused():
    pytest.importorskip("can")
    run, log = recorded()
    with pytest.raises(ArgumentError, match="speed is 0; it must be positive"):
        replay(log, Bus(), speed=0)
    with pytest.raises(ArgumentError, match="speed is nan"):
        replay(log, Bus(), speed=float("nan"))
    with pytest.raises(ArgumentError, match="time of frame 2 of the log lies before"):
        replay(log._replace(time=-log.time), Bus())
    with pytest.raises(ArgumentError, match=r"payload of 'alarm' is .*; it must be 0..8 bytes"):
        log_from_run(run, payload=lambda name, k: bytes(9))
