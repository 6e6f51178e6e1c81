"""Master and valve, message by message: a command, and what the registers say meanwhile."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from shipnet.ballast.plant import Plant
from shipnet.ballast.registers import (
    COMMAND_REGISTER,
    FIRST_REGISTER,
    N_REGISTERS,
    Code,
    RegisterMap,
)
from shipnet.ballast.sensors import CHANNELS
from shipnet.ballast.slave import valve_slaves
from shipnet.modbus.adu import rtu_frame
from shipnet.modbus.pdu import Request

if TYPE_CHECKING:
    import pandas as pd

__all__ = ["conversation"]


def conversation(position: int = 40, times: Sequence[float] = (0.5, 2.0, 5.0)) -> pd.DataFrame:
    """Send a closed valve to a position, and read its status from time to time.

    Parameters
    ----------
    position : int, default 40
        Where to go, 0..100 [%].
    times : sequence of float
        When the status is read, rising [s].

    Returns
    -------
    pandas.DataFrame
        One row a message on the line: ``time_s`` of the query, who it is ``from``, ``frame``
        (hexadecimal), and what it ``says``.

    Raises
    ------
    ArgumentError
        If the position is out of range.

    Examples
    --------
    >>> for row in conversation(times=[2.0]).itertuples():
    ...     print(row.frame, "|", row.says)
    01 06 40 01 28 0a 53 cd | go to 40 %
    01 06 40 01 28 0a 53 cd | the same
    01 04 40 20 00 04 e5 c3 | how are you?
    01 04 08 16 28 00 14 32 5a 0c 12 96 8c | FP 90 bar, OP 1.8 bar, MC 1.2 A, OT 50 degC, VPos 22 %
    """
    import pandas as pd

    registers = RegisterMap()
    valve = valve_slaves(Plant())[1]
    write = Request.write_single_register(
        COMMAND_REGISTER, registers.command(Code.POSITION_OPEN, position)
    )
    read = Request.read_input_registers(FIRST_REGISTER, N_REGISTERS)
    rows = []

    def exchange(time: float, query: bytes, meant: str) -> bytes:
        answer = bytes(valve.answer(query, time))
        rows.append((time, "master", rtu_frame(1, query).hex(" "), meant))
        rows.append((time, "valve", rtu_frame(1, answer).hex(" "), "the same"))
        return answer

    exchange(0.0, write.pdu, f"go to {position} %")
    for time in times:
        data = exchange(time, read.pdu, "how are you?")[2:]
        words = [int.from_bytes(data[k : k + 2], "big") for k in range(0, len(data), 2)]
        seen = registers.unpack([words]).readings[:, 0]
        said = [f"{c.name} {x:.3g} {c.unit}" for c, x in zip(CHANNELS, seen, strict=True)]
        rows[-1] = (*rows[-1][:3], ", ".join(said))
    return pd.DataFrame(rows, columns=["time_s", "from", "frame", "says"])
