"""How fast waveforms and transfer impedances of a tree are computed, compared with other programs.

The network is a trunk with 31 tees, each with a slave and a stub that ends at another slave; the
master and the power supply are at the beginning of the trunk: 62 slaves, 63 nodes, 99 m of cable.
ngspice (with the same error limit) and scikit-rf are measured only if they are installed.
"""

import shutil
import subprocess
import tempfile
from pathlib import Path

import numpy as np
from _timing import seconds
from scipy.interpolate import CubicSpline

from shipnet.asi.modulation import Modulation
from shipnet.asi.telegram import RESPONSES
from shipnet.line import Cable, CableRun, Load, Network
from shipnet.line.waveform import laplace_grid, synthesize

ERROR = 1e-5  # maximum error of every waveform, as a fraction of its peak
F_MAX = 6e6  # high enough for this error; the program prints the error reached
DURATION, START, SWING, HALF_BIT = 64e-6, 5e-6, 60e-3, 3e-6
DEVICE, SUPPLY = Load(r=13.5e3, l=13.5e-3, c=50e-12), Load(r=78.0, l=100e-6)
RESPONSE = [0, 0, 1, 1, 0, 0, 1]
SENDER = "stub 20"
STEPS = Modulation(RESPONSES).steps.astype(np.float32)


def tree(cable):
    runs, loads = [], {"master": SUPPLY + DEVICE}
    before = "master"
    for k in range(31):
        runs.append(CableRun(before, f"tee {k}", 2.2, cable))
        runs.append(CableRun(f"tee {k}", f"stub {k}", 1.0, cable))
        loads |= {f"tee {k}": DEVICE, f"stub {k}": DEVICE}
        before = f"tee {k}"
    return Network(runs, loads)


LOSSLESS = Cable.lossless(100.0, 6.5e-9)


def steps_of(bits):
    drawn = np.stack([bits, 1 - np.array(bits)], axis=-1).ravel()
    return np.diff(drawn, prepend=0)


def change_spectrum(s):
    x = s * HALF_BIT / 2
    pulse = -np.expm1(-2 * x) / (2 * x) / (1 + (x / np.pi) ** 2)
    return SWING * pulse / s * np.exp(-s * START)


def one_waveform(f_max=F_MAX, duration=DURATION, samples=1280):
    s = laplace_grid(duration, f_max)
    network = tree(LOSSLESS)
    z = network.transfer("master", s)[network.index(SENDER)]
    steps = steps_of(RESPONSE)
    code = steps @ np.exp(-np.outer(HALF_BIT * np.arange(len(steps)), s))
    return synthesize(-z * change_spectrum(s) * code, samples, duration)


