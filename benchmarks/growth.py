"""How the time and memory of eight main jobs grow with their size, compared with other programs.

The program prints a table, and writes it with a figure to build/growth.html. Times are CPU seconds
on one core; memory is the peak that Python and numpy allocate.
"""

import os

# Run on one core; numpy reads these variables when it is imported.
os.environ["OMP_NUM_THREADS"] = os.environ["OPENBLAS_NUM_THREADS"] = "1"

import tracemalloc
from datetime import date
from functools import partial
from io import StringIO
from pathlib import Path
from time import process_time

import numpy as np
import pandas as pd
from asi_capture import RATE, plain_decode, record
from asi_receiver import BITS, DT, plain_receive
from can_response import message_set, plain
from design_scale import whole
from matplotlib.figure import Figure

from shipnet import asi, can
from shipnet.asi.capture import decode
from shipnet.asi.receiver import receive
from shipnet.ballast.plant import Command
from shipnet.ballast.trials import run_fleet
from shipnet.crc import MODBUS

PAGE = Path(__file__).parents[1] / "build" / "growth.html"


def receiver(n, loop=False):
    wave = asi.line(100, slaves=(5,)).waveform()
    u = np.resize(wave.u, (n, wave.u.shape[-1]))
    rows = u.tolist()
    if loop:
        return lambda: [plain_receive(row, True) for row in rows]
    return lambda: receive(u, DT, BITS)


def capture(n, loop=False):
    u, _ = record(n / 1000, RATE)
    return partial(plain_decode, u.tolist(), 1 / RATE) if loop else lambda: decode(u, 1 / RATE)


def tree(n):
    return lambda: asi.line(100, slaves=np.linspace(2, 100, n)).waveform()


def bus(n, loop=False):
    from can_bus import BIT_RATE, PERIODS_MS, peer

    messages = can.MessageSet(
        can.Message(f"m{k}", k, 8, ms / 1e3, offset=k * 0.293e-3, bits=110)
        for k, ms in enumerate(PERIODS_MS)
    )
    if loop:
        return lambda: peer(messages, n)
    return lambda: can.simulate(messages, BIT_RATE, until=float(n))


def response(n, loop=False):
    messages = message_set(n, 0.6, np.random.default_rng(n))
    return partial(plain, messages) if loop else lambda: can.response_times(messages, 250e3)


def checks(n, loop=False):
    from pymodbus.framer import FramerRTU

    rows = np.random.default_rng(n).integers(0, 256, (n, 6), dtype=np.uint8)
    frames = [row.tobytes() for row in rows] if loop else []
    return lambda: [FramerRTU.compute_CRC(frame) for frame in frames] if loop else MODBUS.of(rows)


def design(n):
    return lambda: whole(n)


def valves(n):
    plan = Command.random(n, until=7200, operations=2, group=min(n, 16), rng=1)
    return lambda: run_fleet(n, plan, until=7200, rng=1)


#: For each job: function, unit of size, our sizes, name of the peer program, and the peer's sizes.
JOBS = {
    "receive AS-i responses": (receiver, "telegrams", (1e3, 1e4, 1e5), "plain loop", (100, 1e3)),
    "decode a capture at 10 MS/s": (capture, "ms", (10, 100, 1000), "plain loop", (30, 100)),
    "waveforms of a new AS-i line": (tree, "slaves", (4, 16, 62), "", ()),
    "simulate a CAN bus": (bus, "s", (10, 100, 1000), "simpy", (3, 10)),
    "CAN response times": (response, "messages", (30, 100, 300), "plain loop", (30, 100)),
    "checksums of Modbus frames": (checks, "frames", (1e3, 1e4, 1e5), "pymodbus", (1e3, 1e4)),
    "plan and compare designs": (design, "points", (250, 1000, 4000), "", ()),
    "two hours of valves, diagnosed": (valves, "valves", (16, 64, 256), "", ()),
}


def measured(make, sizes, **options):
    """Return one row per size: size, shortest CPU time [s] and peak memory [MB]."""
    rows = []
    for size in sizes:
        job, times = make(int(size), **options), []
        while not times or (sum(times) < 0.2 and len(times) < 50):
            begin = process_time()
            job()
            times.append(process_time() - begin)
        tracemalloc.start()
        job()
        rows.append((size, min(times), tracemalloc.get_traced_memory()[1] / 1e6))
        tracemalloc.stop()
    return np.array(rows)


def power(rows, column):
    """Return the growth exponent between the last two sizes."""
    return float(np.diff(np.log(rows[-2:, column]))[0] / np.diff(np.log(rows[-2:, 0]))[0])


def main():
    figure = Figure(figsize=(11, 5.5), layout="constrained")
    axes, table = figure.subplots(2, 4).flat, []
    for ax, (name, (make, unit, sizes, peer, few)) in zip(axes, JOBS.items(), strict=True):
        make(int(sizes[0]))()  # first call: triggers lazy imports
        ours = measured(make, sizes)
        theirs = measured(make, few, loop=True) if peer else None
        row = {
            "job": name, "largest": f"{sizes[-1]:g} {unit}", "time [s]": ours[-1, 1],
            "time exponent": power(ours, 1), "memory [MB]": ours[-1, 2],
            "memory exponent": power(ours, 2), "peer": peer or "-",
        }  # fmt: skip
        if peer:
            # Our time at the peer's largest size, interpolated linearly on logarithmic scales.
            own = np.exp(np.interp(np.log(few[-1]), *np.log(ours[:, :2]).T))
            row["faster than peer"] = f"{theirs[-1, 1] / own:.1f}x"
        table.append(row)
        ax.loglog(*ours[:, :2].T, "o-", label="ours [s]")
        ax.loglog(ours[:, 0], ours[:, 2], "s:", color="0.6", label="memory [MB]")
        if peer:
            ax.loglog(*theirs[:, :2].T, "x--", label=f"{peer} [s]")
        ax.set_title(name, fontsize=9)
        ax.set_xlabel(f"{unit}; time ~ n^{power(ours, 1):.2f}", fontsize=8)
        ax.set_xticks(sizes, [f"{size:g}" for size in sizes])
        ax.minorticks_off()
        ax.legend(fontsize=7)
    drawn = StringIO()
    figure.savefig(drawn, format="svg")
    page = pd.DataFrame(table).fillna("-")
    title = f"How eight jobs grow, measured on {date.today()} in CPU seconds on one core"
    PAGE.parent.mkdir(exist_ok=True)
    svg = drawn.getvalue()
    PAGE.write_text(
        f"<!doctype html><meta charset=utf-8><title>How it grows</title><h1>{title}</h1>\n"
        f"{svg[svg.index('<svg') :]}\n{page.to_html(index=False, float_format='{:.3g}'.format)}",
        encoding="utf-8",
    )
    print(title)
    print(page.to_string(index=False, float_format="{:.3g}".format))
    print(f"written: {PAGE}")


if __name__ == "__main__":
    main()
