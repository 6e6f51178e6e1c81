"""Logs of sensor readings, as data loggers and spreadsheets save them."""

from __future__ import annotations

from collections.abc import Callable
from itertools import product
from os import PathLike

import numpy as np

from shipnet.arrays import Floats
from shipnet.ballast.rule_table import rule_base
from shipnet.ballast.sensors import position_speed
from shipnet.fuzzy.rules import RuleBase
from shipnet.lazy import pd
from shipnet.lists import ALIKE, Cells, Words
from shipnet.signals import plain
from shipnet.tables import Remark, read_sheet

#: Titles other than those of variables.
_TITLES = {
    "time": "time timestamp t datetime zeit uhrzeit zeitstempel datumuhrzeit datumundzeit datumzeit"
    " 시간 시각 일시",
    "date": "date datum 날짜 일자",
    "valve": "valve ventil 밸브",
    "note": "note notes remark remarks comment bemerkung no nr 비고 번호",
}

#: Dates and times of day: ISO, German and Korean.
_DAYS = ("", "%Y-%m-%d ", "%Y/%m/%d ", "%d.%m.%Y ", "%d.%m.%y ", "%Y. %m. %d. ")
_FORMS = list(map("".join, product(_DAYS, ("%H:%M:%S.%f", "%H:%M", "%p %I:%M:%S.%f"))))

#: What some logs write differently: decimal commas, whole seconds, Korean halves of a day, and the
#: midnight that a workbook adds to a date.
_SPELLINGS = {",": ".", r"(?<=\d)T(?=\d)": " ", "오전": "AM", "오후": "PM", " 00:00:00 ": " "}
_SPELLINGS |= {r"(:\d\d:\d\d)Z?$": r"\1.0"}


class _Log(Cells):
    """The cells of a log."""

    noun, key = "sample", "time"
    missing = frozenset("nan - -- --- n/a na #n/a #nv null".split())
    hint = "rename them, or use them as labels of the variables in the rules"

    def column_faults(self) -> list[str]:
        """Return that the column of times is missing; a column of dates may contain them."""
        return [] if {"time", "date"} & self.places.keys() else ["no column time"]

    def is_entry(self, cell: Callable[[str], str]) -> bool:
        """Return whether a row has a time."""
        return any(map(str.isdigit, cell("time") or cell("date")))

    def time(self) -> Floats:
        """Return the times [s]; times of day are counted from the first."""
        texts = pd.Series(map(" ".join, zip(self["date"], self["time"], strict=True))).str.strip()
        if texts.str.contains(":").any():
            texts = texts.replace(_SPELLINGS, regex=True)
            some = texts[texts != ""][:100]
            form = max(_FORMS, key=lambda form: _stamps(some, form).notna().sum())
            stamps = _stamps(texts, form)
            seconds = np.asarray((stamps - stamps.min()).dt.total_seconds(), dtype=float)
        else:
            seconds = self.numbers("time", -1e12, 1e12)
        legal = "a time such as 12:00:01.5, 2026-11-30 12:00:01 or 30.11.2026 12:00:01"
        column = "time" if "time" in self.places else "date"
        self.wrong(np.flatnonzero(np.isnan(seconds)).tolist(), column, legal)
        earlier = np.flatnonzero(np.diff(seconds) < 0) + 1
        self.wrong(earlier.tolist(), column, "a time that is not before that of the row above")
        return seconds


def _stamps(texts: pd.Series[str], form: str) -> pd.Series[pd.Timestamp]:
    return pd.to_datetime(texts, format=form, errors="coerce")


def _log_of(base: RuleBase) -> type[_Log]:
    """Return the kind of log that has the variables of a rule base, and the position."""
    written = {"VPos": "%", **{one.name: one.unit for one in base.variables}}
    labels = [one.english for one in base.variables]
    pairs = [(one.english, one.name) for one in base.variables if labels.count(one.english) == 1]
    titles = dict[str, str]()
    for word, name in [*filter(all, pairs), *zip(written, written, strict=True)]:
        usual = written[name].casefold()
        powers = ALIKE.get(usual, {usual: 0})
        for unit in ("", *(one for one, power in powers.items() if power == powers[usual])):
            titles |= {plain(f"{word}{unit}"): name, plain(f"{word} in {unit}"): name}
    titles |= {plain(word): name for name, all_ in _TITLES.items() for word in all_.split()}
    units = {name: unit.casefold() for name, unit in written.items()}
    units = {name: unit if unit in ALIKE else "" for name, unit in units.items()}

    class Log(_Log):
        words = Words(titles, {**units, "time": "s"})
        titled_by = frozenset(written)

    return Log


def read_log(path: str | PathLike[str], rules: RuleBase | None = None) -> pd.DataFrame:
    r"""Read a log of the readings of one valve, for the variables of a rule base.

    Parameters
    ----------
    path : path
        A CSV file or Excel workbook with one row per sample, and columns for the time and the
        variables. A title is the name or label of a variable, with or without a unit, such as
        ``FP [mbar]``; values are converted to the variable's unit. Numbers may have a decimal
        comma. Times are seconds, or times of day with or without a date, in ascending order.
    rules : RuleBase, optional
        The rules whose variables are read, by default those of the paper.

    Returns
    -------
    pandas.DataFrame
        One column per variable, indexed by ``time_s``, for `RuleBase.decide`; NaN where a reading
        is missing. ``attrs["remarks"]`` lists what is not used or missing. Without a column
        ``DVPos``, the speed is computed from ``VPos``: its absolute mean since the latest reading
        at least 1 s old, also while the motor is off.

    Raises
    ------
    InputError
        If the file cannot be read, or has faults; the message names their rows and columns.

    Examples
    --------
    >>> from pathlib import Path
    >>> from tempfile import TemporaryDirectory
    >>> with TemporaryDirectory() as folder:
    ...     file = Path(folder, "log.csv")
    ...     size = file.write_text("Zeit;FP [bar];OP [mbar]\n12:00:00;90,5;2000\n12:00:01;95;35\n")
    ...     log = read_log(file)
    >>> log[["FP", "OP"]].reset_index().to_numpy().tolist()
    [[0.0, 90.5, 2.0], [1.0, 95.0, 0.035]]
    """
    base = rules if rules is not None else rule_base()
    kind = _log_of(base)
    what = f"titles of a time and of variables ({', '.join(base.names)})"
    cells = kind(read_sheet(path, is_titles=kind.score(), what=what))
    time = cells.time()
    values = {name: cells.numbers(name, -1e9, 1e9) for name in (*base.names, "VPos")}
    if len(set(cells["valve"])) > 1:
        cells.check("has rows of several valves; save one file per valve")
    cells.check()
    if "DVPos" in base.names and "DVPos" not in cells.places and "VPos" in cells.places:
        values["DVPos"] = position_speed(time, values["VPos"][:, np.newaxis])[:, 0]
        cells.remarks.append(Remark("DVPos computed from VPos"))
    if missing := [name for name in base.names if np.isnan(values[name]).all()]:
        cells.remarks.append(Remark(f"no values of {', '.join(missing)}"))
    log = pd.DataFrame({name: values[name] for name in base.names}, pd.Index(time, name="time_s"))
    log.attrs["remarks"] = cells.shown
    return log
