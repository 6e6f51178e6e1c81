"""A network small enough to be followed by hand: four points, two stations, one Modbus loop."""

from __future__ import annotations

from shipnet.design.iolist import IoList, parse_iolist
from shipnet.design.network import Network, frame
from shipnet.design.site import Site

__all__ = ["example"]

_LIST = """\
tag,system,type,signal,conductors,x_m,y_m,z_m,update_ms,category,note
PS-1,Cooling,DI,contact,2,21,2,4,500,II,low pressure of cooling water
TT-2,Cooling,AI,rtd_3wire,3,24,2,4,1000,II,temperature of cooling water
TT-3,Fuel oil,AI,rtd_3wire,3,41,2,4,1000,II,temperature of fuel oil
LS-4,Bilge,DI,contact,2,44,2,2,1000,I,level in the bilge well
"""


def example(*, redundant: bool = False) -> Network:
    """Return two stations with two points each, on a Modbus loop from the cabinet.

    Parameters
    ----------
    redundant : bool, default False
        Whether a second line leads to each station, over other trays.

    Returns
    -------
    Network
        Runs named ``trunk 1``, ``trunk 2`` (with A and B behind if redundant) on the trays port and
        starboard, and a ``drop`` to each point.

    Examples
    --------
    >>> example(redundant=True)
    <Network 'example, redundant': 4 of 4 points fit, 8 cables, 182 m>
    """
    iolist: IoList = parse_iolist(_LIST, "example")
    tags = list(iolist.points["tag"])
    stations = ["JB1", "JB1", "JB2", "JB2"]
    places = {"cabinet": 0.0, "master": 0.0, "JB1": 22.5, "JB2": 42.5}
    kinds = ["cabinet", "master", "station", "station"]
    lines = {"A": "port", "B": "starboard"} if redundant else {"": "port"}
    trunk = [
        {"run": f"trunk {n}{line}", "cable": "RS485_MARINE", "a": a, "b": b, "segment": "loop 1",
         "kind": "trunk", "route_m": metres, "length_m": metres, "used": 2, "conductors": 2,
         "at_cabinet": n == 1, "line": line, "way": (tray,)}
        for line, tray in lines.items()
        for n, a, b, metres in ((1, "master", "JB1", 45.0), (2, "JB1", "JB2", 26.0))
    ]  # fmt: skip
    drops = [
        {"run": f"drop {tag}", "cable": "MI2P075", "a": station, "b": tag, "segment": "loop 1",
         "kind": "drop", "route_m": 4.0, "length_m": 10.0, "used": wires, "conductors": 4,
         "at_cabinet": False, "line": "", "way": ()}
        for tag, station, wires in zip(tags, stations, iolist.points["conductors"], strict=True)
    ]  # fmt: skip
    return Network(
        "example, redundant" if redundant else "example",
        iolist,
        Site((0.0, 0.0, 4.0)),
        points=frame("points", {
            "tag": tags, "bus": "Modbus RTU", "segment": "loop 1", "device": stations,
            "address": ["1/0", "1/1", "2/0", "2/1"], "response_ms": 180.0, "fits": True,
        }),
        devices=frame("devices", {
            "device": list(places), "kind": kinds, "segment": ["", *["loop 1"] * 3],
            "x_m": list(places.values()), "y_m": 0.0, "z_m": 4.0,
        }),
        runs=frame("runs", trunk + drops),
        segments=frame("segments", [{
            "segment": "loop 1", "bus": "Modbus RTU", "points": 4, "devices": 2,
            "length_m": 71.0, "load": 0.18, "response_ms": 180.0, "slowest_update_ms": 500.0,
        }]),
        reasons=frame("reasons"),
    )  # fmt: skip
