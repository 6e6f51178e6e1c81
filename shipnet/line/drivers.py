"""Senders on a line: a current drawn, or a voltage behind a conductance that may change."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from shipnet.errors import ArgumentError
from shipnet.line.network import Network

__all__ = ["CurrentDriver", "Driver", "NortonSources", "TheveninDriver", "norton_sources"]

Floats = npt.NDArray[np.float64]

#: A quantity over time: a constant, its samples, or a function of the array of times.
Signal = float | npt.ArrayLike | Callable[[Floats], npt.ArrayLike]


@dataclass(frozen=True)
class CurrentDriver:
    """A sender that draws a current, such as that of an AS-i telegram.

    Parameters
    ----------
    node : str
        Where it is connected.
    i : float, array_like of shape (n_t,), or callable
        Current drawn from the node [A], at each time or as a function of the times [s].
    """

    node: str
    i: Signal


@dataclass(frozen=True)
class TheveninDriver:
    """A sender that is a voltage behind a conductance, such as a CAN or RS-485 driver.

    Parameters
    ----------
    node : str
        Where it is connected.
    g : float, array_like of shape (n_t,), or callable
        Conductance, not negative [S]; 0 while the driver is off.
    e : float, array_like of shape (n_t,), or callable
        Voltage [V].
    """

    node: str
    g: Signal
    e: Signal


Driver = CurrentDriver | TheveninDriver


class NortonSources(NamedTuple):
    """All drivers of all columns as current sources; those of one node and column are added up.

    Attributes
    ----------
    node, column : list of int
        Node and column of each source.
    current : ndarray of float, shape (n_sources, n_t)
        Current into the node [A].
    conductance : ndarray of float, shape (n_sources, n_t), or None
        Conductance beside it [S]; None if there is none at any time.
    columns : int
        Number of columns.
    """

    node: list[int]
    column: list[int]
    current: Floats
    conductance: Floats | None
    columns: int


def norton_sources(
    network: Network, drivers: Sequence[Driver | Sequence[Driver]], t: Floats
) -> NortonSources:
    """Return the drivers of a simulation as current sources.

    Parameters
    ----------
    network : Network
        Where the drivers are connected.
    drivers : sequence of CurrentDriver or TheveninDriver, or of lists of them
        One entry a column; the drivers of an inner list or tuple act together.
    t : ndarray of float, shape (n_t,)
        Times [s].

    Returns
    -------
    NortonSources
        The sources.

    Raises
    ------
    ArgumentError
        If there is no driver, a node is unknown, or the samples of a driver do not fit the times,
        are not finite, or hold a negative conductance.

    Examples
    --------
    >>> from shipnet.line import CABLES
    >>> net = Network()
    >>> net.line("a", "b", 40, CABLES["can"])
    >>> t = np.array([0.0, 1e-6])
    >>> norton_sources(net, [TheveninDriver("b", g=[0, 0.025], e=4)], t).current.tolist()
    [[0.0, 0.1]]
    """
    current: dict[tuple[int, int], Floats] = {}
    conductance: dict[tuple[int, int], Floats] = {}
    zero = np.zeros_like(t)
    columns = [entry if isinstance(entry, list | tuple) else [entry] for entry in drivers]
    for column, together in enumerate(columns):
        for driver in together:
            if not isinstance(driver, CurrentDriver | TheveninDriver):
                raise ArgumentError(
                    f"driver in column {column} is {driver!r}; "
                    "it must be a CurrentDriver or a TheveninDriver"
                )
            at = network.index(driver.node), column
            name = f"of the driver at node {driver.node!r}"
            if isinstance(driver, CurrentDriver):
                into = -_samples(f"current {name}", driver.i, t, "A", -np.inf)
            else:
                g = _samples(f"conductance {name}", driver.g, t, "S", 0.0)
                into = g * _samples(f"voltage {name}", driver.e, t, "V", -np.inf)
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