def all_waveforms(samples, late=None, out=None):
    """Return the waveforms of a new tree: 62 slaves x 16 responses x samples.

    A caller may pass the arrays `late` (zeros at first) and `out`, to avoid allocating them anew.
    """
    # On a lossless cable, the voltage of a current step has faded after half of `DURATION`.
    s = laplace_grid(DURATION / 2, F_MAX, 4.0)
    network = tree(LOSSLESS)
    z = network.transfer("master", s)[1:]
    change = synthesize(z * -change_spectrum(s), samples // 2, DURATION / 2, 4.0)
    change = change.astype(np.float32)
    slot = round(HALF_BIT / DURATION * samples)
    if late is None:
        late = np.zeros((len(change), STEPS.shape[1], samples), dtype=np.float32)
    for j in range(STEPS.shape[1]):
        late[:, j, j * slot : j * slot + samples // 2] = change[:, : samples - j * slot]
    return np.matmul(STEPS, late, out=out)


def deck(network, sender, step):
    """Return a network with a sender as an ngspice netlist; `step` is the longest time step [s]."""
    names = {name: name.replace(" ", "_") for name in network.nodes}
    lines = ["* 62 slaves", ".func cl(x) {min(max(x,0),1)}"]
    lines.append(f".func rho(x) {{cl(x)-sin({2 * np.pi!r}*cl(x))/{2 * np.pi!r}}}")
    for k, run in enumerate(network.runs):
        ends, delay = (names[run.a], names[run.b]), run.length * run.made_of.delay
        lines.append(f"T{k} {ends[0]} 0 {ends[1]} 0 Z0={run.made_of.z0!r} TD={delay!r}")
    for node, (g, per_henry, c) in zip(network.nodes, network.shunts()[:, :, 0].T, strict=True):
        for letter, value in (("R", 1 / g), ("L", 1 / per_henry), ("C", c)):
            if value:
                lines.append(f"{letter}_{names[node]} {names[node]} 0 {float(value)!r}")
    rises = "".join(
        f"{step:+d}*rho((time-{START + j * HALF_BIT!r})/{HALF_BIT!r})"
        for j, step in enumerate(steps_of(RESPONSE))
        if step
    )
    lines.append(f"Bsend {names[sender]} 0 I={SWING}*({rises})")
    lines += [
        ".options reltol=1e-5 abstol=1e-9 vntol=1e-7 method=trap",
        f".tran 50n {DURATION!r} 0 {step!r} uic",
        ".control", "run", "wrdata out.txt v(master)", "quit", ".endc", ".end",
    ]  # fmt: skip
    return "\n".join(lines) + "\n"


def ngspice(step):
    """Return the run time of ngspice [s], and the waveform at the master."""
    with tempfile.TemporaryDirectory() as folder:
        (Path(folder) / "tree.cir").write_text(deck(tree(LOSSLESS), SENDER, step))
        command = ["ngspice", "-b", "tree.cir"]
        time = seconds(
            lambda: subprocess.run(command, cwd=folder, check=True, capture_output=True), 3
        )
        t, v = np.loadtxt(Path(folder) / "out.txt", unpack=True)
    t, first = np.unique(t, return_index=True)
    return time, CubicSpline(t, v[first])(np.arange(1280) * DURATION / 1280)


def scikit_rf(skrf, f):
    """Return the transfer impedance between two ports, from `skrf.circuit.Circuit`."""
    frequency = skrf.Frequency.from_f(f, unit="hz")
    omega = 2 * np.pi * f
    z0 = 100.0
    media = skrf.media.DefinedGammaZ0(frequency, z0=z0, gamma=1j * omega * 6.5e-9)
    network = tree(LOSSLESS)
    joints = {node: [] for node in network.nodes}
    for k, run in enumerate(network.runs):
        piece = media.line(run.length, "m", name=f"line {k}")
        joints[run.a].append((piece, 0))
        joints[run.b].append((piece, 1))
    for node, (g, per_henry, c) in zip(network.nodes, network.shunts()[:, :, 0].T, strict=True):
        y = z0 * (g + per_henry / (1j * omega) + 1j * omega * c)
        reflection = ((1 - y) / (1 + y))[:, np.newaxis, np.newaxis]
        load = skrf.Network(frequency=frequency, s=reflection, z0=z0, name=f"load {node}")
        joints[node].append((load, 0))
    for name in ("master", SENDER):
        port = skrf.circuit.Circuit.Port(frequency, f"port {name}", z0=z0)
        joints[name].append((port, 0))
    return skrf.circuit.Circuit(list(joints.values())).network.z[:, 1, 0]


def report(what, time, peer=None, peer_time=None, note=""):
    ratio = (
        "" if peer_time is None else f"{peer_time / time:>8.1f}x  {peer} {peer_time * 1e3:.4g} ms"
    )
    print(f"{what:<48}{time * 1e3:>9.2f} ms{ratio}{note}")


def main():
    exact = one_waveform(40e6, 2 * DURATION, 2560)[:1280]
    peak = np.abs(exact).max()
    error = np.abs(one_waveform() - exact).max() / peak
    assert error <= ERROR, error
    sent = int("".join(map(str, RESPONSE[1:5])), 2)
    one_of_all = all_waveforms(1280)[tree(LOSSLESS).index(SENDER) - 1, sent]
    assert np.abs(one_of_all - exact).max() / peak <= ERROR
    print(f"62 slaves, error {error:.1e} of the peak at {F_MAX / 1e6:g} MHz; a new tree each time")

    single = seconds(one_waveform)
    sweep = seconds(lambda: tree(LOSSLESS).transfer("master", laplace_grid(DURATION, F_MAX)))
    late, out = np.zeros((62, 14, 256), np.float32), np.empty((62, 16, 256), np.float32)
    every = seconds(lambda: all_waveforms(256, late, out))
    assert (out == all_waveforms(256)).all()
    if shutil.which("ngspice"):
        time, wave = ngspice(5e-9)  # with steps above the shortest delay, 6.5 ns, it never ends
        theirs = np.abs(wave - exact).max() / peak
        assert theirs <= ERROR, theirs
        note = f" (error {theirs:.1e})"
        report("one sender, one waveform", single, "ngspice", time, note)
        report(
            "62 senders to the master, one telegram each", every, "ngspice, 62 such runs", 62 * time
        )
    else:
        report("one sender, one waveform", single, note="  (ngspice is not installed)")

    try:
        import skrf
    except ImportError:
        report("transfer, all 62", sweep, note="  (scikit-rf is not installed)")
    else:
        f = np.arange(1, round(F_MAX * DURATION) + 1) / DURATION
        network = tree(LOSSLESS)
        z = network.transfer("master", 2j * np.pi * f)[network.index(SENDER)]
        assert np.allclose(scikit_rf(skrf, f), z, rtol=1e-9)
        theirs = seconds(lambda: scikit_rf(skrf, f), 2)
        ours = seconds(lambda: tree(LOSSLESS).transfer("master", 2j * np.pi * f))
        report("transfer, all 62 (scikit-rf: one pair)", ours, "scikit-rf", theirs)

    report("62 slaves x 16 responses, 250 ns", every, note="   an AS-i cycle takes 10 ms")
    report("the same in new memory", seconds(lambda: all_waveforms(256)))
    report("62 slaves x 16 responses, 50 ns", seconds(lambda: all_waveforms(1280)))

    rng = np.random.default_rng(2024)
    r, l, c = (value * rng.uniform(0.9, 1.1, 100) for value in (0.06, 0.65e-6, 65e-12))  # noqa: E741
    for f_max in (3e6, F_MAX):
        s = laplace_grid(DURATION, f_max)
        batch = seconds(lambda s=s: tree(Cable(r, l, c)).transfer("master", s), 5)
        loop = seconds(
            lambda s=s: [tree(Cable(*k)).transfer("master", s) for k in zip(r, l, c, strict=True)],
            5,
        )
        report(f"Monte Carlo, 100 cables, {f_max / 1e6:g} MHz", batch, "loop", loop)


if __name__ == "__main__":
    main()
