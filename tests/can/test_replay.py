from dataclasses import replace

import numpy as np
import pytest

from shipnet.can import Log, Message, MessageSet, simulate
from shipnet.errors import ArgumentError

MESSAGES = MessageSet(
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


def recorded():
    run = simulate(MESSAGES, 125e3, until=0.03)
    return run, run.log(payload=lambda name, k: name.encode()[:3] + bytes([k]))


def test_a_run_becomes_a_log_in_the_order_of_the_line():
    run, log = recorded()
    assert np.all(np.diff(log.time) > 0)
    assert len(log.time) == run.table()["sent"].sum() == 16
    assert log.time.tolist() == sorted((run.events()["end_ms"] / 1e3).tolist())
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
    _, log = recorded()
    bus = Bus(slow)
    log.replay(bus, speed=speed, clock=lambda: bus.now, sleep=bus.sleep)
    due = 100 + (log.time - log.time[0]) / speed
    assert [when for when, _ in bus.seen] == pytest.approx(due.tolist(), abs=1e-9)
    assert bus.slept


def test_without_a_speed_nothing_waits_and_error_reports_are_left_out():
    pytest.importorskip("can")
    _, log = recorded()
    bus = Bus()
    assert replace(log, error=log.extended).replay(bus, sleep=bus.sleep) == 6
    assert bus.slept == []
    assert Log(*(column[:0] for column in log.columns)).replay(bus) == 0


def test_what_cannot_be_played_is_refused():
    pytest.importorskip("can")
    run, log = recorded()
    with pytest.raises(ArgumentError, match="speed is 0; it must be positive"):
        log.replay(Bus(), speed=0)
    with pytest.raises(ArgumentError, match="speed is nan"):
        log.replay(Bus(), speed=float("nan"))
    with pytest.raises(ArgumentError, match="time of frame 2 of the log lies before"):
        replace(log, time=-log.time).replay(Bus())
    with pytest.raises(ArgumentError, match=r"payload of 'alarm' is .*; it must be 0..8 bytes"):
        run.log(payload=lambda name, k: bytes(9))
