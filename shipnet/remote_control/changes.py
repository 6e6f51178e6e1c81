"""What to send: only the data that have changed since they were sent last."""

from __future__ import annotations

from collections.abc import Sequence

from shipnet.errors import ArgumentError
from shipnet.fields import check_whole
from shipnet.remote_control.packet import Format

__all__ = ["Sender", "changed"]


def changed(sending: Sequence[int], sended: Sequence[int]) -> dict[int, int]:
    """Return the data that differ from those sent last, by number.

    Parameters
    ----------
    sending : sequence of int
        The data to send, ``SENDING`` of the paper.
    sended : sequence of int
        The data sent last, ``SENDED`` of the paper; as many.

    Returns
    -------
    dict of int to int
        Number and value of each that differs, ``NEW_SEND`` of the paper; may be empty.

    Raises
    ------
    ArgumentError
        If there are not as many of both, or one is no whole number 0..65535.

    References
    ----------
    .. [1] K. Y. Chung, K. S. Rhyu, "A study on the communication method for a ship main engine
       remote control system", J. Korean Soc. Marine Eng., 1998, section 4.1 and Fig 6.

    Examples
    --------
    >>> changed([120, 1, 0], [118, 1, 1])
    {0: 120, 2: 0}
    """
    if len(sending) != len(sended):
        raise ArgumentError(
            f"sending has {len(sending)} data; it must have {len(sended)}, as many as sended"
        )
    pairs = zip(_values("sending", sending), _values("sended", sended), strict=True)
    return {number: value for number, (value, last) in enumerate(pairs) if value != last}


def _values(name: str, values: Sequence[int]) -> list[int]:
    # The name of a value is only made for one that does not look right: there are two a byte sent.
    return [
        value
        if type(value) is int and 0 <= value <= 0xFFFF
        else check_whole(f"{name}[{number}]", value, 0, 0xFFFF)
        for number, value in enumerate(values)
    ]


class Sender:
    """Packs what has changed, and takes it as received: there is no acknowledgement.

    Parameters
    ----------
    packet_format : Format
        How packets are made; it has one number for each datum.
    sended : sequence of int, optional
        What the other side has at the start; all 0 if omitted.
    repeat : int, default 0
        How many of the other data go with each packet, in turn, though they have not changed:
        0..n_numbers. 0 is the paper's rule; n_numbers sends everything every time.

    Raises
    ------
    ArgumentError
        If `sended` are not as many as there are numbers, or `repeat` is out of range.

    Notes
    -----
    With the paper's rule a lost packet leaves the other side with old values until they change
    again. With ``repeat=k`` they are mended within ``ceil(n_numbers / k)`` packets.

    Examples
    --------
    >>> from shipnet.remote_control.packet import Markers
    >>> sender = Sender(Markers(n_numbers=3))
    >>> [sender.packet([120, 1, 0]).hex(" ") for _ in range(2)]
    ['cc dd 00 78 00 01 01 00 ee', 'cc dd ee']
    >>> sender = Sender(Markers(n_numbers=3), [120, 1, 0], repeat=1)
    >>> [sender.packet([120, 1, 0]).hex(" ") for _ in range(2)]
    ['cc dd 00 78 00 ee', 'cc dd 01 01 00 ee']
    """

    def __init__(
        self, packet_format: Format, sended: Sequence[int] | None = None, *, repeat: int = 0
    ) -> None:
        n = packet_format.n_numbers
        self.packet_format = packet_format
        self.sended = [0] * n if sended is None else list(sended)
        self.repeat = check_whole("repeat", repeat, 0, n)
        self._turn = 0
        if len(self.sended) != n:
            raise ArgumentError(f"sended has {len(self.sended)} data; it must have {n}")

    def packet(self, sending: Sequence[int]) -> bytes:
        """Return the next packet, and take its data as received.

        Parameters
        ----------
        sending : sequence of int
            All the data as they are now, n_numbers values of 0..65535.
        """
        n = self.packet_format.n_numbers
        again = [number % n for number in range(self._turn, self._turn + self.repeat)]
        items = changed(sending, self.sended) | {number: sending[number] for number in again}
        packet = self.packet_format.encode(items)
        self._turn = (self._turn + self.repeat) % n
        self.sended = list(sending)
        return packet
