"""What takes a master several requests: to identify a slave, to activate it, to move it.

A task yields orders, one after the other, and is sent each reply: four bits, or `SILENT` or
`FAULTY`. Who leads it decides about repetitions, and whether it takes one cycle or many.
"""

from __future__ import annotations

from collections.abc import Generator
from typing import TypeAlias, TypeVar

from shipnet.asi.calls import Call
from shipnet.asi.profile import Profile
from shipnet.asi.simulation.lists import Identity, Lists, half_of
from shipnet.asi.simulation.orders import Order, key_of, order
from shipnet.asi.telegram import Half

__all__ = ["FAULTY", "SILENT", "Task", "activate", "identify", "move", "wait_for_storing"]

#: Replies that are no data: nothing came in time, and something came that breaks a rule.
SILENT, FAULTY = -1, -2

T = TypeVar("T")
Task: TypeAlias = Generator[Order, int, T]

#: Questions whether a slave has stored its address: enough for 15 ms with the shortest cycle,
#: which has one management and one inclusion request, 26 and 24 bit times.
_PATIENCE = 100


def identify(key: int) -> Task[Identity | None]:
    """Read the four codes of a slave.

    Parameters
    ----------
    key : int
        Twice its address, plus 1 for a B slave.

    Returns
    -------
    generator
        Yields orders; ends with the slave's `Identity`, or None where nobody answers.

    Examples
    --------
    >>> task = identify(10)
    >>> print(next(task).request)
    read the I/O configuration of slave 5
    >>> print(task.send(3).request)
    read the ID code of slave 5
    """
    half: Half | None = "B" if key & 1 else None
    io = yield order(Call.READ_IO_CONFIGURATION, key >> 1, half=half)
    if io < 0:
        return None
    code = yield order(Call.READ_ID, key >> 1, half=half)
    if code < 0:
        return None
    id1 = yield order(Call.READ_ID1, key >> 1, half=half)
    id2 = yield order(Call.READ_ID2, key >> 1, half=half)
    return Identity(Profile(io, code, id2 if id2 >= 0 else None), max(id1, -1))


def activate(lists: Lists, key: int) -> Task[bool]:
    """Send a detected slave its parameters and first outputs, if it is meant to be active.

    Parameters
    ----------
    lists : Lists
        The master's lists; the slave enters the LAS if it answers.
    key : int
        Its key; it must be in the LDS.

    Returns
    -------
    generator
        Yields orders; ends with whether the slave is active now.

    Examples
    --------
    >>> lists = Lists()
    >>> lists.note(10, Identity(Profile.parse("S-0.F"), -1))
    >>> task = activate(lists, 10)
    >>> print(next(task).request)
    write parameter 1111 (F) to slave 5
    >>> print(task.send(0xF).request)
    data exchange with slave 5: outputs 1111 (F)
    """
    if not lists.wanted(key):
        return False
    profile = lists.detected[key].profile
    half = half_of(key, profile)
    reply = yield order(Call.WRITE_PARAMETER, key >> 1, lists.parameter(key), half)
    if reply < 0:
        return False
    # The first outputs are all set: the ports stay off.
    inputs = yield order(Call.DATA_EXCHANGE, key >> 1, (1 << profile.output_bits) - 1, half)
    if inputs < 0:
        return False
    lists.join(key, inputs)
    return True


def move(lists: Lists, label: str) -> Task[bool]:
    """Give the slave at address 0 a label: its half first, if it has one, then its address.

    Parameters
    ----------
    lists : Lists
        The master's lists; the slave must be in the LDS at address 0.
    label : str
        The new label.

    Returns
    -------
    generator
        Yields orders; ends with whether the slave was found at its new address.

    Notes
    -----
    The half is bit 3 of the extended ID code 1; the other bits stay as they are. Replies may be
    lost although the request was carried out, so what counts is who answers afterwards.

    References
    ----------
    .. [1] ZMD AG, "ASI4U Universal AS-Interface IC", data sheet rev. 1.4, 2006, p. 48.

    Examples
    --------
    >>> lists = Lists()
    >>> lists.note(0, Identity(Profile.parse("S-7.A.E"), 7))
    >>> task = move(lists, "5B")
    >>> print(next(task).request)
    write extended ID code 1 1111 (F) to the slave at address 0
    """
    identity = lists.detected[0]
    key, half = key_of(label)
    wanted = identity.id1 & 7 | (8 if half == "B" else 0)
    if half and wanted != identity.id1:
        yield order(Call.WRITE_ID1, 0, wanted)
        yield from wait_for_storing(0, None)
    yield order(Call.ASSIGN_ADDRESS, 0, key >> 1)
    yield from wait_for_storing(key >> 1, half)
    found = yield from identify(key)
    if found is None or found.profile != identity.profile:
        return False
    lists.forget(0)
    lists.note(key, found)
    return True


def wait_for_storing(address: int, half: Half | None) -> Task[None]:
    """Ask a slave for its status until it says that it has stored its address or ID code 1.

    Parameters
    ----------
    address : int
        Its address.
    half : {"A", "B"} or None
        Its half.

    Returns
    -------
    generator
        Yields orders; ends when status bit S0 is clear, or after 100 questions.

    Examples
    --------
    >>> task = wait_for_storing(5, None)
    >>> print(next(task).request)
    read the status of slave 5
    """
    for _ in range(_PATIENCE):
        status = yield order(Call.READ_STATUS, address, half=half)
        if status >= 0 and not status & 1:
            return
