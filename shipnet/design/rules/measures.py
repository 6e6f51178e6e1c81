"""What can be computed of a planned network for a rule: times, losses, lines, standards."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import numpy.typing as npt

from shipnet.design.rules.cuts import single_cuts
from shipnet.engine.class_rules import STANDARDS as DATA_LINKS
from shipnet.engine.error_detection import undetected

if TYPE_CHECKING:
    import pandas as pd

    from shipnet.design.network import Network

__all__ = ["APPLIES", "LEFT_OUT", "MEASURES", "STANDARDS", "Facts", "Measure", "Outcome"]

Bools = npt.NDArray[np.bool_]

#: Buses with an open international standard or public specification, and the CRC they have.
STANDARDS: Mapping[str, tuple[str, str | None]] = {**DATA_LINKS, "AS-i": ("IEC 62026-2", None)}

#: What the list wants within so long is fast [ms]: the shortest time that class rules name, 0.1 s
#: in DNV-OS-D202 Ch.2 Sec.3 Table A1.
FAST_MS = 100.0


#: The measure that counts the points that are left out; all others know nothing of these.
LEFT_OUT = "unconnected points"


class Outcome(NamedTuple):
    """What a measure came to.

    Attributes
    ----------
    computed : float
        NaN if nothing could be computed.
    subject : str
        Where the worst value is: point, segment, run, device.
    why : str
        What it is made of, or why there is none.
    partial : bool
        Whether some points have no value: then it may be worse.
    """

    computed: float
    subject: str = ""
    why: str = ""
    partial: bool = False


#: Which points a rule is for, by name.
APPLIES: Mapping[str, Callable[[pd.DataFrame], pd.Series[bool]]] = {
    "all": lambda points: points["type"] != "",
    "inputs": lambda points: points["type"].isin(["DI", "AI"]),
    "outputs": lambda points: points["type"].isin(["DO", "AO"]),
    "fast": lambda points: points["update_ms"] <= FAST_MS,
    "fast outputs": lambda points: (
        points["type"].isin(["DO", "AO"]) & (points["update_ms"] <= FAST_MS)
    ),
    "essential": lambda points: points["category"] != "I",
    "category III": lambda points: points["category"] == "III",
}


@dataclass(frozen=True, eq=False)
class Facts:
    """A network with what several measures need of it.

    Parameters
    ----------
    network : Network
        What was planned.
    host_time : float
        From the host's having a value to its being shown or sounded [s].
    given_cuts : pandas.DataFrame, optional
        Every single failure, if it is known already.

    Examples
    --------
    >>> from shipnet.design.example import example
    >>> Facts(example(), 0.5).links["bus"].tolist()
    ['Modbus RTU']
    """

    network: Network
    host_time: float
    given_cuts: pd.DataFrame | None = None

    @cached_property
    def cuts(self) -> pd.DataFrame:
        """Every single failure."""
        return single_cuts(self.network) if self.given_cuts is None else self.given_cuts

    @cached_property
    def links(self) -> pd.DataFrame:
        """The segments that are data links."""
        segments = self.network.segments
        return segments[segments["bus"].isin(["AS-i", "CAN", "Modbus RTU"])]

    def left_out(self, concerned: Bools) -> int:
        """Return how many of the points concerned fit nowhere.

        Parameters
        ----------
        concerned : ndarray of bool, shape (n_points,)
            Points.
        """
        return int((concerned & ~self.network.points["fits"].to_numpy(bool)).sum())

    def concerned(self, applies: str) -> Bools:
        """Return which points are concerned.

        Parameters
        ----------
        applies : str
            One of `APPLIES`.
        """
        return APPLIES[applies](self.network.iolist.points).to_numpy(bool)


class Measure(NamedTuple):
    """Something that can be computed.

    Attributes
    ----------
    unit : str
        Of the computed value.
    meaning : str
        What it is.
    compute : callable
        Takes the facts, the points concerned and whether the host counts.
    """

    unit: str
    meaning: str
    compute: Callable[[Facts, Bools, bool], Outcome]


_NAN = float("nan")


def _response(facts: Facts, concerned: Bools, host: bool) -> Outcome:
    points = facts.network.points[concerned]
    if points.empty:
        return Outcome(_NAN, why="the list has no such point")
    # Nothing lies between a hardwired point and its host.
    times = points["response_ms"].where(points["bus"] != "hardwired", 0.0) / 1e3
    known = times.dropna()
    missing = len(times) - len(known)
    if known.empty:
        return Outcome(_NAN, why=f"none of {missing} points has a response time")
    added = facts.host_time if host else 0.0
    worst: Any = known.idxmax()
    parts = [f"{known[worst]:.3g} s to the host"]
    parts += [f"{added:g} s in the host, assumed"] if host else []
    parts += [f"{missing} points have no response time"] if missing else []
    where: Any = points.loc[worst, "segment"] or points.loc[worst, "tag"]
    return Outcome(float(known[worst] + added), str(where), "; ".join(parts), missing > 0)


def _late(facts: Facts, concerned: Bools, host: bool) -> Outcome:
    points = facts.network.points
    needs = facts.network.iolist.points["update_ms"]
    late = concerned & (points["response_ms"] > needs).to_numpy()
    first = str(points["tag"].to_numpy()[late][0]) if late.any() else ""
    return Outcome(int(late.sum()), first, "response longer than the list's update time")


def _unconnected(facts: Facts, concerned: Bools, host: bool) -> Outcome:
    out = concerned & ~facts.network.points["fits"].to_numpy()
    first = str(facts.network.points["tag"].to_numpy()[out][0]) if out.any() else ""
    return Outcome(int(out.sum()), first, "see the reasons of the plan" if first else "")


def _lost(
    failures: tuple[str, ...], kinds: tuple[str, ...] | None, none: str
) -> Callable[[Facts, Bools, bool], Outcome]:
    def compute(facts: Facts, concerned: Bools, host: bool) -> Outcome:
        rows = facts.cuts[facts.cuts["failure"].isin(failures)]
        rows = rows[rows["kind"].isin(kinds)] if kinds else rows[rows["kind"] != "cabinet"]
        if rows.empty:
            return Outcome(_NAN, why=none)
        if not concerned.any():
            return Outcome(_NAN, why="the list has no such point")
        counts = rows["points_lost"]
        if not concerned.all():
            mine = set(facts.network.points["tag"].to_numpy()[concerned])
            counts = rows["tags"].map(lambda tags: len(mine.intersection(tags)))
        worst: Any = counts.idxmax()
        return Outcome(
            int(counts[worst]), str(rows.loc[worst, "failed"]), f"worst of {len(rows)} failures"
        )

    return compute


def _systems(facts: Facts, concerned: Bools, host: bool) -> Outcome:
    cuts = facts.cuts
    if facts.links.empty:
        return Outcome(0, why="no data link")
    rows = cuts[
        cuts["failure"].isin(["cut", "short"])
        & cuts["kind"].isin(["trunk", "feeder"])
        & cuts["segment"].isin(facts.links["segment"])
    ]
    if rows.empty:
        return Outcome(_NAN, why="the links have no cable of their own")
    if not concerned.any():
        return Outcome(_NAN, why="the list has no such point")
    points = facts.network.iolist.points[concerned]
    system = dict(zip(points["tag"], points["system"], strict=True))
    found = rows["tags"].map(lambda tags: sorted({system[tag] for tag in tags if system.get(tag)}))
    unnamed = {tag for tags in rows["tags"] for tag in tags if system.get(tag) == ""}
    worst: Any = found.map(len).idxmax()
    parts = [f"a cut costs points of {', '.join(found[worst])}"] if found[worst] else []
    if unnamed:
        s = "s" if len(unnamed) > 1 else ""
        parts.append(f"the list names no system for {len(unnamed)} point{s} that a cut costs")
    why = "; ".join(parts) or "none is lost"
    return Outcome(len(found[worst]), str(rows.loc[worst, "failed"]), why, bool(unnamed))


def _lines(facts: Facts, concerned: Bools, host: bool) -> Outcome:
    trunk = facts.network.runs[facts.network.runs["kind"] == "trunk"]
    trunk = trunk[trunk["segment"].isin(facts.links["segment"])]
    if trunk.empty:
        return Outcome(_NAN, why="no data link")
    lines = trunk.groupby("segment", sort=False)["line"].nunique()
    return Outcome(int(lines.min()), str(lines.idxmin()), "the fewest of any segment")


def _switch_over(facts: Facts, concerned: Bools, host: bool) -> Outcome:
    own = set(facts.network.points.loc[concerned, "segment"])
    links = facts.links[facts.links["segment"].isin(own)]
    if links.empty:
        return Outcome(_NAN, why="no data link has such a point")
    trunk = facts.network.runs[facts.network.runs["line"] != ""]
    single = links.loc[~links["segment"].isin(trunk["segment"]), "segment"]
    if len(single):
        return Outcome(float("inf"), str(single.iloc[0]), "has no second line to switch to")
    gaps = links.set_index("segment").get("switch_over_ms")
    if gaps is None or gaps.isna().any():
        return Outcome(_NAN, why="how a second line takes over is not in the plan")
    return Outcome(gaps.max() / 1e3, str(gaps.idxmax()), "longest silence when a line breaks")


def _change_over(facts: Facts, concerned: Bools, host: bool) -> Outcome:
    lost = _LOST_BY_A_SUPPLY(facts, concerned, host)
    if lost.computed != lost.computed:
        return lost
    if lost.computed:
        return Outcome(float("inf"), lost.subject, "has no other supply beside it")
    return Outcome(0.0, "", "two supplies feed at once, so that none has to take over")


def _shared(facts: Facts, concerned: Bools, host: bool) -> Outcome:
    trunk = facts.network.runs[facts.network.runs["kind"] == "trunk"]
    pairs = trunk[trunk["line"] != ""]
    if pairs.empty:
        return Outcome(_NAN, why="no link has two lines")
    if not pairs["way"].map(len).any():
        return Outcome(_NAN, why="no trays are given: how the lines run is not known")
    on = pairs[["segment", "line", "way"]].explode("way").dropna().drop_duplicates()
    twice = on[on.duplicated(["segment", "way"])]
    names = ", ".join(dict.fromkeys(twice["way"]))
    return Outcome(twice["way"].nunique(), names, "trays with both lines of a segment")


def _buses(facts: Facts) -> list[str]:
    return sorted(set(facts.links["bus"]))


def _standard(facts: Facts, concerned: Bools, host: bool) -> Outcome:
    without = [bus for bus in _buses(facts) if bus not in STANDARDS]
    known = [f"{bus}: {STANDARDS[bus][0]}" for bus in _buses(facts) if bus in STANDARDS]
    return Outcome(len(without), ", ".join(without), "; ".join(known) or "no data link")


def _unseen(facts: Facts, concerned: Bools, host: bool) -> Outcome:
    if facts.links.empty:
        return Outcome(_NAN, why="no data link")
    checks = {bus: STANDARDS[bus][1] for bus in _buses(facts)}
    without = [bus for bus, check in checks.items() if check is None]
    if without:
        return Outcome(float("inf"), ", ".join(without), "has no CRC")
    missed = sum(undetected(check, flips=n) for check in checks.values() if check for n in (1, 2))
    return Outcome(missed, "", ", ".join(check for check in checks.values() if check))


def _repeats(facts: Facts, concerned: Bools, host: bool) -> Outcome:
    if facts.links.empty:
        return Outcome(_NAN, why="no data link")
    asked = [bus for bus in _buses(facts) if bus != "CAN"]
    if asked:
        return Outcome(_NAN, why=f"how often the master of {asked[0]} asks again is not in a plan")
    return Outcome(float("inf"), "", "CAN repeats by itself")


_PARTS = ("module", "station", "box")
_LOST_BY_A_SUPPLY = _lost(("device",), ("supply", "auxiliary supply"), "no supply is planned")

#: What can be computed, by the name that a rule uses.
MEASURES: Mapping[str, Measure] = {
    "response": Measure("s", "longest time from a change to the host, and in it", _response),
    "late points": Measure("points", "points slower than the list wants them", _late),
    LEFT_OUT: Measure("points", "points that fit nowhere", _unconnected),
    "points lost by a cable": Measure(
        "points", "lost by the worst cut or short", _lost(("cut", "short"), None, "no cable")
    ),
    "points lost by a tray": Measure(
        "points", "lost by the worst tray", _lost(("tray",), None, "no trays are given")
    ),
    "points lost by a station": Measure(
        "points", "lost by the worst station, module or box",
        _lost(("device",), _PARTS, "no station, module or box"),
    ),
    "points lost by a supply": Measure("points", "lost by the worst supply", _LOST_BY_A_SUPPLY),
    "supply change-over": Measure("s", "until another supply feeds", _change_over),
    "switch-over": Measure(
        "s", "longest silence of a point until its second line takes over", _switch_over
    ),
    "points lost by a device": Measure(
        "points", "lost by the worst device but the cabinet",
        _lost(("device",), None, "no device but the cabinet"),
    ),
    "systems on one link": Measure("systems", "hit by the worst failure of a link", _systems),
    "lines of a link": Measure("lines", "lines of the link that has the fewest", _lines),
    "trays shared by two lines": Measure("trays", "trays that hold both lines of a link", _shared),
    "links without a standard": Measure("links", "buses without an open standard", _standard),
    "bit errors unseen": Measure("patterns", "wrong bits, one or two, that a CRC misses", _unseen),
    "repeats": Measure("repeats", "how often a message that was lost is sent again", _repeats),
}  # fmt: skip
