"""A slave: what it remembers, what it answers, and when it stays silent.

Times are the simulated time [s] and must not run backwards.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import cast

from shipnet.asi.batch import NONE
from shipnet.asi.calls import Answer, Call
from shipnet.asi.profile import IO_CONFIGURATIONS, Profile
from shipnet.asi.simulation.orders import KINDS, Kind, label_of
from shipnet.asi.simulation.states import TRANSITIONS, Action, Event, State
from shipnet.asi.telegram import Half, Request, Response
from shipnet.errors import ArgumentError, FrameError, UnknownCallError
from shipnet.fields import check_whole

__all__ = ["DEFAULT", "OBEY", "WATCHDOG", "WRITE_TIME", "Slave"]

#: After this time without data or parameters a slave resets itself [s]: SAP5S/SAP51 data sheet
#: rev. 3.1, 2012, p. 47. The AS2702 (rev. C, 2001, p. 13) does it after 50 ms to 100 ms.
WATCHDOG = 94.2e-3

#: Longest time that a slave takes to store its address [s]: Siemens, "IE/AS-INTERFACE LINK PN IO",
#: manual, p. 169.
WRITE_TIME = 15e-3

#: Output and parameter bits after a reset: all set, the ports switched off (AS2702, p. 13).
DEFAULT = 0xF

_NEVER = float("inf")


class Slave:
    """A slave of the line.

    Parameters
    ----------
    profile : Profile or str
        What it is: ``"S-7.A.E"``. ID code A makes it an A/B slave; without an ID code 2 it is one
        from before specification 2.1, which answers neither request for an extended ID code.
    address : int, default 0
        Its address, 0..31; 0 is a new slave's.
    half : {"A", "B"}, optional
        For an A/B slave with an address; A if omitted. It is bit 3 of the extended ID code 1.
    id1 : int, optional
        Extended ID code 1, 0..15, or 0..7 for an A/B slave; all bits set if omitted.
    inputs : int, default 0
        What its input ports read, 0..15.
    watchdog : float, default 94.2e-3
        Time without data or parameters after which it resets itself [s]; ``inf`` for none.
    write_time : float, default 15e-3
        How long it takes to store an address or an ID code 1 [s].
    locked : bool, default True
        Whether its maker closed the program mode.

    Raises
    ------
    ArgumentError
        If a value is out of its range.

    Notes
    -----
    After a reset a slave keeps its outputs off and does not answer *data exchange* until a
    *write parameter* has come: the flag Data_Exchange_Disable of [1]_. While it stores, it is
    silent to calls that would store something else. If it loses its supply meanwhile, it comes
    back at address 0 with its memory error flag set: our reading of the warning in [2]_.

    Ports that are outputs are echoed in the response, as in [1]_, p. 39.

    References
    ----------
    .. [1] ZMD AG, "SAP5S/SAP51", data sheet rev. 3.1, 2012, pp. 39, 46, 47.
    .. [2] Siemens, "IE/AS-INTERFACE LINK PN IO", manual, p. 169.

    Examples
    --------
    A new slave hears nothing until there was a pause, and then answers its own address only:

    >>> slave = Slave("S-3.F.F", address=21, inputs=0b0010)
    >>> request = Request.read_io_configuration(21).bits
    >>> slave.hear(request)
    >>> slave.pause()
    >>> print(slave.hear(request))
    answer to read I/O configuration: 3, ports D0..D3 IN IN OUT OUT
    """

    def __init__(
        self,
        profile: Profile | str,
        address: int = 0,
        half: Half | None = None,
        *,
        id1: int | None = None,
        inputs: int = 0,
        watchdog: float = WATCHDOG,
        write_time: float = WRITE_TIME,
        locked: bool = True,
    ) -> None:
        self.profile = profile if isinstance(profile, Profile) else Profile.parse(profile)
        self.extended = self.profile.extended
        if half not in KINDS or (half and (not self.extended or not address)):
            raise ArgumentError(
                f"half is {half!r}; it must be 'A' or 'B' for an A/B slave with an address, "
                f"else None, and this is {self.profile} at {address!r}"
            )
        most = 7 if self.extended else 15
        self.id1 = most if id1 is None else check_whole("id1", id1, 0, most)
        if half == "B":
            self.id1 |= 8
        self.address = check_whole("address", address, 0, 31)
        self.inputs = check_whole("inputs", inputs, 0, 15)
        for name, value in (("watchdog", watchdog), ("write_time", write_time)):
            if not 0 <= value:
                raise ArgumentError(f"{name} is {value} s; it must be 0 or more")
        self.watchdog, self.write_time, self.locked = watchdog, write_time, locked

        ports = IO_CONFIGURATIONS[self.profile.io]
        self._in_mask = sum(1 << bit for bit, port in enumerate(ports) if port in ("IN", "I/O"))
        self._echo_mask = sum(1 << bit for bit, port in enumerate(ports) if port == "OUT")
        self._stored = (self.address, self.id1)
        self._writing_until = -_NEVER
        self.powered = True
        self.periphery_fault = self.memory_error = False
        #: When the watchdog reset the slave [s].
        self.trips: list[float] = []
        self._start()

    def _start(self) -> None:
        """Come up as after switching on: out of step with the master."""
        self.state = State.ASYNCHRONOUS
        self.synchronised = self.programming = False
        self._settle()

    def _settle(self) -> None:
        """Take the stored address, switch the ports off, and wait for parameters."""
        self.address, self.id1 = self._stored
        self.kind = self._kind()
        self.outputs = self.parameter = DEFAULT
        self.active = False
        self._expires = _NEVER

    def _kind(self) -> Kind:
        return cast("Kind", 1 + (self.id1 >> 3) if self.extended else 0)

    @property
    def half(self) -> Half | None:
        """Which half of its address an A/B slave takes; None for a standard slave."""
        return KINDS[self.kind]

    @property
    def label(self) -> str:
        """Its label: ``"21"``, ``"21A"``, ``"21B"``."""
        return label_of(2 * self.address + (self.kind == 2), extended=self.extended)

    def status(self, time: float = 0.0) -> int:
        """Return the status bits S3..S0 of a slave of specification 2.1, 0..15.

        Parameters
        ----------
        time : float, default 0
            When [s].
        """
        volatile = self._stores(time) or self._stored != (self.address, self.id1)
        return volatile | self.periphery_fault << 1 | self.memory_error << 3

    def switch_off(self, time: float = 0.0) -> None:
        """Take the supply away at a time [s]; what is being stored is lost with the address."""
        if self._stores(time):
            self._stored = (0, self._stored[1])
            self.memory_error = True
            self._writing_until = -_NEVER
        self.powered = False
        self._settle()

    def switch_on(self) -> None:
        """Give the supply back."""
        self.powered = True
        self._start()

    def pause(self, event: Event = Event.SLAVE_PAUSE) -> None:
        """Hear a pause.

        Parameters
        ----------
        event : Event
            `Event.SLAVE_PAUSE`, behind a response or where none came, or any other
            `Event.PAUSE`, as before a response.
        """
        if event not in (Event.PAUSE, Event.SLAVE_PAUSE):
            raise ArgumentError(f"event is {event}; it must be Event.PAUSE or Event.SLAVE_PAUSE")
        self._step(event)

    def _step(self, event: Event) -> Action:
        step = TRANSITIONS.get((self.state, event))
        if step is None:
            return Action.NONE
        self.state = step.state
        if step.state is not State.RECEIVE:
            self.synchronised = step.state is State.SYNCHRONOUS
        return step.action

    def hear(self, bits: str, time: float = 0.0) -> Response | None:
        """Hear one telegram.

        Parameters
        ----------
        bits : str
            The bits that its receiver makes of the line: a request, a response of another slave,
            or what a disturbance left of them.
        time : float, default 0
            When the telegram ends [s].

        Returns
        -------
        Response or None
            The answer; None while it stays silent, because the telegram is not for it, is
            faulty, or has no answer.

        Notes
        -----
        If `synchronised` was False before, the answer comes 2 bit times later than usual.
        """
        if not self.powered or self.state is not State.RECEIVE:
            return None
        try:
            request = Request.parse(bits, extended=self.extended)
        except UnknownCallError:
            self._step(Event.UNKNOWN)
            return None
        except FrameError:
            self._step(Event.ERROR)
            return None
        self.rest(time)
        everybody = request.call is Call.BROADCAST_RESET
        other_half = request.half not in (None, self.half) and self.address != 0
        if not everybody and (request.address != self.address or other_half):
            self._step(Event.FOREIGN)
            return None
        data = self.obey(request, time)
        unanswered = Event.SILENT if request.call.rule.answer is None else Event.UNKNOWN
        event = Event.OWN if data != NONE else unanswered
        return Response(data, request.call) if self._step(event) is Action.ANSWER else None

    def rest(self, time: float) -> None:
        """Let the time pass up to `time` [s]: the watchdog may reset the slave meanwhile."""
        if time > self._expires:
            self.trips.append(self._expires)
            self._settle()

    def exchange(self, outputs: int, time: float) -> int:
        """Carry out *data exchange*.

        Parameters
        ----------
        outputs : int
            What the request carries, 0..15.
        time : float
            When [s].

        Returns
        -------
        int
            Inputs, and the outputs where the ports are such; -1 while the slave waits for
            parameters after a reset.
        """
        if time > self._expires:
            self.rest(time)
        if not self.active:
            return NONE
        self.outputs = outputs
        self._expires = time + self.watchdog
        return self.inputs & self._in_mask | outputs & self._echo_mask

    def obey(self, request: Request, time: float) -> int:
        """Carry out a request that is meant for this slave.

        Parameters
        ----------
        request : Request
            The request as this slave reads it.
        time : float
            When [s].

        Returns
        -------
        int
            The four bits of the answer, 0..15, or -1 where it gives none.
        """
        if self.programming:
            return NONE
        return OBEY[request.call](self, request.data, time)

    def _write_parameter(self, data: int, time: float) -> int:
        if self.address == 0:
            return NONE
        self.rest(time)
        self.parameter = data
        self.active = True
        self._expires = time + self.watchdog
        return data

    def _stores(self, time: float) -> bool:
        return time < self._writing_until

    def _store(self, address: int, id1: int, answer: Answer, time: float) -> int:
        if self.address != 0 or self._stores(time):
            return NONE
        self.address, self.id1 = self._stored = address, id1
        self.kind = self._kind()
        self._writing_until = time + self.write_time
        return answer

    def _assign(self, data: int, time: float) -> int:
        return self._store(data, self.id1, Answer.DONE, time)

    def _write_id1(self, data: int, time: float) -> int:
        if self.profile.id2 is None or self.address != 0 or self._stores(time):
            return NONE
        # The address stays deleted, whatever the memory holds.
        self.id1 = data
        self.kind = self._kind()
        self._stored = (self._stored[0], data)
        self._writing_until = time + self.write_time
        return Answer.ERASED

    def _delete(self, data: int, time: float) -> int:
        if self.address == 0 or self._stores(time):
            return NONE
        self.address = 0
        self.active = False
        self._expires = _NEVER
        return Answer.ERASED

    def _reset(self, data: int, time: float) -> int:
        self._settle()
        return Answer.DONE

    def _broadcast(self, data: int, time: float) -> int:
        self._settle()
        return NONE

    def _program(self, data: int, time: float) -> int:
        if self.address == 0 and not self.locked:
            self._settle()
            self.programming = True
        return NONE


#: What each call does, in the order of `Call`; the data and the time are its arguments.
OBEY: tuple[Callable[[Slave, int, float], int], ...] = (
    Slave.exchange,
    Slave._write_parameter,
    Slave._assign,
    Slave._write_id1,
    Slave._delete,
    Slave._reset,
    lambda slave, data, time: slave.profile.io,
    lambda slave, data, time: slave.profile.id,
    lambda slave, data, time: NONE if slave.profile.id2 is None else slave.id1,
    lambda slave, data, time: NONE if slave.profile.id2 is None else slave.profile.id2,
    lambda slave, data, time: slave.status(time),
    Slave._broadcast,
    Slave._program,
)
