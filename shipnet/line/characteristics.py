"""Time-domain simulation of lines by the method of characteristics.

Each end of a lossless line is modelled as a resistor Z0 and a source that repeats the wave that
left the other end one delay earlier, so each node is solved separately. A quarter of a line's
resistance is at each end and half in its middle; inductors and capacitors are integrated by the
trapezoidal rule. See H. W. Dommel, "Digital computer solution of electromagnetic transients",
IEEE Trans. PAS-88 (1969) 388-399.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from shipnet.arrays import Floats
from shipnet.errors import ArgumentError
from shipnet.line.network import Network

#: Maximum number of steps computed at a time.
_BLOCK = 512


def simulate(network: Network, sources: Mapping[str, tuple[Floats, Floats]], dt: float) -> Floats:
    """Return the voltages of all nodes, shape (n_nodes, n_t) [V]; the network is initially at rest.

    A source is a current into its node [A] and a parallel conductance [S], with one value of each
    per step `dt` [s]. Values at the first step are ignored: all voltages are 0 then. The error
    falls with the square of `dt` and is smallest if `dt` divides all delays; otherwise waves are
    interpolated.
    """
    if network.trees is not None:
        raise ArgumentError(f"the network has {network.trees} trees; this simulation needs one")
    ends, leak = _ends(network, dt)
    driven = [network.index(node) for node in sources]
    injected, beside = np.array([*sources.values()]).swapaxes(0, 1)
    nodes = _Nodes(network, dt)

    every = np.arange(len(ends.node))
    starts = np.searchsorted(ends.node, np.arange(len(network.nodes)))
    steady = leak + np.add.reduceat(ends.y, starts)
    block = min(_BLOCK, int(ends.steps.min()))
    depth = int(ends.steps.max()) + 2 + block
    # Waves that left each end; entries for times before 0 are still 0 when they are read.
    left = np.zeros((depth, len(every)))
    v = np.zeros((len(network.nodes), injected.shape[1]))
    for begin in range(1, v.shape[1], block):
        now = np.arange(begin, min(begin + block, v.shape[1]))
        slots = (now[:, np.newaxis] - ends.steps) % depth
        came = left[slots, every]
        if np.any(ends.fraction):
            came += ends.fraction * (left[slots - 1, every] - came)
        into = (1 + ends.h) / 2 * came[:, ends.far] + (1 - ends.h) / 2 * came
        current = np.add.reduceat(into, starts, axis=1)
        current[:, driven] += injected[:, now].T
        conductance = np.tile(steady, (len(now), 1))
        conductance[:, driven] += beside[:, now].T
        voltage = nodes.advance(current, conductance)
        outward = ends.y * voltage[:, ends.node]
        left[now % depth] = outward + ends.h * (outward - into)
        v[:, now] = voltage.T
    return v


class _Ends(NamedTuple):
    """Both ends of all lines, sorted by node; `far` is the index of the other end."""

    node: npt.NDArray[np.intp]
    far: npt.NDArray[np.intp]
    steps: npt.NDArray[np.intp]  # delay in whole steps
    fraction: Floats  # remainder of the delay [step]
    y: Floats  # 1 / (Z0 + R/4)
    h: Floats  # (Z0 - R/4) / (Z0 + R/4)


def _ends(network: Network, dt: float) -> tuple[_Ends, Floats]:
    """Return the ends of the lines, and the conductance that their insulation adds at each node."""
    leak = np.zeros(len(network.nodes))
    rows = []
    for run in network.runs:
        cable, length = run.made_of, run.length
        if cable.skin:
            raise ArgumentError(
                f"{run} has skin = {cable.skin:g} Hz; a time-domain simulation needs "
                "a constant resistance, skin = 0"
            )
        delay, z0, quarter = length * cable.delay, cable.z0, length * cable.r / 4
        # Rounding may have made a whole number of steps a little too small or too large.
        steps = delay / dt + 1e-9
        if steps < 1:
            raise ArgumentError(
                f"dt is {dt:g} s, but the delay of {run} is only {delay:.4g} s; "
                "dt must be at most the shortest delay"
            )
        if quarter >= z0:
            raise ArgumentError(
                f"{run} has {4 * quarter:.4g} ohm; a time-domain simulation needs less than "
                f"four times the characteristic impedance of {z0:.4g} ohm: divide the run"
            )
        whole = int(steps)
        fraction = max(0.0, steps - whole - 2e-9)
        row = (whole, fraction, 1 / (z0 + quarter), (z0 - quarter) / (z0 + quarter))
        a, b = network.index(run.a), network.index(run.b)
        rows += [(a, *row), (b, *row)]
        leak[[a, b]] += length * cable.g / 2
    order = np.argsort([row[0] for row in rows], kind="stable")
    node, whole_steps = (np.array([row[k] for row in rows], dtype=np.intp)[order] for k in (0, 1))
    # The rows come in pairs: the other end of row k is row k ^ 1.
    far = np.argsort(order)[order ^ 1]
    return _Ends(node, far, whole_steps, *np.array([row[2:] for row in rows])[order].T), leak


class _Nodes:
    """The loads of all nodes: conductances, and the states of inductors and capacitors."""

    def __init__(self, network: Network, dt: float) -> None:
        conductance, per_henry, capacitance = network.shunts()[..., 0]
        inductive, capacitive = per_henry * dt / 2, capacitance * 2 / dt
        self.conductance = conductance + inductive + capacitive
        self.inductive, self.capacitive = 2 * inductive, 2 * capacitive
        self.flux = np.zeros_like(conductance)
        self.charge = np.zeros_like(conductance)

    def advance(self, current: Floats, conductance: Floats) -> Floats:
        """Return the voltages (n_steps, n_nodes); `current` is overwritten with them."""
        inverse = 1 / (conductance + self.conductance)
        for voltage, factor in zip(current, inverse, strict=True):
            voltage += self.charge
            voltage -= self.flux
            voltage *= factor
            # Trapezoidal rule: each state combines a current and a voltage, and has one recurrence.
            self.flux += self.inductive * voltage
            self.charge = self.capacitive * voltage - self.charge
        return current
