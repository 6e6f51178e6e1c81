"""How old a value can be at the AMS, by one formula; and how long a silent box goes unnoticed."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import numpy.typing as npt

from shipnet.can.schedule import Convention, response_times
from shipnet.clock import nanoseconds
from shipnet.engine.system import System
from shipnet.errors import ArgumentError
from shipnet.fields import check_scalar, check_whole

if TYPE_CHECKING:
    import pandas as pd

__all__ = ["Marking", "can_response", "hop_ns", "marking", "poll_spacing", "worst_age"]

Floats = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int64]

#: From queueing to the end of the frame, which is where the receiver's interrupt comes.
_CONVENTION = Convention(own_jitter=False, intermission="between")


def can_response(system: System) -> Floats:
    """Return how long each message takes at worst from queueing to its end.

    Parameters
    ----------
    system : System
        The system.

    Returns
    -------
    ndarray of float, shape (n_messages,)
        Response time [s], the highest priority first.

    Raises
    ------
    ArgumentError
        If the bus is too slow for the messages.

    Examples
    --------
    All 22 frames are queued at once; the last of them is through 22.8 ms later, less the three
    bits behind it:

    >>> (can_response(System()) * 1e3).round(3).tolist()[::21]
    [2.136, 22.776]
    """
    found = response_times(system.messages, system.can_bit_rate, convention=_CONVENTION)
    if not all(response.met for response in found):
        raise ArgumentError(
            f"can_bit_rate is {system.can_bit_rate} bit/s; frames must arrive within the update "
            f"period of {system.period_ns.max() / 1e9:g} s"
        )
    return np.array([response.response for response in found])


def poll_spacing(system: System, lost: float = 0.0) -> float:
    """Return the time from poll to poll [s].

    Parameters
    ----------
    system : System
        The system. A poll that lasts longer than the period makes the AMS skip some.
    lost : float, default 0
        How long each poll asks in vain before it is answered, 0..1e6 [s].

    Returns
    -------
    float
        A multiple of the poll period [s].

    Raises
    ------
    ArgumentError
        If `lost` is out of range.

    Examples
    --------
    >>> poll_spacing(System()), round(poll_spacing(System(poll_period=0.2)), 9)
    (1.0, 0.4)
    """
    period = nanoseconds(system.poll_period)
    whole = nanoseconds(check_scalar("lost", lost, "s", 0, 1e6) + system.poll.time)
    return -(-whole // period) * period / 1e9


def worst_age(system: System) -> pd.DataFrame:
    r"""Return how old each point can be at the AMS, just before the next value takes its place.

    .. math:: A = \left( L - o \right) + P + S + R + h + T + t_{response}

    Parameters
    ----------
    system : System
        The system, without faults.

    Returns
    -------
    pandas.DataFrame
        One row a point: ``tag``, ``box``, ``channel`` (over which this bound holds), and the
        terms: ``sampling_s`` (L - o: from sampling to the end of the box's round), ``update_s``
        (P: one round later), ``interrupt_s`` (S: a Modbus request in that round), ``can_s``
        (R: response time of the message), ``handling_s`` (h: the CAN interrupt), ``poll_s``
        (T: the poll before came too early), ``transaction_s`` (from the reading of the registers
        to the end of the response); their sum ``worst_s``.

    Raises
    ------
    ArgumentError
        If two polls can meet one round of a loop, or the CAN bus is overloaded.

    Notes
    -----
    A value that the polled box measures itself skips the bus: then L is the conversion alone, and
    R, h and S are 0. S is 0 there because the registers are read when the interrupt begins: it
    delays only what comes after. Where both channels are polled, the better one counts.

    The request itself is no part of it: the clock of an age runs while the AMS waits for its next
    poll, and a poll is one period after the other, whatever a request takes.

    Examples
    --------
    >>> ages = worst_age(System())
    >>> ages.groupby("box")["worst_s"].max().round(3).to_dict()
    {'JB1': 1.781, 'JB2': 1.771, 'JB3': 1.789}
    >>> f"{worst_age(System.mended())['worst_s'].max():.3f}"
    '1.582'
    """
    import pandas as pd

    spacing = poll_spacing(system)
    longest = int(system.loop_ns.max()) + system.service_ns
    if longest > nanoseconds(spacing):
        raise ArgumentError(
            f"poll_period is {system.poll_period:g} s; a round of a loop takes "
            f"{longest / 1e9:g} s, so that two polls meet it"
        )
    response = can_response(system)[system.message_of]
    box, offset = system.box_of, system.offset_ns
    converted, looped = system.convert_ns[box], system.loop_ns[box]
    channels = system.ports if system.polled == "both" else system.ports[:1]
    # The silence behind the response takes the place of the one behind the request.
    transaction = system.poll.shortest_timeout
    tables = []
    for channel, reader in enumerate(channels, start=1):
        own = box == reader
        tables.append(
            pd.DataFrame(
                {
                    "tag": [point.tag for point in system.points],
                    "box": [point.box for point in system.points],
                    "channel": channel,
                    "sampling_s": (np.where(own, converted, looped) - offset) / 1e9,
                    "update_s": system.period_ns[box] / 1e9,
                    "interrupt_s": np.where(own, 0, system.suspended_ns[box]) / 1e9,
                    "can_s": np.where(own, 0.0, response),
                    "handling_s": np.where(own, 0.0, _handling(system)),
                    "poll_s": spacing,
                    "transaction_s": transaction,
                }
            )
        )
        terms = tables[-1].columns[3:]
        tables[-1]["worst_s"] = tables[-1][terms].sum(axis=1)
    first, last = tables[0], tables[-1]
    better = (first["worst_s"] <= last["worst_s"]).to_numpy()
    return pd.concat([first[better], last[~better]]).sort_index()


def _handling(system: System) -> float:
    """Return how long the CAN interrupt of a frame takes, others before it included [s]."""
    receive = system.firmware.receive
    spread = int(system.frame_ns.min()) >= nanoseconds(receive)
    return receive if spread else receive * system.sender.size


def hop_ns(system: System, reader: int) -> Integers:
    """Return how old a frame can be when its reader has taken it over.

    Parameters
    ----------
    system : System
        The system.
    reader : int
        Number of the box that answers, from 0 on.

    Returns
    -------
    ndarray of int64, shape (n_messages,)
        Longest time from the begin of the sender's round until the values are in the table [ns].
        The mended design adds it to the time since then, which the reader knows.

    Raises
    ------
    ArgumentError
        If there is no such box, or the CAN bus is overloaded.

    Examples
    --------
    >>> (hop_ns(System.mended(), 0) / 1e6).round(1).tolist()[::7]
    [45.8, 45.8, 40.6, 64.4]
    """
    check_whole("reader", reader, 0, len(system.boxes) - 1)
    sender = system.sender
    pile = system.service_ns + nanoseconds(system.firmware.receive) * sender.size
    sent = np.ceil(can_response(system) * 1e9).astype(np.int64)
    others = system.loop_ns[sender] + system.suspended_ns[sender] + sent + pile
    return np.where(sender == reader, system.convert_ns[sender] + system.service_ns, others)


class Marking(NamedTuple):
    """How long the values of a box that fell silent are shown as good.

    Attributes
    ----------
    after : float
        Longest time from the failure until the AMS shows the values as bad [s].
    oldest : float
        Greatest age of a value then [s].
    """

    after: float
    oldest: float


def marking(system: System) -> Marking:
    r"""Return how long a silent box goes unnoticed at worst.

    .. math:: t_{after} = t_{stale} + t_{mark} + h + T + t_{response}

    with the time T from poll to poll. If the box itself is the one that is asked, it does not
    answer either: the AMS first asks it in vain for :math:`t_{lost}`, time-outs and retries
    included, and a poll with that in it has a longer spacing :math:`T_{lost}`. An AMS that stays
    on the other channel does so once, and the marks may be seen later for it,

    .. math:: t_{after} \ge T + T_{lost} + t_{request} + t_{response}

    One that returns to channel 1 does so in every poll: T is :math:`T_{lost}` then, and

    .. math:: t_{after} \ge T + t_{lost} + t_{request} + t_{response}

    Parameters
    ----------
    system : System
        The system, in which one box fails and nothing else does.

    Returns
    -------
    Marking
        Two times [s].

    Raises
    ------
    ArgumentError
        As `worst_age`.

    Notes
    -----
    In the printed design the last frame restarts the timer of the reader, and the mark waits for
    the next poll. The timer is one for all frames of a box: if the box dies between the first
    frame of a round and its last, values of the round before are held alive. In the mended one
    the AMS marks by age, and needs no poll for it.

    The greatest age is that of any value that comes over CAN, those of the polled box included:
    the other one hears them. With long time-outs both bounds are safe ones that need not be
    attained, and they hold for one failure: two at once may take longer.

    Examples
    --------
    The 4 s of the paper, one poll, and the transfer:

    >>> [round(time, 3) for time in marking(System())]
    [5.248, 5.8]
    >>> marking(System.mended())
    Marking(after=2.0, oldest=2.0)
    """
    if system.coding == "mended":
        return Marking(system.age_limit, system.age_limit)
    transaction = float(worst_age(system)["transaction_s"].iloc[0])
    request = system.serial.frame_time(8)
    lost = (1 + system.retries) * (request + system.timeout)
    healthy, hindered = poll_spacing(system), poll_spacing(system, lost)
    pile = system.service_ns / 1e9 + system.firmware.receive * system.sender.size
    marked = system.stale_limit + system.firmware.mark + pile
    read = request + system.serial.t35
    if system.switch_rule == "stay":
        seen = healthy + max(marked, hindered + read)
    else:
        seen = max(marked + hindered, healthy + lost + read)
    after = seen + transaction
    box = system.box_of
    served = system.service_ns * np.isin(box, system.ports)
    old = system.loop_ns[box] - system.offset_ns + system.period_ns[box] + served
    queued = can_response(system)[system.message_of]
    return Marking(after, after + float((old / 1e9 + queued).max()))
