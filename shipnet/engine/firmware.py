"""The times within a junction box: input conversion, frames, and interrupts."""

from __future__ import annotations

from shipnet.fields import check_whole, number, record

#: Clock cycles of one conversion of the AT90CAN128's ADC, and clock cycles from its start until the
#: input is sampled; Atmel, AT90CAN128 data sheet, section "ADC".
_CLOCKS, _HOLD = 13, 1.5


@record(slots=True)
class Firmware:
    """Times within a junction box. The paper prints none of them: all are **assumed**.

    The main loop converts all analogue inputs, reads the switches and hands the frames to the CAN
    controller. Three routines interrupt it, in this order of priority: Modbus, timer, CAN.

    Notes
    -----
    The Modbus interrupt suspends everything else; the bytes of its response are sent one by
    one alongside other work. The timer and CAN routines are short and run while the loop waits for
    the multiplexer, so they do not delay the loop (lee2012, section III.2, figures 5 and 6). A
    conversion takes 13 cycles of a clock of 50..200 kHz (Atmel, AT90CAN32/64/128 data sheet).

    Examples
    --------
    Conversion times of the three boxes, which have 37, 16 and 27 analogue inputs [ms]:

    >>> [round(Firmware().conversion_time(n) * 1e3, 2) for n in (37, 16, 27)]
    [40.85, 17.66, 29.81]
    """

    adc_clock: float = number(
        50e3, 200e3, "Hz", "ADC clock; 125 kHz is a 16 MHz crystal divided by 128", default=125e3
    )
    settling: float = number(
        0, 1, "s", "Settling time of the input filter after an input is selected", default=1e-3
    )
    send: float = number(
        1e-9, 1, "s", "Time to pass one frame to the CAN controller", default=100e-6
    )
    receive: float = number(
        1e-9, 1e-3, "s", "CAN interrupt: time to read a frame and restart a timer", default=50e-6
    )
    mark: float = number(
        1e-9, 1e-3, "s", "Timer interrupt: time to mark stale values", default=100e-6
    )
    processing: float = number(
        1e-9,
        1,
        "s",
        "Time of the Modbus interrupt: from the end of the silence after a request to the first "
        "bit of the response",
        default=5e-3,
    )

    @property
    def input_time(self) -> float:
        """Time of one analogue input: settling and conversion [s]."""
        return self.settling + _CLOCKS / self.adc_clock

    def conversion_time(self, n_analogue: int) -> float:
        """Return the conversion time of 0..1000 analogue inputs [s]."""
        return check_whole("n_analogue", n_analogue, 0, 1000) * self.input_time

    @property
    def sampling_time(self) -> float:
        """Time from the selection of an analogue input until it is sampled [s]."""
        return self.settling + _HOLD / self.adc_clock
