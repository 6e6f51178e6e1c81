"""Feed hostile bytes to every reader and decoder: `make fuzz`, ten minutes on two cores.

    python tests/fuzz/run.py [--seconds 600] [targets ...]

Atheris guides the bytes by the code that they reach. A target fails if it raises what is no
refusal, takes more than 5 s, or more than 1 GB beyond what it starts with. The bytes that did it
are kept in build/fuzz/, and `python tests/fuzz/run.py --try FILE TARGET` runs them again.
"""

from __future__ import annotations

import argparse
import os
import re
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import NamedTuple

FOLDER = Path("build/fuzz")
SECONDS, MEGABYTES, LONGEST = 5, 1400, 65536


class Result(NamedTuple):
    """What one target took and how it ended."""

    name: str
    inputs: int
    failure: str

    def __str__(self) -> str:
        return f"{self.inputs:10,d}  {self.name:24} {self.failure or 'no failure'}"


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
        try:
            target.run(data)
        except REFUSALS:
            pass

    atheris.Setup([sys.argv[0], *os.environ["FUZZ_OPTIONS"].split(), str(corpus)], one)
    atheris.Fuzz()


def _slug(name: str) -> str:
    return re.sub(r"[^a-z0-9.]+", "-", name.lower())


def spawn(name: str, seconds: int) -> Result:
    """Fuzz one target in a process of its own, and read its last words."""
    options = (
        f"-max_total_time={seconds} -timeout={SECONDS} -rss_limit_mb={MEGABYTES}"
        f" -max_len={LONGEST} -print_final_stats=1 -artifact_prefix={FOLDER}/{_slug(name)}-"
    )
    done = subprocess.run(
        [sys.executable, __file__, "--target", name],
        check=False,
        env=os.environ | {"FUZZ_OPTIONS": options},
        capture_output=True,
        text=True,
        errors="replace",
    )
    said = done.stderr + done.stdout
    count = re.search(r"stat::number_of_executed_units:\s*(\d+)", said)
    failure = ""
    if done.returncode:
        wanted = re.findall(r"^[\w.]*(?:Error|Exception)\b.*|^.*ERROR: .*", said, re.M)
        failure = "; ".join(line.strip()[:200] for line in wanted[:2]) or said[-300:]
    return Result(name, int(count[1]) if count else 0, failure)


def main() -> int:
    """Fuzz all targets or some, and return 1 if any failed."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--seconds", type=int, default=600, help="for all targets, on all cores")
    parser.add_argument("--target", help=argparse.SUPPRESS)
    parser.add_argument("--try", dest="again", type=Path, metavar="FILE", help="run one input")
    parser.add_argument("targets", nargs="*")
    given = parser.parse_args()
    if given.target:
        fuzz(given.target)
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
