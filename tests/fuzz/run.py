"""Feed hostile bytes to every reader and decoder: `make fuzz`, half an hour on two cores.

    python tests/fuzz/run.py [--seconds 600] [targets ...]

Each target first gets the large inputs of `large.py`; the report shows the largest exponent of time
against length. Then Atheris guides the bytes by the code that they reach. A target fails if it
raises what is not a refusal, takes more than 5 s of processor time, or more than 500 MB (1.4 GB
with the instruments of the fuzzer). The bytes that did it are kept in build/fuzz/, and
`python tests/fuzz/run.py --try FILE TARGET` runs them again.
"""

from __future__ import annotations

import argparse
import os
import re
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import NamedTuple

FOLDER = Path("build/fuzz")
#: Limits for one input; libFuzzer counts the seconds of the wall, so it only ends what hangs.
SECONDS, HANGS, MEGABYTES = 5, 60, 1400
#: Longest input that is guided [byte].
LONGEST = 65536


class Result(NamedTuple):
    """What one target took and how it ended."""

    name: str
    inputs: int
    exponent: str
    failure: str

    def __str__(self) -> str:
        growth = f"time ~ n^{self.exponent:4}"
        return f"{self.inputs:10,d}  {self.name:24} {growth} {self.failure or 'no failure'}"


def fuzz(name: str) -> None:
    """Fuzz one target in this process until libFuzzer ends it."""
    import atheris

    with atheris.instrument_imports(include=["shipnet"]):
        from targets import REFUSALS, TARGETS
    target = TARGETS[name]
    corpus = FOLDER / _slug(name)
    corpus.mkdir(parents=True, exist_ok=True)
    for number, seed in enumerate(target.seeds()):
        (corpus / f"seed{number}").write_bytes(seed)

    def one(data: bytes) -> None:
        begin = time.process_time()
        try:
            target.run(data)
        except REFUSALS:
            pass
        check_time(len(data), begin)

    atheris.Setup([sys.argv[0], *os.environ["FUZZ_OPTIONS"].split(), str(corpus)], one)
    atheris.Fuzz()


def check_time(size: int, begin: float) -> None:
    """Raise if an input has taken too much processor time."""
    took = time.process_time() - begin
    if took > SECONDS:
        raise TimeoutError(f"an input of {size} bytes took {took:.1f} s")


def try_large(name: str) -> None:
    """Read large inputs, without the instruments of the fuzzer."""
    from large import costs

    tried = list(costs(name, FOLDER / f"{_slug(name)}-large"))
    print(f"exponent {max((one.exponent for one in tried), default=0):.1f}")
    if failed := [one for one in tried if one.failure]:
        raise MemoryError("; ".join(map(str, failed)))


def _slug(name: str) -> str:
    return re.sub(r"[^a-z0-9.]+", "-", name.lower())


def spawn(name: str, seconds: int) -> Result:
    """Fuzz one target in a process of its own, and read its last words."""
    options = (
        f"-max_total_time={seconds} -timeout={HANGS} -rss_limit_mb={MEGABYTES}"
        f" -max_len={LONGEST} -print_final_stats=1 -artifact_prefix={FOLDER}/{_slug(name)}-"
    )
    exponent = ""
    for what in ("--large", "--target"):
        done = subprocess.run(
            [sys.executable, __file__, what, name],
            check=False,
            env=os.environ | {"FUZZ_OPTIONS": options},
            capture_output=True,
            text=True,
            errors="replace",
        )
        if match := re.search(r"^exponent (.*)", done.stdout, re.M):
            exponent = match[1]
        if done.returncode:
            break
    said = done.stderr + done.stdout
    count = re.search(r"stat::number_of_executed_units:\s*(\d+)", said)
    failure = ""
    if done.returncode:
        wanted = re.findall(r"^[\w.]*(?:Error|Exception)\b.*|^.*ERROR: .*", said, re.M)
        failure = "; ".join(line.strip()[:200] for line in wanted[:2]) or said[-300:]
    return Result(name, int(count[1]) if count else 0, exponent or "?", failure)


def main() -> int:
    """Fuzz all targets or some, and return 1 if any failed."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--seconds", type=int, default=600, help="for all targets, on all cores")
    parser.add_argument("--target", help=argparse.SUPPRESS)
    parser.add_argument("--large", help=argparse.SUPPRESS)
    parser.add_argument("--try", dest="again", type=Path, metavar="FILE", help="run one input")
    parser.add_argument("targets", nargs="*")
    given = parser.parse_args()
    if given.target:
        fuzz(given.target)
    if given.large:
        try_large(given.large)
        return 0
    from targets import REFUSALS, TARGETS

    names = given.targets or list(TARGETS)
    if given.again:
        for name in names:
            try:
                print(TARGETS[name].run(given.again.read_bytes()))
            except REFUSALS as refusal:
                print(f"refused: {refusal}")
        return 0
    FOLDER.mkdir(parents=True, exist_ok=True)
    cores = os.cpu_count() or 1
    share = max(1, given.seconds * cores // len(names))
    failed, total = 0, 0
    with ThreadPoolExecutor(cores) as pool:
        for result in pool.map(lambda name: spawn(name, share), names):
            print(result, flush=True)
            failed += bool(result.failure)
            total += result.inputs
    print(f"{total:,} inputs, {failed} of {len(names)} targets failed")
    return int(failed > 0)


if __name__ == "__main__":
    sys.exit(main())
