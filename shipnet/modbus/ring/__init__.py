"""Redundant lines: a closed loop or two channels, their faults, and how long data stay away."""

from shipnet.modbus.ring.bounds import System, longest_recovery, worst_gap
from shipnet.modbus.ring.channels import Channels
from shipnet.modbus.ring.faults import Break, DeadPort, DeadSlave, Fault, Short
from shipnet.modbus.ring.loop import Loop
from shipnet.modbus.ring.reach import Reach
from shipnet.modbus.ring.run import Run
from shipnet.modbus.ring.simulation import simulate, sweep
from shipnet.modbus.ring.supervision import Supervision
from shipnet.modbus.ring.tables import fault_pairs, fault_table, single_faults

__all__ = ["Break", "Channels", "DeadPort", "DeadSlave", "Fault", "Loop", "Reach", "Run", "Short"]
__all__ += ["Supervision", "System", "fault_pairs", "fault_table", "longest_recovery", "simulate"]
__all__ += ["single_faults", "sweep", "worst_gap"]
