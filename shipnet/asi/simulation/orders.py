"""Requests made ready to be sent many times, and the labels of slaves: ``"5"``, ``"5A"``, ``"5B"``.

What a request means depends on who reads it: the bits that carry four outputs to a standard slave
carry three outputs and a select bit to an A/B slave. An `Order` is read once by each of the three
kinds of slave, and then knows what each of them makes of its bits.
"""

from __future__ import annotations

import re
from functools import cache
from typing import Literal

from shipnet.asi.calls import Call
from shipnet.asi.telegram import Half, Request
from shipnet.errors import ArgumentError, UnknownCallError

__all__ = ["KINDS", "Kind", "Order", "key_of", "label_of", "order"]

Kind = Literal[0, 1, 2]

#: The kinds of slave by what they make of the select bit: a standard slave, an A and a B slave.
KINDS: tuple[Half | None, ...] = (None, "A", "B")

_MOVING = (
    Call.ASSIGN_ADDRESS,
    Call.WRITE_ID1,
    Call.DELETE_ADDRESS,
    Call.RESET,
    Call.BROADCAST_RESET,
    Call.ENTER_PROGRAM_MODE,
)


class Order:
    """A request with all that is needed to send it again and again.

    Parameters
    ----------
    request : Request
        What is sent.

    Attributes
    ----------
    request : Request
        What is sent.
    bits : str
        Its 14 bits.
    station : int
        The address in it, and 32 for the broadcast, which goes to all.
    code : int
        Call, address, half and data in 16 bits: 4, 5, 2 and 5 of them from the lowest up.
    reads : tuple of (Request or None)
        What a standard slave, an A and a B slave at this address read; None where the bits are no
        request to it.
    expects : bool
        Whether the call has an answer at all.
    moves : bool
        Whether the call can change which slave is found at which address.

    Examples
    --------
    >>> outputs = Order(Request.data_exchange(5, 0x6))
    >>> [str(read) for read in outputs.reads if read]
    ['data exchange with slave 5: outputs 0110 (6)', 'data exchange with slave 5B: outputs 110 (6)']
    """

    __slots__ = ("bits", "code", "expects", "moves", "reads", "request", "station")

    def __init__(self, request: Request) -> None:
        call, half = request.call, KINDS.index(request.half)
        self.request = request
        self.bits = request.bits
        self.station = 32 if call is Call.BROADCAST_RESET else request.address
        self.code = call | request.address << 4 | half << 9 | request.data << 11
        self.reads = tuple(_read(self.bits, kind) for kind in range(len(KINDS)))
        self.expects = call.rule.answer is not None
        self.moves = call in _MOVING


def _read(bits: str, kind: int) -> Request | None:
    try:
        request = Request.parse(bits, extended=kind > 0)
    except UnknownCallError:
        return None
    # A slave without an address is of no half yet, as a master does not know what it meets there;
    # the calls without a select bit go to it, or to everybody.
    meant = request.address == 0 or request.half is None or request.half == KINDS[kind]
    return request if meant else None


@cache
def order(call: Call, address: int, data: int = 0, half: Half | None = None) -> Order:
    """Return the order for a request; the same one whenever it is asked for.

    Parameters
    ----------
    call : Call
        Which call.
    address : int
        Address of the slave, 0..31.
    data : int, default 0
        What the call carries.
    half : {"A", "B"}, optional
        Which of two slaves that share the address.

    Returns
    -------
    Order
        The request, made ready.

    Raises
    ------
    ArgumentError
        As `Request`.

    Examples
    --------
    >>> order(Call.RESET, 5) is order(Call.RESET, 5)
    True
    """
    return Order(Request(call, address, data, half))


def label_of(key: int, *, extended: bool) -> str:
    """Return the label of a slave, as it is written on the device.

    Parameters
    ----------
    key : int
        Twice the address, plus 1 for a B slave: 0..63.
    extended : bool
        Whether it is an A/B slave; at address 0 no slave has a half.

    Returns
    -------
    str
        Address, and A or B behind it if it is an A/B slave.

    Examples
    --------
    >>> label_of(10, extended=False), label_of(10, extended=True), label_of(11, extended=True)
    ('5', '5A', '5B')
    """
    return f"{key >> 1}{'AB'[key & 1] if extended and key > 1 else ''}"


def key_of(label: str) -> tuple[int, Half | None]:
    """Read the label of a slave; the inverse of `label_of`.

    Parameters
    ----------
    label : str
        Address 0..31, and A or B behind it for an A/B slave with an address.

    Returns
    -------
    key : int
        Twice the address, plus 1 for a B slave.
    half : {"A", "B"} or None
        None for a standard slave.

    Raises
    ------
    ArgumentError
        If the label has another form.

    Examples
    --------
    >>> key_of("5"), key_of("5B")
    ((10, None), (11, 'B'))
    """
    found = re.fullmatch(r"(\d{1,2})([AB]?)", label) if isinstance(label, str) else None
    address = int(found[1]) if found else 32
    if not found or address > 31 or (address == 0 and found[2]):
        raise ArgumentError(
            f"slave is {label!r}; it must be '1'..'31', with A or B behind it for an A/B slave, "
            "or '0'"
        )
    half: Half | None = "A" if found[2] == "A" else "B" if found[2] == "B" else None
    return 2 * address + (half == "B"), half
