"""The words in I/O lists: column titles, numbers with units, frames, decks and sides."""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Iterable, Mapping, Sequence
from functools import cache, lru_cache
from typing import NamedTuple

import numpy as np

from shipnet.errors import ArgumentError, InputError
from shipnet.signals import find_signal, meanings, plain, spellings
from shipnet.tables import Sheet

#: Columns of an I/O list in order, and their contents: text, a whole number, or a quantity whose
#: unit is the suffix of the column's name. `data/iolist_words.csv` has their titles.
COLUMNS: Mapping[str, str] = {
    "tag": "text", "system": "text", "type": "text", "signal": "text", "conductors": "whole",
    "x_m": "length", "y_m": "length", "z_m": "length", "box": "text", "box_x_m": "length",
    "box_y_m": "length", "box_z_m": "length", "to_box_m": "length", "home_run_m": "length",
    "update_ms": "time", "category": "text", "note": "text", "device": "text", "ex": "text",
}  # fmt: skip

#: Columns that give a position by frame, deck and side, and the legal contents of their cells.
PLACED: Mapping[str, str] = {
    "frame": "a frame within [frames], such as FR 34+200",
    "deck": "one of [decks]",
    "side": "P or S with metres, such as P 4.2, or C",
    "location": "frame, deck and side, such as FR 34+200, DK3, P 4.2",
}

#: Units that a title or a cell may include, as multiples of the column's unit.
UNITS: Mapping[str, Mapping[str, float]] = {
    "length": {"m": 1.0, "mm": 1e-3, "cm": 1e-2, "meter": 1.0, "metre": 1.0},
    "time": {"ms": 1.0, "s": 1e3, "sec": 1e3, "msec": 1.0},
}


class Reading(NamedTuple):
    """The words of one list: columns and signals by spelling, x by frame, and z by deck [m]."""

    columns: tuple[tuple[str, str], ...] = ()
    signals: tuple[tuple[str, str], ...] = ()
    frames: tuple[tuple[str, float], ...] = ()
    decks: tuple[tuple[str, float], ...] = ()

    def tried(self, table: str, values: Mapping[str, object]) -> tuple[Reading, list[str]]:
        """Return the words extended by those in a table, and the faults in the table."""
        known, faults = dict(getattr(self, table)), []
        for word, value in values.items():
            try:
                known[word] = _OWN[table](word, value)
            except (ArgumentError, TypeError):
                faults.append(f"{table}.{word} is {value!r}; it must be {_LEGAL[table]}")
        if table == "frames":
            faults += [f"frames has {word!r}; it must be a number" for word in known
                       if _frame(word) is None]  # fmt: skip
        return self._replace(**{table: tuple(known.items())}), faults

    def with_sheets(self, sheets: Iterable[Sheet]) -> Reading:
        """Return the words extended by the tables of frames and decks in a workbook."""
        found = self
        for sheet in sheets:
            columns = {c.name: (n, c) for n, t in enumerate(sheet.titles) if (c := column_of(t))}
            word, axis = ("frame", "x_m") if "frame" in columns else ("deck", "z_m")
            (at, _), (place, column) = columns[word], columns[axis]
            values: dict[str, object] = {}
            faults = []
            for number, cells in sheet.rows:
                cells += [""] * (len(sheet.titles) - len(cells))
                value = read_number(cells[place], ".", column.scale, UNITS["length"])
                values[cells[at]] = value
                if value is None or not cells[at]:
                    said = f"{cells[at]!r} at {cells[place]!r}; expected a {word} and a number in m"
                    faults.append(f"row {number}: {said}")
            if not faults:
                found, faults = found.tried(f"{word}s", values)
            if faults:
                raise InputError(f"{sheet.source}, sheet {sheet.sheet}", *faults)
        return found

    def signal(self, word: str) -> str:
        """Return the signal that the list defines for a word, or the word itself."""
        own = {plain(spelling): name for spelling, name in self.signals}
        return own.get(plain(word), word)

    def place(self, cells: Mapping[str, str]) -> tuple[float, float, float] | str:
        """Return the position given by frame, deck and side, or the name of the unknown part."""
        parts = {name: cell.replace(",", ".") for name, cell in cells.items() if name != "location"}
        # A comma before a digit is a decimal comma.
        several = re.split(r"[;/]|,(?![0-9])", cells.get("location", ""))
        for part in filter(None, (one.strip().replace(",", ".") for one in several)):
            kind = "frame" if re.match(r"(?i)fr", part) else "deck"
            if kind == "deck" and (_side(part) is not None or parts.get("deck")):
                kind = "side"
            parts[kind] = parts.get(kind) or part
        frame, deck = _offset(parts.get("frame", "")), _offset(parts.get("deck", ""))
        number = _frame(frame[0])
        numbers = sorted((float(_frame(word) or 0.0), x) for word, x in self.frames)
        if number is None or not (numbers and numbers[0][0] <= number <= numbers[-1][0]):
            return "frame"
        levels = {plain(name): z for name, z in self.decks}
        if plain(deck[0]) not in levels:
            return "deck"
        side = _side(parts.get("side", ""))
        if side is None:
            return "side"
        known, along = zip(*numbers, strict=True)
        x = float(np.interp(number, known, along))
        return x + frame[1], side, levels[plain(deck[0])] + deck[1]


