"""Ballast valves with electro-hydraulic actuators: the plant, its faults, its registers."""

from shipnet.ballast.actuator import Actuator
from shipnet.ballast.commands import Command
from shipnet.ballast.diagnosis import Diagnosis, diagnose_run
from shipnet.ballast.faults import FAULTS, Fault, fault_table
from shipnet.ballast.master import Station, operate
from shipnet.ballast.operation import operating_point
from shipnet.ballast.plant import Plant
from shipnet.ballast.registers import RegisterMap
from shipnet.ballast.scan import assignment, scan_table, status_poll, worst_age
from shipnet.ballast.sensors import Sensors
from shipnet.ballast.simulation import Run, blocks, simulate
from shipnet.ballast.slave import ValveDevice, valve_slaves

__all__ = ["FAULTS", "Actuator", "Command", "Diagnosis", "Fault", "Plant", "RegisterMap", "Run"]
__all__ += ["Sensors", "ValveDevice", "blocks", "diagnose_run", "fault_table", "operating_point"]
__all__ += ["Station", "assignment", "operate", "scan_table", "simulate", "status_poll"]
__all__ += ["valve_slaves", "worst_age"]
