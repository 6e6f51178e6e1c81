"""What a capture says about the network as a whole: cycle, faults, margins of each slave."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from shipnet.asi.receiver import AMPLITUDE_TOLERANCE, RINGING_TOLERANCE
from shipnet.asi.transactions import CUT_OFF, NO_ANSWER

if TYPE_CHECKING:
    import pandas as pd

__all__ = ["Summary", "summarize"]

#: A master repeats a request at once [s]; later than this it is the next cycle.
_AT_ONCE = 1e-3


@dataclass(frozen=True)
class Summary:
    """The network that was heard.

    Attributes
    ----------
    transactions : int
        Rows of the table.
    cycle_time : float
        Median time from one data exchange with an address to the next one, repetitions left out
        [s]; NaN if no address comes twice.
    repetitions : int
        Requests that come again at once after one that failed: the same bits, but for one at
        most, in which two requests in order never differ.
    unanswered : int
        Requests in order whose answer did not come.
    seen : list of str
        Slaves that answered, such as ``"21"`` or ``"21B"``.
    missing : list of str
        Slaves that were asked and never answered. A master also asks free addresses, one a
        cycle, to find new slaves.
    errors : dict of str to int
        Bad telegrams by class.
    cut_off : int
        Telegrams at the ends of the record, or at a gap in it.
    slaves : pandas.DataFrame
        One row a slave: ``requests``, ``answers`` without an error, ``errors`` of its responses,
        ``amplitude_V`` (median of the first pulses), ``weakest_pulse`` (smallest) and ``ringing``
        (largest) of its responses, and what they leave of the tolerances:
        ``amplitude_margin`` (`weakest_pulse` - 0.65) and ``ringing_margin`` (0.30 - `ringing`),
        both over the largest pulse; negative is out of tolerance.
    """

    transactions: int
    cycle_time: float
    repetitions: int
    unanswered: int
    seen: list[str]
    missing: list[str]
    errors: dict[str, int]
    cut_off: int
    slaves: pd.DataFrame

    def __str__(self) -> str:
        """Report in a few lines."""
        errors = ", ".join(f"{name} {count}" for name, count in self.errors.items())
        cycle = "unknown" if np.isnan(self.cycle_time) else f"{self.cycle_time * 1e3:.3f} ms"
        return "\n".join(
            [
                f"transactions   {self.transactions}, {self.cut_off} telegrams cut off",
                f"cycle time     {cycle}",
                f"repetitions    {self.repetitions}",
                f"unanswered     {self.unanswered}",
                f"slaves seen    {', '.join(self.seen) or 'none'}",
                f"never answered {', '.join(self.missing) or 'none'}",
                f"errors         {errors or 'none'}",
            ]
        )


def summarize(transactions: pd.DataFrame) -> Summary:
    """Summarise a table of transactions.

    Parameters
    ----------
    transactions : pandas.DataFrame
        As `shipnet.asi.capture.Capture` describes it.

    Returns
    -------
    Summary
        Printed, it is a report.

    Examples
    --------
    >>> from shipnet.asi.transactions import Telegrams, transactions_of
    >>> print(summarize(transactions_of(Telegrams.none(), np.array([1.0]))))
    transactions   0, 0 telegrams cut off
    cycle time     unknown
    repetitions    0
    unanswered     0
    slaves seen    none
    never answered none
    errors         none
    """
    states = transactions[["request_error", "response_error"]].to_numpy()
    told = [state for state in states.ravel() if state not in ("", "ok", CUT_OFF, NO_ANSWER)]
    repeated = _repeated(transactions)
    slaves = _slaves(transactions)
    answered = slaves["answers"] > 0
    asked = slaves["requests"] > 0
    return Summary(
        len(transactions),
        _cycle_time(transactions[~repeated]),
        int(repeated.sum()),
        int((transactions["response_error"] == NO_ANSWER).sum()),
        list(slaves.index[answered]),
        list(slaves.index[asked & ~answered & (slaves["unanswered"] > 0)]),
        {name: told.count(name) for name in sorted(set(told))},
        int((states == CUT_OFF).sum()),
        slaves.drop(columns="unanswered"),
    )


def _repeated(transactions: pd.DataFrame) -> npt.NDArray[np.bool_]:
    """Return which rows ask again what the row before them asked in vain."""
    request = transactions["request"].to_numpy()
    start = transactions["start_s"].to_numpy()
    failed = (
        ~transactions["request_error"].isin(["ok", CUT_OFF])
        | ~transactions["response_error"].isin(["ok", "", CUT_OFF])
    ).to_numpy()
    repeated = np.zeros(len(request), dtype=bool)
    for row in np.flatnonzero(failed[:-1]) + 1:
        before, now = request[row - 1], request[row]
        if before and len(before) == len(now) and start[row] - start[row - 1] < _AT_ONCE:
            differences = sum(a != b for a, b in zip(before, now, strict=True) if a != "?")
            repeated[row] = differences <= 1
    return repeated


def _cycle_time(transactions: pd.DataFrame) -> float:
    data = transactions[transactions["call"] == "data exchange"]
    times = data.groupby("address")["start_s"].diff().dropna()
    return float(times.median()) if len(times) else float("nan")


def _slaves(transactions: pd.DataFrame) -> pd.DataFrame:
    import pandas as pd

    rows = transactions[
        transactions["address"].notna() & (transactions["call"] != "broadcast reset")
    ]
    place = rows["address"].astype(int)
    label = place.astype(str) + rows["half"]
    answer = rows["response_error"] == "ok"
    heard = rows[answer]
    by = rows.groupby(label)
    good = heard.groupby(label[answer])
    table = pd.DataFrame(
        {
            "requests": by.size(),
            "answers": good.size().reindex(by.size().index, fill_value=0),
            "unanswered": (rows["response_error"] == NO_ANSWER).groupby(label).sum(),
            "errors": (~rows["response_error"].isin(["ok", "", NO_ANSWER, CUT_OFF]))
            .groupby(label)
            .sum(),
            "amplitude_V": good["response_amplitude_V"].median(),
            "weakest_pulse": good["weakest_pulse"].min(),
            "ringing": good["ringing"].max(),
        }
    )
    table["amplitude_margin"] = table["weakest_pulse"] - AMPLITUDE_TOLERANCE
    table["ringing_margin"] = RINGING_TOLERANCE - table["ringing"]
    order = pd.DataFrame({"place": place.groupby(label).first(), "name": by.size().index})
    table = table.loc[order.sort_values(["place", "name"]).index]
    return table.rename_axis("slave")
