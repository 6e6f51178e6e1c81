"""Break the code in every small way and see whether a test notices: `make mutants`, weekly.

    python tests/mutants/run.py [--left] [targets ...]

mutmut changes one operator, number, string or argument at a time and runs the tests that reach the
changed function. A mutant is killed when a test fails or never ends. A mutant that no test can
kill, because it behaves like the original, is listed in `equal.csv` with the reason; a lost
`strict=True` of a zip counts as equal without being listed. The run fails if fewer than 95 % of
the other mutants are killed, or if an entry of the list is out of date. What draws is left alone:
a picture is looked at.
`--left` prints the survivors that are not listed, in the form of the list.
"""

from __future__ import annotations

import argparse
import csv
import json
import os
import re
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).resolve().parents[2]
FOLDER = ROOT / "build" / "mutants"
LEAST = 0.95
STRICT = re.compile(r",\s*(strict=\w+)?(?=\))")
KILLED = ("killed", "timeout", "segfault", "caught by type check")


class Target(NamedTuple):
    """A module to break, the tests that should notice, and which of its functions."""

    module: str
    tests: list[str]
    functions: tuple[str, ...] = ("*",)


TARGETS = {
    "asi telegram": Target(
        "asi/telegram", ["asi/test_telegram.py", "papers/test_printed_tables.py"]
    ),
    "asi receiver": Target("asi/receiver", ["asi/test_receiver.py", "asi/test_eye.py"]),
    "modbus frame": Target("modbus/frame", ["modbus/test_frames.py"]),
    "can frame": Target(
        "can/frame", ["can/test_frame.py", "can/test_arbitration.py", "can/test_lengths.py"]
    ),
    "can response": Target(
        "can/response",
        ["can/test_response.py", "can/test_priorities.py", "can/test_offsets.py"],
        ("x_*", "*ǁ[!p]*"),
    ),
    "fuzzy samples": Target("fuzzy/firing", ["fuzzy/test_firing.py", "fuzzy/test_decision.py"]),
    "fuzzy firing": Target(
        "fuzzy/rules", ["fuzzy/test_firing.py"], ("*ǁfire__*", "*ǁ_membership__*")
    ),
    "membership": Target(
        "fuzzy/terms", ["fuzzy/test_terms.py"], ("*x_trapezoid__*", "*x_sloping__*")
    ),
    "ring buffer": Target("remote_control/ring_buffer", ["remote_control/test_receive_ring.py"]),
    "voltage drop": Target(
        "line/network", ["line/test_networks.py"], ("*operating_point*", "*x__drop__*")
    ),
}


class Mutant(NamedTuple):
    """One change of one function: the lines that it removes and adds."""

    module: str
    function: str
    before: str
    after: str

    @property
    def same_zip(self) -> bool:
        """Whether only the check of zip is gone that two sequences are as long as each other."""
        before, after = (STRICT.sub("", text) for text in (self.before, self.after))
        return before == after


class Result(NamedTuple):
    """What became of the mutants of a target."""

    name: str
    killed: int
    equal: int
    left: list[Mutant]
    stale: list[Mutant]

    @property
    def good(self) -> bool:
        """Whether enough mutants are killed and the list of equal ones is up to date."""
        return not self.stale and self.killed >= LEAST * (self.killed + len(self.left))

    def __str__(self) -> str:
        total = self.killed + self.equal + len(self.left)
        share = self.killed / max(1, self.killed + len(self.left))
        return (
            f"{self.name:14} {total:5} mutants  {self.killed:5} killed  {self.equal:3} equal  "
            f"{len(self.left):3} left  {share:6.1%}"
        )


def equal_mutants() -> set[Mutant]:
    """Return the mutants that behave like the original."""
    with (Path(__file__).parent / "equal.csv").open(newline="", encoding="utf-8") as file:
        return {Mutant(*row[:4]) for row in list(csv.reader(file))[1:]}


