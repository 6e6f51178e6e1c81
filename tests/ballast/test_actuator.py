from dataclasses import fields, replace

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from scipy.optimize import brentq

from shipnet.ballast.actuator import (
    Actuator,
    hydraulics,
    load_pressure,
    losses,
    motor_current,
    steady_temperature,
    stroke_time,
    velocity,
)
from shipnet.ballast.plant import FAULTS, Command, Fault, faulty
from shipnet.ballast.scan import System
from shipnet.ballast.sensors import Sensors
from shipnet.ballast.simulation import simulate
from shipnet.errors import ArgumentError
from tests.ballast.compliance import integrate_stroke
from tests.ballast.nominal import IDEAL, normal_values, operating_point


def one(code, severity):
    """Return a single valve with a fault, as plain numbers."""
    sick, _ = faulty(Actuator(), [Fault(code, severity)], 1)
    numbers = {field.name: getattr(sick, field.name) for field in fields(sick)}
    return Actuator(**{name: float(np.ravel(value)[0]) for name, value in numbers.items()})


def test_the_operating_point_agrees_with_the_printed_digits():
    point = operating_point(Actuator())
    for name, printed in normal_values().items():
        digit = 10.0 ** -len(f"{printed:g}".partition(".")[2])
        assert getattr(point, name) == pytest.approx(printed, abs=0.51 * digit), name
    assert point.stroke_time < 10
    assert operating_point(Actuator(), -1).stroke_time < 10


def balance(actuator, load):
    """Solve the same balances by bracketing, without the quadratic equations."""
    a = actuator

    def surplus(pump, cylinder):
        relieved = a.relief_slope * max(pump - a.relief_pressure, 0)
        through = a.restrictor * np.sqrt(max(pump - cylinder, 0))
        return a.displacement * a.speed - a.pump_leak * pump - relieved - through

    def pump(cylinder):
        high = cylinder + 1e10
        if surplus(cylinder, cylinder) <= 0:
            return cylinder
        return brentq(surplus, cylinder, high, args=(cylinder,), xtol=1e-3, rtol=1e-14)

    def flow(cylinder):
        into = a.restrictor * np.sqrt(max(pump(cylinder) - cylinder, 0))
        return into - a.piston_leak * cylinder

    if flow(load) > 0:
        return pump(load), load, flow(load)
    cylinder = brentq(flow, 0, load, xtol=1e-3, rtol=1e-14)
    return pump(cylinder), cylinder, 0.0


ACTUATORS = st.builds(
    Actuator,
    pump_leak=st.floats(-15, -9).map(lambda x: 10**x),
    restrictor=st.floats(-11, -7).map(lambda x: 10**x),
    piston_leak=st.floats(-15, -9).map(lambda x: 10**x),
    relief_slope=st.floats(-12, -9).map(lambda x: 10**x),
)


@given(actuator=ACTUATORS, load=st.floats(1e3, 5e7))
def test_the_closed_form_solves_the_balances_of_pump_and_cylinder(actuator, load):
    pump, cylinder, flow = hydraulics(actuator, load)
    expected = balance(actuator, load)
    assert pump == pytest.approx(expected[0], rel=1e-6, abs=10)
    assert cylinder == pytest.approx(expected[1], rel=1e-6, abs=10)
    # The flow is a difference of two flows, so the tolerance is relative to the pump's flow.
    assert flow == pytest.approx(expected[2], abs=1e-6 * actuator.displacement * actuator.speed)


def test_the_relief_valve_holds_a_stuck_valve_and_a_leaking_piston_holds_nothing():
    stuck = hydraulics(one("V1", 1.0), np.inf)
    assert 125e5 < stuck.pump_pressure < 130e5
    assert stuck.flow == 0
    open_relief = hydraulics(replace(one("V1", 1.0), relief_slope=1e-14), np.inf)
    assert open_relief.pump_pressure > 1e8
    leaking = hydraulics(one("V2", 1.0), load_pressure(Actuator(), 0.5))
    assert leaking.flow == 0
    assert leaking.cylinder_pressure < load_pressure(Actuator(), 0.5)


# The tolerances are those in the docstring of `integrate_stroke`.
@pytest.mark.parametrize(
    ("code", "severity", "direction"),
    [
        *[("P1", 0.0, 1), ("P1", 0.0, -1), ("P2", 0.5, 1), ("P2", 1.0, 1)],
        *[("V1", 0.6, 1), ("V1", 1.0, 1), ("V2", 1.0, 1), ("P1", 1.0, 1)],
    ],
)
def test_differential_equations_with_compliance_agree_with_the_closed_form(
    code, severity, direction
):
    valve = one(code, severity)
    ode = integrate_stroke(valve, np.linspace(0, 12, 121), direction=direction)
    run = simulate(
        System(actuator=valve, sensors=IDEAL, opening=0.0 if direction > 0 else 1.0),
        [Command("open" if direction > 0 else "close")],
        until=12,
    )
    settled = ode.time >= 0.5
    n = ode.time.size
    assert n >= 80
    assert np.abs(100 * ode.opening - run.samples["VPos"][:n, 0])[settled].max() < 0.1
    assert np.abs(ode.pump_pressure / 1e5 - run.samples["FP"][:n, 0])[settled].max() < 0.2
    assert np.abs(ode.cylinder_pressure / 1e5 - run.samples["OP"][:n, 0])[settled].max() < 0.2
    if np.isfinite(ode.end):
        assert run.strokes()["duration_s"][0] == pytest.approx(ode.end, abs=0.02)


