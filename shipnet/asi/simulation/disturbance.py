"""Which telegrams are disturbed: drawn before the simulation, one byte for each that may be sent.

A byte belongs to one slave, one request of a cycle and one attempt at it. Both models of a line,
the one that goes from telegram to telegram (`run`) and the one that works on whole arrays (`poll`),
read the same bytes, so that they can be compared exactly.

    bit 0       the slave does not understand the request
    bit 1       it did not understand the request before, which went to another slave
    bits 2..7   0, or 1..32: which of the 32 disturbances of one pulse hits the response
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from shipnet.asi.modulation import ONE_PULSE_CODES
from shipnet.errors import ArgumentError
from shipnet.fields import check_whole

__all__ = ["MISSED", "PLANES", "REQUEST_LOST", "VARIANTS", "draw_disturbances"]

#: The slave does not understand the request.
REQUEST_LOST = 1

#: The slave did not understand the request before this one, which went to another slave.
MISSED = 2

#: Disturbances of one pulse of a response; they are counted from 1 in bits 2..7.
VARIANTS = len(ONE_PULSE_CODES[0])

#: The requests of a cycle: data exchange, management, inclusion.
PLANES = 3

Bytes = npt.NDArray[np.uint8]


def draw_disturbances(
    rng: np.random.Generator,
    n_cycles: int,
    request: Sequence[float] | npt.NDArray[np.floating[Any]],
    response: Sequence[float] | npt.NDArray[np.floating[Any]],
    *,
    attempts: int = 2,
    n_runs: int | None = None,
) -> Bytes:
    """Draw independent disturbances of requests and responses.

    Parameters
    ----------
    rng : numpy.random.Generator
        Where the randomness comes from.
    n_cycles : int
        Cycles of a run, 0 or more.
    request : sequence of float, shape (n_slaves,)
        Probability that a slave does not understand a request, 0..1.
    response : sequence of float, shape (n_slaves,)
        Probability that the master does not understand its response, 0..1.
    attempts : int, default 2
        How often a request is sent at most: once and its repetitions, 1..8.
    n_runs : int, optional
        Number of runs; without it the first axis of the result falls away.

    Returns
    -------
    ndarray of uint8, shape (n_runs, n_cycles, 3, n_slaves, attempts)
        The bytes as said above; the third axis are data exchange, management and inclusion.

    Raises
    ------
    ArgumentError
        If a probability or a number is out of its range, or the slaves are not as many in both.

    Examples
    --------
    >>> rng = np.random.default_rng(2024)
    >>> drawn = draw_disturbances(rng, 10_000, [0.0, 0.02], [0.0, 0.0])
    >>> drawn.shape, ((drawn & REQUEST_LOST) > 0).mean(axis=(0, 1, 3)).round(3).tolist()
    ((10000, 3, 2, 2), [0.0, 0.019])
    """
    rates = []
    for name, values in (("request", request), ("response", response)):
        rate = np.asarray(values, dtype=float)
        if rate.ndim != 1 or not ((rate >= 0) & (rate <= 1)).all():
            raise ArgumentError(f"{name} is {values!r}; it must be one probability 0..1 a slave")
        rates.append(rate)
    if rates[0].size != rates[1].size:
        raise ArgumentError(
            f"request has {rates[0].size} probabilities and response {rates[1].size}; both need "
            "one a slave"
        )
    check_whole("n_cycles", n_cycles, 0, 10**9)
    check_whole("attempts", attempts, 1, 8)
    runs = 1 if n_runs is None else check_whole("n_runs", n_runs, 0, 10**9)
    shape = (runs, n_cycles, PLANES, rates[0].size, attempts)
    drawn = np.zeros(shape, dtype=np.uint8)
    for slave, (lost, garbled) in enumerate(zip(*rates, strict=True)):
        plane = (runs, n_cycles, PLANES, attempts)
        if lost > 0:
            drawn[..., slave, :] |= (rng.random(plane) < lost) * np.uint8(REQUEST_LOST)
            drawn[..., slave, :] |= (rng.random(plane) < lost) * np.uint8(MISSED)
        if garbled > 0:
            variant = rng.integers(1, VARIANTS + 1, plane, dtype=np.uint8) << 2
            drawn[..., slave, :] |= np.where(rng.random(plane) < garbled, variant, 0)
    return drawn if n_runs is not None else drawn[0]
