"""Rule bases in TOML files."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import MISSING, fields
from os import PathLike
from typing import Any, TypeVar

from shipnet.errors import ArgumentError, InputError
from shipnet.files import read_bytes
from shipnet.fuzzy.rules import RuleBase
from shipnet.fuzzy.terms import Rule, Term, Variable
from shipnet.tables import text_of
from shipnet.toml_file import parse_toml

T = TypeVar("T")


def read_rules(path: str | PathLike[str]) -> RuleBase:
    """Read a rule base from a TOML file, such as one that `RuleBase.save` has written.

    Parameters
    ----------
    path : path
        The file. Each table ``[[variables]]`` has the parameters of `Variable`, and its ``terms``
        those of `Term`; each table ``[[rules]]`` has those of `Rule`.

    Returns
    -------
    RuleBase
        The variables and rules, in the order of the file.

    Raises
    ------
    InputError
        If the file cannot be read, or has faults; the message names each table with a fault.

    Examples
    --------
    >>> from shipnet import ballast, datasets
    >>> base = read_rules(datasets.path("kim2014_assumed_rules.toml"))
    >>> base, base == ballast.rule_base()
    (RuleBase(12 rules, variables FP OP MC OT VPos DVPos), True)
    """
    source, faults = str(path), list[str]()
    content = parse_toml(text_of(read_bytes(path)), source)
    variables = list[Any]()
    for place, table in _tables(content, "variables", faults):
        parts = _tables(table, "terms", faults, f"{place}, ")
        terms = [_made(Term, where, part, faults) for where, part in parts]
        if good := [term for term in terms if term is not None]:
            variables.append(_made(Variable, place, {**table, "terms": good}, faults))
    rules = list[Any]()
    for place, table in _tables(content, "rules", faults):
        rules.append(_made(Rule, place, table, faults))
    for name in content:
        if name not in ("variables", "rules"):
            faults.append(f"{name} is unknown; expected variables and rules")
    if not faults:
        try:
            return RuleBase(variables, rules)
        except ArgumentError as error:
            faults += error.args[0].split("; ")
    raise InputError(source, *faults)


def _tables(
    parent: Mapping[str, Any], name: str, faults: list[str], within: str = ""
) -> list[tuple[str, dict[str, Any]]]:
    """Return the tables in a list, each with its place in the file, such as ``rule 3 (V1)``."""
    tables = parent.get(name)
    if not tables or not isinstance(tables, list) or not all(isinstance(t, dict) for t in tables):
        faults.append(f"{within}{name} must be a list of one or more tables")
        return []
    places = []
    for number, table in enumerate(tables, 1):
        label = table.get("code", table.get("name"))
        shown = f" ({label})" if isinstance(label, str) else ""
        places.append((f"{within}{name[:-1]} {number}{shown}", table))
    return places


def _made(kind: type[T], place: str, table: Mapping[str, Any], faults: list[str]) -> T | None:
    """Return the object that a table describes; if the table has faults, add them to `faults`."""
    needed = {one.name: one.default is MISSING for one in fields(kind)}  # type: ignore[arg-type]
    wrong = [f"no {name}" for name, is_needed in needed.items() if is_needed and name not in table]
    legal = ", ".join(needed)
    wrong += [f"{name!r} is unknown; expected {legal}" for name in table if name not in needed]
    try:
        if not wrong:
            return kind(**table)
    except (TypeError, ValueError) as error:
        wrong.append(str(error))
    faults += [f"{place}: {fault}" for fault in wrong]
    return None
