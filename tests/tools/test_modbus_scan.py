import pytest

from shipnet.tools.modbus_scan import ModbusScan


@pytest.mark.parametrize("dead", [0, 1])
def test_one_slave_too_many_is_too_slow(dead):
    most = ModbusScan(dead=dead).result.max_slaves
    assert ModbusScan(slaves=most, dead=dead).ok
    assert not ModbusScan(slaves=most + 1, dead=dead).ok


def test_errors_are_sentences_and_dead_slaves_follow_the_slaves():
    page = ModbusScan(dead=5).explore()
    page.controls["timeout_ms"].value = 20.0
    assert "timeout is 0.02 s; it must be" in page.text
    page.controls["timeout_ms"].value = 100.0
    # There are fewer slaves than dead ones.
    page.controls["slaves"].value = 3
    assert page.controls["dead"].value == page.controls["dead"].max == 3
    assert "scan: 0.655 s" in page.text
