"""Messages on a CAN bus: the load that they are, and how long each one takes at worst."""

from shipnet.can.schedule.convention import NO_ERRORS, Convention, ErrorModel
from shipnet.can.schedule.faults import fault_table, miss_probability
from shipnet.can.schedule.lengths import LENGTHS, frame_bits
from shipnet.can.schedule.load import BIT_RATES, bus_load, load_table
from shipnet.can.schedule.messages import Message, MessageSet
from shipnet.can.schedule.priority import audsley, deadline_monotonic, rate_monotonic
from shipnet.can.schedule.response import response_table, response_times, schedulable
from shipnet.can.schedule.sensitivity import lowest_bit_rate, period_factor
from shipnet.can.schedule.table import (
    from_table,
    load_messages,
    parse_messages,
    save_messages,
    to_table,
)

__all__ = ["BIT_RATES", "LENGTHS", "NO_ERRORS", "Convention", "ErrorModel", "Message"]
__all__ += ["MessageSet", "audsley", "bus_load", "deadline_monotonic", "fault_table"]
__all__ += ["frame_bits", "from_table", "load_messages", "load_table", "lowest_bit_rate"]
__all__ += ["miss_probability", "period_factor", "rate_monotonic", "response_table"]
__all__ += ["parse_messages", "response_times", "save_messages", "schedulable", "to_table"]
