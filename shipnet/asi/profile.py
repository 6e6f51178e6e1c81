"""Profiles of slaves, their ports and their status bits."""

from __future__ import annotations

import re
from functools import lru_cache
from typing import Literal

from shipnet import style
from shipnet.errors import ArgumentError
from shipnet.fields import check_whole, record, whole
from shipnet.lazy import Axes, pd

Port = Literal["IN", "OUT", "I/O", "TRI"]

_PORTS: dict[str, Port] = {"I": "IN", "O": "OUT", "B": "I/O", "T": "TRI"}

# Ports D0..D3 for the codes 0..F, from OMRON CQM1-ARM21 manual W357 (1999), p. 63, and the
# SAP5S/SAP51 data sheet (2012), p. 39: I input, O output, B both, T no function.
_CODES = "IIII IIIO IIIB IIOO IIBB IOOO IBBB BBBB OOOO OOOI OOOB OOII OOBB OIII OBBB TTTT"

#: Functions of the ports D0..D3 for each I/O configuration code 0..15.
IO_CONFIGURATIONS: tuple[tuple[Port, ...], ...] = tuple(
    tuple(_PORTS[letter] for letter in code) for code in _CODES.split()
)

#: Meanings of the status bits S0..S3 of a slave, according to specification 2.1.
_STATUS = ("address or ID code still volatile", "periphery fault", "reserved", "memory read error")


def describe_io_configuration(code: int) -> str:
    """Return a description of the port functions for an I/O configuration code."""
    ports = IO_CONFIGURATIONS[check_whole("code", code, 0, 15)]
    return "no port has a function" if "TRI" in ports else f"ports D0..D3 {' '.join(ports)}"


def describe_status(status: int) -> str:
    """Return the meanings of the status bits S3..S0 that are set."""
    bits = check_whole("status", status, 0, 15)
    flags = [f"S{bit} {meaning}" for bit, meaning in enumerate(_STATUS) if bits >> bit & 1]
    return ", ".join(flags) or "no flag set"


@record(slots=True)
class Profile:
    """Profile of a slave, as printed on its nameplate: for example, ``S-7.A.E``.

    Examples
    --------
    >>> Profile.parse("S-7.A.E")
    Profile(io=7, id=10, id2=14)
    >>> Profile.parse("S-7.A.E").extended
    True
    >>> str(Profile(0, 0xF))
    'S-0.F'
    """

    io: int = whole(0, 15, help="I/O configuration code")
    id: int = whole(0, 15, help="ID code; 10, hexadecimal A, makes the slave an A/B slave")
    id2: int | None = whole(
        0, 15, help="Extended ID code 2; None before specification 2.1", default=None, optional=True
    )

    @property
    def extended(self) -> bool:
        """True for an A/B slave, whose ID code is A (hexadecimal)."""
        return self.id == 0xA

    @property
    def output_bits(self) -> int:
        """Number of output bits per request: 4, or 3 for an A/B slave, which needs a select bit."""
        return 3 if self.extended else 4

    def __str__(self) -> str:
        codes = [self.io, self.id] + ([] if self.id2 is None else [self.id2])
        return "S-" + ".".join(f"{code:X}" for code in codes)

    @classmethod
    @lru_cache(maxsize=256)
    def parse(cls, text: str | Profile) -> Profile:
        """Return the profile for a name such as ``S-7.A.E``; a `Profile` is returned unchanged."""
        if isinstance(text, Profile):
            return text
        match = re.fullmatch(r"[Ss]-([0-9A-Fa-f])\.([0-9A-Fa-f])(?:\.([0-9A-Fa-f]))?", text)
        if not match:
            raise ArgumentError(
                f"profile is {text!r}; it must look like 'S-7.A.E' or 'S-0.F', in hexadecimal"
            )
        return cls(*(int(code, 16) for code in match.groups() if code is not None))

    @property
    def ports(self) -> tuple[Port, ...]:
        """Functions of the ports D0..D3: ``"IN"``, ``"OUT"``, ``"I/O"``, or ``"TRI"`` for none."""
        return IO_CONFIGURATIONS[self.io]

    @classmethod
    def table(cls) -> pd.DataFrame:
        """Return the functions of D0..D3 for each I/O configuration code: kim2023's Table 7."""
        codes = pd.Index([f"{code:X}" for code in range(len(IO_CONFIGURATIONS))], name="code")
        return pd.DataFrame(IO_CONFIGURATIONS, index=codes, columns=["D0", "D1", "D2", "D3"])

    @classmethod
    @style.applied
    def plot_table(cls, ax: Axes | None = None) -> Axes:
        """Draw the ports of the 16 I/O configuration codes as a grid, one column per code."""
        ax = style.axes(ax, figsize=(6.4, 2))
        fields = {"IN": "address", "OUT": "information", "I/O": "parity", "TRI": "frame"}
        for code, ports in enumerate(IO_CONFIGURATIONS):
            for row, port in enumerate(ports):
                colour = style.FIELD[fields[port]]
                style.box(ax, code, row, 1, 1, facecolor=colour, edgecolor="white")
                ax.text(code + 0.5, row + 0.5, port, ha="center", va="center")
        codes = range(len(IO_CONFIGURATIONS))
        ax.set_xticks([code + 0.5 for code in codes], [f"{code:X}" for code in codes])
        ax.set_yticks([row + 0.5 for row in range(4)], [f"D{row}" for row in range(4)])
        ax.set(xlim=(0, len(codes)), ylim=(4, 0), ylabel="port")
        ax.set_xlabel("I/O configuration code [hexadecimal]")
        ax.grid(visible=False)
        ax.tick_params(length=0)
        ax.spines[:].set_visible(False)
        return ax
