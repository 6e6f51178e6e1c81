"""Draw the floors of the package, with the imports between packages as they are in the code.

    python docs/floors.py        write docs/_static/floors.svg

Floors are the layers of the first import contract in pyproject.toml. An arrow means that code of
one package imports the other when it is loaded, or inside a function.
"""

from __future__ import annotations

import ast
import tomllib
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
PICTURE = ROOT / "docs" / "_static" / "floors.svg"
#: Places from left to right where even spacing would draw an arrow through a box.
PLACES = {"design": 0.43, "engine": 0.15, "ballast": 0.73, "remote_control": 0.9, "modbus": 0.8,
          "can": 0.43, "fuzzy": 0.66}  # fmt: skip
COLOURS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#56b4e9", "#e69f00", "#555555")


def floors(root: Path = ROOT) -> list[list[str]]:
    """Return the packages and modules of each floor, the highest first; the ground is one floor."""
    contracts = tomllib.loads((root / "pyproject.toml").read_text("utf-8"))["tool"]["importlinter"]
    layers = contracts["contracts"][0]["layers"]
    named = [[name.strip().removeprefix("shipnet.") for name in row.split("|")] for row in layers]
    packages = [row for row in named if any((root / "shipnet" / name).is_dir() for name in row)]
    above = named[: named.index(packages[0])]
    ground = [name for row in named[len(above) :] for name in row]
    ground = [name for name in ground if not (root / "shipnet" / name).is_dir()]
    return [*above, *([n for n in row if n not in ground] for row in packages), ground]


def imports(root: Path = ROOT) -> set[tuple[str, str]]:
    """Return every (importing, imported) pair of packages, the ground left out."""
    rooms = {name for row in floors(root)[:-1] for name in row}
    found = set()
    for path in (root / "shipnet").rglob("*.py"):
        own = path.relative_to(root / "shipnet").parts[0].removesuffix(".py")
        for node in ast.walk(ast.parse(path.read_bytes())):
            names = []
            if isinstance(node, ast.ImportFrom) and node.module and not node.level:
                names = [node.module, *(f"{node.module}.{alias.name}" for alias in node.names)]
            elif isinstance(node, ast.Import):
                names = [alias.name for alias in node.names]
            for name in names:
                first, _, rest = name.partition(".")
                if first == "shipnet" and rest.split(".")[0] in rooms:
                    found.add((own, rest.split(".")[0]))
    return {(one, other) for one, other in found if one in rooms and one != other}


def draw(root: Path = ROOT, picture: Path = PICTURE) -> None:
    """Write the picture; the two top floors may use every other, so they have no arrows."""
    import matplotlib
    import matplotlib.pyplot as plt

    matplotlib.rcParams.update({"svg.hashsalt": "floors", "font.size": 11})
    rows = floors(root)
    bands = ["command", "recomputes, shows, asks", "a whole ship", "one system", "one bus",
             "cables, rules", "ground"]  # fmt: skip
    fig, ax = plt.subplots(figsize=(8, 6.2))
    places: dict[str, tuple[float, float]] = {}
    patches = {}
    for level, row in enumerate(reversed(rows)):
        ax.axhspan(level - 0.4, level + 0.4, color="#f4f4f4" if level else "#e4e4e4", zorder=0)
        ax.text(-0.01, level, bands[-1 - level], ha="right", va="center", color="#555555")
        if level == 0:
            half = (len(row) + 1) // 2
            names = ", ".join(row[:half]) + ",\n" + ", ".join(row[half:])
            ax.text(0.5, 0, names, ha="center", va="center", fontsize=9.5)
            continue
        for k, name in enumerate(row):
            places[name] = (PLACES.get(name, (k + 0.5) / len(row)), float(level))
            box = {"boxstyle": "round,pad=0.4", "facecolor": "white", "edgecolor": "#333333"}
            text = ax.text(*places[name], name, ha="center", va="center", bbox=box, zorder=3)
            patches[name] = text.get_bbox_patch()
    ax.set(xlim=(0, 1), ylim=(-0.5, len(rows) - 0.5))
    ax.axis("off")
    fig.canvas.draw()  # only then do the boxes have their sizes
    top = {name for row in rows[:2] for name in row}
    for one, other in sorted(imports(root)):
        if one in top:
            continue
        colour = COLOURS[sorted(places).index(one) % len(COLOURS)]
        style = {"arrowstyle": "-|>", "color": colour, "lw": 1.4, "shrinkA": 0, "shrinkB": 0}
        style |= {"patchA": patches[one], "patchB": patches[other]}
        ax.annotate("", places[other], places[one], arrowprops=style, zorder=4)
    pairs = " ".join(f"{one}>{other}" for one, other in sorted(imports(root)))
    more = {"Date": None, "Description": pairs} if picture.suffix == ".svg" else None
    fig.savefig(picture, metadata=more, bbox_inches="tight")


if __name__ == "__main__":
    draw()
