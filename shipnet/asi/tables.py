"""The tables of the protocol, read off the code that encodes and decodes it."""

from __future__ import annotations

import pandas as pd

from shipnet.asi.calls import Call
from shipnet.asi.frame import REQUEST_BITS, RESPONSE_BITS, frame, information_of
from shipnet.asi.profile import IO_CONFIGURATIONS
from shipnet.errors import FrameError

__all__ = ["io_code_table", "request_fields", "request_map", "response_fields"]

_PLACES = ["CB", "A4", "A3", "A2", "A1", "A0", "I4", "I3", "I2", "I1", "I0"]


def request_map(*, extended: bool = True) -> pd.DataFrame:
    """Return all requests bit by bit: kim2023's Table 5, from the patterns of `Call`.

    Parameters
    ----------
    extended : bool, default True
        Whether to show the requests to A/B slaves (with select bit) or to standard slaves.

    Returns
    -------
    pandas.DataFrame
        One row a call, indexed by its name, one column a bit. A cell is 0 or 1 where the bit is
        fixed, else the name of what it carries; ``S`` is the select bit, ``~S`` its inverse.

    Examples
    --------
    >>> request_map().loc["RESET", "I4":"I0"].tolist()
    ['1', '~S', '1', '0', '0']
    >>> request_map(extended=False).loc["DATA_EXCHANGE", "I4":"I0"].tolist()
    ['0', 'D3', 'D2', 'D1', 'D0']
    """
    rows = {}
    for call in Call:
        layout = call.rule.layout(extended)
        left = layout.count("d")
        cells = []
        for letter, place in zip(layout, _PLACES, strict=True):
            if letter == "d":
                left -= 1
                cells.append(f"{call.rule.symbol}{left}")
            elif letter == "a":
                cells.append(place)
            else:
                cells.append({"s": "S", "S": "~S"}.get(letter, letter))
        rows[call.name] = ["0", *cells, "PB", "1"]
    columns = ["ST", *_PLACES, "PB", "EB"]
    return pd.DataFrame.from_dict(rows, orient="index", columns=columns).rename_axis("call")


def request_fields() -> pd.DataFrame:
    """Return the fields of a request with their lengths and values: kim2023's Table 4.

    Returns
    -------
    pandas.DataFrame
        Indexed by the field's symbol; what the values 0 and 1 mean is found out by asking the
        decoder and the patterns of the calls.

    Examples
    --------
    >>> request_fields().length_bit.sum()
    np.int64(14)
    """
    by_control = {
        bit: " ".join(call.name for call in Call if call.rule.pattern[0] == bit) for bit in "01"
    }
    rows = [
        ("ST", "start bit", 1, *_start_and_end(REQUEST_BITS)[0], ""),
        ("CB", "control bit", 1, by_control["0"], by_control["1"], ""),
        ("A0~A4", "address", 5, "", "", ""),
        ("I0~I4", "information", 5, "", "", ""),
        ("PB", "parity bit", 1, "", "", _parity_counts(REQUEST_BITS)),
        ("EB", "end bit", 1, *_start_and_end(REQUEST_BITS)[1], ""),
    ]
    return _field_table(rows)


def response_fields() -> pd.DataFrame:
    """Return the fields of a response with their lengths and values: kim2023's Table 6.

    Returns
    -------
    pandas.DataFrame
        As for `request_fields`.

    Examples
    --------
    >>> response_fields().length_bit.sum()
    np.int64(7)
    """
    start, end = _start_and_end(RESPONSE_BITS)
    rows = [
        ("ST", "start bit", 1, *start, ""),
        ("I0~I3", "information", 4, "", "", ""),
        ("PB", "parity bit", 1, "", "", _parity_counts(RESPONSE_BITS)),
        ("EB", "end bit", 1, *end, ""),
    ]
    return _field_table(rows)


def _field_table(rows: list[tuple[str, str, int, str, str, str]]) -> pd.DataFrame:
    columns = ["symbol", "field", "length_bit", "value_0", "value_1", "ones_even_over"]
    return pd.DataFrame(rows, columns=columns).set_index("symbol")


def _readable(bits: str) -> bool:
    try:
        information_of(bits, len(bits), "telegram")
    except FrameError:
        return False
    return True


def _start_and_end(length: int) -> tuple[tuple[str, str], tuple[str, str]]:
    """Say for both values of the start and of the end bit whether a telegram can be read."""
    word = frame("0" * (length - 3))
    verdict = {True: "valid", False: "invalid"}
    # A parity bit that follows the start bit keeps the parity from deciding.
    start = tuple(verdict[_readable(f"{bit}{word[1:-2]}{bit}1")] for bit in "01")
    end = tuple(verdict[_readable(f"{word[:-1]}{bit}")] for bit in "01")
    return (start[0], start[1]), (end[0], end[1])


def _parity_counts(length: int) -> str:
    """Find out over which bits the decoder wants an even number of ones."""
    spans = {"all bits": slice(0, length), "all bits but the end bit": slice(0, length - 1)}
    words = [f"0{i:0{length - 2}b}1" for i in range(2 ** (length - 2))]
    return next(
        name
        for name, span in spans.items()
        if all((word[span].count("1") % 2 == 0) == _readable(word) for word in words)
    )


def io_code_table() -> pd.DataFrame:
    """Return the ports D0..D3 of every I/O configuration code: kim2023's Table 7.

    Returns
    -------
    pandas.DataFrame
        Indexed by the code as a hexadecimal digit.

    Examples
    --------
    >>> io_code_table().loc["9"].tolist()
    ['OUT', 'OUT', 'OUT', 'IN']
    """
    codes = pd.Index([f"{code:X}" for code in range(len(IO_CONFIGURATIONS))], name="code")
    return pd.DataFrame(IO_CONFIGURATIONS, index=codes, columns=["D0", "D1", "D2", "D3"])
