"""What the ship design tool takes as files: a list, and settings."""

from __future__ import annotations

import tempfile
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

from shipnet.design.iolist import read_iolist
from shipnet.design.settings import Settings
from shipnet.errors import InputError
from shipnet.tables import text_of

if TYPE_CHECKING:
    from _typeshed import DataclassInstance


#: `shipnet.tools.ship_design.Inputs`, which stands above.
Inputs = TypeVar("Inputs", bound="DataclassInstance")


def from_file(inputs: Inputs, name: str, content: bytes) -> Inputs:
    """Return inputs with the I/O list of a file, whose cabinet is to be found."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "list"
        path.write_bytes(content)
        try:
            iolist = read_iolist(path)
        except InputError as problem:
            raise InputError(name, *problem.faults, more=problem.more) from None
        if content.startswith(b"PK"):
            iolist.save(path)
            content = path.read_bytes()
    return replace(inputs, points=text_of(content), name=name[-80:], cabinet="")


def settings_from_file(inputs: Inputs, name: str, content: bytes) -> Inputs:
    """Return inputs with the lines of a file of settings."""
    lines = text_of(content)
    Settings.parse(lines, name)
    return replace(inputs, own=lines)
