"""Fields of a data or remote frame of classic CAN, in the order in which they are sent.

Stuff bits may follow any bit from the start of frame up to the last of the CRC sequence; from the
CRC delimiter on, every bit has a fixed value.
"""

from __future__ import annotations

from shipnet.fields import check_whole

__all__ = [
    "CRC",
    "CRC_BITS",
    "INTERMISSION",
    "LONGEST",
    "TAIL",
    "head",
    "highest_id",
    "payload",
    "stuffed_region",
]

#: Row of `shipnet.crc.ALGORITHMS`, and its width.
CRC, CRC_BITS = "CRC-15/CAN", 15

#: Recessive bits between the end of a frame and the start of the next, at least.
INTERMISSION = 3

#: Fields behind the CRC sequence and their bits on a bus where a receiver acknowledges.
TAIL = (("CRC delimiter", "1"), ("ACK slot", "0"), ("ACK delimiter", "1"), ("EOF", "1111111"))

#: Bound on the bits of a frame, stuff bits and intermission included: 8 bytes, 29-bit identifier.
LONGEST = 160

# Bits that a transmitter may choose are "x"; reserved bits are dominant.
_BASE = {
    "SOF": "0",
    "base identifier": "x" * 11,
    "RTR": "x",
    "IDE": "0",
    "r0": "0",
    "DLC": "xxxx",
}
_EXTENDED = {
    "SOF": "0",
    "base identifier": "x" * 11,
    "SRR": "1",
    "IDE": "1",
    "identifier extension": "x" * 18,
    "RTR": "x",
    "r1": "0",
    "r0": "0",
    "DLC": "xxxx",
}


def head(extended: bool) -> dict[str, str]:
    """Return the fields before the data.

    Parameters
    ----------
    extended : bool
        Whether the arbitration id has 29 bits instead of 11.

    Returns
    -------
    dict of str to str
        Name of each field and its bits, ``x`` where they are free.

    References
    ----------
    .. [1] Robert Bosch GmbH, "CAN Specification", version 2.0, 1991, part B, section 3.1.

    Examples
    --------
    >>> "".join(head(extended=False).values())
    '0xxxxxxxxxxxx00xxxx'
    """
    return dict(_EXTENDED if extended else _BASE)


def highest_id(extended: bool) -> int:
    """Return the highest arbitration id, that of lowest priority.

    Parameters
    ----------
    extended : bool
        Whether the arbitration id has 29 bits instead of 11.

    Returns
    -------
    int
        2**29 - 1 or 2**11 - 1.

    Examples
    --------
    >>> hex(highest_id(extended=True))
    '0x1fffffff'
    """
    return 2**29 - 1 if extended else 2**11 - 1


def payload(dlc: int, remote: bool = False) -> int:
    """Return how many bytes of data a frame with this data length code carries.

    Parameters
    ----------
    dlc : int
        Data length code, 0..15; 9 to 15 mean 8 bytes too.
    remote : bool, default False
        Whether it is a remote frame, which carries none.

    Returns
    -------
    int
        Bytes, 0..8.

    Raises
    ------
    ArgumentError
        If `dlc` is out of range.

    Examples
    --------
    >>> payload(5), payload(15), payload(5, remote=True)
    (5, 8, 0)
    """
    dlc = check_whole("dlc", dlc, 0, 15)
    return 0 if remote else min(dlc, 8)


def stuffed_region(n_bytes: int, extended: bool) -> int:
    """Return how many bits of a frame are subject to stuffing, stuff bits not counted.

    Parameters
    ----------
    n_bytes : int
        Bytes of data, 0..8.
    extended : bool
        Whether the arbitration id has 29 bits instead of 11.

    Returns
    -------
    int
        Bits from the start of frame to the end of the CRC sequence.

    Examples
    --------
    >>> stuffed_region(8, False), stuffed_region(8, True)
    (98, 118)
    """
    return sum(map(len, head(extended).values())) + 8 * n_bytes + CRC_BITS
