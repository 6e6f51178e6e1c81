"""What came of a simulation: the transactions, and what an analyser makes of them."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import numpy.typing as npt

from shipnet.asi.calls import Call
from shipnet.asi.simulation.master import Phase
from shipnet.asi.simulation.record import ATTEMPT, EXECUTED, OUTCOME, PHASE, Record
from shipnet.asi.telegram import REQUEST_BITS, RESPONSE_BITS

if TYPE_CHECKING:
    import pandas as pd

    from shipnet.asi.simulation.master import Master
    from shipnet.asi.simulation.slave import Slave

__all__ = ["InputChange", "Simulation", "Summary"]

Floats = npt.NDArray[np.float64]


class InputChange(NamedTuple):
    """The input ports of a slave change to a value at a time [s]."""

    time: float
    slave: str
    value: int


@dataclass(frozen=True)
class Summary:
    """The numbers of a simulation that are looked at first.

    Parameters
    ----------
    cycles : int
        Complete cycles.
    cycle_time : tuple of float
        Least, mean and longest cycle [s]; NaN without any.
    requests : int
        Requests in all cycles, repetitions included.
    repetitions : int
        Requests that were sent again.
    dropped : int
        How often a slave was dropped for its failures.
    lost_replies : int
        Requests that were carried out although the master got no reply.
    """

    cycles: int
    cycle_time: tuple[float, float, float]
    requests: int
    repetitions: int
    dropped: int
    lost_replies: int

    def __str__(self) -> str:
        """Say it in two lines."""
        least, mean, most = (1e3 * time for time in self.cycle_time)
        return (
            f"{self.cycles} cycles of {mean:.2f} ms ({least:.2f} to {most:.2f} ms), "
            f"{self.requests} requests in them\n"
            f"{self.repetitions} repetitions, {self.dropped} slaves dropped, "
            f"{self.lost_replies} replies to executed requests lost"
        )


@dataclass(frozen=True)
class Simulation:
    """A finished simulation.

    Parameters
    ----------
    record : Record
        What was sent, packed.
    end : float
        When it ended [bit].
    masters : list of Master
        The master, and the standby master behind it if that took over.
    slaves : list of Slave
        The slaves as they are at the end.
    changes : list of InputChange
        What happened at the inputs.
    """

    record: Record
    end: float
    masters: list[Master]
    slaves: list[Slave]
    changes: list[InputChange]

    @property
    def master(self) -> Master:
        """Who leads at the end."""
        return self.masters[-1]

    @cached_property
    def transactions(self) -> pd.DataFrame:
        """One row a transaction; the columns are those of `Record.table`."""
        return self.record.table()

    @cached_property
    def cycle_times(self) -> Floats:
        """Length of each complete cycle, shape (n_cycles,) [s]."""
        if not self.record.cycles:
            return np.zeros(0)
        rows, numbers = np.array([*self.record.cycles, (len(self.record.start), -2)]).T
        starts = np.append(self.record.starts, self.end)[rows]
        complete = (numbers[:-1] >= 0) & (numbers[1:] == numbers[:-1] + 1)
        return np.asarray(np.diff(starts)[complete] * self.record.timing.bit_time)

    def summary(self) -> Summary:
        """Return the numbers that are looked at first.

        Returns
        -------
        Summary
            They count the cycles; start-up is left out.
        """
        times = self.cycle_times
        nan = float("nan")
        span = (times.min(), times.mean(), times.max()) if times.size else (nan, nan, nan)
        record = self.record
        cyclic = record.cycle >= 0
        lost = (record.field(OUTCOME, 4) > 0) & (record.field(EXECUTED, 1) == 1)
        return Summary(
            cycles=times.size,
            cycle_time=(float(span[0]), float(span[1]), float(span[2])),
            requests=int(cyclic.sum()),
            repetitions=int((cyclic & (record.field(ATTEMPT, 3) > 0)).sum()),
            dropped=sum(len(master.dropped) for master in self.masters),
            lost_replies=int((cyclic & lost).sum()),
        )

    @cached_property
    def lists(self) -> pd.DataFrame:
        """What entered and left the lists: ``time_s``, ``list``, ``slave``, ``present``."""
        import pandas as pd

        rows = [change for master in self.masters for change in master.lists.changes]
        return pd.DataFrame(rows, columns=["time_s", "list", "slave", "present"])

    @cached_property
    def commands(self) -> pd.DataFrame:
        """What became of the host's commands: ``time_s``, ``command``, ``done``, ``outcome``."""
        import pandas as pd

        rows = [
            (time, str(command), done, outcome)
            for master in self.masters
            for time, command, done, outcome in master.finished
        ]
        return pd.DataFrame(rows, columns=["time_s", "command", "done", "outcome"])

    def _exchanges(self) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.int64]]:
        """Return the rows with data exchanges, sorted by slave and time, and their slaves."""
        record = self.record
        slave = record.field(4, 7)
        rows = np.flatnonzero(record.field(0, 4) == Call.DATA_EXCHANGE)
        rows = rows[np.argsort(slave[rows], kind="stable")]
        return rows, slave[rows]

    def failure_classes(self) -> pd.DataFrame:
        """Count the failures in a row, as an analyser does.

        Returns
        -------
        pandas.DataFrame
            Indexed by slave; column n counts how often n data exchanges failed in a row, from 1
            to the number after which the master drops the slave, or more: 6 by default.

        References
        ----------
        .. [1] Siemens, "AS-Interface Analyser 3RK1904-3AB01", manual.
        """
        import pandas as pd

        leading = self.masters[0]
        worst = (1 + leading.repetitions) * leading.drop_after
        rows, slave = self._exchanges()
        failed = self.record.field(OUTCOME, 4)[rows] > 0
        # A run of failures ends with a success, with another slave, or with the record.
        border = np.ones(rows.size, dtype=bool)
        border[1:] = (failed[1:] != failed[:-1]) | (slave[1:] != slave[:-1])
        begins = np.flatnonzero(border)
        length = np.diff(np.append(begins, rows.size))
        runs = failed[begins]
        table = pd.crosstab(
            pd.Index(_labels(slave[begins][runs]), name="slave"),
            pd.Index(np.minimum(length[runs], worst), name="class"),
        )
        everybody = _labels(np.unique(slave))
        whole = table.reindex(index=everybody, columns=range(1, worst + 1), fill_value=0)
        return whole.rename_axis(index="slave", columns="class")

    def response_times(self) -> pd.DataFrame:
        """Return how old inputs are when they reach the master.

        Returns
        -------
        pandas.DataFrame
            Indexed by slave: ``least_s``, ``mean_s``, ``longest_s`` of the time from a change of
            an input to the end of the response that reports it, for a change at a random time
            between the first cyclic exchange that succeeds and the last.

        Notes
        -----
        A change waits for the next exchange that succeeds. A slave that was dropped meanwhile
        has a long time for it.
        """
        import pandas as pd

        rows, slave = self._exchanges()
        cyclic = self.record.field(PHASE, 3)[rows] == Phase.DATA_EXCHANGE
        keep = cyclic & (self.record.field(OUTCOME, 4)[rows] == 0)
        rows, slave = rows[keep], slave[keep]
        sampled, known = self._sampled(rows)
        same = slave[1:] == slave[:-1]
        waited = (sampled[1:] - sampled[:-1])[same]
        longest, least = (known[1:] - sampled[:-1])[same], (known[1:] - sampled[1:])[same]
        area = (longest**2 - least**2) / 2
        frame = pd.DataFrame(
            {
                "slave": _labels(slave[1:][same]),
                "least_s": least,
                "longest_s": longest,
                "area": area,
                "waited": waited,
            }
        )
        grouped = frame.groupby("slave", sort=False)
        totals = grouped[["area", "waited"]].sum()
        return pd.DataFrame(
            {
                "least_s": grouped["least_s"].min(),
                "mean_s": totals["area"] / totals["waited"],
                "longest_s": grouped["longest_s"].max(),
            }
        )

    def _sampled(self, rows: npt.NDArray[np.int64]) -> tuple[Floats, Floats]:
        """Return when the slave took its inputs, and when the master had them [s]."""
        record = self.record
        sampled = record.starts[rows] + REQUEST_BITS
        known = sampled + record.pauses[rows] + RESPONSE_BITS
        return sampled * record.timing.bit_time, known * record.timing.bit_time

    def input_changes(self) -> pd.DataFrame:
        """Return when the master learnt of each change of inputs.

        Returns
        -------
        pandas.DataFrame
            One row a change: ``time_s``, ``slave``, ``value``, and ``response_time_s``, NaN where
            the simulation ended before, or the input had changed again.
        """
        import pandas as pd

        rows, slave = self._exchanges()
        keep = self.record.field(OUTCOME, 4)[rows] == 0
        rows, labels = rows[keep], np.array(_labels(slave[keep]))
        sampled, known = self._sampled(rows)
        answers = []
        for change in self.changes:
            later = [
                c.time for c in self.changes if c.slave == change.slave and c.time > change.time
            ]
            own = labels == change.slave
            place = np.searchsorted(sampled[own], change.time)
            seen = place < own.sum() and sampled[own][place] < min(later, default=np.inf)
            answers.append(known[own][place] - change.time if seen else np.nan)
        frame = pd.DataFrame(self.changes, columns=["time_s", "slave", "value"])
        return frame.assign(response_time_s=np.array(answers, dtype=float))


def _labels(slave: npt.NDArray[np.int64]) -> list[str]:
    """Return the labels of packed slaves: five bits of address, two of half."""
    return [f"{code & 31}{('', 'A', 'B')[code >> 5]}" for code in slave.tolist()]
