"""How long a tool takes to open (target: 1 s) and to respond to a slider (target: 100 ms).

The time to the first picture is measured in a new process; it includes interpreter, imports and
page. tools_latency.py also includes Voila and a browser. `update` and `figure` are the longest
times to update and to draw, without cached results, with each slider in turn at either end.
"""

import subprocess
import sys
from pathlib import Path
from timeit import repeat

from _timing import seconds

from shipnet import tools
from shipnet.fields import Number, Whole, declared

ROOT = Path(__file__).resolve().parents[1]
EXPLORE = sorted((ROOT / "notebooks" / "explore").glob("*.ipynb"))
#: Class of each tool, by the name of its module and notebook.
TOOLS = {
    kind.__module__.rpartition(".")[2]: kind
    for kind in (getattr(tools, name) for name in dir(tools))
    if isinstance(kind, type)
}


def first_picture(tool):
    """Start Python, import the tool and make its page, as a new kernel does."""
    name = TOOLS[tool].__name__
    program = (
        f"from shipnet import tools; p = tools.{name}().explore(); assert 'png' in p.figure.value"
    )
    subprocess.run([sys.executable, "-c", f"{program}; p.close()"], check=True)


def cases(inputs):
    """Yield changes of inputs: none, then each slider without `at_most` at its low and high end."""
    yield {}
    for name, kind in declared(inputs).items():
        if isinstance(kind, Number | Whole) and not getattr(kind, "at_most", ""):
            yield from ({name: end} for end in kind.shown)


def forget():
    """Empty the caches of the tools, so that everything is computed anew."""
    for name, module in sys.modules.copy().items():
        if name.startswith("shipnet.tools."):
            for value in vars(module).values():
                if hasattr(value, "cache_clear"):
                    value.cache_clear()


def measure(tool):
    """Return the times of the slowest update and the slowest figure [s]."""
    kind = TOOLS[tool]
    updates, figures = [], []
    for values in cases(kind):
        try:
            view = kind(**values)._view()
        except ValueError:
            continue  # the page shows a message instead of a figure
        updates.append(min(repeat(lambda v=values: kind(**v).result, forget, number=1, repeat=3)))
        figures.append(seconds(lambda v=view: v.figure, 1))
    return max(updates), max(figures)


def main():
    print(f"{'tool':<16} {'update':>9} {'figure':>9} {'first picture':>14}")
    for path in EXPLORE:
        update, figure = measure(path.stem)
        opened = seconds(lambda tool=path.stem: first_picture(tool), 2)
        print(
            f"{path.stem:<16} {1e3 * update:6.1f} ms {1e3 * figure:6.0f} ms {opened:12.1f} s",
            flush=True,
        )


if __name__ == "__main__":
    main()
