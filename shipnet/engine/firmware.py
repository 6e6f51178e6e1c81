"""The program of a junction box: one firmware, whose switch chooses the box that it serves.

Its main loop converts all analogue inputs, reads the switches, hands the frames to the CAN
controller, and begins again. Three routines interrupt it: Modbus before timer before CAN.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from shipnet.errors import ArgumentError
from shipnet.fields import check_scalar, check_whole

__all__ = ["Cpu", "Firmware"]

Integers = npt.NDArray[np.int64]

#: Clocks of one conversion of the AT90CAN128's ADC; Atmel, AT90CAN128 data sheet, section "ADC".
_CLOCKS = 13

#: Legal range of every duration [s].
_RANGES = {
    "settling": (0.0, 1.0),
    "send": (1e-9, 1.0),
    "receive": (1e-9, 1e-3),
    "mark": (1e-9, 1e-3),
    "processing": (1e-9, 1.0),
}


@dataclass(frozen=True, slots=True)
class Firmware:
    """How long a junction box works at what. The paper prints none of it: all is **assumed**.

    Parameters
    ----------
    adc_clock : float, default 125e3
        Clock of the ADC, 50e3..200e3 [Hz]; 125 kHz is a 16 MHz crystal divided by 128.
    settling : float, default 1e-3
        Wait after the multiplexer has chosen an input, until its filter has settled, 0..1 [s].
    send : float, default 100e-6
        To hand one frame to the CAN controller, above 0, up to 1 [s].
    receive : float, default 50e-6
        CAN interrupt: to take over one frame and reset the timer of its sender, up to 1e-3 [s].
    mark : float, default 100e-6
        Timer interrupt: to mark the values of a silent box, up to 1e-3 [s].
    processing : float, default 5e-3
        Modbus interrupt: from the end of the silence behind a request to the first bit of the
        response, up to 1 [s].
    holds_cpu : bool, default False
        Whether the Modbus interrupt keeps the CPU until the last byte is sent, as figure 6(a)
        may be read; otherwise the bytes go out one by one beside other work.

    Raises
    ------
    ArgumentError
        If a field is out of its range.

    Notes
    -----
    The Modbus interrupt breaks into everything; it suspends the main loop for its whole length.
    The short timer and CAN routines run while the loop waits for the multiplexer, so they do not
    prolong it.

    References
    ----------
    .. [1] J. H. Lee, D. S. Kim, "Design and implementation of distributed control system based on
       dual field-bus for ship engine", J. IEEK 49-SC(2), 2012, section III.2, figures 5 and 6.
    .. [2] Atmel, "AT90CAN32/64/128" data sheet: a conversion takes 13 clocks of 50..200 kHz,
       65..260 us.

    Examples
    --------
    The three modes, 37, 16 and 27 analogue inputs:

    >>> [round(Firmware().conversion_time(n) * 1e3, 2) for n in (37, 16, 27)]
    [40.85, 17.66, 29.81]
    >>> [round(Firmware(f, settling=0).conversion_time(1) * 1e6) for f in (50e3, 200e3)]
    [260, 65]
    """

    adc_clock: float = 125e3
    settling: float = 1e-3
    send: float = 100e-6
    receive: float = 50e-6
    mark: float = 100e-6
    processing: float = 5e-3
    holds_cpu: bool = False

    def __post_init__(self) -> None:
        """Check every field."""
        clock = check_scalar("adc_clock", self.adc_clock, "Hz", 50e3, 200e3)
        object.__setattr__(self, "adc_clock", clock)
        for name, (low, high) in _RANGES.items():
            value = check_scalar(name, getattr(self, name), "s", low, high)
            object.__setattr__(self, name, value)
        if not isinstance(self.holds_cpu, bool):
            raise ArgumentError(f"holds_cpu is {self.holds_cpu!r}; it must be True or False")

    @property
    def input_time(self) -> float:
        """One analogue input: settling and conversion [s]."""
        return self.settling + _CLOCKS / self.adc_clock

    def conversion_time(self, n_analogue: int) -> float:
        """Return how long the inputs of a box take [s].

        Parameters
        ----------
        n_analogue : int
            Number of its analogue inputs, 0..1000.
        """
        return check_whole("n_analogue", n_analogue, 0, 1000) * self.input_time


class Cpu:
    """What the Modbus interrupt leaves of a CPU's time, in whole nanoseconds.

    Parameters
    ----------
    begins : array_like of int, shape (n_requests,)
        When each Modbus interrupt begins [ns], rising.
    length : int
        How long each takes [ns]; the next does not begin earlier.

    Examples
    --------
    Two interrupts of 10 ns; work of 30 ns that is due at 95 ends 10 ns later for the first:

    >>> cpu = Cpu([100, 200], 10)
    >>> cpu.at(cpu.until(np.array([95, 105, 120])) + 30).tolist()
    [135, 140, 150]
    """

    def __init__(self, begins: npt.ArrayLike, length: int) -> None:
        self.begins = np.asarray(begins, dtype=np.int64)
        self.length = length
        self._left = self.begins - length * np.arange(self.begins.size)

    def until(self, time: Integers) -> Integers:
        """Return how much time the interrupts have left until a time [ns].

        Parameters
        ----------
        time : ndarray of int64
            Times [ns].
        """
        begun = np.searchsorted(self.begins, time, side="right")
        if not self.begins.size:
            return np.asarray(time, dtype=np.int64)
        inside = time - self.begins[np.maximum(begun - 1, 0)]
        last = np.where(begun > 0, np.minimum(inside, self.length), 0)
        taken = self.length * np.maximum(begun - 1, 0) + last
        return np.asarray(time - taken, dtype=np.int64)

    def at(self, left: Integers) -> Integers:
        """Return when so much time has been left: the inverse of `until` [ns].

        Parameters
        ----------
        left : ndarray of int64
            Time left since the start of the clock [ns]. Work that is done when an interrupt
            begins is done before it.
        """
        begun = np.searchsorted(self._left, left, side="left")
        return np.asarray(left + self.length * begun, dtype=np.int64)

    def queue(self, due: Integers, work: int) -> Integers:
        """Return when jobs of one kind begin that wait for each other.

        Parameters
        ----------
        due : ndarray of int64, shape (n_jobs,)
            When each is due [ns], not falling.
        work : int
            What each takes of the CPU [ns].

        Returns
        -------
        ndarray of int64, shape (n_jobs,)
            CPU time left by the interrupts at which each *begins*; `at` makes times of them.
        """
        number = work * np.arange(due.size, dtype=np.int64)
        return np.asarray(number + np.maximum.accumulate(self.until(due) - number), dtype=np.int64)
