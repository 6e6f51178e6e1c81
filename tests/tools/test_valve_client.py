import gc
import socket
import threading
from contextlib import contextmanager
from functools import partial

import numpy as np
import pytest

from shipnet.ballast.live import Client, Link, ModelValves, serve
from shipnet.ballast.plant import Fault
from shipnet.errors import ArgumentError
from shipnet.modbus.frame import tcp_frame
from shipnet.modbus.pdu import decode
from shipnet.tools.valve_client import ValveClient


@pytest.fixture(autouse=True)
def patience(monkeypatch):
    """On a busy machine, a server may take longer than a second to answer."""
    monkeypatch.setattr("shipnet.tools.valve_client.Link", partial(Link, timeout=60.0))


def send(ask, valve, action):
    return Client.over(ask).command(valve, action)


def seen(tool, ask):
    """Return what the page shows for valves that respond."""
    return tool.view(Client.over(ask, tool.valves).read())


@contextmanager
def linked(port, timeout=5.0):
    link = Link("127.0.0.1", port, timeout)
    try:
        yield link
    finally:
        link.close()


def test_a_valve_travels_in_simulated_time():
    valves = ModelValves(8)
    assert send(valves, 3, "open") == "valve 3: open"
    assert send(valves, 5, 40) == "valve 5: position 40 %"
    places = []
    for valves.time in (0.0, 3.0, 12.0):
        readout = Client.over(valves, 8).read()
        places.append(readout.rows.VPos_percent.loc[[1, 3, 5]].tolist())
    assert places == [[0, 0, 0], [0, 33, 33], [0, 100, 40]]
    view = ValveClient(valves=8, valve=3).view(readout)
    assert view.verdict == "valve 3: open, 100 %"
    assert view.numbers["motor ran"] == "9.0 s"
    assert view.numbers["mode"] == "auto" and view.numbers["last command reported"] == "open"
    states = readout.screen.table().state.tolist()
    assert states[:5] == ["closed", "closed", "open", "closed", "part open"]


def test_refusals_are_shown_as_messages():
    valves = ModelValves(2)
    assert send(valves, 1, "manual") == "valve 1: manual"
    assert send(valves, 1, "open") == "valve 1 refuses: server device failure"
    assert send(valves, 3, "open") == "valve 3 refuses: gateway target failed to respond"
    assert seen(ValveClient(valves=3, valve=3), valves).verdict == "valve 3 does not respond"
    assert seen(ValveClient(valves=3, valve=3), valves).numbers == {}


def test_a_socket_gives_the_same_results_as_simulated_time():
    with serve(4, speed=0, faults=[Fault("Pos3", valves=2)]) as server:
        with linked(server.port) as link:
            assert send(link, 3, "open") == "valve 3: open"
            readout = Client.over(link, 5).read()
    assert readout.rows.VPos_percent.tolist()[:4] == [0, 15, 0, 0]
    assert readout.rows.fault.dropna().index.tolist() == [1, 2, 3, 4]
    assert ValveClient(valves=5, valve=3).view(readout).verdict == "valve 3: moving, 0 %"


def test_an_address_without_a_server_is_reported_in_a_sentence():
    with socket.socket() as closed:
        closed.bind(("127.0.0.1", 0))
        port = closed.getsockname()[1]
        with pytest.raises(OSError, match=f"no server at 127.0.0.1, port {port}: "):
            Link("127.0.0.1", port)
    with pytest.raises(OSError, match=r"no server at .*\.invalid, port 1"):
        Link("no.such.invalid", 1)


@pytest.mark.parametrize("reply", [b"", b"\x00" * 9, "silence", "other unit"])
def test_a_server_that_answers_nonsense_is_reported_in_a_sentence(reply):
    with socket.create_server(("127.0.0.1", 0)) as listener:

        def answer():
            peer, _ = listener.accept()
            with peer:
                request = decode(peer.recv(260), "tcp")
                if reply == "other unit":
                    # The response to another request, then the start of one more.
                    late = tcp_frame(1, b"\x84\x01", (request.transaction_id + 5) % 65536)
                    peer.sendall(late + late[:3])
                elif reply != "silence":
                    peer.sendall(reply)
                else:
                    peer.recv(1)

        thread = threading.Thread(target=answer)
        thread.start()
        with linked(listener.getsockname()[1], 0.3) as link:
            with pytest.raises(OSError, match="does not answer for valve 1"):
                Client.over(link, 1).read()
        thread.join()


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: send(ModelValves(), 0, "open"), "valve is 0"),
        (lambda: send(ModelValves(), 1, "stop"), "action is 'stop'"),
        (lambda: send(ModelValves(), 1, 101), "action is 101"),
        (lambda: send(ModelValves(), 1, "position"), r"action is 'position'.*0\.\.100"),
    ],
)
def test_a_value_out_of_range_is_named(make, message):
    with pytest.raises(ArgumentError, match=message):
        make()


