"""The words in I/O lists: column titles, numbers with units, frames, decks and sides."""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import cache
from typing import Any, NamedTuple

import numpy as np

from shipnet.errors import ArgumentError, InputError
from shipnet.lists import ALIKE, Column, Words, read_number
from shipnet.signals import find_signal, meanings, plain, spellings
from shipnet.tables import Remark, Sheet

#: Columns of an I/O list in order, and their contents: text, a whole number, or a quantity whose
#: unit is the suffix of the column's name. `data/iolist_words.csv` has their titles.
COLUMNS: Mapping[str, str] = {
    name: kind or "text"
    for name, _, kind in (
        word.partition(":")
        for word in (
            "tag system type signal conductors:whole x_m:length y_m:length z_m:length box "
            "box_x_m:length box_y_m:length box_z_m:length to_box_m:length home_run_m:length "
            "update_ms:time category note device ex"
        ).split()
    )
}

#: Columns that give a position by frame, deck and side, and the legal contents of their cells.
PLACED: Mapping[str, str] = {
    "frame": "a frame within [frames], such as FR 34+200",
    "deck": "one of [decks]",
    "side": "P or S with metres, such as P 4.2, or C",
    "location": "frame, deck and side, such as FR 34+200, DK3, P 4.2",
}


class Reading(NamedTuple):
    """The words of one list: columns and signals by spelling, x by frame, and z by deck [m]."""

    columns: tuple[tuple[str, str], ...] = ()
    signals: tuple[tuple[str, str], ...] = ()
    frames: tuple[tuple[str, float], ...] = ()
    decks: tuple[tuple[str, float], ...] = ()

    def tried(self, table: str, values: Mapping[str, object]) -> tuple[Reading, list[str]]:
        """Return the words extended by those in a table, and the faults in the table."""
        entries, faults = dict(getattr(self, table)), []
        for word, value in values.items():
            try:
                entries[word] = _own(table, value)
            except (ArgumentError, TypeError):
                faults.append(f"{table}.{word} is {value!r}; it must be {_LEGAL[table]}")
        wrong = [word for word in entries if table == "frames" and _frame(word) is None]
        faults += [f"frames has {word!r}; it must be a number" for word in wrong]
        return self._replace(**{table: tuple(entries.items())}), faults

    def with_sheets(self, sheets: Iterable[Sheet]) -> tuple[Reading, list[Remark]]:
        """Return the words extended by the tables of frames and decks in a workbook, and remarks.

        A sheet may have several tables, one below the other or side by side.
        """
        reading, remarks = self, []
        for sheet in sheets:
            values: dict[str, dict[str, object]] = {"frame": {}, "deck": {}}
            faults, unread = [], []
            tables = _place_tables(sheet.titles)
            for number, cells in sheet.rows:
                if below := _place_tables(cells):
                    taken = {column for _, *places, _ in below for column in places}
                    tables = [one for one in tables if taken.isdisjoint(one[1:3])] + below
                    continue
                for word, at, column, unit in tables:
                    name, cell = (cells[n] if n < len(cells) else "" for n in (at, column))
                    if not cell and not (word == "frame" and is_frame(name)):
                        if name:
                            unread.append(number)
                        continue
                    mark = "" if (number, column) in sheet.typed else "."
                    is_length = unit in ("", *ALIKE["m"])
                    value = read_number(cell, mark, unit or "m", "m") if is_length else None
                    if value is None or not name or values[word].get(name, value) != value:
                        text = f"{name!r} at {cell!r}; expected a {word} and a number in m"
                        faults.append(f"row {number}: {text}")
                    values[word][name] = value
            for word in values if not faults else ():
                reading, more = reading.tried(f"{word}s", values[word])
                faults += more
            if faults:
                raise InputError(f"{sheet.source}, sheet {sheet.sheet}", *faults)
            if unread:
                text = f"not read on sheet {sheet.sheet}, not a frame or deck with a place"
                remarks.append(Remark(text, tuple(dict.fromkeys(unread))))
        return reading, remarks

    def signal(self, word: str) -> str:
        """Return the signal that the list defines for a word, or the word itself."""
        meanings_of = {plain(spelling): name for spelling, name in self.signals}
        return meanings_of.get(plain(word), word)

    def parts(self, cells: Mapping[str, str]) -> dict[str, str]:
        """Return the frame, the deck and the side that the cells of a row name, such as FR 34."""
        parts = {name: cell.replace(",", ".") for name, cell in cells.items() if name != "location"}
        # A comma before a digit is a decimal comma.
        several = re.split(r"[;/]|,(?![0-9])", cells.get("location", ""))
        for part in filter(None, (one.strip().replace(",", ".") for one in several)):
            kind = "frame" if re.match(r"(?i)fr", part) else "deck"
            is_deck = not parts.get("deck") and self.above(part) is not None
            if kind == "deck" and not is_deck and (off_centre(part) is not None or "deck" in parts):
                kind = "side"
            parts[kind] = parts.get(kind) or part
        return parts

    def along(self, text: str) -> float | None:
        """Return x at a frame [m], or None if it is unknown."""
        frame, offset = _offset(text)
        number = _frame(frame)
        numbers = sorted((float(_frame(word) or 0.0), x) for word, x in self.frames)
        if number is None or not (numbers and numbers[0][0] <= number <= numbers[-1][0]):
            return None
        frames, along = zip(*numbers, strict=True)
        return float(np.interp(number, frames, along)) + offset

    def above(self, text: str) -> float | None:
        """Return z on a deck [m], or None if it is unknown."""
        deck, offset = _offset(text)
        level = {plain(name): z for name, z in self.decks}.get(plain(deck))
        return None if level is None else level + offset


