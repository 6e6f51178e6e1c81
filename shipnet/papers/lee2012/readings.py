"""How long the answer takes, apart from how old it is: readings of a printed 22.3 us."""

from __future__ import annotations

from typing import TYPE_CHECKING

from shipnet.engine.system import System

if TYPE_CHECKING:
    import pandas as pd

__all__ = ["response_readings"]


def response_readings(system: System) -> pd.DataFrame:
    r"""Return how long a request and its response take, read in several ways.

    .. math:: t = \left( 8 + 3.5 + n \right) \frac{b}{r}

    Parameters
    ----------
    system : System
        The system, for its serial line, registers and firmware.

    Returns
    -------
    pandas.DataFrame
        One row a reading: ``reading``, ``bits`` of a character, ``bytes`` of the response, and
        ``time_ms`` from the first bit of the request to the last one of the response; without
        processing, but for the last two rows, which are the system itself up to the first and up
        to the last bit of its response.

    Notes
    -----
    The paper prints 22.3 us from request to response (figure 13), 0.21 bit times. Read as ms, it
    is request, silence and response of 8 bytes each, as figure 4 draws them, in characters of 11
    bits, to the last digit; no FC03 response has 8 bytes, for 5 + 2 n is odd. That the sum fits
    may be chance: from the request alone 9.1 ms of processing would give it too.

    References
    ----------
    .. [1] J. H. Lee, D. S. Kim, "Design and implementation of distributed control system based on
       dual field-bus for ship engine", J. IEEK 49-SC(2), 2012, section IV.2.c, figures 4 and 13.

    Examples
    --------
    >>> table = response_readings(System())
    >>> table.loc[table["time_ms"].between(22.25, 22.35), ["bits", "bytes"]].values.tolist()
    [[11, 8]]
    """
    import pandas as pd

    rate = system.serial.bit_rate
    own = system.serial.character_bits
    cases = [
        ("as drawn in figure 4, 8 bits a character", 8, 8),
        ("as drawn, without the parity bit", 10, 8),
        ("as drawn, 8E1", 11, 8),
        ("one register, 8E1", 11, 7),
        ("two registers, 8E1", 11, 9),
    ]
    rows = [(name, bits, size, (8 + 3.5 + size) * bits / rate * 1e3) for name, bits, size in cases]
    size = 5 + 2 * system.registers
    whole = system.serial.frame_time(8) + system.poll.shortest_timeout
    first = whole - system.serial.frame_time(size)
    rows.append(("all points, to the first bit of the response", own, size, first * 1e3))
    rows.append(("all points, to the last bit of the response", own, size, whole * 1e3))
    return pd.DataFrame(rows, columns=["reading", "bits", "bytes", "time_ms"])