def is_place_titles(cells: Sequence[str]) -> bool:
    """Return whether cells are the titles of a table of frames or decks."""
    names = {column.name for cell in cells if (column := column_of(cell))}
    return "tag" not in names and (names >= {"frame", "x_m"} or names >= {"deck", "z_m"})


def is_frame(cell: str) -> bool:
    """Return whether a cell has the form of a frame number."""
    return _frame(_offset(cell)[0]) is not None


def _offset(text: str) -> tuple[str, float]:
    """Return the frame or deck named in text, and the offset [m], given there in mm or m."""
    text = text.strip()
    found = re.fullmatch(r"(.*[^\s+-])\s*([+-]\s*[0-9]+(?:\.[0-9]+)?)\s*(mm|m)?", text)
    if found is None or _frame(text) is not None:
        return text, 0.0
    return found[1], float("".join(found[2].split())) * (1.0 if found[3] == "m" else 1e-3)


def _frame(text: str) -> float | None:
    """Return the number of a frame, or None if the text is not a frame."""
    found = re.fullmatch(
        r"(?i)(?:fr(?:ame)?\.?\s*(?:no\.?)?\s*#?)?\s*(-?[0-9]+(?:\.[0-9]+)?)", text
    )
    return None if found is None else float(found[1])


_PORT = {"p": 1, "ps": 1, "port": 1, "c": 0, "cl": 0, "centre": 0, "center": 0, "": 0,
         "s": -1, "sb": -1, "stbd": -1, "starboard": -1, "좌": 1, "중": 0, "우": -1}  # fmt: skip


def _side(text: str) -> float | None:
    """Return the distance to port of the centre line [m], or None if the text is not a side."""
    found = re.fullmatch(
        r"([^\W\d]*)\.?\s*([0-9]+(?:\.[0-9]+)?)?\s*(?:m)?\s*([^\W\d]*)", text.strip()
    )
    word = "" if found is None else (found[1] or found[3]).casefold()
    if found is None or word not in _PORT or (word and _PORT[word] and not found[2]):
        return None
    return _PORT[word] * float(found[2] or 0.0)


def _is_column(word: str, value: object) -> str:
    name = column_of(str(value))
    if name is None:
        raise ArgumentError("no column")
    return name.name


def _is_metres(word: str, value: object) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float) or not abs(value) <= 1e3:
        raise ArgumentError("no place")
    return float(value)


def _is_signal(word: str, value: object) -> str:
    find_signal(str(value))
    return str(value)


#: The check for the values of each table, and the legal values in words.
_OWN = {"columns": _is_column, "signals": _is_signal, "frames": _is_metres, "decks": _is_metres}
_LEGAL = {
    "columns": f"one of {', '.join((*COLUMNS, *PLACED))}",
    "signals": "a signal, such as contact or rtd_3wire",
    "frames": "a number -1000..1000 m",
    "decks": "a number -1000..1000 m",
}


# Titles ---------------------------------------------------------------------------------------


class Column(NamedTuple):
    """The meaning of a title: the column, and the factor that converts values to its unit."""

    name: str
    scale: float = 1.0


@cache
def _titles() -> Mapping[str, str]:
    known = {plain(name): name for name in (*COLUMNS, *PLACED)}
    known |= {plain(n.rpartition("_")[0]): n for n, holds in COLUMNS.items() if holds in UNITS}
    return {word: found[0][0] for word, found in spellings("column").items()} | known


