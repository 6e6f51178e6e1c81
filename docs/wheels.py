"""Fill build/wheels, from which shipnet and JupyterLab can be installed without a network.

    make wheels [SYSTEM=linux|windows|macos [PYTHON=3.12]]

The wheels have the versions in the lock file and are checked by hash. By default they are for the
system and the Python version that run this command. Only this command needs a network.
"""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
#: Platform tags of wheels for each system, newest first: 64-bit PCs, and Macs with Apple chips.
TAGS = {
    "linux": [*(f"manylinux_2_{n}_x86_64" for n in (28, 27, 24, 17, 12)), "manylinux2014_x86_64"],
    "windows": ["win_amd64"],
    "macos": [f"macosx_{n}_0_{chip}" for n in (14, 13, 12, 11) for chip in ("arm64", "universal2")],
}
README = """\
shipnet without a network, for {system} and Python {python}
{line}

In a terminal, in the folder that contains this folder "wheels":

    {python_command} -m venv course
    {bin}python -m pip install --no-index --find-links wheels "shipnet[notebooks]"
    {bin}shipnet copy lessons
    {bin}jupyter lab lessons/notebooks
"""


def here() -> str:
    """Return the name of this system."""
    return {"win32": "windows", "darwin": "macos"}.get(sys.platform, "linux")


def readme(system: str, python: str) -> str:
    """Return the instructions for installing from the folder."""
    windows = system == "windows"
    text = README.format(
        system=system,
        python=python,
        line="=" * len(f"shipnet without a network, for {system} and Python {python}"),
        python_command=f"py -{python}" if windows else f"python{python}",
        bin="course\\Scripts\\" if windows else "course/bin/",
    )
    return text.replace("\n", "\r\n") if windows else text


def commands(uv: str, folder: Path, system: str, python: str) -> list[list[str]]:
    """Return the commands that choose the versions, download the wheels and build shipnet's own."""
    listed = str(folder / "requirements.txt")
    tags = [part for tag in TAGS[system] for part in ("--platform", tag)]
    return [
        # Omit the overrides in pyproject.toml: pip ignores them when it installs the wheels.
        [
            *(uv, "pip", "compile", "--quiet", "--no-config", "--no-header", "--generate-hashes"),
            *("--extra", "notebooks", "--constraint", "requirements.lock"),
            *("--python-platform", system, "--python-version", python),
            *("--output-file", listed, "pyproject.toml"),
        ],
        [
            *(sys.executable, "-m", "pip", "download", "--quiet", "--disable-pip-version-check"),
            *("--require-hashes", "--no-deps", "--only-binary", ":all:", *tags),
            *("--python-version", python, "--dest", str(folder), "--requirement", listed),
        ],
        [sys.executable, "-m", "hatchling", "build", "-t", "wheel", "-d", str(folder)],
    ]


def main(uv: str, system: str = here(), python: str = "") -> int:
    """Fill the folder and return the exit code."""
    python = python or "{}.{}".format(*sys.version_info)
    folder = ROOT / "build" / "wheels"
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    for command in commands(uv, folder, system, python):
        done = subprocess.run(command, cwd=ROOT, stdout=subprocess.DEVNULL, check=False)
        if done.returncode:
            return done.returncode
    (folder / "README.txt").write_text(readme(system, python), encoding="utf-8", newline="")
    found = list(folder.glob("*.whl"))
    size = sum(file.stat().st_size for file in found) / 1e6
    print(f"build/wheels: {len(found)} wheels, {size:.0f} MB, for {system} and Python {python}")
    return 0


if __name__ == "__main__":
    if not 2 <= len(sys.argv) <= 4 or (len(sys.argv) > 2 and sys.argv[2] not in TAGS):
        sys.exit(__doc__)
    sys.exit(main(*sys.argv[1:]))
