"""I/O lists for the tests of design: by hand, random, and large."""

import numpy as np
import pandas as pd
from hypothesis import strategies as st

from shipnet.design.iolist import IoList

SIGNALS = ("contact", "solenoid", "rtd_3wire", "current_loop", "contact_common", "analogue_output")


def table(rows):
    """A list of rows of signal, place and update need [ms]."""
    return IoList.from_table(
        pd.DataFrame(
            [
                {"tag": f"P{n}", "signal": signal, "x_m": x, "y_m": y, "z_m": z, "update_ms": need}
                for n, (signal, (x, y, z), need) in enumerate(rows)
            ]
        )
    )


def lists(most=14, needs=(5.0, 50.0, 200.0, 1000.0, 2000.0), span=120):
    """Random lists; half of the points crowd in two rooms, so that groups get full."""
    anywhere = st.tuples(st.integers(0, span), st.integers(-10, 10), st.integers(0, 10))
    rooms = st.sampled_from([(30, 5, 2), (span - 10, 0, 2)])
    place = st.one_of(anywhere, rooms, rooms)
    row = st.tuples(st.sampled_from(SIGNALS), place, st.sampled_from(needs))
    return st.lists(row, min_size=1, max_size=most).map(table)


def ship(n, seed=1):
    """A ship of so many points around n / 25 places."""
    rng = np.random.default_rng(seed)
    middles = rng.uniform([0, -12, 0], [180, 12, 16], (max(n // 25, 1), 3))
    places = middles[rng.integers(0, len(middles), n)] + rng.normal(0, [3, 2, 1], (n, 3))
    signals = rng.choice(SIGNALS[:4], n, p=[0.45, 0.2, 0.15, 0.2])
    needs = rng.choice([200.0, 500.0, 1000.0, 2000.0], n, p=[0.05, 0.2, 0.5, 0.25])
    return table(list(zip(signals, places.round(1).tolist(), needs, strict=True)))
