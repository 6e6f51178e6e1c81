"""I/O lists for the tests of design: handwritten, random and large."""

import io

import numpy as np
import pandas as pd
from hypothesis import strategies as st

from shipnet.design.designs import Design
from shipnet.design.iolist import IoList
from shipnet.design.layout import Site, frame

SIGNALS = ("contact", "solenoid", "rtd_3wire", "current_loop", "contact_common", "analogue_output")


def cases(text):
    """Return the rows of a table with bars between cells, and a line or semicolon between rows."""
    return [row.split("|") for row in text.replace("\n", ";").split(";")]


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


def rows_of(table, text, **columns):
    """Return a table of a design: comma-separated rows below their titles, and equal columns."""
    rows = pd.read_csv(io.StringIO(text), keep_default_na=False)
    return frame(table, rows.assign(**columns))


def small_loop(*, redundant=False):
    """Return a small Modbus loop of two stations, with a second line if `redundant`."""
    iolist = IoList.parse(_SENSORS, "example")
    bus = {"segment": "loop 1", "bus": "Modbus RTU"}
    points = "tag,device,address\nPS-1,JB1,1/0\nTT-2,JB1,1/1\nTT-3,JB2,2/0\nLS-4,JB2,2/1"
    devices = "device,kind,segment,x_m\ncabinet,cabinet,,0\nmaster,master,loop 1,0\n"
    devices += "JB1,station,loop 1,22.5\nJB2,station,loop 1,42.5"
    runs = "run,a,b,route_m,at_cabinet,line\n" + "".join(
        f"trunk 1{line},master,JB1,45,True,{line}\ntrunk 2{line},JB1,JB2,26,False,{line}\n"
        for line in (("A", "B") if redundant else ("",))
    )
    drops = "run,a,b,used\ndrop PS-1,JB1,PS-1,2\ndrop TT-2,JB1,TT-2,3\ndrop TT-3,JB2,TT-3,3\n"
    drops += "drop LS-4,JB2,LS-4,2"
    unknown = dict.fromkeys(("bus_time", "capacity_used"), float("nan"))
    return Design(
        "example, redundant" if redundant else "example",
        iolist,
        Site((0.0, 0.0, 4.0)),
        points=rows_of("points", points, response_ms=180.0, fits=True, **bus),
        devices=rows_of("devices", devices, y_m=0.0, z_m=4.0),
        cables=pd.concat(
            [
                rows_of(
                    "cables",
                    runs,
                    cable="RS485_MARINE",
                    kind="trunk",
                    used=2,
                    conductors=2,
                    segment="loop 1",
                    length_m=[45.0, 26.0] * (1 + redundant),
                ),
                rows_of(
                    "cables",
                    drops,
                    cable="MI2P075",
                    kind="drop",
                    conductors=4,
                    route_m=4.0,
                    length_m=10.0,
                    at_cabinet=False,
                    line="",
                    segment="loop 1",
                ),
            ]
        ),
        segments=rows_of(
            "segments",
            "points,devices,length_m,response_ms,slowest_update_ms\n4,2,71,180,500",
            **bus,
            **unknown,
        ),
        reasons=frame("reasons"),
    )
