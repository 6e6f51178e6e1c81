"""Measure how third-party Modbus clients react to faults; write data/modbus_clients.csv.

    make clients                      or  python benchmarks/modbus_clients/run.py [UV]

In each run, a client polls our server on this machine; about a quarter of the responses are faulty,
all with the same kind of fault. Each poll reads a different address, so the response to any other
request contains wrong values. Most clients are installed under build/clients; if a client cannot be
installed, the program says so and keeps its rows of the table.
"""

from __future__ import annotations

import csv
import os
import re
import select
import shutil
import subprocess
import sys
import threading
from collections import Counter
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack, contextmanager
from importlib.metadata import version
from pathlib import Path
from queue import Empty, Queue
from typing import NamedTuple, get_args

from shipnet.modbus import SerialLine, Slave, WireFault, serve
from shipnet.modbus.wire import Name

HERE = Path(__file__).resolve().parent
ROOT = HERE.parents[1]
TABLE = ROOT / "data" / "modbus_clients.csv"
BUILD = ROOT / "build" / "clients"
POLLS, TIMEOUT, SHARE, SEED = 40, 1.0, 0.25, 2024
#: Durations of faults, as multiples of the time-out; a late response arrives during the next poll.
SECONDS = {"late": 1.5, "delay": 0.2, "gap": 0.2}
COLUMNS = (
    "client", "version", "defaults", "transport", "fault", "timeout_s", "polls", "right", "error",
    "wrong", "hang", "verdict",
)  # fmt: skip
OUTCOMES = COLUMNS[-5:-1]
BOTH = ("tcp", "rtu")


class Client(NamedTuple):
    """A client: its transports, its default settings, its version, and how to start it."""

    name: str
    kinds: tuple[str, ...]
    defaults: str
    version: str
    command: list[str | Path]
    variables: dict[str, str]


def values(address: int) -> tuple[int, int]:
    """Return the values of the register at an address and of the next register."""
    return 1000 + 7 * address, 1007 + 7 * address


def faults(kind: str) -> list[Name]:
    """Return the faults that a transport can have."""
    other = "wrong-crc" if kind == "tcp" else "wrong-transaction"
    return [name for name in get_args(Name) if name != other]


@contextmanager
def serial_pair() -> Iterator[list[str]]:
    """Yield the names of two pseudo-terminals that are connected to each other."""
    import tty

    with ExitStack() as stack:
        ends = []
        for _ in range(2):
            ends.append(os.openpty())
            for number in ends[-1]:
                stack.callback(os.close, number)
            tty.setraw(ends[-1][1])
        stop, stopper = os.pipe()
        stack.callback(os.close, stop)
        (first, one), (second, other) = ends

        def pump() -> None:
            while stop not in (ready := select.select([first, second, stop], [], [])[0]):
                for source in ready:
                    os.write(second if source == first else first, os.read(source, 1024))

        thread = threading.Thread(target=pump)
        thread.start()
        stack.callback(thread.join)
        stack.callback(os.close, stopper)
        yield [os.ttyname(one), os.ttyname(other)]


def measure(
    client: Client, kind: str, fault: Name, polls: int = POLLS, timeout: float = TIMEOUT
) -> Counter[str]:
    """Return how many of a client's polls have each outcome."""
    seconds = SECONDS[fault] * timeout if fault in SECONDS else None
    registers = [1000 + 7 * address for address in range(2 * polls + 2)]
    with ExitStack() as stack:
        options, place = {}, ""
        if kind == "rtu":
            ours, place = stack.enter_context(serial_pair())
            options = {"serial_port": ours, "line": SerialLine(19200, "8N1")}
        server = serve(
            {1: Slave(holding_registers=registers)},
            kind,  # type: ignore[arg-type]
            wire_faults=WireFault(fault, SHARE, seconds),
            rng=SEED,
            **options,
        )
        stack.enter_context(server)
        words = [*client.command, kind, place or server.port, polls, timeout]
        return _outcomes(list(map(str, words)), client.variables, polls, 20 * timeout + 30)


