"""The master's other side: what a PC on the ship's network asks it, in frames of Modbus/TCP."""

from __future__ import annotations

from collections.abc import Sequence

from shipnet.ballast.master import Station
from shipnet.ballast.registers import COMMAND_REGISTER
from shipnet.ballast.scales import FIRST_REGISTER, N_REGISTERS
from shipnet.modbus.adu import decode, tcp_frame
from shipnet.modbus.pdu import ExceptionCode
from shipnet.modbus.slave import DeviceError, Slave, Table, answer

__all__ = ["Gateway"]


class _Image:
    """A valve as the master knows it."""

    def __init__(self, station: Station, unit: int) -> None:
        self.station, self.unit = station, unit

    def read(self, table: Table, address: int, quantity: int, time: float) -> Sequence[int]:
        """Return registers of the status that came last; exception 11 before the first."""
        first = address - FIRST_REGISTER
        if table != "input_registers" or not 0 <= first <= N_REGISTERS - quantity:
            raise DeviceError(ExceptionCode.ILLEGAL_DATA_ADDRESS)
        for status in reversed(self.station.shown):
            if status.unit == self.unit:
                return status.registers[first : first + quantity]
        raise DeviceError(ExceptionCode.GATEWAY_TARGET_FAILED_TO_RESPOND)

    def write(self, table: Table, address: int, values: Sequence[int], time: float) -> None:
        """Send a command on to the slave, and its exception back."""
        if table != "holding_registers" or address != COMMAND_REGISTER or len(values) != 1:
            raise DeviceError(ExceptionCode.ILLEGAL_DATA_ADDRESS)
        response = self.station.write(values[0], self.unit).response
        if not response:
            raise DeviceError(ExceptionCode.GATEWAY_TARGET_FAILED_TO_RESPOND)
        if response[0] & 0x80:
            raise DeviceError(response[1])


class Gateway:
    """What the master answers a PC.

    Parameters
    ----------
    station : Station
        The master; a command takes its time on the line, a status is the one that came last.

    Notes
    -----
    Section 3.5 of the paper: the PC watches a slave and commands it through the master. Whether
    the master answers from memory or asks the slave is not printed; here it answers at once, for a
    scan keeps the line busy.

    Examples
    --------
    >>> from shipnet.ballast import Plant
    >>> from shipnet.ballast.scan import status_poll
    >>> from shipnet.modbus.redundancy import Loop
    >>> from shipnet.modbus.uart import SerialLine
    >>> station = Station(Plant(n_valves=5), Loop(5, status_poll(SerialLine(9600))))
    >>> pc = Gateway(station)
    >>> pc.answer(bytes.fromhex("00010000000602 06 4001 0008")).hex(" ")
    '00 01 00 00 00 06 02 06 40 01 00 08'
    >>> station.run_until(12)
    >>> pc.answer(bytes.fromhex("00020000000602 04 4020 0001")).hex(" ")
    '00 02 00 00 00 05 02 04 02 64 28'
    """

    def __init__(self, station: Station) -> None:
        self.station = station
        self.slaves = {
            unit: Slave(_Image(station, unit), functions={4, 6}) for unit in station.slaves
        }

    def answer(self, adu: bytes) -> bytes:
        """Return the answer to a frame.

        Parameters
        ----------
        adu : bytes
            One whole frame, MBAP header first.

        Returns
        -------
        bytes
            The answer, with the transaction id of the request; nothing to a broadcast, which is
            not passed on.

        Raises
        ------
        FrameError
            If it is no frame.
        """
        request = decode(adu, "tcp")
        if request.unit_id == 0:
            return b""
        pdu = answer(self.slaves, request, self.station.time).pdu
        return tcp_frame(request.unit_id, pdu, request.transaction_id or 0) if pdu else b""
