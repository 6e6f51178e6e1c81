"""TOML files that users write: limits on what is read, and values as TOML text."""

from __future__ import annotations

import re
import tomllib
from itertools import accumulate
from json import dumps
from typing import Any

from shipnet.errors import InputError

#: A value with a decimal comma.
_COMMA = re.compile(r"^[\w. \t]+=[ \t]*([0-9]+,[0-9]+)[ \t]*(?:#.*)?$", re.MULTILINE)

#: Maximum length of a file in characters, and maximum nesting depth: the time to read TOML grows
#: with the square of each.
_LARGEST, _DEEPEST = 1_000_000, 8

#: Patterns for strings and comments, for brackets, and for a key with too many parts.
_QUOTED = re.compile(r""""[^"\n]*"|'[^'\n]*'|#[^\n]*""")
_BRACKET = re.compile(r"[\[{]|[\]}]")
_LONG_KEY = re.compile(rf"(?<![\w\"-])(?:[\w\"-]+[ \t]*\.[ \t]*){{{_DEEPEST}}}")


def parse_toml(text: str, source: str) -> dict[str, Any]:
    """Return the tables in TOML text, or raise InputError; text too slow to read is refused."""
    if len(text) > _LARGEST:
        raise InputError(source, f"has {len(text)} characters; at most {_LARGEST} are allowed")
    bare = _QUOTED.sub('""', text)
    depths = accumulate(1 if one in "[{" else -1 for one in _BRACKET.findall(bare))
    if max(depths, default=0) > _DEEPEST or _LONG_KEY.search(bare):
        raise InputError(source, f"nests values more than {_DEEPEST} deep; 3 levels are enough")
    try:
        return tomllib.loads(text)
    except ValueError as error:
        reason = " ".join(str(error).split())[:200]
        if comma := _COMMA.search(text):
            reason += f"; {comma[1]} has a comma instead of a point"
        raise InputError(source, f"is not a TOML file: {reason}") from None


def shown(value: object) -> str:
    """Return a value as TOML text."""
    if isinstance(value, tuple):
        return f"[{', '.join(map(shown, value))}]"
    if isinstance(value, bool):
        return "true" if value else "false"
    return dumps(value, ensure_ascii=False) if isinstance(value, str) else repr(value)
