"""Simulate a CAN bus: periodic messages, arbitration, errors, and how long each frame took."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Literal, NamedTuple

import numpy as np
import numpy.typing as npt
import pandas as pd

from shipnet.can.bus.arbitration import OVERWRITTEN, WAITING, Releases, send_all
from shipnet.can.bus.disturbed import Disturbed, Faults, send_disturbed
from shipnet.can.bus.messages import Messages, bit_time_ns, read_messages
from shipnet.can.layout import INTERMISSION
from shipnet.errors import ArgumentError
from shipnet.fields import check_whole

__all__ = ["BusRun", "simulate"]

Integers = npt.NDArray[np.int64]

#: Most frames that one run may release: some gigabytes of memory.
MOST_FRAMES = 20_000_000

#: Lengths of an error frame with intermission [bit]: a flag of 6..12, a delimiter of 8, 3 more.
_ERROR_FRAME = (17, 23)


class BusRun(NamedTuple):
    """What happened on the bus.

    Attributes
    ----------
    transmissions : pandas.DataFrame
        A row a frame, in the order of the release: ``message``, ``arrival_ms`` (of the event),
        ``release_ms`` (later by the jitter), ``start_ms``, ``end_ms``, ``response_ms`` (from the
        event to the end), ``retries``, ``outcome`` (sent, waiting, overwritten). Times of what
        was not sent are NaN.
    statistics : pandas.DataFrame
        A row a message, the highest priority first: ``message``, ``arbitration_id``,
        ``extended``, how many were ``released``, ``sent``, ``waiting`` and ``overwritten``;
        ``min_ms``, ``mean_ms``, ``max_ms`` of the response; ``missed`` (sent behind the deadline,
        or waiting beyond it); ``retries``.
    errors : pandas.DataFrame
        A row a destroyed frame: ``message``, ``sender``, ``start_ms``, ``free_ms`` (when the bus
        was free again), ``bit`` that was disturbed, ``tec`` and ``state`` of the sender then.
    nodes : pandas.DataFrame
        A row a sender at the end: ``sender``, ``tec``, ``rec``, ``state``, ``bus_off`` (how
        often).
    load : float
        Share of the time in which the bus was busy, error frames and intermission included.
    """

    transmissions: pd.DataFrame
    statistics: pd.DataFrame
    errors: pd.DataFrame
    nodes: pd.DataFrame
    load: float


def simulate(
    messages: pd.DataFrame | Mapping[str, npt.ArrayLike],
    duration: float,
    bit_rate: float,
    *,
    queue: Literal["fifo", "overwrite"] = "fifo",
    intermission: bool = True,
    error_rate: float = 0.0,
    error_instants: npt.ArrayLike = (),
    error_bits: int = 23,
    recover: bool = True,
    rng: np.random.Generator | None = None,
) -> BusRun:
    """Simulate the arbitration of periodic messages on a CAN bus.

    Parameters
    ----------
    messages : pandas.DataFrame or mapping of str to array_like
        Columns as for `shipnet.can.bus.messages.read_messages`: ``arbitration_id``,
        ``period_ms``, ``bits`` or ``dlc``; optional ``name``, ``sender``, ``extended``,
        ``remote``, ``offset_ms``, ``jitter_ms``, ``deadline_ms``.
    duration : float
        Time to simulate, positive [s]; a frame that began before its end is finished.
    bit_rate : float
        Bit rate, 5e3 to 1e6 [bit/s].
    queue : {"fifo", "overwrite"}, default "fifo"
        Whether frames of a message queue up behind each other, or the newest replaces one that
        still waits, as in a controller with one buffer a message.
    intermission : bool, default True
        Whether a frame ends with its 3 bits of intermission, as in response-time analysis, or
        before them. The bus is free only behind them in either case.
    error_rate : float, default 0
        Probability that an attempt to send a frame is disturbed, 0 up to but not 1, in a bit
        that is any of the frame's with equal chance.
    error_instants : array_like of float, shape (n_instants,), optional
        Times at which a bit is disturbed [s], 0 or more. One that meets no frame does no harm.
    error_bits : int, default 23
        Length of an error frame with intermission, 17..23 [bit]; the 6 bits of a second flag
        that does not overlap the first make the difference.
    recover : bool, default True
        Whether a node off the bus comes back after 128 sequences of 11 recessive bits.
    rng : numpy.random.Generator, optional
        Chance; needed if there is jitter or an `error_rate`.

    Returns
    -------
    BusRun
        Tables of the frames, the messages, the errors and the nodes, and the load.

    Raises
    ------
    ArgumentError
        If an argument is out of range, chance is needed and `rng` missing, or more than 20
        million frames would be released.

    Notes
    -----
    Time runs in whole nanoseconds. Jitter delays each release by a uniform chance, and no frame
    of a message overtakes another. An error is seen by all nodes at once and destroys the frame;
    the sender tries again. A node that is error passive lets 8 more bits pass after its own
    frames [1]_, and one whose counter reaches 256 leaves the bus. What disturbs an error frame,
    overload frames and the lack of an acknowledgement are not modelled.

    A simulation finds no bound: other offsets may do worse. See the response-time analysis.

    References
    ----------
    .. [1] Robert Bosch GmbH, "CAN specification 2.0", 1991, part B, sections 3.2.5 and 8.

    Examples
    --------
    Three messages of 7 bytes at 125 kbit/s, 1 ms each by the bound, released together: the lowest
    meets its worst case of 3.5 ms, a miss, as its deadline is 3.25 ms.

    >>> table = {"name": list("ABC"), "arbitration_id": [1, 2, 3], "dlc": 7,
    ...          "period_ms": [2.5, 3.5, 3.5], "deadline_ms": [2.5, 3.25, 3.25]}
    >>> run = simulate(table, 1.0, 125e3)
    >>> run.statistics[["message", "sent", "max_ms", "missed"]].values.tolist()
    [['A', 400, 1.5, 0], ['B', 286, 2.0, 0], ['C', 286, 3.5, 57]]
    >>> round(run.load, 3)
    0.972
    """
    columns = read_messages(messages)
    bit = bit_time_ns(bit_rate)
    if queue not in ("fifo", "overwrite"):
        raise ArgumentError(f"queue is {queue!r}; it must be 'fifo' or 'overwrite'")
    horizon = _horizon(duration)
    faults = _faults(error_rate, error_instants, error_bits, recover, rng)
    arrival, releases = _releases(columns, horizon, bit, rng)
    senders = pd.Index(pd.unique(pd.Series(columns.sender)))
    overwrite = queue == "overwrite"
    happened = None
    if faults.rng is not None or faults.instants.size:
        owner = senders.get_indexer(pd.Index(columns.sender)).astype(np.int64)
        happened = send_disturbed(releases, horizon, owner, faults, bit, overwrite=overwrite)
    start = np.array(
        send_all(releases, horizon, overwrite=overwrite) if happened is None else happened.start,
        dtype=np.int64,
    )
    failed = np.array([] if happened is None else [f.release for f in happened.failures], dtype=int)
    retries = np.bincount(failed, minlength=len(start))
    trailing = 0 if intermission else INTERMISSION * bit
    end = start + releases.duration - trailing
    sent = start >= 0
    response = np.where(sent, end - arrival, 0)
    transmissions = pd.DataFrame(
        {
            "message": pd.Categorical.from_codes(releases.message, pd.Index(columns.name)),
            "arrival_ms": arrival / 1e6,
            "release_ms": releases.time / 1e6,
            "start_ms": np.where(sent, start / 1e6, np.nan),
            "end_ms": np.where(sent, end / 1e6, np.nan),
            "response_ms": np.where(sent, response / 1e6, np.nan),
            "retries": retries,
            "outcome": pd.Categorical.from_codes(
                np.select([sent, start == WAITING], [0, 1], 2),
                pd.Index(["sent", "waiting", "overwritten"]),
            ),
        }
    )
    waited = np.where(sent, response, np.where(start == OVERWRITTEN, -1, horizon - arrival))
    statistics = _statistics(columns, releases.message, start, response, waited, retries)
    busy = int(releases.duration[sent].sum())
    errors, nodes = _error_tables(columns, senders, releases, happened)
    busy += 0 if happened is None else sum(f.free - f.start for f in happened.failures)
    # The last frame may reach beyond the horizon.
    span = max(horizon, int((start + releases.duration).max(initial=0)))
    return BusRun(transmissions, statistics, errors, nodes, busy / span)


def _horizon(duration: float) -> int:
    if not isinstance(duration, int | float | np.number) or not 1e-9 <= duration <= 1e6:
        raise ArgumentError(f"duration is {duration!r} s; it must be 1e-9..1e6")
    return round(duration * 1e9)


def _faults(
    rate: float, instants: npt.ArrayLike, bits: int, recover: bool, rng: np.random.Generator | None
) -> Faults:
    if not isinstance(rate, int | float | np.number) or not 0 <= rate < 1:
        raise ArgumentError(f"error_rate is {rate!r}; it must be 0 or more, and below 1")
    times = np.asarray(instants, dtype=float)
    if times.ndim != 1 or not np.all((times >= 0) & (times <= 1e6)):
        raise ArgumentError(f"error_instants are {instants!r} s; they must be a list of 0..1e6")
    if rate and rng is None:
        raise ArgumentError(f"error_rate is {rate}, but rng is missing")
    return Faults(
        rate,
        np.sort(np.rint(times * 1e9).astype(np.int64)),
        check_whole("error_bits", bits, *_ERROR_FRAME),
        recover,
        rng if rate else None,
    )


def _releases(
    columns: Messages, horizon: int, bit: int, rng: np.random.Generator | None
) -> tuple[Integers, Releases]:
    """Return the times of the events, and the releases by them in order of time."""
    counts = np.maximum(-(-(horizon - columns.offset) // columns.period), 0)
    if counts.sum() > MOST_FRAMES:
        raise ArgumentError(
            f"duration is {horizon / 1e9} s, which releases {counts.sum()} frames; it must be so "
            f"short that they are {MOST_FRAMES} at most"
        )
    message = np.repeat(np.arange(len(counts)), counts)
    place = np.arange(len(message)) - np.repeat(np.cumsum(counts) - counts, counts)
    arrival = columns.offset[message] + place * columns.period[message]
    time = arrival
    if columns.jitter.any():
        if rng is None:
            raise ArgumentError("messages have jitter, but rng is missing")
        time = arrival + rng.integers(0, columns.jitter[message], endpoint=True)
        for block in np.split(time, np.cumsum(counts)[:-1]):
            np.maximum.accumulate(block, out=block)
    order = np.argsort(time, kind="stable")
    message = message[order]
    releases = Releases(time[order], message, columns.bits[message] * bit)
    return arrival[order], releases


def _statistics(
    columns: Messages,
    message: Integers,
    start: Integers,
    response: Integers,
    waited: Integers,
    retries: Integers,
) -> pd.DataFrame:
    number = len(columns.name)
    sent = start >= 0

    def count(chosen: npt.NDArray[np.bool_]) -> Integers:
        return np.bincount(message[chosen], minlength=number)

    times = pd.Series(response[sent] / 1e6).groupby(message[sent])
    frame = {"min_ms": times.min(), "mean_ms": times.mean(), "max_ms": times.max()}
    return pd.DataFrame(
        {
            "message": columns.name,
            "arbitration_id": columns.arbitration_id,
            "extended": columns.extended,
            "released": np.bincount(message, minlength=number),
            "sent": count(sent),
            "waiting": count(start == WAITING),
            "overwritten": count(start == OVERWRITTEN),
            **{name: values.reindex(range(number)).to_numpy() for name, values in frame.items()},
            "missed": count(waited > columns.deadline[message]),
            "retries": np.bincount(message, weights=retries, minlength=number).astype(int),
        }
    )


def _error_tables(
    columns: Messages, senders: pd.Index[str], releases: Releases, happened: Disturbed | None
) -> tuple[pd.DataFrame, pd.DataFrame]:
    failures = [] if happened is None else happened.failures
    ranks = [int(releases.message[failure.release]) for failure in failures]
    errors = pd.DataFrame(
        {
            "message": [columns.name[rank] for rank in ranks],
            "sender": [columns.sender[rank] for rank in ranks],
            "start_ms": np.array([failure.start for failure in failures], dtype=float) / 1e6,
            "free_ms": np.array([failure.free for failure in failures], dtype=float) / 1e6,
            "bit": np.array([failure.bit for failure in failures], dtype=int),
            "tec": np.array([failure.tec for failure in failures], dtype=int),
            "state": [failure.state for failure in failures],
        }
    )
    counters = None if happened is None else happened.counters
    nodes = pd.DataFrame(
        {
            "sender": senders,
            "tec": 0 if counters is None else counters.tec,
            "rec": 0 if counters is None else counters.rec,
            "state": "error active"
            if counters is None
            else [counters.state(node) for node in range(len(senders))],
            "bus_off": 0 if happened is None else happened.bus_off,
        }
    )
    return errors, nodes
