"""The messages of a network from a DBC file, and into one, through cantools."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
import pandas as pd

from shipnet.can.files.extras import load_extra
from shipnet.errors import ArgumentError, InputError

__all__ = ["Dbc", "read_dbc", "write_dbc"]

#: Columns of the signals and the cantools attribute that each one is.
_SIGNAL = {
    "signal": "name",
    "start": "start",
    "length": "length",
    "byte_order": "byte_order",
    "signed": "is_signed",
    "scale": "scale",
    "offset": "offset",
    "minimum": "minimum",
    "maximum": "maximum",
    "unit": "unit",
}

#: Longest cycle that cantools writes into a DBC, a whole number [ms].
_LONGEST_CYCLE = 65535


class Dbc(NamedTuple):
    """What a DBC file says.

    Attributes
    ----------
    messages : pandas.DataFrame
        A row a message: ``name``, ``arbitration_id``, ``extended``, ``dlc``, ``period_ms`` (NaN
        where none is given) and ``sender`` (empty where none is given); these are columns that
        `shipnet.can.bus.simulate` takes once every period is known.
    signals : pandas.DataFrame
        A row a signal: ``message``, ``signal``, ``start`` and ``length`` in bits, ``byte_order``
        (little_endian or big_endian), ``signed``, ``scale``, ``offset``, ``minimum``,
        ``maximum`` (NaN where none is given) and ``unit``.
    """

    messages: pd.DataFrame
    signals: pd.DataFrame


def read_dbc(path: str | os.PathLike[str]) -> Dbc:
    """Read messages and signals from a DBC file.

    Parameters
    ----------
    path : str or path-like
        The file.

    Returns
    -------
    Dbc
        Its messages and signals.

    Raises
    ------
    InputError
        If the file is missing or is no DBC file.
    ImportError
        If cantools is missing.

    Notes
    -----
    The period is the attribute GenMsgCycleTime; 0 there means that none is given. Multiplexers,
    value tables and comments are not kept.

    Examples
    --------
    >>> from tempfile import TemporaryDirectory
    >>> table = {"name": ["Level"], "arbitration_id": [5], "dlc": [2], "period_ms": [100]}
    >>> with TemporaryDirectory() as folder:  # doctest: +SKIP
    ...     write_dbc(f"{folder}/ship.dbc", table)
    ...     read_dbc(f"{folder}/ship.dbc").messages["period_ms"].tolist()
    [100.0]
    """
    cantools = load_extra("cantools")
    try:
        database = cantools.database.load_file(path, database_format="dbc")
    except OSError as problem:
        raise InputError(str(path), f"cannot be read: {problem.strerror}") from None
    except (cantools.database.Error, UnicodeError, ValueError) as problem:
        raise InputError(str(path), f"is no DBC file: {' '.join(str(problem).split())}") from None
    messages = pd.DataFrame(
        {
            "name": [m.name for m in database.messages],
            "arbitration_id": np.array([m.frame_id for m in database.messages], dtype=np.int64),
            "extended": np.array([m.is_extended_frame for m in database.messages], dtype=bool),
            "dlc": np.array([m.length for m in database.messages], dtype=np.int64),
            "period_ms": [float(m.cycle_time or np.nan) for m in database.messages],
            "sender": [m.senders[0] if m.senders else "" for m in database.messages],
        }
    )
    rows = [(m.name, s) for m in database.messages for s in m.signals]
    signals: dict[str, list[Any]] = {"message": [name for name, _ in rows]}
    for column, attribute in _SIGNAL.items():
        signals[column] = [getattr(signal, attribute) for _, signal in rows]
    table = pd.DataFrame(signals)
    for column in ("scale", "offset", "minimum", "maximum"):
        table[column] = table[column].astype(float)
    table["unit"] = table["unit"].fillna("")
    return Dbc(messages, table)


def write_dbc(
    path: str | os.PathLike[str],
    messages: pd.DataFrame | Mapping[str, npt.ArrayLike],
    signals: pd.DataFrame | Mapping[str, npt.ArrayLike] | None = None,
) -> None:
    """Write messages and signals as a DBC file.

    Parameters
    ----------
    path : str or path-like
        File to write.
    messages : pandas.DataFrame or mapping of str to array_like
        Columns as in `Dbc.messages`; ``extended``, ``period_ms`` and ``sender`` may be missing.
    signals : pandas.DataFrame or mapping of str to array_like, optional
        Columns as in `Dbc.signals`; ``scale``, ``offset``, ``minimum``, ``maximum``, ``unit`` and
        ``signed`` may be missing.

    Raises
    ------
    ArgumentError
        If a column is missing, a period is no whole number of milliseconds 1..65535, a signal
        belongs to no message, or cantools refuses a message or a signal.
    ImportError
        If cantools is missing.

    Examples
    --------
    >>> table = {"name": ["Level"], "arbitration_id": [5], "dlc": [2], "period_ms": [100]}
    >>> write_dbc("ship.dbc", table)  # doctest: +SKIP
    """
    cantools = load_extra("cantools")
    can = load_extra("cantools").database.can
    table, parts = pd.DataFrame(messages), pd.DataFrame({} if signals is None else signals)
    for what, given, needed in (
        ("messages", table, ("name", "arbitration_id", "dlc")),
        ("signals", parts, ("message", "signal", "start", "length") if len(parts) else ()),
    ):
        for column in needed:
            if column not in given:
                raise ArgumentError(f"{what} have no column {column!r}")
    known = set(table["name"])
    for row in parts.to_dict("records"):
        if row["message"] not in known:
            raise ArgumentError(f"signal {row['signal']!r} belongs to no message")
    try:
        built = [
            can.Message(
                frame_id=int(row["arbitration_id"]),
                name=row["name"],
                length=int(row["dlc"]),
                signals=[
                    _signal(can, part)
                    for part in parts.to_dict("records")
                    if part["message"] == row["name"]
                ],
                senders=[row["sender"]] if row.get("sender") else [],
                cycle_time=_cycle(row["name"], row.get("period_ms")),
                is_extended_frame=bool(row.get("extended", False)),
            )
            for row in table.to_dict("records")
        ]
        nodes = dict.fromkeys(sender for message in built for sender in message.senders)
        database = can.Database(messages=built, nodes=[can.Node(name) for name in nodes])
        text = database.as_dbc_string()
    except cantools.database.Error as problem:
        raise ArgumentError(f"messages make no DBC file: {problem}") from None
    Path(path).write_text(text, encoding="cp1252", newline="")


def _signal(can: Any, row: dict[Any, Any]) -> Any:
    def bound(column: str) -> float | None:
        value = row.get(column)
        return None if value is None or np.isnan(value) else float(value)

    conversion = load_extra("cantools").database.conversion.BaseConversion.factory(
        scale=row.get("scale", 1.0), offset=row.get("offset", 0.0)
    )
    return can.Signal(
        name=row["signal"],
        start=int(row["start"]),
        length=int(row["length"]),
        byte_order=row.get("byte_order", "little_endian"),
        is_signed=bool(row.get("signed", False)),
        conversion=conversion,
        minimum=bound("minimum"),
        maximum=bound("maximum"),
        unit=row.get("unit") or None,
    )


def _cycle(name: str, period: float | None) -> int | None:
    if period is None or np.isnan(period):
        return None
    if period != round(period) or not 1 <= period <= _LONGEST_CYCLE:
        raise ArgumentError(
            f"period_ms of message {name!r} is {period}; a DBC file takes a whole number "
            f"1..{_LONGEST_CYCLE}"
        )
    return int(period)
