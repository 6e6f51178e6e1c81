"""Host commands, which a master carries out with one request per cycle in its management phase.

`simulate` accepts pairs (time [s], command); `Run.commands` reports the outcomes.
"""

from __future__ import annotations

from shipnet.asi.master import (
    CommandFailed,
    Lists,
    Task,
    activate,
    check_bits,
    half_of,
    identify,
    move,
)
from shipnet.asi.slave import slave_key
from shipnet.asi.telegram import Call, Request
from shipnet.errors import ArgumentError
from shipnet.fields import check_fields, record, text, whole

__all__ = ["ChangeAddress", "ReadCodes", "ResetSlave", "WriteParameter"]
__dir__ = __all__.copy


def _detected(lists: Lists, slave: str) -> int:
    """Return the key of a slave; raise CommandFailed if the slave is not in the LDS."""
    if slave not in lists.lds:
        raise CommandFailed(f"slave {slave} is not in the LDS")
    return slave_key(slave)[0]


@record
class ChangeAddress:
    """Change the label of a slave: delete its address, then assign the new one.

    Notes
    -----
    The command fails if the new label is taken, or if the LDS contains another slave at address 0,
    because both slaves at address 0 would then receive the new address.

    References
    ----------
    .. [1] R. G. Kim, Y. H. Cho, K. H. Hyun, "AS-Interface protocol utilization for smart ships",
       J. Soc. Nav. Archit. Korea 60(6), 2023, section 3.4.

    Examples
    --------
    >>> ChangeAddress("5", "6")
    ChangeAddress(old='5', new='6')
    """

    old: str = text('Label of the slave, "0" for a new slave')
    new: str = text("New label")

    def __post_init__(self) -> None:
        check_fields(self)
        slave_key(self.old, "old")
        if slave_key(self.new, "new")[0] < 2 or self.new == self.old:
            raise ArgumentError(f"new is {self.new!r}; it must be 1..31, and not {self.old!r}")

    def run(self, lists: Lists) -> Task[str]:
        """Yield the requests, and return the outcome in words."""
        old, (new, half) = _detected(lists, self.old), slave_key(self.new)
        identity = lists.detected[old]
        if identity.profile.extended != (half is not None):
            raise CommandFailed(
                f"label {self.new} does not fit the profile of slave {self.old}, {identity.profile}"
            )
        neighbour = lists.detected.get(new ^ 1)
        alone = neighbour is None or (neighbour.profile.extended and identity.profile.extended)
        if new in lists.detected or (old >> 1 != new >> 1 and not alone):
            raise CommandFailed(f"address {self.new} is taken")
        if old:
            if 0 in lists.detected:
                raise CommandFailed("the LDS contains another slave at address 0")
            # If the slave keeps its address, the inclusion phase finds it again.
            lists.forget(old)
            yield Request(Call.DELETE_ADDRESS, old >> 1, half=half_of(old, identity.profile))
            # The response may be lost although the address was deleted, so check address 0.
            identity_there = yield from identify(0)
            if identity_there is None or identity_there.profile != identity.profile:
                raise CommandFailed(f"slave {self.old} did not delete its address")
            lists.note(0, identity_there)
        if not (yield from move(lists, self.new)):
            raise CommandFailed(f"slave {self.old} was not found at address {self.new}")
        yield from activate(lists, new)
        return f"slave {self.old} is now slave {self.new}"


@record
class _OfSlave:
    """Base class of commands to one slave."""

    slave: str = text("Label of the slave")

    def __post_init__(self) -> None:
        check_fields(self)
        slave_key(self.slave)


@record
class ReadCodes(_OfSlave):
    """Read the profile and ID code 1 of a slave, which need not be in any list.

    Examples
    --------
    >>> ReadCodes("5A").slave
    '5A'
    """

    def run(self, lists: Lists) -> Task[str]:
        """Yield the requests, and return the outcome in words."""
        identity_there = yield from identify(slave_key(self.slave)[0])
        if identity_there is None:
            raise CommandFailed(f"slave {self.slave} does not return its codes")
        id1 = f"ID1 {identity_there.id1:X}" if identity_there.id1 >= 0 else "no ID1"
        return f"slave {self.slave} is {identity_there.profile}, {id1}"


@record
class WriteParameter(_OfSlave):
    """Set the parameter bits of a slave that is in the LDS, now and at each later activation.

    Examples
    --------
    >>> WriteParameter("5A", 3)
    WriteParameter(slave='5A', value=3)
    """

    value: int = whole(0, 15, help="Parameter bits; 0..7 for an A/B slave")

    def __post_init__(self) -> None:
        check_fields(self)
        check_bits("parameter", self.slave, self.value)

    def run(self, lists: Lists) -> Task[str]:
        """Yield the request, and return the outcome in words."""
        key = _detected(lists, self.slave)
        lists.parameters[self.slave] = self.value
        echo = yield Request(Call.WRITE_PARAMETER, key >> 1, self.value, slave_key(self.slave)[1])
        if echo < 0:
            raise CommandFailed(f"slave {self.slave} does not respond")
        return f"slave {self.slave} echoes {echo:X}"


@record
class ResetSlave(_OfSlave):
    """Reset a slave that is in the LDS and activate it again.

    Examples
    --------
    >>> ResetSlave("5").slave
    '5'
    """

    def run(self, lists: Lists) -> Task[str]:
        """Yield the requests, and return the outcome in words."""
        key = _detected(lists, self.slave)
        reply = yield Request(Call.RESET, key >> 1, half=half_of(key, lists.detected[key].profile))
        if reply < 0:
            raise CommandFailed(f"slave {self.slave} does not respond")
        active = key in lists.detected and (yield from activate(lists, key))
        return f"slave {self.slave} was reset and is {'active' if active else 'not active'}"
