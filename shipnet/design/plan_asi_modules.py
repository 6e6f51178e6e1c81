"""Which points share an AS-i module, where it stands, and how late the host knows of them."""

from __future__ import annotations

from math import ceil
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from shipnet.asi.profile import Profile
from shipnet.asi.timing import ADDRESSES, Transaction, cycle_time, response_time, transfer_time
from shipnet.design.drafting import Draft, Place, balanced, zones
from shipnet.design.settings import AsiLimits

#: A module of values takes an address of its own; its outputs and inputs have this profile.
_ANALOGUE = "S-7.3"

#: Digital modules by whether they have outputs and whether they may share their address. Four
#: outputs of an A/B slave come in two requests, as one bit of four selects the half.
_DIGITAL = {
    (False, False): "S-0.F",
    (True, False): "S-7.F",
    (False, True): "S-0.A",
    (True, True): "S-7.A.7",
}

#: Most points that are shared out among modules at once; the time grows with their cube.
_MOST = 400


class Module(NamedTuple):
    """A module with its points."""

    profile: str
    place: Place
    rows: npt.NDArray[np.intp]
    ports: list[str]

    @property
    def shares(self) -> bool:
        """Whether its profile lets it share an address."""
        return Profile.parse(self.profile).extended

    @property
    def analogue(self) -> bool:
        """Whether it transfers values."""
        return self.ports[0].startswith("A")

    @property
    def outputs(self) -> bool:
        """Whether it has outputs, which auxiliary power feeds."""
        return any("Q" in port for port in self.ports)

    def current(self, limits: AsiLimits) -> float:
        """Return what it draws from the line [A]."""
        return limits.current + limits.loop_current * len(self.ports) * self.analogue


def modules(
    draft: Draft, rows: npt.NDArray[np.intp], places: npt.NDArray[np.float64]
) -> list[Module]:
    """Return the modules of some points."""
    limits = draft.settings.asi
    kinds = np.array([draft.types[row] for row in rows], dtype=object)
    channels = _channels(draft, rows, kinds)
    found = []
    digital = np.flatnonzero(np.isin(kinds, ["DI", "DO"]) & (channels > 0))
    found += _grouped(
        digital, rows, places, kinds, ("DI", "DO"), (limits.inputs, limits.outputs), limits
    )
    for kind in ("AI", "AO"):
        for number in range(limits.channels, 0, -1):
            values = np.flatnonzero((kinds == kind) & (channels == number))
            found += _grouped(values, rows, places, kinds, (kind,), (number,), limits)
    return found


def analogue_response(channels: int, limits: AsiLimits, cycle: float | None = None) -> float:
    """Return how late the host knows of a value."""
    one = float(transfer_time(_ANALOGUE, float(cycle_time(ADDRESSES)) if cycle is None else cycle))
    late = limits.repetitions * Transaction().duration
    return (channels + 1) * one + late + channels * limits.conversion


def digital_response(
    cycle: float, paired: bool, profile: str, output: bool, limits: AsiLimits
) -> float:
    """Return how late a change of a state is known at the other end."""
    worst = float(response_time(cycle, paired=paired, repetitions=limits.repetitions).worst)
    if output and Profile.parse(profile).extended:
        whole = float(transfer_time(profile, cycle, paired=paired, direction="out"))
        return whole + worst - cycle * (2 if paired else 1)
    return worst


def _channels(
    draft: Draft, rows: npt.NDArray[np.intp], kinds: npt.NDArray[np.object_]
) -> npt.NDArray[np.intp]:
    """Return how many points of its kind a point's module may have; 0 if even one is too slow."""
    limits = draft.settings.asi
    need = draft.need[rows]
    channels = np.zeros(len(rows), dtype=np.intp)
    least = np.empty(len(rows))
    for kind, most in (("DI", limits.inputs), ("DO", limits.outputs)):
        output = kind == "DO"
        profile = _DIGITAL[output, limits.shared]
        alone = digital_response(float(cycle_time(1)), False, profile, output, limits)
        least[kinds == kind] = alone
        channels[(kinds == kind) & (need >= alone)] = most
    for kind in ("AI", "AO"):
        least[kinds == kind] = analogue_response(1, limits)
        for number in range(1, limits.channels + 1):
            quick = need >= analogue_response(number, limits)
            channels[(kinds == kind) & quick] = number
    for place in np.flatnonzero(channels == 0):
        tag, wanted, alone = draft.tags[rows[place]], 1e3 * need[place], 1e3 * least[place]
        text = (
            f"{tag} needs an update every {wanted:g} ms; with an AS-i module of its own it has a "
            f"response of {alone:.3g} ms"
        )
        draft.reason(tag, "update", float(alone), float(wanted), "ms", text)
    return channels


def _grouped(
    mine: npt.NDArray[np.intp],
    rows: npt.NDArray[np.intp],
    places: npt.NDArray[np.float64],
    kinds: npt.NDArray[np.object_],
    names: tuple[str, ...],
    ports: tuple[int, ...],
    limits: AsiLimits,
) -> list[Module]:
    found = []
    labels = zones(places[mine], reach=limits.reach, most=_MOST)
    for zone in range(labels.max(initial=-1) + 1):
        inside = mine[labels == zone]
        kind = np.array([names.index(str(name)) for name in kinds[inside]], dtype=np.intp)
        counts = np.bincount(kind, minlength=len(names))
        number = max(ceil(count / room) for count, room in zip(counts, ports, strict=True))
        groups = balanced(places[inside], number, kinds=kind, most=ports)
        for group in range(groups.max() + 1):
            own = inside[groups == group]
            found.append(_module(rows[own], places[own], kinds[own], limits))
    return found


def _module(
    rows: npt.NDArray[np.intp],
    places: npt.NDArray[np.float64],
    kinds: npt.NDArray[np.object_],
    limits: AsiLimits,
) -> Module:
    letters = {"DI": "I", "DO": "Q", "AI": "AI", "AO": "AQ"}
    seen: dict[str, int] = {}
    ports = []
    for kind in kinds:
        seen[kind] = seen.get(kind, 0) + 1
        ports.append(f"{letters[kind]}{seen[kind]}")
    x, y, z = (float(value) for value in np.median(places, axis=0))
    outputs = "DO" in seen
    profile = _ANALOGUE if kinds[0][0] == "A" else _DIGITAL[outputs, limits.shared]
    return Module(profile, (x, y, z), rows, ports)