def test_the_stroke_time_equals_a_sum_of_many_small_steps():
    for direction in (1, -1):
        x = (np.arange(20_000) + 0.5) / 20_000
        expected = np.mean(1 / velocity(Actuator(), x, direction))
        assert stroke_time(Actuator(), direction) == pytest.approx(expected, rel=1e-6)
    assert stroke_time(one("V1", 1.0)) == np.inf


def test_many_valves_give_the_same_as_each_alone():
    leaks = np.geomspace(1e-13, 1e-10, 7)
    many = operating_point(replace(Actuator(), pump_leak=leaks))
    for k, leak in enumerate(leaks):
        alone = operating_point(replace(Actuator(), pump_leak=leak))
        assert [v[k] if np.ndim(v) else v for v in many] == pytest.approx([float(v) for v in alone])


def test_the_flow_helps_to_close_a_valve_and_resists_opening():
    valve = Actuator()
    opens, closes = (load_pressure(valve, 0.58, way) for way in (1, -1))
    torque = (opens - closes) * valve.piston_area * valve.pinion_radius
    assert torque == pytest.approx(2 * 20 * 0.58 * np.sin(np.pi * 0.58) ** 2)
    assert load_pressure(replace(valve, dynamic_torque=1e4), 0.5, -1) == 0


def test_electric_power_is_work_on_the_oil_or_heat():
    pressure = np.array([0, 5e6, 9e6, 12.76e6])
    a = Actuator()
    active = np.sqrt(motor_current(a, pressure) ** 2 - a.magnetising_current**2)
    taken = np.sqrt(3) * 400 * active
    assert taken == pytest.approx(a.displacement * a.speed * pressure + losses(a, pressure))
    assert (np.diff(losses(a, pressure)) > 0).all()
    assert steady_temperature(replace(a, duty=0)) == 45


@given(st.sampled_from(list(FAULTS)), st.floats(0, 1), st.floats(0, 1), st.sampled_from([-1, 1]))
@example("P1", 1.0, 0.5, 1)
def test_no_fault_breaks_the_energy_balance_of_the_motor(code, severity, opening, way):
    sick, _ = faulty(Actuator(), [Fault(code, severity)], 1)
    pressure = hydraulics(sick, load_pressure(sick, opening, way)).pump_pressure
    torque = sick.displacement * pressure / (2 * np.pi * sick.pump_efficiency) + sick.friction
    shaft = 2 * np.pi * sick.speed * torque
    oil = sick.displacement * sick.speed * pressure
    taken = oil + losses(sick, pressure)
    assert (oil <= shaft).all()
    assert (shaft <= taken).all()
    assert (taken <= np.sqrt(3) * sick.voltage * motor_current(sick, pressure)).all()


def test_a_motor_that_would_deliver_more_than_it_draws_is_refused():
    with pytest.raises(ArgumentError, match=r"at most 4\.56 N m/A at this voltage and speed"):
        Actuator(torque_constant=[4.0, 5.0])
    assert Actuator(torque_constant=4.56).torque_constant == 4.56


def test_sensors_clip_step_and_keep_nan():
    sensors = Sensors()
    truth = np.array([[-5, 200], [np.nan, 5], [1.2, 7], [50, 160], [-30, 130]], float)
    readings = sensors.read(truth)
    assert readings[0].tolist() == [0, 160]
    assert np.isnan(readings[1, 0])
    assert readings[4].tolist() == [-20, 120]
    inside = np.random.default_rng(1).uniform(0, 10, 500)
    read = sensors.read(np.tile(inside, (5, 1)))[1]
    assert np.abs(read - inside).max() <= 10 / 4095 / 2 * (1 + 1e-9)
    assert np.unique(np.rint(read / (10 / 4095)) - read / (10 / 4095)).max() < 1e-9


def test_the_noise_has_the_requested_deviations():
    sensors = Sensors(low=(-1e3,) * 5, high=(1e3,) * 5, bits=None)
    read = sensors.read(np.zeros((5, 20_000)), np.random.default_rng(2024))
    # The deviation of 20,000 draws has a standard error of 0.5 %; the tolerance is four times that.
    assert read.std(axis=1) == pytest.approx(sensors.noise, rel=0.02)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Actuator(speed=0), "speed is 0"),
        (lambda: Actuator(pump_leak=float("nan")), "pump_leak is nan"),
        (lambda: Actuator(pump_leak=[1e-13, 1e-3]), "pump_leak"),
        (lambda: Actuator(duty=1.5), r"duty is 1.5.*0\.\.1"),
        (lambda: Actuator(pump_leak=[1e-13] * 2, speed=[20] * 3), "2 and for 3 valves"),
        (lambda: Sensors(bits=0), "bits is 0"),
        (lambda: Sensors(noise=(1, 1)), "five numbers"),
        (lambda: Sensors(low=(0, 0, 6, 0, 0)), "scale of MC is 6..6"),
        (lambda: Sensors(noise=(0, 0, 0, -1, 0)), "noise of OT"),
        (lambda: Sensors().read(np.zeros((4, 2))), r"\(5, n_valves\)"),
    ],
)
def test_arguments_out_of_range_are_named(make, message):
    with pytest.raises(ArgumentError, match=message):
        make()
