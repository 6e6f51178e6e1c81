"""The supervised link of three stations: its turns, its counters, its times, what goes wrong."""

from shipnet.remote_control.link.cascade import cascade
from shipnet.remote_control.link.faults import BitErrors, Dead, LostPacket, Stall
from shipnet.remote_control.link.result import LinkRun
from shipnet.remote_control.link.run import simulate
from shipnet.remote_control.link.states import transition_table
from shipnet.remote_control.link.supervision import MEANT, PRINTED, Supervision
from shipnet.remote_control.link.system import BIT_RATES, System
from shipnet.remote_control.link.timing import cycle_time, timing_table, worst_age

__all__ = ["BIT_RATES", "MEANT", "PRINTED", "BitErrors", "Dead", "LinkRun", "LostPacket"]
__all__ += ["Stall", "Supervision", "System", "cascade", "cycle_time", "simulate"]
__all__ += ["timing_table", "transition_table", "worst_age"]
