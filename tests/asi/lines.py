"""Helpers for tests: slaves by address, lines with given disturbances, slaves at given places."""

from dataclasses import replace
from unittest.mock import patch

import numpy as np

from shipnet.asi import channel
from shipnet.asi.master import Master
from shipnet.asi.modulation import Modulation
from shipnet.asi.plan import Plan, plan_of
from shipnet.asi.segment import Repeater
from shipnet.asi.simulation import simulate
from shipnet.asi.slave import Slave
from shipnet.asi.telegram import frame
from shipnet.line.network import CableRun

#: Bits of every request that fits into a frame, known or unknown, and of every response.
REQUESTS = Modulation([frame(f"{information:011b}") for information in range(2**11)]).bits
RESPONSES = Modulation([frame(f"{data:04b}") for data in range(16)]).bits


def slave(profile, address=0, half=None, **options):
    return Slave(f"{address}{half or ''}", profile, **options)


def renamed(plan, prefix):
    """Return a plan with a prefix before each node's name."""
    moved = []
    for element in plan:
        ends = [name for name in ("node", "a", "b") if hasattr(element, name)]
        moved.append(replace(element, **{name: prefix + getattr(element, name) for name in ends}))
    return plan_of(moved)


def draw(rng, n_cycles, request, response, *, attempts=2):
    """Draw disturbances with the rates of each slave, shape (n_cycles, 3, n_slaves, attempts)."""
    rates = list(zip(request, response, strict=True))
    return channel.draw_disturbances(rng, n_cycles, rates, attempts)


def undisturbed(n_cycles, n_slaves, attempts=2):
    """Return no disturbances, of the shape (n_cycles, 3, n_slaves, attempts)."""
    return np.zeros((n_cycles, channel.PHASES, n_slaves, attempts), channel.DISTURBANCE)


def simulate_drawn(drawn, system, *given, **options):
    """Simulate with given disturbances of shape (n_cycles, 3, n_slaves, attempts)."""
    begun = 0

    def hand_out(rng, n_cycles, rates, attempts):
        nonlocal begun
        rows = undisturbed(n_cycles, len(rates), attempts)
        own = drawn[begun : begun + n_cycles]
        rows[: len(own)] = own
        begun += n_cycles
        return rows

    with patch.object(channel, "draw_disturbances", hand_out):
        return simulate(system, *given, **options)


def placed(slaves, positions=None, delays=None):
    """Return a plan of slaves, each on its own leg, some of them downstream of a repeater."""
    runs, elements, repeaters = [CableRun("m", "end", 1)], [], []
    for number, one in enumerate(slaves):
        near, node = "m", f"s{number}"
        if delays and one.label in delays:
            near = f"r{number}"
            repeaters.append(Repeater("m", near, delays[one.label]))
        runs.append(CableRun(near, node, (positions or {}).get(one.label, 0.01)))
        settings = {name: getattr(one, name) for name in ("inputs", "id1", "watchdog")}
        elements.append(Slave(one.label, one.profile, node=node, **settings))
    return Plan(runs, [Master(node="m")], slaves=elements, repeaters=repeaters)
