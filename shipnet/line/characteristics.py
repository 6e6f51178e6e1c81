"""Waveforms step by step in time: the method of characteristics.

Each end of a line without loss is a resistor Z0 and a source that repeats what left the other end
one delay ago, so each node is solved by itself. A quarter of a line's resistance lies at each end
and half in its middle; inductors and capacitors follow the trapezoidal rule. See H. W. Dommel,
"Digital computer solution of electromagnetic transients", IEEE Trans. PAS-88 (1969) 388-399.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple, TypeAlias

import numpy as np
import numpy.typing as npt

from shipnet.arguments import checked
from shipnet.arrays import Floats
from shipnet.errors import ArgumentError
from shipnet.fields import check_scalar
from shipnet.line.network import Network
from shipnet.line.waveform import Waveform

#: A quantity over time: a constant, its samples, or a function of the array of times.
Signal: TypeAlias = "npt.ArrayLike | Callable[[Floats], npt.ArrayLike]"

#: Most steps that are taken at a time.
_BLOCK = 512


@checked
@dataclass(frozen=True)
class Driver:
    """A sender on a network: a current that it draws, or a voltage behind a conductance.

    Each value is a number, one sample per time step, or a function of the array of times [s].

    Parameters
    ----------
    node : str
        The node to which it is connected.
    current : float, array_like of shape (n_t,), or callable, optional
        Current drawn from the node, as by an AS-i telegram [A].
    voltage : float, array_like of shape (n_t,), or callable, optional
        Voltage of a driver, as of CAN or RS-485 [V]; it needs a `conductance`.
    conductance : float, array_like of shape (n_t,), or callable, optional
        Conductance in series with the voltage, not negative [S]; 0 while the driver is off.

    Examples
    --------
    >>> Driver("b0", voltage=3.2, conductance=1 / 40)
    Driver(node='b0', current=None, voltage=3.2, conductance=0.025)
    """

    node: str
    current: Signal | None = None
    voltage: Signal | None = None
    conductance: Signal | None = None

    def __post_init__(self) -> None:
        given = [self.current is not None, self.voltage is not None, self.conductance is not None]
        if given not in ([True, False, False], [False, True, True]):
            raise ArgumentError(
                f"driver at node {self.node!r} must have a current, or a voltage and a conductance"
            )


class NortonSources(NamedTuple):
    """All drivers of all columns as current sources, added up per node and column."""

    node: list[int]
    column: list[int]
    current: Floats  # into the node, shape (n_sources, n_t) [A]
    conductance: Floats | None  # beside it [S]; None if there is none at any time
    columns: int


def norton_sources(
    network: Network, columns: Sequence[Sequence[Driver]], t: Floats
) -> NortonSources:
    """Return the drivers of a simulation as current sources."""
    current: dict[tuple[int, int], Floats] = {}
    conductance: dict[tuple[int, int], Floats] = {}
    zero = np.zeros_like(t)
    for column, together in enumerate(columns):
        for driver in together:
            at = network.index(driver.node, "node of a driver"), column
            name = f"of the driver at node {driver.node!r}"
            if driver.current is not None:
                into = -_samples(f"current {name}", driver.current, t, "A", -np.inf)
            elif driver.voltage is not None and driver.conductance is not None:
                g = _samples(f"conductance {name}", driver.conductance, t, "S", 0.0)
                into = g * _samples(f"voltage {name}", driver.voltage, t, "V", -np.inf)
                conductance[at] = conductance.get(at, zero) + g
            current[at] = current.get(at, zero) + into
    if not current:
        raise ArgumentError("drivers are empty; there must be at least one")
    return NortonSources(
        [node for node, _ in current],
        [column for _, column in current],
        np.array(list(current.values())),
        np.array([conductance.get(at, zero) for at in current]) if conductance else None,
        len(columns),
    )


def _samples(what: str, signal: Signal, t: Floats, unit: str, low: float) -> Floats:
    values = np.asarray(signal(t) if callable(signal) else signal)
    if values.dtype.kind not in "iuf" or values.shape not in ((), t.shape):
        raise ArgumentError(
            f"{what} has shape {values.shape} and type {values.dtype}; "
            f"it must be a number, or one for each of the {t.size} times"
        )
    good = np.isfinite(values) & (values >= low)
    if not good.all():
        worst = values.reshape(-1)[np.argmin(good)]
        legal = "finite" if low == -np.inf else f"finite and at least {low:g} {unit}"
        raise ArgumentError(f"{what} is {worst:g} {unit}; it must be {legal}")
    return np.broadcast_to(values.astype(float), t.shape)


class _Ends(NamedTuple):
    """Both ends of all lines, sorted by node; `far` is the place of the other end."""

    node: npt.NDArray[np.intp]
    far: npt.NDArray[np.intp]
    steps: npt.NDArray[np.intp]  # delay in whole steps
    fraction: Floats  # and the rest of the delay
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
                f"cable of {run} has skin = {cable.skin:g} Hz; steps in time need a constant "
                "resistance, skin = 0 (Network.transfer takes any)"
            )
        delay, z0, quarter = length * cable.delay, cable.z0, length * cable.r / 4
        # A delay of a whole number of steps may lie a rounding below it, or above.
        steps = delay / dt + 1e-9
        if steps < 1:
            raise ArgumentError(
                f"dt is {dt:g} s, but {run} delays by {delay:.4g} s only; "
                "dt must be at most the shortest delay"
            )
        if quarter >= z0:
            raise ArgumentError(
                f"{run} has {4 * quarter:.4g} ohm; in steps of time a line must stay below four "
                f"times its wave impedance of {z0:.4g} ohm: use Network.subdivided"
            )
        whole = int(steps)
        fraction = max(0.0, steps - whole - 2e-9)
        row = (whole, fraction, 1 / (z0 + quarter), (z0 - quarter) / (z0 + quarter))
        a, b = network.index(run.a), network.index(run.b)
        rows += [(a, *row), (b, *row)]
        leak[[a, b]] += length * cable.g / 2
    order = np.argsort([row[0] for row in rows], kind="stable")
    node, whole_steps = (np.array([row[k] for row in rows], dtype=np.intp)[order] for k in (0, 1))
    # The rows came in pairs: the other end of row k is row k ^ 1.
    far = np.argsort(order)[order ^ 1]
    return _Ends(node, far, whole_steps, *np.array([row[2:] for row in rows])[order].T), leak


@checked
def simulate(
    network: Network,
    drivers: Driver | Sequence[Driver] | Sequence[Sequence[Driver]],
    until: float,
    dt: float,
    *,
    probes: Sequence[str] | None = None,
) -> Waveform:
    """Simulate the voltages of a network that is at rest before its drivers begin.

    Parameters
    ----------
    network : Network
        A single tree or ring, whose cables have ``skin=0``. The resistance of a run should stay
        far below its wave impedance; cut a long one by `Network.subdivided`.
    drivers : Driver, sequence of Driver, or sequence of sequences of Driver
        The senders, which act together; each inner sequence is a case of its own.
    until : float
        Time to simulate, at least `dt` [s].
    dt : float
        Step, at least 1e-15 and at most the delay of the shortest run [s]. The error falls with
        its square and is smallest where it divides all delays; else waves are interpolated.
    probes : sequence of str, optional
        Nodes to report; all of them by default.

    Returns
    -------
    Waveform
        Voltages at the probes from 0 in steps of `dt`, shape (n_probes, n_t), or
        (n_probes, n_cases, n_t) if cases were given.

    Examples
    --------
    A wave of 1 V meets the open end of 100 m after 0.65 us and doubles there:

    >>> from shipnet.line import CableRun
    >>> net = Network([CableRun("near", "far", 100, "as-i lossless")])
    >>> sender = Driver("near", voltage=2.0, conductance=0.01)
    >>> wave = simulate(net, sender, until=1e-6, dt=0.05e-6)
    >>> wave.u[:, [1, 12, 14]].round(6).tolist()
    [[1.0, 1.0, 1.0], [0.0, 0.0, 2.0]]
    """
    if network.trees is not None:
        raise ArgumentError(f"the network holds {network.trees} trees; steps in time take one")
    network.rooted(next(iter(network.nodes), ""))
    step = check_scalar("dt", dt, "s", 1e-15, 1e6)
    total = check_scalar("until", until, "s", 1e-15, 1e6)
    if total < step:
        raise ArgumentError(f"until is {total:g} s; it must be at least dt, {step:g} s")
    ends, leak = _ends(network, step)
    t: Floats = np.arange(int(total / step + 1e-9) + 1, dtype=float) * step
    columns, single = _columns(drivers)
    sources = norton_sources(network, columns, t)
    names = network.nodes if probes is None else tuple(probes)
    shown = [network.index(name, "one of probes") for name in names]
    nodes = _Nodes(network, step, sources.columns)

    own = np.arange(len(ends.node))
    starts = np.searchsorted(ends.node, np.arange(len(network.nodes)))
    steady = leak + np.add.reduceat(ends.y, starts)
    y, h, fraction = (column[:, np.newaxis] for column in (ends.y, ends.h, ends.fraction))
    block = min(_BLOCK, int(ends.steps.min()))
    depth = int(ends.steps.max()) + 2 + block
    # The waves that left each end; times before 0 are read as 0 before they are written.
    left = np.zeros((depth, len(own), sources.columns))
    v = np.zeros((len(shown), sources.columns, t.size))
    for begin in range(1, t.size, block):
        now = np.arange(begin, min(begin + block, t.size))
        slots = (now[:, np.newaxis] - ends.steps) % depth
        came = left[slots, own]
        if np.any(fraction):
            came += fraction * (left[slots - 1, own] - came)
        into = (1 + h) / 2 * came[:, ends.far] + (1 - h) / 2 * came
        current = np.add.reduceat(into, starts, axis=1)
        current[:, sources.node, sources.column] += sources.current[:, now].T
        conductance = np.empty_like(current)
        conductance[:] = steady[:, np.newaxis]
        if sources.conductance is not None:
            conductance[:, sources.node, sources.column] += sources.conductance[:, now].T
        voltage = nodes.advance(current, conductance)
        outward = y * voltage[:, ends.node]
        left[now % depth] = outward + h * (outward - into)
        v[:, :, now] = voltage[:, shown].transpose(1, 2, 0)
    return Waveform(v[:, 0] if single else v, step, names=names)


def _columns(
    drivers: Driver | Sequence[Driver] | Sequence[Sequence[Driver]],
) -> tuple[list[list[Driver]], bool]:
    """Return the drivers of each case, and whether they were given without cases."""
    entries: list[Any] = [drivers] if isinstance(drivers, Driver) else list(drivers)
    single = not entries or not all(isinstance(entry, list | tuple) for entry in entries)
    columns = [entries] if single else [list(entry) for entry in entries]
    for together in columns:
        for driver in together:
            if not isinstance(driver, Driver):
                raise ArgumentError(f"one of drivers is {driver!r}; it must be a Driver")
    return columns, single


class _Nodes:
    """The loads at all nodes: conductances, and the states of inductors and capacitors."""

    def __init__(self, network: Network, dt: float, columns: int) -> None:
        conductance, per_henry, capacitance = np.repeat(network.shunts(), columns, axis=2)
        inductive, capacitive = per_henry * dt / 2, capacitance * 2 / dt
        self.conductance = conductance + inductive + capacitive
        self.inductive = 2 * inductive if inductive.any() else None
        self.capacitive = 2 * capacitive if capacitive.any() else None
        self.flux = np.zeros_like(conductance)
        self.charge = np.zeros_like(conductance)

    def advance(self, current: Floats, conductance: Floats) -> Floats:
        """Return the voltages (n_steps, n_nodes, n_columns); `current` is overwritten by them."""
        inverse = 1 / (conductance + self.conductance)
        if self.inductive is None and self.capacitive is None:
            current *= inverse
            return current
        work = np.empty_like(self.flux)
        for voltage, factor in zip(current, inverse, strict=True):
            voltage += self.charge
            voltage -= self.flux
            voltage *= factor
            # The trapezoidal rule with state and voltage added up: one recurrence for each.
            if self.inductive is not None:
                np.multiply(self.inductive, voltage, out=work)
                self.flux += work
            if self.capacitive is not None:
                np.multiply(self.capacitive, voltage, out=work)
                np.subtract(work, self.charge, out=self.charge)
        return current