def prepare(name: str, target: Target) -> Path:
    """Return a folder with the package, the tests, and the settings of mutmut for a target."""
    place = FOLDER / name.replace(" ", "_")
    shutil.rmtree(place, ignore_errors=True)
    place.mkdir(parents=True)
    for part in ("shipnet", "tests", "data"):
        (place / part).symlink_to(ROOT / part)
    settings = (ROOT / "pyproject.toml").read_text(encoding="utf-8")
    tests = [f"tests/{test}" for test in target.tests]
    # pytest would refuse the settings of mutmut's own folder as unknown.
    settings = settings.replace('"--strict-config", ', "") + (
        "\n[tool.mutmut]\n"
        'source_paths = ["shipnet"]\n'
        f'only_mutate = ["shipnet/{target.module}.py"]\n'
        'also_copy = ["data"]\n'
        f"pytest_add_cli_args_test_selection = {tests}\n"
        'pytest_add_cli_args = ["-p", "no:cacheprovider", "-x", "-s"]\n'
    )
    (place / "pyproject.toml").write_text(settings, encoding="utf-8")
    return place


def python(place: Path, code: str, *arguments: str) -> str:
    """Run Python in a folder and return what it prints."""
    done = subprocess.run(
        [sys.executable, "-c", code, *arguments],
        cwd=place,
        check=False,
        capture_output=True,
        text=True,
        errors="replace",
    )
    if done.returncode:
        raise SystemExit(f"mutmut failed:\n{done.stdout[-3000:]}\n{done.stderr[-3000:]}")
    return done.stdout


def break_all(name: str, target: Target, children: int) -> Result:
    """Break one target in every way and count what becomes of the mutants."""
    place = prepare(name, target)
    package = f"shipnet.{target.module.replace('/', '.')}"
    chosen = [f"{package}.{function}" for function in target.functions]
    run = "from mutmut.__main__ import cli; cli()"
    python(place, run, "run", "--max-children", str(children), *chosen)
    listed = {mutant for mutant in equal_mutants() if mutant.module == target.module}
    killed, equal, left = 0, list[Mutant](), list[Mutant]()
    for status, mutant in results(place, target.module):
        if mutant and "plot" not in mutant.function:
            (equal if mutant in listed or mutant.same_zip else left).append(mutant)
        else:
            killed += status in KILLED
    return Result(name, killed, len(equal), left, sorted(listed.difference(equal)))


def results(place: Path, module: str) -> Iterator[tuple[str, Mutant | None]]:
    """Yield what became of each mutant, and what those that live change."""
    file = f"shipnet/{module}.py"
    for name, (status, change) in json.loads(python(place, _REPORT, file)).items():
        lines = change.splitlines()[3:]
        before, after = (
            " ".join(line[1:].strip() for line in lines if line.startswith(sign)) for sign in "-+"
        )
        function = re.sub(r"__mutmut_\d+$", "", name.rpartition(".")[2]).removeprefix("x")
        function = function.replace("ǁ", ".").strip("._")
        yield status, Mutant(module, function, before, after) if change else None


# In the folder of a target: the status of each mutant, and the difference of those that live.
_REPORT = """
import json, sys
from mutmut.mutation.data import SourceFileMutationData
from mutmut.mutation.diff_apply import get_diff_for_mutant
from mutmut.stats import status_by_exit_code

data = SourceFileMutationData(path=sys.argv[1])
data.load()
found = {name: status_by_exit_code[code] for name, code in data.exit_code_by_key.items()}
lives = {"survived", "no tests", "suspicious"}
print(json.dumps({
    name: (status, get_diff_for_mutant(name, path=sys.argv[1]) if status in lives else "")
    for name, status in found.items()
}))
"""


def main() -> int:
    """Break all targets or some, and return 1 if too much goes unnoticed."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--children", type=int, default=os.cpu_count() or 1)
    parser.add_argument("--left", action="store_true", help="print what is left")
    parser.add_argument("targets", nargs="*", help=", ".join(TARGETS))
    given = parser.parse_args()
    good = True
    for name in given.targets or TARGETS:
        result = break_all(name, TARGETS[name], given.children)
        print(result, flush=True)
        if given.left:
            csv.writer(sys.stdout).writerows(result.left)
        for mutant in result.stale:
            print(f"  equal.csv lists what is killed or gone: {', '.join(mutant)}")
        good &= result.good
    return int(not good)


if __name__ == "__main__":
    sys.exit(main())
