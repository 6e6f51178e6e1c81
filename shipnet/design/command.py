"""The command `shipnet design`, which turns a command line into settings and a comparison."""

from __future__ import annotations

import argparse
import re
import tomllib
from collections.abc import Sequence
from pathlib import Path

from shipnet.design.comparison import Comparison
from shipnet.design.iolist import read_iolist
from shipnet.design.planning import OPTIONS
from shipnet.design.rules import RuleSet
from shipnet.design.settings import Settings
from shipnet.errors import ArgumentError, InputError
from shipnet.files import complete
from shipnet.tables import csv_text


def settings_of(arguments: argparse.Namespace) -> Settings:
    """Return the settings given on a command line."""
    settings = Settings() if arguments.settings is None else Settings.read(arguments.settings)
    values: dict[str, object] = {}
    for text in arguments.set:
        name, equals, value = text.partition("=")
        if not equals:
            raise ArgumentError(f"--set is {text!r}; it must be NAME=VALUE, such as detour=1.3")
        try:
            values[name.strip()] = tomllib.loads(f"value = {value}")["value"]
        except tomllib.TOMLDecodeError:  # a value that is not TOML is text
            values[name.strip()] = value.strip()
    return settings.replace(values)


def compared(arguments: argparse.Namespace, settings: Settings) -> Comparison:
    """Compare the options given on a command line."""
    if arguments.list is None:
        raise ArgumentError("no LIST is given; see shipnet design --help")
    rules, options = RuleSet.of(arguments.rules), OPTIONS
    if arguments.options is not None:
        options = tuple(_option(name, "--options") for name in arguments.options.split(","))
        if twice := [name for name in dict.fromkeys(options) if options.count(name) > 1]:
            raise ArgumentError(f"--options lists {', '.join(twice)} twice")
    mix = _choices(arguments.mix)
    try:
        iolist = read_iolist(
            arguments.list, sheet=arguments.sheet, settings=settings, strict=arguments.strict
        )
    except InputError as mistake:
        save_faults(arguments.save_faults, mistake.file, mistake.faults)
        raise
    save_faults(arguments.save_faults)
    result, cabinet = None, arguments.cabinet
    for path in arguments.previous:
        earlier = read_iolist(path, settings=settings)
        result = earlier.compare(
            cabinet, options, settings=settings, mix=mix, rules=rules, keep=result
        )
        cabinet = cabinet or result.site
    return iolist.compare(cabinet, options, settings=settings, mix=mix, rules=rules, keep=result)


#: Pattern for the row, the column and the message of a fault.
_PLACED = re.compile(r"row (\d+)(?:, column ([^:]*?))?(?::|(?= has)) ?(.*)", re.DOTALL)


def save_faults(path: str | None, file: str = "", faults: Sequence[str] = ()) -> None:
    """Write the faults in an I/O list to a CSV file, one per row; without a path, do nothing."""
    if path is None:
        return
    places = [(_PLACED.fullmatch(fault), fault) for fault in faults]
    rows = [(file, *(placed.groups("") if placed else ("", "", fault))) for placed, fault in places]
    text = csv_text([("file", "row", "column", "fault"), *rows])
    with complete(path) as new:
        Path(new).write_text(text, encoding="utf-8-sig", newline="")


def _choices(texts: Sequence[str]) -> dict[str, str]:
    choose: dict[str, str] = {}
    for text in texts:
        what, option = (part.strip() for part in text.rpartition("=")[::2])
        if not what or not option:
            raise ArgumentError(f"--mix is {text!r}; it must be WHAT=OPTION, such as DI=AS-i")
        option = _option(option, "--mix")
        if choose.setdefault(what, option) != option:
            raise ArgumentError(f"--mix assigns {what!r} to both {choose[what]} and {option}")
    return choose


def _option(text: str, what: str) -> str:
    """Return the name of an option, which may be given in upper or lower case."""
    for name in OPTIONS:
        if name.casefold() == text.strip().casefold():
            return name
    raise ArgumentError(f"{what} names {text.strip()!r}; it must be one of {', '.join(OPTIONS)}")
