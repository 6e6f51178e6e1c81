"""The public objects agree with the functions that they call."""

import numpy as np
import pytest

from shipnet import asi
from shipnet.errors import ArgumentError, ParityError


def test_a_spectrum_is_the_transform_of_the_slope():
    code = asi.Modulation("0011001")
    t = np.arange(0, 50e-6, 5e-9)
    slope = np.gradient(code.current(t), t)
    by_hand = [abs(np.trapezoid(slope * np.exp(-2j * np.pi * f * t), t)) for f in (50e3, 167e3)]
    assert code.spectrum([50e3, 167e3]) == pytest.approx(by_hand, rel=1e-3)
    with pytest.raises(ArgumentError, match="bits of telegrams must be 0 or 1"):
        asi.Modulation("012")


def test_pulses_are_decoded_or_name_the_violated_rule():
    for response in asi.Response.all():
        pulses = asi.Modulation(response.bits).pulses
        assert (pulses.decode(), pulses.broken, pulses.error) == (response.bits, (), "ok")
        assert pulses.count == np.count_nonzero(pulses)
    bad = asi.Pulses("0-+-0+-+-+0-0+00")
    assert bad.error == "ParityError"
    with pytest.raises(ParityError):
        bad.decode()
    assert bad.check()[1] == ParityError.code
    for wrong in ("0-x", "", [2], 1.5):
        with pytest.raises(ArgumentError, match="signs are"):
            asi.Pulses(wrong)


def test_a_receiver_hears_every_response_and_a_finer_step_hears_the_same():
    plan = asi.line(100, slaves=(5, 100))
    for dt in (250e-9, 50e-9):
        heard = plan.waveform(dt=dt).receive()
        assert heard.within_tolerance.all()
        assert heard.amplitude[:, 0] == pytest.approx([2.33, 3.15], abs=0.1)
    one = plan.waveform("0011001", "5 m")
    assert one.u == pytest.approx(plan.waveform().u[0, 6], abs=1e-12)
    with pytest.raises(ArgumentError, match="threshold is 1"):
        asi.Receiver(threshold=1)


def test_error_rates_do_not_depend_on_the_step():
    plan, receiver = asi.line(100, slaves=(5,)), asi.Receiver(minimum=0.9)
    rates = [
        asi.emc.count_errors(
            plan.waveform(dt=dt), asi.emc.Noise(), 0.7, 4000, 2024, receiver=receiver
        )["rate"][0]
        for dt in (125e-9, 250e-9)
    ]
    assert rates == pytest.approx([0.068, 0.068], abs=0.012)


def test_a_disturbed_waveform_has_the_disturbance_on_every_telegram():
    wave = asi.line(100, slaves=(5,)).waveform()
    noisy = wave.disturbed(asi.emc.Noise(), 0.5, 2024)
    assert (noisy.u - wave.u).std() == pytest.approx(0.5, rel=0.05)
    assert (noisy.bits == wave.bits).all()


def test_a_capture_against_its_plan_names_who_is_missing():
    plan = asi.line(80, slaves=(1, 80))
    request = asi.Request.data_exchange(1, 0xE)
    asked = plan.waveform(request, "1 m", dt=1e-7, before=20e-6, after=296e-6)
    answered = plan.waveform(request.answer(3), "1 m", dt=1e-7, before=122e-6, after=236e-6)
    capture = asi.decode(asked.u + answered.u, 1e-7)
    assert capture.check().ok
    missing = capture.check(plan).violated()
    assert missing[["rule", "object"]].values.tolist() == [["answers", "slave 2"]]
    with pytest.raises(ArgumentError, match="dt is missing"):
        asi.decode(asked.u)


def test_a_master_given_a_node_as_profiles_says_how_to_give_both():
    with pytest.raises(ArgumentError, match=r"projected is 'PLC'; .* \{'1': .*node='PLC'"):
        asi.Master("PLC")
    assert asi.Master({"1": "S-7.F.F"}).protected and not asi.Master().protected