def test_the_explorer_moves_the_valves_of_its_own_server_and_closes_it(monkeypatch):
    now = [0.0]
    monkeypatch.setattr("shipnet.ballast.live.real_clock", lambda factor: lambda: now[0])
    before = threading.active_count()
    box = ValveClient().explore()
    fields, buttons = box.controls, box.buttons
    device = box.server.slaves[3].device
    picture = box.figure.value
    fields["valve"].value = 3
    assert box.figure.value != picture
    buttons["open"].click()
    assert device.plant.running.tolist() == [False, False, True] + [False] * 13
    assert "sent from here: valve 3: open" in box.text
    assert "valve 3: moving" in box.text
    now[0] = 3.0
    buttons["read again"].click()
    assert device.plant.opening[2] == pytest.approx(1 / 3, abs=0.01)
    assert "valve 3: moving" in box.text
    buttons["position"].click()
    assert device.plant.running[2]
    fields["valves"].value = 17
    fields["valve"].value = 17
    assert "valve 17 does not respond" in box.text
    port = box.server.port
    box.close()
    assert threading.active_count() == before
    with pytest.raises(OSError, match="no server"):
        Link("127.0.0.1", port)
    box.close()


def test_a_missing_reading_is_reported_and_does_not_count_as_silence():
    valves = ModelValves(2)
    valves._slaves[1].device.plant._offsets[:] = np.nan
    readout = Client.over(valves, 3).read()
    view = ValveClient(valves=3).view(readout)
    assert view.numbers["position"] == view.numbers["pump pressure"] == "missing"
    assert view.verdict == "valve 1: not seen, missing"
    assert readout.screen.table().state.tolist() == ["not seen", "not seen", "silent"]


def test_a_refusal_colours_its_valve_only_until_that_obeys():
    box = ValveClient().explore()
    try:
        fields, buttons = box.controls, box.buttons
        device = box.server.slaves[2].device
        device.local = True
        colours = []

        def look(valve):
            fields["valve"].value = valve
            colours.append(not box.ok)

        look(2)
        buttons["open"].click()
        for valve in (2, 3, 2):
            look(valve)
        device.local = False
        buttons["open"].click()
        look(2)
        assert colours == [False, True, False, True, False]
    finally:
        box.close()


def test_the_answer_to_a_command_is_shown_with_its_own_valve_only():
    box = ValveClient().explore()
    try:
        box.controls["valve"].value = 3
        box.buttons["open"].click()
        assert "sent from here: valve 3: open" in box.text
        assert "last command reported: open" in box.text
        box.controls["valve"].value = 7
        assert "sent from here" not in box.text and "last command reported: none" in box.text
        box.controls["valve"].value = 3
        assert "sent from here: valve 3: open" in box.text
        with serve(8, speed=0) as other:
            box.controls["port"].value = other.port
            box.controls["address"].value = "127.0.0.1"
            assert "valve 3: closed" in box.text and "sent from here" not in box.text
    finally:
        box.close()


def test_the_explorer_connects_to_a_typed_address_or_reports_that_no_server_responds():
    box = ValveClient().explore()
    try:
        fields, buttons = box.controls, box.buttons
        with serve(2, speed=0, faults=[Fault("Pos3", valves=1)]) as other:
            fields["port"].value = other.port
            fields["valves"].value = 2
            fields["address"].value = "127.0.0.1"
            assert "valve 1: part open, 15 %" in box.text
        buttons["read again"].click()
        assert "127.0.0.1" in box.text
        assert "no server" in box.text or "does not answer" in box.text
        fields["address"].value = ""
        assert "valve 1: closed" in box.text
    finally:
        box.close()


def test_a_client_that_is_no_longer_referenced_closes_its_server():
    before = threading.active_count()
    box = ValveClient().explore()
    assert threading.active_count() == before + 1
    box._end()
    assert threading.active_count() == before
    box.close()
    del box
    gc.collect()
    assert threading.active_count() == before
