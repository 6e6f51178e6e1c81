"""The command `shipnet design`: from the words of a command line to a table and a report."""

from __future__ import annotations

import argparse
from collections.abc import Mapping, Sequence
from pathlib import Path

from shipnet.design.comparison import compare_options
from shipnet.design.iolist import read_iolist
from shipnet.design.planning import OPTIONS
from shipnet.design.rules import RuleSet
from shipnet.design.settings import Settings
from shipnet.design.site import Trays
from shipnet.errors import ArgumentError


def run(arguments: argparse.Namespace) -> None:
    """Compare the options that a command line asks for, print the table and write the report."""
    settings = Settings() if arguments.settings is None else Settings.read(arguments.settings)
    if arguments.redundant:
        settings = settings.replace({"redundant": True})
    if arguments.show_settings:
        print(settings.text(), end="")
        return
    if arguments.list is None:
        raise ArgumentError("no LIST is given; see shipnet design --help")
    rules = RuleSet.of(arguments.rules)
    options = OPTIONS
    if arguments.options is not None:
        options = tuple(_option(name, "--options") for name in arguments.options.split(","))
        if twice := [name for name in dict.fromkeys(options) if options.count(name) > 1]:
            raise ArgumentError(f"--options names {', '.join(twice)} twice")
    if arguments.output is not None and not Path(arguments.output).absolute().parent.is_dir():
        raise ArgumentError(f"--output is {arguments.output!r}; there is no such folder")
    choose = _choices(arguments.mix)
    trays = None if arguments.trays is None else Trays.read(arguments.trays)
    known = {} if trays is None else trays.cabinets
    cabinet = None if arguments.cabinet is None else _place(arguments.cabinet, known)
    iolist = read_iolist(arguments.list, sheet=arguments.sheet)
    try:
        compared = compare_options(
            iolist, cabinet, options, trays=trays, settings=settings, mix=choose, rules=rules
        )
    except ArgumentError as mistake:
        said = str(mistake)
        for own, option in (
            ("mix names", "--mix names"),
            ("give its place x, y, z", "give --cabinet X,Y,Z"),
        ):
            said = said.replace(own, option, 1)
        raise ArgumentError(said) from None
    # The file comes first: whoever reads the output may stop reading.
    if arguments.output is not None:
        compared.report(arguments.output, title=arguments.title, date=arguments.date)
    print(compared)
    if arguments.output is not None:
        print(f"\nreport written to {arguments.output}")


def _choices(texts: Sequence[str]) -> dict[str, str]:
    choose: dict[str, str] = {}
    for text in texts:
        what, option = (part.strip() for part in text.rpartition("=")[::2])
        if not what or not option:
            raise ArgumentError(f"--mix is {text!r}; it must be such as DI=AS-i")
        option = _option(option, "--mix")
        if choose.setdefault(what, option) != option:
            raise ArgumentError(f"--mix has {what!r} by {choose[what]} and by {option}")
    return choose


def _option(text: str, what: str) -> str:
    """Return an option as it is called, however its letters are written."""
    found = {name.casefold(): name for name in OPTIONS}.get(text.strip().casefold())
    if found is None:
        raise ArgumentError(
            f"{what} names {text.strip()!r}; it must be one of {', '.join(OPTIONS)}"
        )
    return found


def _place(
    text: str, known: Mapping[str, tuple[float, float, float]]
) -> tuple[float, float, float]:
    if text.strip() in known:
        return known[text.strip()]
    try:
        x, y, z = (float(number) for number in text.split(","))
    except ValueError:
        names = f", or one of {', '.join(map(repr, known))}" if known else ""
        raise ArgumentError(
            f"--cabinet is {text!r}; it must be three numbers X,Y,Z in m{names}"
        ) from None
    return x, y, z