@lru_cache(4096)
def column_of(title: str, own: tuple[tuple[str, str], ...] = ()) -> Column | None:
    """Return the column that a title names, or None; a title may be in two languages."""
    mine = {plain(word): name for word, name in own}
    if plain(title) in mine:
        return Column(mine[plain(title)])
    if found := _column(title):
        return found
    # A unit in brackets may be anywhere; a second language may come before or after the first.
    unit = re.search(r"[\[(]\s*(\w+)\s*[\])]", title)
    bare, mark = title, ""
    if unit is not None and any(unit[1].casefold() in known for known in UNITS.values()):
        bare, mark = title.replace(unit[0], " "), f" {unit[1]}"
    own_letters = ("".join(c if c.isascii() else " " for c in bare),
                   "".join(" " if c.isascii() else c for c in bare))  # fmt: skip
    for split in (own_letters, re.split(r"[/|()\[\]]", bare)):
        parts = [part for part in split if plain(part)]
        each = [_column(part + mark) for part in parts]
        # A part of a title may be unknown only if it has a letter outside ASCII.
        foreign = all(found or not part.isascii() for part, found in zip(parts, each, strict=True))
        names = {found for found in each if found is not None}
        if names == {Column("type"), Column("signal")}:  # a column of types may contain signals
            names = {Column("type")}
        if len(names) == 1 and foreign and (parts[1:] or mark):
            return names.pop()
    return None


def _column(title: str) -> Column | None:
    name = _titles().get(plain(title))
    if name is not None:
        return Column(name)
    words = re.findall(r"[^\W_]+", title.casefold())
    name = _titles().get("".join(words[:-1])) if words else None
    units = UNITS.get(COLUMNS.get(name, ""), {}) if name is not None else {}
    return Column(name, units[words[-1]]) if name is not None and words[-1] in units else None


# Numbers --------------------------------------------------------------------------------------

#: Replacements for East Asian wide characters, the minus sign and non-breaking spaces.
_WIDE = {0xFF01 + k: 0x21 + k for k in range(94)} | {0x3000: 32, 0x2212: 45, 0xA0: 32, 0x202F: 32}

_CELL = re.compile(
    r"([+-]?(?:[0-9][0-9., ']*|[.,][0-9]+))(?<! )(e[+-]?[0-9]{1,3})? ?([^\W\d_]*)\.?", re.IGNORECASE
)
_GROUPS = {
    mark: re.compile(rf"[+-]?[0-9]{{1,3}}(?:{re.escape(mark)}[0-9]{{3}})+") for mark in ",. '"
}


def widened(cell: str) -> str:
    """Return a cell with wide characters replaced by plain ones."""
    return cell if cell.isascii() else cell.translate(_WIDE).strip()


def decimal_mark(cells: Iterable[str]) -> str:
    """Return a list's decimal mark: a point, a comma, or "" if its numbers show neither or both."""
    marks = set()
    for cell in set(cells):
        found = _CELL.fullmatch(widened(cell))
        digits = found[1] if found else ""
        last = max(".,", key=digits.rfind)
        if digits.count(last) == 1 and not _GROUPS[last].fullmatch(digits):
            marks.add(last)
    return marks.pop() if len(marks) == 1 else ""


def read_number(cell: str, mark: str, scale: float, units: Mapping[str, float]) -> float | None:
    """Return a cell's number in the unit of its column, or None if it is illegible or ambiguous.

    `scale` is the factor for the unit in the title; a unit in the cell overrides it. A comma is
    ambiguous if it may mark decimals or separate thousands.
    """
    found = _CELL.fullmatch(widened(cell))
    if found is None or (found[3] and found[3].casefold() not in units):
        return None
    digits, exponent, unit = found.groups()
    for blank in " '":
        digits = digits.replace(blank, "") if _GROUPS[blank].match(digits) else digits
    last = max(".,", key=digits.rfind)
    other = "." if last == "," else ","
    if other in digits:
        head, _, tail = digits.partition(last)
        if not _GROUPS[other].fullmatch(head) or last in tail:
            return None
        digits = f"{head.replace(other, '')}.{tail}"
    elif digits.count(last) > 1 or (mark and mark != last and _GROUPS[last].fullmatch(digits)):
        if not _GROUPS[last].fullmatch(digits):
            return None
        digits = digits.replace(last, "")
    elif last == "," and mark != "," and _GROUPS[","].fullmatch(digits):
        return None
    try:
        value = float(digits.replace(",", ".") + (exponent or ""))
    except ValueError:
        return None
    return value * (units[unit.casefold()] if unit else scale)


# Intrinsic safety -----------------------------------------------------------------------------

