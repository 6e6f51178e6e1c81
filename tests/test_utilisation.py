"""Bus time, capacity used and worst response: the same three numbers, computed and simulated."""

import math

import pytest

from shipnet import asi, can, modbus
from shipnet.errors import ArgumentError
from tests.support import tolerance

UPDATE = 0.5
POLL = modbus.Poll(
    modbus.Request.read_input_registers(0, 4), modbus.SerialLine(19200), processing=5e-3
)


def line(addresses, pairs=0, modules=()):
    """Return a plan whose first slaves are modules, and whose last addresses are shared."""
    slaves = list(modules)
    for n in range(len(modules) + 1, addresses + 1):
        halves = "AB" if n > addresses - pairs else ("",)
        slaves += [asi.Slave(f"{n}{half}", node="0 m") for half in halves]
    cable = asi.CableRun("0 m", "50 m", 50)
    return asi.Plan([cable], masters=[asi.Master(node="0 m")], slaves=slaves)


def messages(n):
    return can.MessageSet(
        can.Message(f"box {k}", k, 8, period=UPDATE / 2, sender=str(k)) for k in range(1, n + 1)
    )


def assert_close(computed, seen, rel):
    assert computed._asdict() == pytest.approx(seen._asdict(), rel=rel)


@pytest.mark.parametrize(
    ("plan", "update"),
    [
        (line(31), UPDATE),
        (line(31, pairs=31), 5e-3),
        (line(12, pairs=4, modules=[asi.Slave("1", "S-7.3", node="0 m", channels=4)]), 0.1),
    ],
)
def test_an_asi_line_is_used_as_it_is_simulated(plan, update):
    seen = asi.simulate(plan, cycles=4000).utilisation(update)
    assert_close(plan.utilisation(update), seen, tolerance("utilisation.asi"))


@pytest.mark.parametrize("n", [1, 13, 100])
def test_a_can_bus_is_used_as_it_is_simulated(n):
    computed = can.response_times(messages(n), 125e3).utilisation()
    seen = can.simulate(messages(n), 125e3, until=20 * UPDATE).utilisation()
    assert_close(computed, seen, tolerance("utilisation.can"))
    assert computed.bus_time == pytest.approx(can.bus_load(messages(n), 125e3))
    assert computed.capacity_used == computed.bus_time
    assert computed.worst_response == pytest.approx(UPDATE / 2 + n * 135 / 125e3)


@pytest.mark.parametrize("n", [1, 13, 100])
def test_a_modbus_line_is_used_as_it_is_simulated(n):
    seen = modbus.simulate(modbus.Loop(n, POLL), until=20 * n * POLL.time).utilisation(UPDATE)
    assert_close(POLL.utilisation(n, UPDATE), seen, tolerance("utilisation.modbus"))


def test_what_is_nearest_to_its_end_counts():
    # 31 addresses are all that there are, whatever the update; one is asked every 0.5 ms.
    assert line(31).utilisation(60.0).capacity_used == 1
    assert line(1).utilisation(1e-3).capacity_used == pytest.approx(3 * 0.156)
    assert POLL.utilisation(247, 1000.0).capacity_used == 1
    assert POLL.utilisation(1, 1e-3).capacity_used == pytest.approx(POLL.time / 1e-3)


def test_nothing_uses_nothing():
    nothing = can.response_times(can.MessageSet([]), 125e3).utilisation()
    assert nothing[:2] == (0, 0) and math.isnan(nothing.worst_response)
    empty = line(0).utilisation(1.0)
    assert empty.capacity_used == 0 and math.isnan(empty.worst_response)


@pytest.mark.parametrize("update", [0, -1.0, math.nan, "1", None])
def test_an_update_is_a_time(update):
    run = asi.simulate(line(2), cycles=3)
    poll = modbus.simulate(modbus.Loop(2, POLL), until=1)
    for one in (line(2), run, poll):
        with pytest.raises(ArgumentError, match="update is"):
            one.utilisation(update)
    with pytest.raises(ArgumentError, match="update is"):
        POLL.utilisation(2, update)


def test_an_unknown_transfer_has_no_utilisation():
    used = line(2, modules=[asi.Slave("1A", "S-7.A.9", node="0 m")]).utilisation(1.0)
    assert math.isnan(used.capacity_used) and math.isnan(used.worst_response) and used.bus_time > 0
    with pytest.raises(ArgumentError, match="no slave answered twice"):
        asi.simulate(line(2), cycles=1).utilisation(1.0)
