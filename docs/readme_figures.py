"""Redraw the two figures of the README: python docs/readme_figures.py."""

from pathlib import Path

import matplotlib as mpl
from matplotlib.figure import Figure

from shipnet import datasets, style
from shipnet.asi import Request, Transaction
from shipnet.design import read_iolist

FOLDER = Path(__file__).parent / "_static"


def main() -> None:
    mpl.use("agg")
    style.use()
    figure = Figure(figsize=(6.4, 3))
    request = Request.data_exchange(21, 0xE)
    Transaction(3, 2).plot(request, request.answer(0x6), figure.subplots())
    figure.savefig(FOLDER / "telegram.png", dpi=160, metadata={"Software": None})

    iolist = read_iolist(datasets.path("synthetic_iolist_valves.csv"))
    figure = Figure(figsize=(6.4, 7))
    above, below = figure.subplots(2)
    iolist.plot("home runs", above)
    iolist.plot("AS-i", below)
    figure.savefig(FOLDER / "conductors.png", dpi=140, metadata={"Software": None})


if __name__ == "__main__":
    main()