_SAFE = re.compile(
    r"[\[(]?\b(?:ex[ -]?\(?\[?i[abc]?\]?\)?|eex ?i[abc]?|intrinsically safe|intrinsic safe|"
    r"I\.?S\.?(?= |\)|\]|$))[\])]?(?: ?II[ABC](?: ?T[1-6])?)?", re.IGNORECASE,
)  # fmt: skip

#: Cells of a column Ex or IS, without blanks and punctuation, that mean yes and no.
YES = frozenset("yes y x 1 true ja j wahr sann 예 네 ✓ ✔ √ ○ ◯".split())
_NO = frozenset(
    " no n 0 false na none nil nein nei falsch usann 아니오 아니요 없음 해당없음".split(" ")
)
_PUNCTUATION = re.compile(r"[\s./_\u2010-\u2015\u2212\ufe0f-]+")

#: Words for intrinsic safety, for other types of protection, for no protection, and for doubt.
_INTRINSIC = re.compile(
    r"(?<!\w)i[./]?s(?!\w)|intrinsic(?:ally)? safe(?:ty)?|eigensicher|egensikker|본질 ?안전|본안"
)
_OTHER = re.compile(r"flameproof|increased safety|내압|안전증")
_WITHOUT = re.compile(
    rf"(?:not?|non|nicht|keine?|ikke|ingen)[ -]*(?:e?ex|hazardous(?: area)?|applicable|required|"
    rf"{_INTRINSIC.pattern})|비 ?(?:방폭|본질 ?안전)"
)
_UNLESS = re.compile(r"\b(?:not?|non|nicht|nein|keine?|nei|ikke)\b")

#: Types of protection in a token that begins with Ex, after one, and without one; then groups,
#: temperature classes and categories, and equipment protection levels.
_KINDS = "(?:[idem][abc]?)+|n[abclr]{0,2}|p[xyzv]?[bc]?|[oqst][abc]?"
_AFTER_EX = re.compile(rf"[ae]?ex({_KINDS}|)|(?:{_KINDS})")
_ALONE = re.compile("i[abc]?|[dem][abc]?|de|n[acr]|p[xyz]?")
_GROUP = re.compile("ii[abc]?|iii[abc]?|t[1-6]|[1-3][gd]?|g")
_LEVEL = re.compile("[gd][abc]")


def _protection(text: str) -> str:
    """Return the types of protection in a marking, such as ``ia`` or ``dia``, or "" if unclear."""
    tokens = re.findall(r"[^\W_]+", text)
    found = [_AFTER_EX.fullmatch(token) for token in tokens]
    alone = not any(one and one[1] is not None for one in found)
    kinds, active = "", alone
    for token, one in zip(tokens, found, strict=True):
        if one and one[1] is not None:
            kinds, active = kinds + one[1], True
        elif _GROUP.fullmatch(token):
            active = active and not kinds
        elif active and (_ALONE.fullmatch(token) if alone else one):
            kinds += token
        elif alone and not _LEVEL.fullmatch(token):
            return ""
        else:
            active = False
    return kinds


def folded(cell: str) -> str:
    """Return a cell in lower case, with full-width characters replaced by plain ones."""
    return unicodedata.normalize("NFKC", cell).casefold().strip()


def is_intrinsically_safe(cell: str) -> tuple[bool, bool]:
    """Return whether a cell of a column Ex or IS says "intrinsically safe", and if this is clear.

    Square brackets mark associated apparatus: its own circuit is not intrinsically safe. A cell
    that names both an intrinsically safe and another type of protection is unclear.
    """
    text = folded(cell)
    word = _PUNCTUATION.sub("", text)
    if word in YES or word in _NO:
        return word in YES, True
    if _WITHOUT.fullmatch(text):
        return False, True
    text = re.sub(r"\[[^\[\]]*\]|\bop[ -]?(?:is|pr|sh)\b", " ", text)
    words, rest = _INTRINSIC.findall(text), _INTRINSIC.sub(" ", text)
    kinds = _protection(rest)
    safe = bool(words) or "i" in kinds
    other = bool({*kinds} & {*"demnopqst"} or _OTHER.search(rest))
    # The verb is may stand beside other words.
    verb = not kinds and {*map(len, words)} & {2, 3} and re.search(r"\w", rest)
    return safe, safe != other and not verb and not _UNLESS.search(text)


def without_safety(word: str) -> tuple[str, str]:
    """Return a signal without its intrinsic-safety marking, and the marking."""
    found = None if meanings(word) else _SAFE.search(word)
    if found is None:
        return word, ""
    rest = " ".join((word[: found.start()] + " " + word[found.end() :]).split())
    return rest, found[0].strip("[]() ")
