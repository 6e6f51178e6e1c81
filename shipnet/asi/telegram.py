"""AS-i telegrams and what they say: a master's request, and the response to it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from shipnet.asi.calls import Answer, Call
from shipnet.asi.frame import REQUEST_BITS, frame, information_of
from shipnet.asi.response import Response
from shipnet.errors import ArgumentError, UnknownCallError
from shipnet.fields import check_whole

__all__ = ["Half", "Request"]

Half = Literal["A", "B"]


@dataclass(frozen=True, slots=True)
class Request:
    """A master's request.

    The named constructors (`data_exchange`, `write_parameter`, ...) read better than the fields.

    Parameters
    ----------
    call : Call
        Which of the 13 calls.
    address : int
        Address of the slave, 0..31; 0 is a slave without an address, 31 also the broadcast.
    data : int, default 0
        The data that the call carries: output bits 0..15 (0..7 for an A/B slave), parameter bits
        likewise, the new address 1..31, or the extended ID code 1 0..15; else 0.
    half : {"A", "B"}, optional
        Which of the two slaves that share an address in extended addressing; None for a
        standard slave.

    Raises
    ------
    ArgumentError
        If a field is outside the range that its call allows.

    Notes
    -----
    Select is sent as it is in delete address and the four read calls, and inverted in data
    exchange, write parameter, reset and read status, so that with select 0 every request equals
    the one that a master before specification 2.1 sends to a standard slave. Claim kim2023-047
    shows where the paper's table differs.

    References
    ----------
    .. [1] ZMD AG, "ASI4U Universal AS-Interface IC", data sheet rev. 1.4, 2006, table 6.
    .. [2] R. G. Kim, Y. H. Cho, K. H. Hyun, "AS-Interface protocol utilization for smart ships",
       J. Soc. Nav. Archit. Korea 60(6), 2023, section 3.4.

    Examples
    --------
    From [2]_, the example of section 3.4 with the parity bit that the rule asks for:

    >>> request = Request.data_exchange(21, 0xE)
    >>> request.bits
    '00101010111001'
    >>> print(request)
    data exchange with slave 21: outputs 1110 (E)
    """

    call: Call
    address: int
    data: int = 0
    half: Half | None = None

    def __post_init__(self) -> None:
        """Check every field against the call's pattern."""
        object.__setattr__(self, "call", Call(self.call))
        rule, layout = self.call.rule, self._layout
        if self.half not in (None, "A", "B"):
            raise ArgumentError(f"half is {self.half!r}; it must be 'A', 'B' or None")
        if self.half and "s" not in layout.lower():
            raise ArgumentError(f"half is {self.half!r}, but {rule.title} has no select bit")
        if "a" in layout:
            why = "" if rule.lowest_address == 0 else f": {rule.title} needs an addressed slave"
            address = check_whole("address", self.address, rule.lowest_address, 31, why)
        else:
            only = int(layout[1:6], 2)
            address = check_whole("address", self.address, only, only, f": {rule.title} goes there")
        lowest = 1 if self.call is Call.ASSIGN_ADDRESS else 0
        why = f" in {rule.title}" + (f" with slave half {self.half}" if self.half else "")
        data = check_whole("data", self.data, lowest, 2 ** layout.count("d") - 1, why)
        object.__setattr__(self, "address", address)
        object.__setattr__(self, "data", data)

    @property
    def _layout(self) -> str:
        return self.call.rule.layout(self.half is not None)

    @property
    def bits(self) -> str:
        """The 14 bits in the order in which they are sent."""
        address = iter(f"{self.address:05b}")
        data = iter(self._data_bits)
        select = int(self.half == "B")
        sent = {
            "a": lambda: next(address),
            "d": lambda: next(data),
            "s": lambda: str(select),
            "S": lambda: str(1 - select),
        }
        return frame("".join(sent[c]() if c in sent else c for c in self._layout))

    @property
    def _data_bits(self) -> str:
        width = self._layout.count("d")
        return f"{self.data:0{width}b}" if width else ""

    @property
    def slave(self) -> str:
        """The slave as its label on board says it: ``"21"``, ``"21A"``, ``"21B"``."""
        return f"{self.address}{self.half or ''}"

    def __str__(self) -> str:
        """Say in one line what the request asks for."""
        return self.call.rule.says.format(slave=self.slave, data=self.data, bits=self._data_bits)

    def answer(self, data: int | None = None) -> Response:
        """Return the response to this request.

        Parameters
        ----------
        data : int, optional
            The slave's four bits, 0..15. Not needed where the standard fixes them.

        Returns
        -------
        Response
            A response that knows the call that it answers.

        Raises
        ------
        ArgumentError
            If the call has no answer, or if `data` is missing where the slave must supply it.

        Examples
        --------
        >>> print(Request.data_exchange(21, 0xE).answer(0x6))
        answer to data exchange: inputs 0110 (6)
        >>> Request.reset(21).answer().bits
        '0011001'
        """
        expected = self.call.rule.answer
        if data is None and isinstance(expected, Answer):
            data = int(expected)
        if data is None and expected is not None:
            raise ArgumentError(f"data is missing: {self.call.rule.title} answers {expected} 0..15")
        return Response(0 if data is None else data, self.call)

    @classmethod
    def parse(cls, bits: str, *, extended: bool = False) -> Request:
        """Read the 14 bits of a request.

        Parameters
        ----------
        bits : str
            Fourteen characters 0 and 1.
        extended : bool, default False
            Whether the addressed slave works in extended addressing. Nothing on the line tells:
            ``00101010111001`` carries outputs 1110 to the standard slave 21, or outputs 110 to
            slave 21A. A set select bit in a control call names a B slave in either case.

        Returns
        -------
        Request
            Call, address, half and data; its `bits` are the ones given.

        Raises
        ------
        LengthError, SymbolError, StartBitError, EndBitError, ParityError
            If the telegram breaks the rule of that name, checked in this order.
        UnknownCallError
            If no call has this pattern.

        Examples
        --------
        >>> print(Request.parse("00101010111001", extended=True))
        data exchange with slave 21A: outputs 110 (6)
        >>> Request.parse("00101010111011")
        Traceback (most recent call last):
            ...
        shipnet.errors.ParityError: request 00101010111011 has 7 ones before its end bit; with the parity bit 1 their number must be even
        """  # noqa: E501 - the message is one line
        information = information_of(bits, REQUEST_BITS, "request")
        for call in Call:
            layout = call.rule.layout(extended)
            seen: dict[str, str] = dict.fromkeys("adsS", "")
            for letter, bit in zip(layout, information, strict=True):
                if letter in seen:
                    seen[letter] += bit
                elif letter != bit:
                    break
            else:
                address = int(information[1:6], 2)
                data = int(seen["d"] or "0", 2)
                if "a" in layout and address < call.rule.lowest_address:
                    continue
                if call is Call.ASSIGN_ADDRESS and data == 0:
                    continue
                return cls(call, address, data, _half(seen["s"], seen["S"], extended))
        raise UnknownCallError(
            f"request {bits}: no call has control bit {information[0]}, address "
            f"{int(information[1:6], 2)} and information {information[6:]}"
        )

    @classmethod
    def data_exchange(cls, address: int, data: int, half: Half | None = None) -> Request:
        """Return a request that sends outputs to a slave and asks for its inputs.

        Parameters
        ----------
        address : int
            Address of the slave, 1..31.
        data : int
            Output bits D3..D0, 0..15; D2..D0, 0..7, for an A/B slave.
        half : {"A", "B"}, optional
            Which of two slaves that share the address; None for a standard slave.

        Examples
        --------
        >>> Request.data_exchange(21, 0x6, "A").bits == Request.data_exchange(21, 0xE).bits
        True
        """
        return cls(Call.DATA_EXCHANGE, address, data, half)

    @classmethod
    def write_parameter(cls, address: int, parameter: int, half: Half | None = None) -> Request:
        """Return a request that sets a slave's parameter bits.

        Parameters
        ----------
        address : int
            Address of the slave, 1..31.
        parameter : int
            Parameter bits P3..P0, 0..15; P2..P0, 0..7, for an A/B slave.
        half : {"A", "B"}, optional
            Which of two slaves that share the address; None for a standard slave.
        """
        return cls(Call.WRITE_PARAMETER, address, parameter, half)

    @classmethod
    def assign_address(cls, new_address: int) -> Request:
        """Return a request that gives the slave at address 0 a new address, 1..31."""
        return cls(Call.ASSIGN_ADDRESS, 0, new_address)

    @classmethod
    def write_id1(cls, id1: int) -> Request:
        """Return a request that writes extended ID code 1 into the slave at address 0.

        Parameters
        ----------
        id1 : int
            The code, 0..15. Its bit 3 is the select bit of an A/B slave: 8 and above make it B.
        """
        return cls(Call.WRITE_ID1, 0, id1)

    @classmethod
    def delete_address(cls, address: int, half: Half | None = None) -> Request:
        """Return a request that puts a slave, address 1..31, back to address 0."""
        return cls(Call.DELETE_ADDRESS, address, half=half)

    @classmethod
    def reset(cls, address: int, half: Half | None = None) -> Request:
        """Return a request that puts a slave, address 0..31, into its initial state."""
        return cls(Call.RESET, address, half=half)

    @classmethod
    def read_io_configuration(cls, address: int, half: Half | None = None) -> Request:
        """Return a request for the I/O configuration code of a slave, address 0..31."""
        return cls(Call.READ_IO_CONFIGURATION, address, half=half)

    @classmethod
    def read_id(cls, address: int, half: Half | None = None) -> Request:
        """Return a request for the ID code of a slave, address 0..31."""
        return cls(Call.READ_ID, address, half=half)

    @classmethod
    def read_id1(cls, address: int, half: Half | None = None) -> Request:
        """Return a request for extended ID code 1 of a slave, address 0..31."""
        return cls(Call.READ_ID1, address, half=half)

    @classmethod
    def read_id2(cls, address: int, half: Half | None = None) -> Request:
        """Return a request for extended ID code 2 of a slave, address 0..31."""
        return cls(Call.READ_ID2, address, half=half)

    @classmethod
    def read_status(cls, address: int, half: Half | None = None) -> Request:
        """Return a request for the status bits of a slave, address 0..31."""
        return cls(Call.READ_STATUS, address, half=half)

    @classmethod
    def broadcast_reset(cls) -> Request:
        """Return the request that resets all slaves at once; none answers.

        Examples
        --------
        The data sheet prints this frame whole [1]_:

        >>> Request.broadcast_reset().bits
        '01111111010111'

        References
        ----------
        .. [1] ZMD AG, "SAP5S/SAP51", data sheet rev. 3.1, 2012, p. 20.
        """
        return cls(Call.BROADCAST_RESET, 31)

    @classmethod
    def enter_program_mode(cls) -> Request:
        """Return the request that opens the chip's production mode at address 0; no answer."""
        return cls(Call.ENTER_PROGRAM_MODE, 0)


def _half(plain: str, inverted: str, extended: bool) -> Half | None:
    """Read the select bit; without extended addressing only a set one says anything."""
    if not plain and not inverted:
        return None
    if plain == "1" or inverted == "0":
        return "B"
    return "A" if extended else None