def _outcomes(
    words: list[str], variables: dict[str, str], polls: int, patience: float
) -> Counter[str]:
    """Run a client and judge its lines; if none comes for `patience` s, the rest count as hangs."""
    found = Counter(dict.fromkeys(OUTCOMES, 0))
    with subprocess.Popen(
        words, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True,
        env={**os.environ, **variables},
    ) as program:  # fmt: skip
        lines: Queue[str] = Queue()

        def listen() -> None:
            for line in program.stdout or ():
                lines.put(line)
            lines.put("")

        thread = threading.Thread(target=listen)
        thread.start()
        try:
            for k in range(polls):
                line = lines.get(timeout=patience)
                if not line:
                    raise OSError(f"{' '.join(words)}: ended after {k} polls")
                outcome, *read = line.split()
                if outcome == "ok":
                    outcome = "right" if read == [str(one) for one in values(2 * k)] else "wrong"
                found[outcome] += 1
        except Empty:
            found["hang"] += polls - k
        finally:
            program.kill()
            thread.join()
    return found


# Clients ---------------------------------------------------------------------------------------


class MissingError(Exception):
    """Something that a client needs is missing on this machine."""


def _run(*words: str | Path, **options: object) -> str:
    """Run a program and return what it prints."""
    try:
        done = subprocess.run(
            list(map(str, words)), check=True, text=True, stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT, **options,
        )  # type: ignore[call-overload]  # fmt: skip
    except FileNotFoundError:
        raise MissingError(f"{words[0]} is not installed") from None
    except subprocess.CalledProcessError as problem:
        last = problem.output.strip().splitlines()[-1:]
        raise MissingError(f"{words[0]} failed: {' '.join(last)}") from None
    return str(done.stdout)


def installed(name: str, kinds: tuple[str, ...], defaults: str) -> Client:
    """Return a client that is installed in the test environment."""
    command = [sys.executable, HERE / "ask.py", name]
    return Client(name, kinds, defaults, version(name), command, {})


def from_pypi(
    name: str, release: str, kinds: tuple[str, ...], defaults: str
) -> Callable[[str], Client]:
    def make(uv: str) -> Client:
        folder = BUILD / "python"
        _run(uv, "pip", "install", "--quiet", "--python", sys.executable, "--target", folder,
             f"{name}=={release}")  # fmt: skip
        word = re.sub("-", "_", name.lower())
        command = [sys.executable, HERE / "ask.py", word]
        return Client(name, kinds, defaults, release, command, {"PYTHONPATH": str(folder)})

    return make


def from_npm(name: str, release: str, defaults: str) -> Callable[[str], Client]:
    def make(uv: str) -> Client:
        folder = BUILD / "node"
        folder.mkdir(parents=True, exist_ok=True)
        _run("npm", "install", "--silent", "--no-audit", "--no-fund", "--prefix", folder,
             f"{name}@{release}", "serialport@13.0.0")  # fmt: skip
        shutil.copy(HERE / "ask.js", folder)
        command = ["node", folder / "ask.js", name]
        return Client(name, BOTH, defaults, release, command, {})

    return make


def libmodbus(uv: str) -> Client:
    release = _run("pkg-config", "--modversion", "libmodbus").strip()
    flags = _run("pkg-config", "--cflags", "--libs", "libmodbus").split()
    BUILD.mkdir(parents=True, exist_ok=True)
    _run("cc", HERE / "ask.c", "-o", BUILD / "ask", *flags)
    defaults = "time-out 0.5 s, no retries, no error recovery"
    return Client("libmodbus", BOTH, defaults, release, [BUILD / "ask"], {})