def _place_tables(cells: Sequence[str]) -> list[tuple[str, int, int, str]]:
    """Return the tables of frames or decks that a row of titles begins.

    Each is the word, its column, the column of the place along that axis, and its unit.
    """
    columns = [(index, column) for index, cell in enumerate(cells) if (column := column_of(cell))]
    if any(column.name == "tag" for _, column in columns):
        return []
    tables = []
    for word, axis in (("frame", "x_m"), ("deck", "z_m")):
        words = [index for index, column in columns if column.name == word]
        axes = [(index, column.unit) for index, column in columns if column.name == axis]
        tables += [(word, at, *one) for at, one in zip(words, axes, strict=False)]
    return tables


def is_place_titles(cells: Sequence[str]) -> bool:
    """Return whether cells are the titles of a table of frames or decks."""
    return bool(_place_tables(cells))


def is_frame(cell: str) -> bool:
    """Return whether a cell has the form of a frame number."""
    return _frame(_offset(cell)[0]) is not None


def _offset(text: str) -> tuple[str, float]:
    """Return the frame or deck named in text, and the offset [m], given there in mm or m."""
    text = text.strip()
    match = re.fullmatch(r"(.*[^\s+-])\s*([+-]\s*[0-9]+(?:\.[0-9]+)?)\s*(mm|m)?", text)
    if match is None or _frame(text) is not None:
        return text, 0.0
    return match[1], float("".join(match[2].split())) * (1.0 if match[3] == "m" else 1e-3)


def _frame(text: str) -> float | None:
    """Return the number of a frame, or None if the text is not a frame."""
    match = re.fullmatch(
        r"(?i)(?:fr(?:ame)?\.?\s*+(?:no\.?\s*+)?#?)?\s*+(-?[0-9]+(?:\.[0-9]+)?)", text
    )
    return None if match is None else float(match[1])


_PORT = dict.fromkeys(("port", "ps", "p", "bb", "좌"), 1)
_PORT |= dict.fromkeys(("starboard", "stbd", "stb", "sb", "s", "우"), -1)
_PORT |= dict.fromkeys("centreline centerline centre center cl c mitte midt 중".split(), 0)
_SIDE = re.compile(rf"[(\[]?(?<![^\W\d_])({'|'.join(_PORT)})(?![^\W\d_])[)\]]?\.?", re.IGNORECASE)


def has_side(text: str) -> bool:
    """Return whether text names a side or the centre line."""
    return _SIDE.search(text) is not None


