"""How fast a recorded line voltage is decoded, compared with real time and with a plain loop.

Memory is measured in a process that decodes a file of 1 GB.
"""

import subprocess
import sys
import tempfile
from functools import partial
from pathlib import Path

import numpy as np
from _timing import seconds
from scipy.signal import bilinear, lfilter

from shipnet.asi import Request
from shipnet.asi.capture import decode
from shipnet.asi.modulation import Modulation

RATE = 10e6
LOOPED = 0.02  # seconds of the recording that the loop decodes; its time is scaled up
BIT = 6e-6


def record(duration, rate):
    """Return the noisy voltage of a full bus [V], and one cycle's pairs of request and response."""
    step = 1 / rate
    words, one = [], []
    for address in range(1, 32):
        request = Request.data_exchange(address, address % 16)
        t = np.arange(round(156e-6 * rate)) * step
        words.append((request.bits, request.answer(7 * address % 16).bits))
        one.append(
            Modulation(words[-1][0]).current(t, start=0)
            + Modulation(words[-1][1]).current(t, start=17 * BIT)
        )
    current = np.concatenate(one)
    cycle = -lfilter(*bilinear([78.0 * 100e-6, 0], [100e-6, 78.0], rate), current)
    u = np.resize(cycle, round(duration * rate)) + 30
    u += 0.05 * np.random.default_rng(2024).normal(size=u.size)
    return u, words


def plain_decode(u, dt):
    """Decode sample by sample like a simple script, with a fixed threshold and a parity check."""
    mean = sum(u) / len(u)
    pulses, loud, sign, top, at = [], False, 0, 0.0, 0
    for k, sample in enumerate(u):
        v = sample - mean
        if abs(v) > 1.2:
            if not loud or (v > 0) != (sign > 0):
                if loud:
                    pulses.append((at * dt, sign))
                loud, sign, top, at = True, 1 if v > 0 else -1, 0.0, k
            if abs(v) > top:
                top, at = abs(v), k
        elif loud:
            pulses.append((at * dt, sign))
            loud = False
    telegrams, group = [], []
    for pulse in [*pulses, (float("inf"), 1)]:
        if group and pulse[0] - group[-1][0] > 10e-6:
            slots = {round((time - group[0][0]) / 3e-6) + 1: sign for time, sign in group}
            bits = "".join("01"[slots.get(k, 0) > 0] for k in range(1, max(slots) + 1, 2))
            if len(bits) in (7, 14) and bits[:-1].count("1") % 2 == 0:
                telegrams.append(bits)
            group = []
        group.append(pulse)
    return telegrams


DECODE = r"""
import re, sys
from pathlib import Path
from shipnet import asi
capture = asi.decode(sys.argv[1], sample_interval=float(sys.argv[2]))
# getrusage would report the memory of the parent process if that used more.
status = Path("/proc/self/status").read_text()
print(capture.telegrams, int(re.search(r"VmHWM:\s*(\d+)", status)[1]) / 1024)
"""


def memory(kind, rate):
    """Return the number of telegrams in a 1 GB file, and the peak memory for decoding it [MiB]."""
    u = (1000 * record(0.31, rate)[0]).astype(kind)
    length = 10**9 // u.itemsize
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "record.npy"
        with path.open("wb") as file:
            header = {"descr": u.dtype.str, "fortran_order": False, "shape": (length,)}
            np.lib.format.write_array_header_1_0(file, header)
            for left in range(length, 0, -len(u)):
                u[:left].tofile(file)
        command = [sys.executable, "-c", DECODE, str(path), repr(1 / rate)]
        said = subprocess.run(command, check=True, capture_output=True, text=True).stdout
    return map(float, said.split())


def main():
    u, words = record(1.0, RATE)
    capture = decode(u, 1 / RATE)
    table = capture.transactions
    part = u[: round(LOOPED * RATE)].tolist()
    looped = plain_decode(part, 1 / RATE)
    pairs = [bits for _, pair in zip(range(len(looped)), words * 99, strict=False) for bits in pair]
    assert looped[:-1] == pairs[: len(looped) - 1]
    assert capture.telegrams >= 2 * len(table) - 2

    ours = seconds(lambda: decode(u, 1 / RATE))
    loop = seconds(lambda: plain_decode(part, 1 / RATE)) / LOOPED
    print(f"1 s of a full bus at {RATE / 1e6:g} MS/s, {capture.telegrams} telegrams")
    print(f"{'':<24}{'time [s]':>10}{'x real time':>14}")
    for name, time in {"decode": ours, "plain loop": loop}.items():
        print(f"{name:<24}{time:>10.2f}{1 / time:>13.2f}x")
    print(f"decode is {loop / ours:.0f}x as fast as the loop")
    for rate in (1e6, 100e6):
        u, _ = record(0.5, rate)
        times = 0.5 / seconds(partial(decode, u, 1 / rate))
        print(f"decode at {rate / 1e6:g} MS/s: {times:.2f}x real time")
    for kind, rate in (("float64", 10e6), ("float32", 100e6), ("int16", 10e6)):
        telegrams, peak = memory(kind, rate)
        what = f"1 GB of {kind} at {rate / 1e6:g} MS/s, {telegrams:.0f} telegrams"
        print(f"{what}: peak memory {peak:.0f} MiB")


if __name__ == "__main__":
    main()
