"""What share of the time the bus is busy."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from shipnet.can.schedule.lengths import LENGTHS, Lengths, frame_bits
from shipnet.can.schedule.messages import MessageSet
from shipnet.errors import ArgumentError

if TYPE_CHECKING:
    import pandas as pd

__all__ = ["BIT_RATES", "bus_load", "load_table"]

#: Bit rates in use [bit/s], with bus lengths from 5000 m down to 20 m: Beckhoff, BX5100
#: documentation.
BIT_RATES = (10_000, 20_000, 50_000, 125_000, 250_000, 500_000, 1_000_000)


def bus_load(
    messages: MessageSet,
    bit_rate: npt.ArrayLike,
    lengths: Lengths | Sequence[float] = "worst",
) -> npt.NDArray[np.float64]:
    r"""Return the share of the time that each message keeps the bus busy.

    .. math:: U_m = \frac{n_m}{r \, T_m}

    Parameters
    ----------
    messages : MessageSet
        The messages.
    bit_rate : float or array_like of float
        Bit rate, 1000..1000000 [bit/s].
    lengths : str or sequence of float, shape (n_messages,), default "worst"
        How long frames are, as in `frame_bits`, where a message does not give its own `bits`. Or
        the lengths themselves, with intermission, 0..1000 [bit], such as those of frames that
        were recorded.

    Returns
    -------
    ndarray of float, shape of `bit_rate` and (n_messages,)
        Load; the sum over the last axis is that of the bus. Above 1 the bus is overloaded.

    Raises
    ------
    ArgumentError
        If a bit rate or a length is out of range, or there are not as many lengths as messages.

    Notes
    -----
    Retransmissions are not counted.

    Examples
    --------
    The 22 frames of the engine of lee2012 once a second, 2850 bits at worst:

    >>> from shipnet import datasets
    >>> from shipnet.can.schedule.table import load_messages
    >>> messages = load_messages(datasets.path("synthetic_can_lee2012.csv"))
    >>> bus_load(messages, [125_000, 250_000]).sum(axis=-1).round(4).tolist()
    [0.0228, 0.0114]
    """
    rate = np.asarray(bit_rate, dtype=np.float64)
    if not ((rate >= 1000) & (rate <= 1e6)).all():
        raise ArgumentError(f"bit_rate is {bit_rate!r}; it must be 1000..1000000 bit/s")
    if isinstance(lengths, str):
        dlc = np.array([message.dlc for message in messages], dtype=np.intp)
        extended = np.array([message.extended for message in messages], dtype=np.bool_)
        given = np.array([message.bits or 0 for message in messages], dtype=np.float64)
        bits = np.where(given > 0, given, frame_bits(dlc, extended, lengths))
    else:
        bits = np.asarray(lengths, dtype=np.float64)
        if bits.shape != (len(messages),) or not ((bits >= 0) & (bits <= 1000)).all():
            raise ArgumentError(
                f"lengths are {lengths!r}; they must be {len(messages)} numbers, 0..1000 bit"
            )
    period = np.array([message.period for message in messages], dtype=np.float64)
    return np.asarray(bits / period / rate[..., np.newaxis])


def load_table(messages: MessageSet, bit_rates: Sequence[int] = BIT_RATES) -> pd.DataFrame:
    """Return the load of the bus by bit rate, for each way to count stuff bits.

    Parameters
    ----------
    messages : MessageSet
        The messages.
    bit_rates : sequence of int, optional
        Bit rates, 1000..1000000 [bit/s]; those in use if not given.

    Returns
    -------
    pandas.DataFrame
        One row a bit rate: ``bit_rate``, and the load in percent as ``nominal_percent``,
        ``mean_percent``, ``attainable_percent`` and ``worst_percent``.

    Raises
    ------
    ArgumentError
        If a bit rate is out of range.

    Examples
    --------
    >>> from shipnet.can.schedule.messages import Message
    >>> messages = MessageSet([Message("A", 1, 8, 5e-3), Message("B", 2, 2, 10e-3)])
    >>> load_table(messages, [125_000]).round(2).loc[0].tolist()
    [125000.0, 22.8, 23.51, 27.04, 27.6]
    """
    import pandas as pd

    rates = np.asarray(bit_rates)
    table = {"bit_rate": rates}
    for lengths in LENGTHS:
        # The form of 1994 is wrong; it is there to recompute what was published with it.
        if lengths != "worst 1994":
            table[f"{lengths}_percent"] = 100 * bus_load(messages, rates, lengths).sum(axis=-1)
    return pd.DataFrame(table)
