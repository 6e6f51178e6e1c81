"""The inputs of a tool as a file that can be shared, and what is checked when it comes back."""

from __future__ import annotations

import json
from base64 import b64encode
from dataclasses import asdict
from html import escape
from typing import Any

from shipnet.errors import ArgumentError, InputError
from shipnet.fields import declared

#: Version of the file; it grows when a field changes its meaning.
VERSION = 1

_FORMAT = "shipnet tool"

#: A state is a few hundred characters; an editor's text makes it longer [bytes].
_LARGEST = 2_000_000


def write_state(tool: str, inputs: Any) -> str:
    """Return the inputs of a tool as JSON."""
    state = {"format": _FORMAT, "version": VERSION, "tool": tool, "inputs": asdict(inputs)}
    return json.dumps(state, indent=2)


def read_state(content: bytes, tool: str, kind: type, file: str = "state") -> Any:
    """Return the inputs that a file holds."""
    given = _inputs(content, tool, file)
    fields = declared(kind)
    faults = [f"unknown input {name!r}" for name in given if name not in fields]
    faults += [f"input {name!r} is missing" for name in fields if name not in given]
    if faults:
        raise InputError(file, *faults)
    # JSON has no tuples.
    values = {name: tuple(v) if isinstance(v, list) else v for name, v in given.items()}
    beside = type("Values", (), values)
    for name, field in fields.items():
        try:
            field.check(name, values[name], beside)
            field.check_shown(name, values[name])
        except ArgumentError as fault:
            faults.append(str(fault))
        except TypeError:
            # What it must not exceed is no number, which is said already.
            continue
    if faults:
        raise InputError(file, *faults)
    try:
        return kind(**values)
    except ArgumentError as fault:
        raise InputError(file, str(fault)) from None


def _inputs(content: bytes, tool: str, file: str) -> dict[str, Any]:
    if len(content) > _LARGEST:
        raise InputError(file, f"it has {len(content)} bytes; a saved state has {_LARGEST} at most")
    try:
        state = json.loads(content.decode("utf-8-sig"))
    except (ValueError, RecursionError):
        raise InputError(file, "this is no saved state: it is no JSON") from None
    if not isinstance(state, dict) or state.get("format") != _FORMAT:
        raise InputError(file, f"this is no saved state: it lacks the format {_FORMAT!r}")
    if state.get("tool") != tool:
        raise InputError(file, f"it is a state of the tool {state.get('tool')!r}, not of {tool!r}")
    version = state.get("version")
    if version != VERSION:
        raise InputError(file, f"its version is {version!r}; this tool reads version {VERSION}")
    inputs = state.get("inputs")
    if not isinstance(inputs, dict):
        raise InputError(file, "it holds no inputs")
    return inputs


def decode_text(file: str, content: bytes) -> str:
    """Return the text of a file that a user loads."""
    if b"\0" in content:
        raise InputError(file, "this is no text file")
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError:
        return content.decode("cp1252", errors="replace")


def download_link(text: str, file: str, content: str | bytes, kind: str) -> str:
    """Return a link that saves a file from the page itself, which asks no server for it."""
    data = content.encode() if isinstance(content, str) else content
    href = f"data:{kind};base64,{b64encode(data).decode()}"
    return (
        f'<a class="shipnet-button" download="{escape(file)}" href="{escape(href)}">'
        f"{escape(text)}</a>"
    )
