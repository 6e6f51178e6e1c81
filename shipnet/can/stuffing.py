"""Bit stuffing: after five equal bits a transmitter sends one of the other value.

The stuff bit counts as the first of the next run, so that the sequence 00000 1111 costs two.
"""

from __future__ import annotations

__all__ = ["RUN", "stuff", "stuff_places"]

#: Equal bits in a row behind which a stuff bit is sent.
RUN = 5


def stuff_places(bits: str) -> list[int]:
    """Return where stuff bits go.

    Parameters
    ----------
    bits : str
        Characters 0 and 1, all subject to stuffing.

    Returns
    -------
    list of int
        For each stuff bit, how many of `bits` are sent before it, 5..len(bits), rising.

    Examples
    --------
    >>> stuff_places("0000011110")
    [5, 9]
    """
    places = []
    last, run = "", 0
    for place, bit in enumerate(bits, start=1):
        run = run + 1 if bit == last else 1
        last = bit
        if run == RUN:
            places.append(place)
            last, run = "10"[int(bit)], 1
    return places


def stuff(bits: str) -> str:
    """Return bits with their stuff bits, as they go onto the line.

    Parameters
    ----------
    bits : str
        Characters 0 and 1, all subject to stuffing.

    Returns
    -------
    str
        The bits and the stuff bits; one behind the last bit is included.

    Examples
    --------
    >>> stuff("0000011110")
    '000001111100'
    """
    parts = []
    begin = 0
    for place in stuff_places(bits):
        parts += [bits[begin:place], "10"[int(bits[place - 1])]]
        begin = place
    return "".join([*parts, bits[begin:]])