def mbpoll(uv: str) -> Client:
    _run("mbpoll", "-V")  # fails if mbpoll is missing; the version that it prints is wrong
    release = _run("dpkg-query", "--show", "--showformat", "${Version}", "mbpoll").partition("+")[0]
    defaults = "time-out 1 s, no retries; started anew for each poll"
    return Client(
        "mbpoll", BOTH, defaults, release, [sys.executable, HERE / "ask.py", "mbpoll"], {}
    )


def go(uv: str) -> Client:
    folder, name, release = BUILD / "go", "simonvetter/modbus", "1.6.4"
    folder.mkdir(parents=True, exist_ok=True)
    shutil.copy(HERE / "ask.go", folder)
    if not (folder / "go.mod").exists():
        _run("go", "mod", "init", "ask", cwd=folder)
    _run("go", "get", f"github.com/{name}@v{release}", cwd=folder)
    _run("go", "build", "-o", "ask", cwd=folder)
    defaults = "time-out 1 s (tcp), 0.3 s (rtu), no retries"
    return Client(name, BOTH, defaults, release, [folder / "ask"], {})


#: Clients that are part of the test environment, and clients that must be installed.
OWN = {
    "pymodbus": (BOTH, "time-out 3 s, 3 retries"),
    "minimalmodbus": (("rtu",), "time-out 0.05 s, no retries"),
}
OTHERS = {
    "umodbus": from_pypi("umodbus", "1.0.4", BOTH, "time-out of the user's socket, no retries"),
    "pyModbusTCP": from_pypi("pyModbusTCP", "0.3.1", ("tcp",), "time-out 30 s, no retries"),
    "modbus-tk": from_pypi(
        "modbus-tk", "1.1.5", BOTH, "time-out 5 s (tcp) or 3.5 characters (rtu); no retries"
    ),
    "libmodbus": libmodbus,
    "mbpoll": mbpoll,
    "modbus-serial": from_npm("modbus-serial", "8.0.25", "no time-out, no retries"),
    "jsmodbus": from_npm("jsmodbus", "5.0.0", "time-out 5 s, no retries"),
    "simonvetter/modbus": go,
}


def verdict(found: Counter[str]) -> str:
    """Return the worst outcome found."""
    worst = {"wrong": "wrong value accepted", "hang": "hang", "error": "error"}
    return next((said for outcome, said in worst.items() if found[outcome]), "right value")


def rows(client: Client, kind: str, fault: Name) -> dict[str, object]:
    """Return a row of the table."""
    found = measure(client, kind, fault)
    print(f"{client.name}, {kind}, {fault}: {dict(found)}", flush=True)
    described = {
        "client": client.name, "version": client.version, "defaults": client.defaults,
        "transport": kind, "fault": fault, "timeout_s": TIMEOUT, "polls": POLLS,
    }  # fmt: skip
    return {**described, **found, "verdict": verdict(found)}


def main(uv: str = "uv") -> int:
    """Measure every client that can be installed, and write the table."""
    clients, kept = [installed(name, *OWN[name]) for name in OWN], []
    for name, make in OTHERS.items():
        try:
            clients.append(make(uv))
        except MissingError as problem:
            kept.append(name)
            print(f"skipped: {name}: {problem}", flush=True)
    jobs = [(c, kind, fault) for c in clients for kind in c.kinds for fault in faults(kind)]
    with ThreadPoolExecutor(6) as pool:  # the threads mostly wait
        new: list[dict[str, object]] = list(pool.map(lambda job: rows(*job), jobs))
    if TABLE.exists():
        with TABLE.open(encoding="utf-8") as file:
            new += [row for row in csv.DictReader(file) if row["client"] in kept]
    order = [*OWN, *OTHERS]
    new.sort(key=lambda row: order.index(str(row["client"])))
    with TABLE.open("w", encoding="utf-8", newline="") as file:
        writer = csv.DictWriter(file, COLUMNS, lineterminator="\n")
        writer.writeheader()
        writer.writerows(new)
    print(f"written: {TABLE.relative_to(ROOT)}; {len(clients)} clients, {len(kept)} skipped")
    return 0


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
