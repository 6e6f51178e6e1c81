"""Values of more than four bits: how many cycles a slave takes for them.

Four bits pass in a cycle, so the profiles for analogue values cut a value into pieces, each type
of transfer (CTT) in its own way. How many cycles a value takes is data, from
`asi_analogue_profiles.csv`; a profile that is not in there is not known to us, as is CTT4.
"""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING, Literal

import numpy as np
import numpy.typing as npt

from shipnet import datasets
from shipnet.asi.profile import Profile
from shipnet.errors import ArgumentError
from shipnet.fields import check_whole

if TYPE_CHECKING:
    import pandas as pd

__all__ = ["analogue_profiles", "least_cycles", "transfer_cycles", "transfer_time"]

#: Most channels of a slave.
_CHANNELS = 4


def analogue_profiles() -> pd.DataFrame:
    """Return what is known about the transfer of values by each profile.

    Returns
    -------
    pandas.DataFrame
        One row a profile, direction and size of value; `cycles` are exchanges with the slave,
        `evidence` says whether the source prints them or they are derived from it.

    Examples
    --------
    >>> analogue_profiles().query("profile == 'S-7.3'")["cycles"].tolist()
    [7, 7]
    """
    return _profiles().copy()


@cache
def _profiles() -> pd.DataFrame:
    table = datasets.read("asi_analogue_profiles.csv")
    return table.astype({"value_bit": int, "cycles": int, "addresses": int})


def least_cycles(bits: int, *, bits_per_cycle: int = 4) -> int:
    """Return in how many cycles a message passes if every bit of every cycle carries it.

    Parameters
    ----------
    bits : int
        Length of the message, 1 or more [bit].
    bits_per_cycle : int, default 4
        What one cycle carries, 1..4 [bit].

    Returns
    -------
    int
        Cycles; a real transfer takes more, as it must say where a value begins.

    Raises
    ------
    ArgumentError
        If a number is out of its range.

    Examples
    --------
    >>> least_cycles(4), least_cycles(5), least_cycles(16)
    (1, 2, 4)
    """
    bits = check_whole("bits", bits, 1, 10**9)
    return -(-bits // check_whole("bits_per_cycle", bits_per_cycle, 1, 4))


def transfer_cycles(
    profile: Profile | str,
    *,
    channels: int = 1,
    direction: Literal["in", "out"] = "in",
    value_bit: int | None = None,
    extra_rounds: int = 0,
) -> int:
    """Return how many exchanges with a slave all of its values take.

    Parameters
    ----------
    profile : Profile or str
        The slave's profile; ``S-7.3.C`` counts as ``S-7.3`` if it has no row of its own.
    channels : int, default 1
        Values that the slave transfers one after the other, 1..4.
    direction : {"in", "out"}, default "in"
        From the slave to the master, or to the slave.
    value_bit : int, optional
        Size of a value where the profile has several [bit]; the largest if omitted.
    extra_rounds : int, default 0
        Values lost to synchronising, as Siemens counts one [1]_.

    Returns
    -------
    int
        Exchanges.

    Raises
    ------
    ArgumentError
        If the profile is not known, or a number is out of its range.

    References
    ----------
    .. [1] Siemens, SlimLine analogue module, manual: 7 x 2 + 7 = 21 cycles for two channels.

    Examples
    --------
    >>> transfer_cycles("S-7.3"), transfer_cycles("S-7.3", channels=2, extra_rounds=1)
    (7, 21)
    """
    profile = Profile.parse(profile) if isinstance(profile, str) else profile
    check_whole("channels", channels, 1, _CHANNELS)
    check_whole("extra_rounds", extra_rounds, 0, 1000)
    return _value_cycles(profile, direction, value_bit) * (channels + extra_rounds)


@cache
def _value_cycles(profile: Profile, direction: str, value_bit: int | None) -> int:
    table = _profiles()
    names = [str(profile), f"S-{profile.io:X}.{profile.id:X}"]
    found = table[table["profile"].isin(names) & (table["direction"] == direction)]
    if value_bit is not None:
        found = found[found["value_bit"] == value_bit]
    if found.empty:
        columns = table[["profile", "direction", "value_bit"]]
        known = [f"{name} {way} {bits} bit" for name, way, bits in columns.itertuples(index=False)]
        raise ArgumentError(
            f"profile is '{profile}' {direction}"
            f"{'' if value_bit is None else f' {value_bit} bit'}; known are {', '.join(known)}"
        )
    return int(found.sort_values("value_bit")["cycles"].iloc[-1])


def transfer_time(
    profile: Profile | str,
    cycle: npt.ArrayLike,
    *,
    channels: int = 1,
    paired: bool = False,
    direction: Literal["in", "out"] = "in",
    value_bit: int | None = None,
    extra_rounds: int = 0,
) -> float | npt.NDArray[np.float64]:
    """Return how long the transfer of all values of a slave takes.

    Parameters
    ----------
    profile : Profile or str
        As for `transfer_cycles`.
    cycle : float or array_like
        Cycle time of the line, positive [s].
    channels : int, default 1
        As for `transfer_cycles`.
    paired : bool, default False
        Whether the slave shares its address, and so is asked every second cycle.
    direction, value_bit, extra_rounds
        As for `transfer_cycles`.

    Returns
    -------
    float or ndarray of float
        Time on the bus [s]; 20 to 60 ms of conversion for each channel come on top.

    Raises
    ------
    ArgumentError
        As `transfer_cycles`, or if `cycle` is not positive.

    Examples
    --------
    From the data sheets of ifm, cycles of 5 ms:

    >>> [f"{transfer_time('S-7.3', 5e-3, channels=n) * 1e3:.0f} ms" for n in (1, 2, 4)]
    ['35 ms', '70 ms', '140 ms']
    """
    time = np.asarray(cycle)
    if time.dtype.kind not in "iuf" or not ((time > 0) & np.isfinite(time)).all():
        raise ArgumentError(f"cycle is {cycle!r} s; it must be positive and finite")
    exchanges = transfer_cycles(
        profile,
        channels=channels,
        direction=direction,
        value_bit=value_bit,
        extra_rounds=extra_rounds,
    )
    whole = time.astype(np.float64) * (exchanges * (2 if paired else 1))
    return whole if whole.ndim else float(whole)
