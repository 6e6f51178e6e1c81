"""I/O lists for the tests of design: handwritten, random and large."""

import numpy as np
import pandas as pd
from hypothesis import strategies as st

from shipnet.design.designs import Design
from shipnet.design.iolist import IoList
from shipnet.design.layout import Site, frame

SIGNALS = ("contact", "solenoid", "rtd_3wire", "current_loop", "contact_common", "analogue_output")


def table(rows):
    """Return a list from rows of signal, place and update time [ms]."""
    return IoList.from_table(
        pd.DataFrame(
            [
                {"tag": f"P{n}", "signal": signal, "x_m": x, "y_m": y, "z_m": z, "update_ms": need}
                for n, (signal, (x, y, z), need) in enumerate(rows)
            ]
        )
    )


def lists(most=14, needs=(5.0, 50.0, 200.0, 1000.0, 2000.0), span=120):
    """Random lists; half of the points are in two rooms, so that groups become full."""
    anywhere = st.tuples(st.integers(0, span), st.integers(-10, 10), st.integers(0, 10))
    rooms = st.sampled_from([(30, 5, 2), (span - 10, 0, 2)])
    place = st.one_of(anywhere, rooms, rooms)
    row = st.tuples(st.sampled_from(SIGNALS), place, st.sampled_from(needs))
    return st.lists(row, min_size=1, max_size=most).map(table)


def ship(n, seed=1):
    """Return a ship with n points around n / 25 places."""
    rng = np.random.default_rng(seed)
    middles = rng.uniform([0, -12, 0], [180, 12, 16], (max(n // 25, 1), 3))
    places = middles[rng.integers(0, len(middles), n)] + rng.normal(0, [3, 2, 1], (n, 3))
    signals = rng.choice(SIGNALS[:4], n, p=[0.45, 0.2, 0.15, 0.2])
    needs = rng.choice([200.0, 500.0, 1000.0, 2000.0], n, p=[0.05, 0.2, 0.5, 0.25])
    return table(list(zip(signals, places.round(1).tolist(), needs, strict=True)))


_SENSORS = """\
tag,system,type,signal,conductors,x_m,y_m,z_m,update_ms,category,note
PS-1,Cooling,DI,contact,2,21,2,4,500,II,low pressure of cooling water
TT-2,Cooling,AI,rtd_3wire,3,24,2,4,1000,II,temperature of cooling water
TT-3,Fuel oil,AI,rtd_3wire,3,41,2,4,1000,II,temperature of fuel oil
LS-4,Bilge,DI,contact,2,44,2,2,1000,I,level in the bilge well
"""


def small_loop(*, redundant=False):
    """Return a small Modbus loop of two stations, with a second line if `redundant`."""
    iolist, nan = IoList.parse(_SENSORS, "example"), float("nan")
    tags = list(iolist.points["tag"])
    stations = ["JB1", "JB1", "JB2", "JB2"]
    places = {"cabinet": 0.0, "master": 0.0, "JB1": 22.5, "JB2": 42.5}
    kinds = ["cabinet", "master", "station", "station"]
    trunk = [
        {"run": f"trunk {n}{line}", "cable": "RS485_MARINE", "a": a, "b": b,
         "segment": "loop 1", "kind": "trunk", "route_m": metres, "length_m": metres,
         "used": 2, "conductors": 2, "at_cabinet": n == 1, "line": line}
        for line in (("A", "B") if redundant else ("",))
        for n, a, b, metres in ((1, "master", "JB1", 45.0), (2, "JB1", "JB2", 26.0))
    ]  # fmt: skip
    drops = [
        {"run": f"drop {tag}", "cable": "MI2P075", "a": station, "b": tag, "segment": "loop 1",
         "kind": "drop", "route_m": 4.0, "length_m": 10.0, "used": wires, "conductors": 4,
         "at_cabinet": False, "line": ""}
        for tag, station, wires in zip(tags, stations, iolist.points["conductors"], strict=True)
    ]  # fmt: skip
    return Design(
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
        cables=frame("cables", trunk + drops),
        segments=frame("segments", [{
            "segment": "loop 1", "bus": "Modbus RTU", "points": 4, "devices": 2,
            "length_m": 71.0, "bus_time": nan, "capacity_used": nan, "response_ms": 180.0,
            "slowest_update_ms": 500.0,
        }]),
        reasons=frame("reasons"),
    )  # fmt: skip
