"""Draw the layers of the package and the imports between its packages, read from the code.

    python docs/layers.py        write docs/_static/layers.svg

The layers are those of the first import contract in pyproject.toml. An arrow from one package
to another means that the first imports the second, at module level or inside a function.
"""

from __future__ import annotations

import ast
import tomllib
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
PICTURE = ROOT / "docs" / "_static" / "layers.svg"
#: Horizontal positions of boxes that an arrow would cross if they were evenly spaced.
PLACES = {"design": 0.43, "engine": 0.15, "ballast": 0.73, "remote_control": 0.9, "modbus": 0.8,
          "can": 0.43, "fuzzy": 0.66}  # fmt: skip
COLOURS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#56b4e9", "#e69f00", "#555555")


def layers(root: Path = ROOT) -> list[list[str]]:
    """Return the names in each layer, from top to bottom; all base modules form one layer."""
    contracts = tomllib.loads((root / "pyproject.toml").read_text("utf-8"))["tool"]["importlinter"]
    listed = contracts["contracts"][0]["layers"]
    named = [[name.strip().removeprefix("shipnet.") for name in row.split("|")] for row in listed]
    packages = [row for row in named if any((root / "shipnet" / name).is_dir() for name in row)]
    above = named[: named.index(packages[0])]
    base = [name for row in named[len(above) :] for name in row]
    base = [name for name in base if not (root / "shipnet" / name).is_dir()]
    return [*above, *([n for n in row if n not in base] for row in packages), base]


def imports(root: Path = ROOT) -> set[tuple[str, str]]:
    """Return every (importing, imported) pair of packages, without the base layer."""
    boxes = {name for row in layers(root)[:-1] for name in row}
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
                if first == "shipnet" and rest.split(".")[0] in boxes:
                    found.add((own, rest.split(".")[0]))
    return {(one, other) for one, other in found if one in boxes and one != other}


def draw(root: Path = ROOT, picture: Path = PICTURE) -> None:
    """Write the picture, without arrows from the two top layers, which may import any lower one."""
    import matplotlib
    import matplotlib.pyplot as plt

    matplotlib.rcParams.update({"svg.hashsalt": "layers", "font.size": 11})
    rows = layers(root)
    bands = ["command", "papers, tools, lessons", "a whole ship", "one system", "one bus",
             "cables, rules", "base"]  # fmt: skip
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
    fig.canvas.draw()  # computes the sizes of the boxes
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
