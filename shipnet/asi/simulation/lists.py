"""The lists of a master: which slaves are projected, detected, active, and faulty.

Inside, a slave has a key, twice its address plus 1 for a B slave; the host sees labels.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import NamedTuple

from shipnet.asi.calls import Call
from shipnet.asi.profile import Profile
from shipnet.asi.simulation.orders import key_of, label_of, order
from shipnet.asi.telegram import Half
from shipnet.errors import ArgumentError
from shipnet.fields import check_whole

__all__ = ["Change", "Identity", "Lists", "Poll", "half_of"]


class Identity(NamedTuple):
    """What a slave says of itself: its profile, and extended ID code 1, or -1 without one."""

    profile: Profile
    id1: int


class Change(NamedTuple):
    """A slave enters or leaves one of the lists LDS, LAS and LPF at a time [s]."""

    time: float
    list: str
    slave: str
    present: bool


def half_of(key: int, profile: Profile) -> Half | None:
    """Return the half of a slave.

    Parameters
    ----------
    key : int
        Twice its address, plus 1 for a B slave.
    profile : Profile
        Its profile.

    Returns
    -------
    {"A", "B"} or None
        None for a standard slave, and for any slave at address 0.

    Examples
    --------
    >>> half_of(11, Profile.parse("S-7.A.E"))
    'B'
    """
    if not profile.extended or key < 2:
        return None
    return "B" if key & 1 else "A"


class Poll:
    """An active slave, with the order that carries its outputs.

    Parameters
    ----------
    key : int
        Its key.
    profile : Profile
        Its profile.
    outputs : int
        What it is sent first.

    Examples
    --------
    >>> print(Poll(11, Profile.parse("S-7.A.E"), 5).order.request)
    data exchange with slave 5B: outputs 101 (5)
    """

    __slots__ = ("_most", "half", "key", "order")

    def __init__(self, key: int, profile: Profile, outputs: int) -> None:
        self.key, self.half = key, half_of(key, profile)
        self._most = (1 << profile.output_bits) - 1
        self.set(outputs)

    def set(self, outputs: int) -> None:
        """Send other outputs from now on; an A/B slave takes the lower three bits."""
        self.order = order(Call.DATA_EXCHANGE, self.key >> 1, outputs & self._most, self.half)


class Lists:
    """LPS, LDS, LAS and LPF, and the data of the host.

    Parameters
    ----------
    projected : mapping of str to (Profile or str), optional
        Label and profile of each slave that should be there; None in configuration mode.
    outputs : mapping of str to int, optional
        What each slave is sent.
    parameters : mapping of str to int, optional
        Parameter bits of each slave.

    Attributes
    ----------
    clock : callable
        Tells the time [s] that changes are noted with.
    detected : dict of int to Identity
        The LDS by key.
    polls : dict of int to Poll
        The LAS by key.
    inputs : dict of int to int
        The last inputs of the active slaves by key.
    left : set of int
        Keys of slaves that were dropped and have not come back.
    schedule : tuple of two lists of Poll
        Who is polled in even and in odd cycles.
    changes : list of Change
        What entered and left the lists.

    Raises
    ------
    ArgumentError
        If a label, a profile or a value is not legal.

    References
    ----------
    .. [1] Beckhoff, "EL6201 AS-Interface master terminal", lists.

    Examples
    --------
    >>> lists = Lists({"5": "S-0.F"})
    >>> lists.note(10, Identity(Profile.parse("S-0.F"), -1))
    >>> lists.join(10, inputs=3)
    >>> lists.lds, lists.las, lists.config_ok
    (['5'], ['5'], True)
    """

    def __init__(
        self,
        projected: Mapping[str, Profile | str] | None = None,
        outputs: Mapping[str, int] | None = None,
        parameters: Mapping[str, int] | None = None,
    ) -> None:
        self.protected = projected is not None
        self.projected: dict[str, Profile] = {}
        for label, profile in (projected or {}).items():
            given = profile if isinstance(profile, Profile) else Profile.parse(profile)
            key, half = key_of(label)
            if given.extended != (half is not None) or key < 2:
                raise ArgumentError(
                    f"slave {label} is projected as {given}; an A/B slave has A or B in its "
                    "label, a standard slave neither, and none has address 0"
                )
            self.projected[label] = given
        self.clock: Callable[[], float] = lambda: 0.0
        self.changes: list[Change] = []
        self._outputs: dict[str, int] = {}
        self._parameters: dict[str, int] = {}
        self.clear()
        for label, value in (outputs or {}).items():
            self.set_output(label, value)
        for label, value in (parameters or {}).items():
            self.set_parameter(label, value)

    def clear(self) -> None:
        """Empty all lists but the LPS."""
        self.detected: dict[int, Identity] = {}
        self.polls: dict[int, Poll] = {}
        self.inputs: dict[int, int] = {}
        self.left: set[int] = set()
        self._periphery: set[int] = set()
        self._plan()

    @property
    def lps(self) -> list[str]:
        """Labels of the projected slaves."""
        return sorted(self.projected, key=lambda label: key_of(label)[0])

    @property
    def lds(self) -> list[str]:
        """Labels of the detected slaves."""
        return [self.label(key) for key in sorted(self.detected)]

    @property
    def las(self) -> list[str]:
        """Labels of the active slaves."""
        return [self.label(key) for key in sorted(self.polls)]

    @property
    def lpf(self) -> list[str]:
        """Labels of the slaves that report a periphery fault."""
        return [self.label(key) for key in sorted(self._periphery)]

    @property
    def config_ok(self) -> bool:
        """Whether exactly the projected slaves are there, with the projected profiles."""
        found = {self.label(key): identity.profile for key, identity in self.detected.items()}
        return found == self.projected and self.las == self.lps

    @property
    def input_image(self) -> dict[str, int]:
        """What the host reads: the last inputs of the active slaves, 0..15."""
        return {self.label(key): self.inputs[key] for key in sorted(self.polls)}

    def label(self, key: int) -> str:
        """Return the label of a slave by its key."""
        known = self.detected.get(key)
        return label_of(key, extended=known is not None and known.profile.extended)

    def set_output(self, slave: str, value: int) -> None:
        """Set what a slave is sent from now on.

        Parameters
        ----------
        slave : str
            Its label.
        value : int
            0..15; 0..7 for an A/B slave.
        """
        key, half = key_of(slave)
        self._outputs[slave] = check_whole(f"output of slave {slave}", value, 0, 7 if half else 15)
        if key in self.polls and self.label(key) == slave:
            self.polls[key].set(value)

    def set_parameter(self, slave: str, value: int) -> None:
        """Set the parameter that a slave gets when it is next activated; values as for outputs."""
        most = 7 if key_of(slave)[1] else 15
        self._parameters[slave] = check_whole(f"parameter of slave {slave}", value, 0, most)

    def parameter(self, key: int) -> int:
        """Return the parameter of a detected slave: as set, or all bits set."""
        all_set = (1 << self.detected[key].profile.output_bits) - 1
        return self._parameters.get(self.label(key), all_set) & all_set

    def wanted(self, key: int) -> bool:
        """Whether a detected slave is meant to be active."""
        profile = self.detected[key].profile
        return key > 1 and (not self.protected or self.projected.get(self.label(key)) == profile)

    def note(self, key: int, identity: Identity) -> None:
        """Enter a slave into the LDS."""
        if self.detected.get(key) != identity:
            if key in self.detected:
                self._change("LDS", key, False)
            self.detected[key] = identity
            self._change("LDS", key, True)

    def join(self, key: int, inputs: int) -> None:
        """Enter a detected slave into the LAS."""
        if key not in self.polls:
            self._change("LAS", key, True)
        outputs = self._outputs.get(self.label(key), 0xF)
        self.polls[key] = Poll(key, self.detected[key].profile, outputs)
        self.inputs[key] = inputs
        self.left.discard(key)
        self._plan()

    def periphery(self, key: int, faulty: bool) -> None:
        """Enter a slave into the LPF, or strike it off."""
        if faulty != (key in self._periphery):
            (self._periphery.add if faulty else self._periphery.discard)(key)
            self._change("LPF", key, faulty)

    def forget(self, key: int) -> None:
        """Strike a slave off LDS, LAS and LPF; the host reads nothing from it."""
        self.periphery(key, False)
        self.inputs.pop(key, None)
        if self.polls.pop(key, None):
            self._plan()
            self._change("LAS", key, False)
        if key in self.detected:
            self._change("LDS", key, False)
            del self.detected[key]

    def _plan(self) -> None:
        # Where both halves of an address are active, they take turns.
        both = {key >> 1 for key in self.polls if key & 1 and key - 1 in self.polls}
        self.schedule = (
            [p for k, p in sorted(self.polls.items()) if k >> 1 not in both or not k & 1],
            [p for k, p in sorted(self.polls.items()) if k >> 1 not in both or k & 1],
        )

    def _change(self, which: str, key: int, present: bool) -> None:
        self.changes.append(Change(self.clock(), which, self.label(key), present))
