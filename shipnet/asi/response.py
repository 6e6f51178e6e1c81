"""A slave's response: four bits, whose meaning is that of the call that they answer."""

from __future__ import annotations

from dataclasses import dataclass

from shipnet.asi.calls import Answer, Call
from shipnet.asi.frame import RESPONSE_BITS, frame, information_of
from shipnet.asi.profile import describe_io_configuration, describe_status
from shipnet.errors import ArgumentError
from shipnet.fields import check_whole

__all__ = ["RESPONSES", "Response"]


@dataclass(frozen=True, slots=True)
class Response:
    """A slave's response.

    Parameters
    ----------
    data : int
        The four information bits, 0..15.
    call : Call, optional
        The call that is answered; it gives the bits their meaning.

    Raises
    ------
    ArgumentError
        If `data` is outside 0..15, or if `call` is one that no slave answers.

    Examples
    --------
    >>> Response(0x6).bits
    '0011001'
    >>> print(Response(0x3, Call.READ_IO_CONFIGURATION))
    answer to read I/O configuration: 3, ports D0..D3 IN IN OUT OUT
    """

    data: int
    call: Call | None = None

    def __post_init__(self) -> None:
        """Check the data and that the call has an answer at all."""
        object.__setattr__(self, "data", check_whole("data", self.data, 0, 15, " in a response"))
        if self.call is not None:
            object.__setattr__(self, "call", Call(self.call))
            if self.call.rule.answer is None:
                raise ArgumentError(f"call is {self.call.rule.title}, which no slave answers")

    @property
    def bits(self) -> str:
        """The 7 bits in the order in which they are sent."""
        return frame(f"{self.data:04b}")

    @property
    def expected(self) -> bool:
        """Whether the data are what the standard fixes for the call; True where it fixes none."""
        answer = self.call.rule.answer if self.call is not None else None
        return not isinstance(answer, Answer) or self.data == answer

    def __str__(self) -> str:
        """Say in one line what the response means."""
        if self.call is None:
            return f"response: {self.data:04b} ({self.data:X})"
        answer = self.call.rule.answer
        head = f"answer to {self.call.rule.title}: "
        if answer == "I/O configuration":
            return f"{head}{self.data:X}, {describe_io_configuration(self.data)}"
        if answer == "status":
            return f"{head}{self.data:04b}, {describe_status(self.data)}"
        if isinstance(answer, Answer):
            ending = "done" if self.expected else f"but the standard asks for {answer:X}"
            return f"{head}{self.data:X}, {ending}"
        what = "" if str(answer) in self.call.rule.title else f"{answer} "
        return f"{head}{what}{self.data:04b} ({self.data:X})"

    @classmethod
    def parse(cls, bits: str, call: Call | None = None) -> Response:
        """Read the 7 bits of a response.

        Parameters
        ----------
        bits : str
            Seven characters 0 and 1.
        call : Call, optional
            The call that is answered.

        Returns
        -------
        Response
            Its `bits` are the ones given.

        Raises
        ------
        LengthError, SymbolError, StartBitError, EndBitError, ParityError
            If the telegram breaks the rule of that name, checked in this order.

        Examples
        --------
        >>> Response.parse("0011001").data
        6
        """
        return cls(int(information_of(bits, RESPONSE_BITS, "response"), 2), call)


#: The bits of all 16 responses.
RESPONSES = tuple(Response(data).bits for data in range(16))
