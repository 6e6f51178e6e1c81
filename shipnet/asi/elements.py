"""What an AS-i installation is made of: master, supply, cable, slaves, repeaters, terminators.

An element is a plain statement: which node of the cable it is clamped to and how it is set. What
master and slaves do while they run is kept by a simulation (`shipnet.asi.simulation`).
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import field
from functools import cache
from math import inf
from typing import TYPE_CHECKING, Literal

from shipnet.asi.cycle import ADDRESSES
from shipnet.asi.profile import Profile
from shipnet.asi.segment import DEVICE, POWER_SUPPLY
from shipnet.errors import ArgumentError
from shipnet.fields import check_whole, number, record, switch, whole
from shipnet.line.network import CableRun as CableRun
from shipnet.line.network import Load as Load
from shipnet.line.network import check_node

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes

Half = Literal["A", "B"]

#: Current of a slave unless it is given [A], from Schneider's AS-i help D-SA-0011271: 65 mA on
#: average. Masters and repeaters are assumed to draw the same.
CURRENT = 0.065

#: After this time without data or parameters a slave resets itself [s]: SAP5S/SAP51 data sheet
#: rev. 3.1, 2012, p. 47. The AS2702 (rev. C, 2001, p. 13) does it after 50 ms to 100 ms.
WATCHDOG = 94.2e-3

#: Longest time that a slave takes to store its address [s]: Siemens, "IE/AS-INTERFACE LINK PN IO",
#: manual, p. 169.
WRITE_TIME = 15e-3


# Labels ----------------------------------------------------------------------------------------


def slave_key(label: str) -> tuple[int, Half | None]:
    """Return the key of a label, twice the address plus 1 for a B slave, and its half."""
    found = _key_and_half(label) if isinstance(label, str) else None
    if found is None:
        raise ArgumentError(
            f"slave is {label!r}; it must be '1'..'31', with A or B behind it for an A/B slave, "
            "or '0'"
        )
    return found


@cache
def _key_and_half(label: str) -> tuple[int, Half | None] | None:
    found = re.fullmatch(r"([0-9]{1,2})([AB]?)", label)
    if not found or int(found[1]) > ADDRESSES or (found[1].strip("0") == "" and found[2]):
        return None
    half: Half | None = "A" if found[2] == "A" else "B" if found[2] == "B" else None
    return 2 * int(found[1]) + (half == "B"), half


def label_of(key: int, *, extended: bool) -> str:
    """Return the label of a slave by its key; an A/B slave with an address has A or B in it."""
    return f"{key >> 1}{'AB'[key & 1] if extended and key > 1 else ''}"


# Elements --------------------------------------------------------------------------------------


@record
class Master:
    """A master: how it deals with its slaves, and where it is.

    Parameters
    ----------
    projected : mapping of str to (Profile or str), optional
        The slaves that should be there: label and profile. Given, the master works in protected
        mode and activates these only; omitted, in configuration mode, and activates all.
    outputs : mapping of str to int, optional
        What each slave is sent, 0..15, or 0..7 for an A/B slave; all bits set if not named.
    parameters : mapping of str to int, optional
        Parameter bits of each slave, likewise.
    repetitions : int, default 1
        How often a failed request is sent again at once, 0..7.
    drop_after : int, default 3
        After so many failed data exchanges in a row, one per cycle, a slave is dropped, 1..1000.
    automatic_addressing : bool, default False
        Whether a new slave at address 0 takes the place of the only one missing, if its profile
        is the same; in protected mode only.
    status_poll : bool, default True
        Whether the management phase asks one slave after the other for its status while the
        host has no commands; it finds the periphery faults (LPF).
    readmit : bool, default True
        Whether the inclusion phase asks at the addresses of slaves that were dropped.
    monitors_supply : bool, default True
        Whether the master sees that the supply fails, stops, and starts again after it.
    node : str, default ""
        Where it is; needed in a plan.
    current : float, default 0.065
        What it draws from the line, 0..10 [A]; assumed to be that of a slave.

    Raises
    ------
    ArgumentError
        If a value is out of its range, or a label does not fit its profile.

    Notes
    -----
    Two tries in each of three cycles are the six tries after which an analyser counts a slave
    as lost [1]_. *Read I/O configuration* asks whether anybody is there: silence is not repeated,
    a faulty answer is. The operating phases are those of [2]_.

    References
    ----------
    .. [1] Siemens, "AS-Interface Analyser 3RK1904-3AB01", manual.
    .. [2] Beckhoff, "EL6201 AS-Interface master terminal", operating phases.

    Examples
    --------
    >>> Master({"1": "S-7.F.F"}, repetitions=2).protected
    True
    """

    projected: Mapping[str, Profile | str] | None = None
    outputs: Mapping[str, int] = field(default_factory=dict, kw_only=True)
    parameters: Mapping[str, int] = field(default_factory=dict, kw_only=True)
    repetitions: int = whole(0, 7, "", "Repetitions of a request", default=1, kw_only=True)
    drop_after: int = whole(1, 1000, "", "Failures until a drop", default=3, kw_only=True)
    automatic_addressing: bool = switch("Readdress a new slave", default=False, kw_only=True)
    status_poll: bool = switch("Ask for the status", default=True, kw_only=True)
    readmit: bool = switch("Ask for dropped slaves", default=True, kw_only=True)
    monitors_supply: bool = switch("Watch the supply", default=True, kw_only=True)
    node: str = field(default="", kw_only=True)
    current: float = number(0, 10, "A", "Current", default=CURRENT, kw_only=True)

    def __post_init__(self) -> None:
        """Check the labels and what belongs to them."""
        if self.node:
            check_node(self.node)
        projected = {}
        for label, given in (self.projected or {}).items():
            profile = given if isinstance(given, Profile) else Profile.parse(given)
            key, half = slave_key(label)
            if profile.extended != (half is not None) or key < 2:
                raise ArgumentError(
                    f"slave {label} is projected as {profile}; an A/B slave has A or B in its "
                    "label, a standard slave neither, and none has address 0"
                )
            projected[label] = profile
        if self.protected:
            object.__setattr__(self, "projected", projected)
        elif self.automatic_addressing:
            raise ArgumentError(
                "automatic_addressing is True, but without projected slaves none is missing"
            )
        for what, values in (("output", self.outputs), ("parameter", self.parameters)):
            checked = {label: check_bits(what, label, value) for label, value in values.items()}
            object.__setattr__(self, f"{what}s", checked)

    @property
    def protected(self) -> bool:
        """Whether the master activates the projected slaves only."""
        return self.projected is not None

    def __str__(self) -> str:
        """Name the master by its node."""
        return f"master at {self.node}" if self.node else "master"


def check_bits(what: str, label: str, value: int) -> int:
    """Return four output or parameter bits, three for an A/B slave, or raise."""
    return check_whole(f"{what} of slave {label}", value, 0, 7 if slave_key(label)[1] else 15)


@record
class Supply:
    """A power supply with its decoupling.

    Parameters
    ----------
    node : str
        Where it is.
    voltage : float, default 30
        Voltage, 1..60 [V].
    rating : float, default 8
        Most current that it delivers, 0.01..100 [A].
    load : shipnet.line.Load, optional
        What its decoupling loads the signal with; by default 39 ohm beside 50 uH in each wire.

    Raises
    ------
    ArgumentError
        If a value is out of its range.

    Examples
    --------
    >>> print(Supply("bridge", rating=4))
    supply at bridge
    """

    node: str
    voltage: float = number(1, 60, "V", "Voltage", default=30.0)
    rating: float = number(0.01, 100, "A", "Most current", default=8.0)
    load: Load = field(default=POWER_SUPPLY, kw_only=True)

    def __post_init__(self) -> None:
        """Check the node."""
        check_node(self.node)

    def __str__(self) -> str:
        """Name the supply by its node."""
        return f"supply at {self.node}"


@record
class Slave:
    """A slave: its address, what it is, and where it is.

    Parameters
    ----------
    label : str
        Its address, ``"1"`` to ``"31"`` with A or B behind it for an A/B slave; ``"0"`` for a
        new one.
    profile : Profile or str, optional
        What it is, such as ``"S-7.A.E"``. ID code A makes it an A/B slave; without an ID code 2
        it is one from before specification 2.1, which answers neither request for an extended
        ID code. If omitted, four inputs: ``S-0.A.F`` with a half in the label, else ``S-0.F.F``.
    node : str, default ""
        Where it is; needed in a plan.
    inputs : int, default 0
        What its input ports read, 0..15.
    current : float, default 0.065
        What it draws from the line, sensors included, 0..10 [A].
    id1 : int, optional
        Extended ID code 1, 0..15, or 0..7 for an A/B slave; all bits set if omitted.
    watchdog : float, default 94.2e-3
        Time without data or parameters after which it resets itself [s]; ``inf`` for none.
    write_time : float, default 15e-3
        How long it takes to store an address or an ID code 1 [s].
    locked : bool, default True
        Whether its maker closed the program mode.
    load : shipnet.line.Load, optional
        What it loads the cable with; by default the limits of a chip's data sheet.

    Raises
    ------
    ArgumentError
        If a value is out of its range.

    Examples
    --------
    >>> print(Slave("12B", node="hatch 3"))
    slave 12B at hatch 3
    >>> Slave("5").profile, Slave("5A").profile
    (Profile(io=0, id=15, id2=15), Profile(io=0, id=10, id2=15))

    What it makes of each telegram that it hears; an empty one is a pause:

    >>> from shipnet.asi.telegram import Request
    >>> request = Request.read_id(21).bits
    >>> heard = Slave("21", "S-3.F.F").listen([request, "", request])
    >>> heard["state"].tolist()
    ['asynchronous', 'receive', 'synchronous']
    >>> heard["answer"].tolist()
    ['silence', '', 'answer to read ID code: 1111 (F)']
    """

    label: str
    profile: Profile | str = ""
    node: str = field(default="", kw_only=True)
    inputs: int = whole(0, 15, "", "What the input ports read", default=0, kw_only=True)
    current: float = number(0, 10, "A", "Current", default=CURRENT, kw_only=True)
    id1: int | None = whole(0, 15, "", "ID code 1", default=None, optional=True, kw_only=True)
    watchdog: float = number(0, inf, "s", "Watchdog", default=WATCHDOG, kw_only=True)
    write_time: float = number(0, inf, "s", "Time to store", default=WRITE_TIME, kw_only=True)
    locked: bool = switch("Program mode closed", default=True, kw_only=True)
    load: Load = field(default=DEVICE, kw_only=True)

    def __post_init__(self) -> None:
        """Check label and profile."""
        half = slave_key(self.label)[1]
        profile = self.profile or ("S-0.A.F" if half else "S-0.F.F")
        if not isinstance(profile, Profile):
            object.__setattr__(self, "profile", Profile.parse(profile))
        if self.node:
            check_node(self.node)
        if self.id1 is not None and self.kind.extended:
            check_whole("id1", self.id1, 0, 7)

    @property
    def kind(self) -> Profile:
        """Its profile."""
        assert isinstance(self.profile, Profile)
        return self.profile

    @property
    def address(self) -> int:
        """Its address, 0..31."""
        return slave_key(self.label)[0] >> 1

    @property
    def half(self) -> Half | None:
        """Which half of the address is its own; None for a standard slave."""
        return slave_key(self.label)[1]

    def listen(self, telegrams: Iterable[str]) -> pd.DataFrame:
        """Return what the slave makes of telegrams that it hears one after the other.

        One row per telegram: `telegram`, the receive `state` after it, and the `answer` in words.
        An empty telegram is a pause, as it follows a response.
        """
        import pandas as pd

        from shipnet.asi.simulation.slave import RunningSlave

        running, rows = RunningSlave(self), []
        for bits in telegrams:
            if bits:
                answer = str(running.hear(bits) or "silence")
            else:
                running.pause()
                answer = ""
            rows.append((bits, running.state.value, answer))
        return pd.DataFrame(rows, columns=["telegram", "state", "answer"])

    @staticmethod
    def plot_states(ax: Axes | None = None) -> Axes:
        """Draw the receive states of any slave, and what leads from one to another."""
        from shipnet.asi.plot import plot_states

        return plot_states(ax=ax)

    def __str__(self) -> str:
        """Name the slave by address and node."""
        return f"slave {self.label} at {self.node}" if self.node else f"slave {self.label}"


@record
class Repeater:
    """A repeater: it couples two segments, and passes telegrams but no current.

    Parameters
    ----------
    a, b : str
        Its nodes, one in either segment; which of them lies toward the master follows from the
        plan.
    delay : float, default 6e-6
        Delay in one direction, 0..1e-3 [s]; the default is assumed.
    current : float, default 0.065
        What it draws from either segment, 0..10 [A]; assumed to be that of a slave.

    Raises
    ------
    ArgumentError
        If a value is out of its range.

    Notes
    -----
    No maker's figure for the delay was found, so it is one bit time: two such repeaters just fit
    the time-out of 10 bit times, three do not.

    Examples
    --------
    >>> print(Repeater("deck", "hold"))
    repeater deck | hold
    """

    a: str
    b: str
    delay: float = number(0, 1e-3, "s", "Delay in one direction", default=6e-6)
    current: float = number(0, 10, "A", "Current", default=CURRENT)

    def __post_init__(self) -> None:
        """Check the nodes."""
        check_node(self.a)
        check_node(self.b)

    def __str__(self) -> str:
        """Name the repeater by its nodes."""
        return f"repeater {self.a} | {self.b}"


@record
class Terminator:
    """A terminator or extension plug: a resistance that only the signal meets.

    Parameters
    ----------
    node : str
        Where it is.
    resistance : float, default 100
        Resistance, 1..1e6 [ohm]; the default is assumed, the wave impedance of the cable. A
        capacitor keeps the supply away from it.

    Raises
    ------
    ArgumentError
        If the resistance is out of range.

    Examples
    --------
    >>> print(Terminator("bow"))
    terminator at bow
    """

    node: str
    resistance: float = number(1, 1e6, "ohm", "Resistance", default=100.0)

    def __post_init__(self) -> None:
        """Check the node."""
        check_node(self.node)

    def __str__(self) -> str:
        """Name the terminator by its node."""
        return f"terminator at {self.node}"


#: What sits at one node.
Device = Master | Supply | Slave | Terminator

Element = CableRun | Device | Repeater
