"""What both telegrams share: start bit, information, parity bit, end bit.

    request   ST=0  CB  A4..A0  I4..I0  PB  EB=1     14 bits
    response  ST=0      I3..I0          PB  EB=1      7 bits

The parity bit makes the number of ones even, counted from the start bit up to and including the
parity bit; the end bit does not count (claim kim2023-040 weighs the other reading).
"""

from shipnet.errors import EndBitError, LengthError, ParityError, StartBitError, SymbolError

__all__ = ["REQUEST_BITS", "RESPONSE_BITS", "frame", "information_of"]

#: Bits of a master's request.
REQUEST_BITS = 14

#: Bits of a slave's response.
RESPONSE_BITS = 7


def frame(information: str) -> str:
    """Put start, parity and end bit around the information bits.

    Parameters
    ----------
    information : str
        Characters 0 and 1: 11 for a request, 4 for a response.

    Returns
    -------
    str
        The telegram, three bits longer.

    Examples
    --------
    >>> frame("0110")
    '0011001'
    """
    return f"0{information}{information.count('1') % 2}1"


def information_of(bits: str, length: int, what: str) -> str:
    """Check a telegram from outside to inside and return its information bits.

    Parameters
    ----------
    bits : str
        Characters 0 and 1.
    length : int
        Bits that this telegram must have: `REQUEST_BITS` or `RESPONSE_BITS`.
    what : str
        Name of the telegram for the message.

    Returns
    -------
    str
        The bits between start bit and parity bit.

    Raises
    ------
    LengthError, SymbolError, StartBitError, EndBitError, ParityError
        If the telegram breaks the rule of that name, checked in this order.

    Examples
    --------
    >>> information_of("0011001", RESPONSE_BITS, "response")
    '0110'
    """
    if not isinstance(bits, str):
        raise TypeError(f"{what} bits are a str of 0 and 1, but got {type(bits).__name__}")
    if len(bits) != length:
        raise LengthError(f"a {what} has {length} bits, but {bits!r} has {len(bits)}")
    for place, symbol in enumerate(bits):
        if symbol not in "01":
            raise SymbolError(f"{what} {bits!r} has {symbol!r} at bit {place}; bits are 0 or 1")
    if bits[0] != "0":
        raise StartBitError(f"{what} {bits} starts with 1; the start bit is 0")
    if bits[-1] != "1":
        raise EndBitError(f"{what} {bits} ends with 0; the end bit is 1")
    ones = bits[:-1].count("1")
    if ones % 2:
        raise ParityError(
            f"{what} {bits} has {ones} ones before its end bit; with the parity bit {bits[-2]} "
            "their number must be even"
        )
    return bits[1:-2]