def off_centre(
    text: str, beside: str = "", read: Callable[[str], float | None] | None = None
) -> float | None:
    """Return the distance to port of the centre line [m], or None if the text does not say it.

    The text is such as P 4.2, 3.1(S), CL or -3.1, and `beside` is the side in another column. A
    number without a side is positive to port.
    """
    others = [number for cell in (text, beside) if (number := _SIDE.sub("", cell).strip(" /"))]
    signs = {_PORT[side.casefold()] for side in _SIDE.findall(f"{text} {beside}")}
    read = read or (lambda number: read_number(number, ".", "m", "m"))
    numbers = [read(number) for number in others]
    if None in numbers or len(signs) > 1 or len({abs(y or 0.0) for y in numbers}) > 1:
        return None
    y = numbers[0] or 0.0 if numbers else None
    sign = signs.pop() if signs else None
    if sign is None or y is None:
        return y or 0.0 if not sign else None
    if sign * y < 0 < sign or (sign == 0 and y):
        return None
    return sign * abs(y)


def _own(table: str, value: object) -> Any:
    """Return the value of a word in a table of the settings, or raise ArgumentError."""
    if table == "signals":
        find_signal(str(value))
    elif table == "columns" and column_of(str(value)) is None:
        raise ArgumentError("no column")
    elif table in ("frames", "decks"):
        if isinstance(value, bool) or not isinstance(value, int | float) or not abs(value) <= 1e3:
            raise ArgumentError("no place")
        return float(value)
    return str(value)


#: The legal values of each table in words.
_LEGAL = {
    "columns": f"one of {', '.join((*COLUMNS, *PLACED))}",
    "signals": "a signal, such as contact or rtd_3wire",
    "frames": "a number -1000..1000 m",
    "decks": "a number -1000..1000 m",
}


# Titles ---------------------------------------------------------------------------------------


@cache
def words() -> Words:
    """Return the titles of an I/O list."""
    quantities = [name for name, holds in COLUMNS.items() if holds in ("length", "time")]
    units = {name: name.rpartition("_")[2] for name in quantities}
    titles = {word: means[0][0] for word, means in spellings("column").items()}
    titles |= {plain(name): name for name in (*COLUMNS, *PLACED) if name not in units}
    titles |= {plain(name.rpartition("_")[0]): name for name in units}
    return Words(titles, units | {"side": "m"})


def column_of(title: str, assigned: tuple[tuple[str, str], ...] = ()) -> Column | None:
    """Return the column of an I/O list that a title names, or None."""
    return words().column_of(title, assigned)


# Intrinsic safety -----------------------------------------------------------------------------

_SAFE = re.compile(
    r"[\[(]?\b(?:ex[ -]?\(?\[?i[abc]?\]?\)?|eex ?i[abc]?|intrinsically safe|intrinsic safe|"
    r"I\.?S\.?(?= |\)|\]|$))[\])]?(?: ?II[ABC](?: ?T[1-6])?)?",
    re.IGNORECASE,
)

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
    matches = [_AFTER_EX.fullmatch(token) for token in tokens]
    alone = not any(one and one[1] is not None for one in matches)
    kinds, active = "", alone
    for token, one in zip(tokens, matches, strict=True):
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
    words, remainder = _INTRINSIC.findall(text), _INTRINSIC.sub(" ", text)
    kinds = _protection(remainder)
    safe = bool(words) or "i" in kinds
    other = bool({*kinds} & {*"demnopqst"} or _OTHER.search(remainder))
    # The verb is may stand beside other words.
    verb = not kinds and {*map(len, words)} & {2, 3} and re.search(r"\w", remainder)
    return safe, safe != other and not verb and not _UNLESS.search(text)


def without_safety(word: str) -> tuple[str, str]:
    """Return a signal without its intrinsic-safety marking, and the marking."""
    mark = None if meanings(word) else _SAFE.search(word)
    if mark is None:
        return word, ""
    remainder = " ".join((word[: mark.start()] + " " + word[mark.end() :]).split())
    return remainder, mark[0].strip("[]() ")
