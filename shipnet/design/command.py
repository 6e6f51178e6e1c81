"""The command `shipnet design`: from the words of a command line to a table and a report."""

from __future__ import annotations

import argparse
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from shipnet.design.comparison import compare
from shipnet.design.designs import Network
from shipnet.design.iolist import IoList, load_iolist
from shipnet.design.planning import OPTIONS, mix
from shipnet.design.report import write_report
from shipnet.design.rules import rules_of
from shipnet.design.settings import Basis, format_basis, load_basis
from shipnet.design.site import Site, find_cabinet, load_trays
from shipnet.errors import ArgumentError

__all__ = ["run"]

#: Seed of the draws of what is assumed: the same list gives the same report.
_SEED = 2024


def run(arguments: argparse.Namespace) -> None:
    """Compare the options that a command line asks for, print the table and write the report."""
    basis = Basis() if arguments.settings is None else load_basis(arguments.settings)
    if arguments.redundant:
        basis = basis.with_({"redundant": True})
    if arguments.show_settings:
        print(format_basis(basis), end="")
        return
    if arguments.list is None:
        raise ArgumentError("no LIST is given; see shipnet design --help")
    rules = rules_of(arguments.rules)
    options = OPTIONS
    if arguments.options is not None:
        options = tuple(_option(name, "--options") for name in arguments.options.split(","))
        if twice := [name for name in dict.fromkeys(options) if options.count(name) > 1]:
            raise ArgumentError(f"--options names {', '.join(twice)} twice")
    if arguments.output is not None and not Path(arguments.output).absolute().parent.is_dir():
        raise ArgumentError(f"--output is {arguments.output!r}; there is no such folder")
    choose = _choices(arguments.mix)
    trays = None if arguments.trays is None else load_trays(arguments.trays)
    known = {} if trays is None else trays.cabinets
    given = None if arguments.cabinet is None else _place(arguments.cabinet, known)
    iolist = load_iolist(arguments.list, arguments.sheet)
    remarks = []
    if given is None and (iolist.located.any() or np.isfinite(iolist.box_places).any()):
        try:
            found = find_cabinet(iolist)
        except ArgumentError as mistake:
            names = f" or one of {', '.join(map(repr, known))}" if known else ""
            raise ArgumentError(f"{mistake}; give --cabinet X,Y,Z in m{names}") from None
        given, remarks = found.place, [str(found)]
    site = basis.site((0.0, 0.0, 0.0) if given is None else given, trays)
    mixed = _mixed(iolist, site, choose, basis)
    compared = compare(
        iolist, site, options,
        rule_set=rules, assumptions=basis.assumptions, settings=basis.settings, more=mixed,
        host_time=basis.host_time, rng=np.random.default_rng(_SEED),
    )  # fmt: skip
    # The file comes first: whoever reads the output may stop reading.
    if arguments.output is not None:
        write_report(
            compared, arguments.output,
            title=arguments.title, date=arguments.date, remarks=remarks,
        )  # fmt: skip
    print(iolist)
    for remark in (*iolist.remarks, *remarks, *(f"not the default: {one}" for one in basis.told)):
        print(remark)
    print(f"\n{compared.short.to_string()}\n")
    print("\n".join(compared.sentences))
    print("A design aid, not class approval.")
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


def _mixed(iolist: IoList, site: Site, choose: Mapping[str, str], basis: Basis) -> list[Network]:
    if not choose:
        return []
    try:
        return [mix(iolist, site, choose, settings=basis.settings)]
    except ArgumentError as mistake:
        raise ArgumentError(f"--mix {str(mistake).removeprefix('choose ')}") from None


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
