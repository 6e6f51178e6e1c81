"""Draw the two figures of the README anew: python docs/readme_figures.py."""

from pathlib import Path

import matplotlib as mpl
from matplotlib.figure import Figure

from shipnet import datasets, style
from shipnet.asi import Request, Transaction
from shipnet.asi.plot import plot_transaction
from shipnet.design import read_iolist

FOLDER = Path(__file__).parent / "_static"


def main() -> None:
    mpl.use("agg")
    style.use()
    figure = Figure(figsize=(9, 2.8))
    request = Request.data_exchange(21, 0xE)
    plot_transaction(request, request.answer(0x6), Transaction(3, 2), ax=figure.subplots())
    figure.savefig(FOLDER / "telegram.png", dpi=120, metadata={"Software": None})

    iolist = read_iolist(datasets.path("synthetic_iolist_valves.csv"))
    figure = Figure(figsize=(9, 6.6))
    above, below = figure.subplots(2)
    iolist.plot("home runs", above)
    iolist.plot("AS-i", below)
    figure.savefig(FOLDER / "strands.png", dpi=100, metadata={"Software": None})


if __name__ == "__main__":
    main()
