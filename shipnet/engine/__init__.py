"""The engine monitoring system of lee2012: points, junction boxes, two field buses, their rules."""

from shipnet.engine.accuracy import accuracy_table
from shipnet.engine.can_messages import CanLayout, volume_table
from shipnet.engine.class_rules import check
from shipnet.engine.coding import CODINGS, Coding, collisions
from shipnet.engine.converters import Adc, InputCard
from shipnet.engine.description import Description, printed_system
from shipnet.engine.holding_registers import HoldingRegisters, answer
from shipnet.engine.input_faults import input_fault_table
from shipnet.engine.points import Point, by_box, load_points, point_table, read_points
from shipnet.engine.registers import RegisterMap
from shipnet.engine.wiring import Conductors, conductors

__all__ = ["CODINGS", "Adc", "CanLayout", "Coding", "Conductors", "Description"]
__all__ += ["HoldingRegisters", "InputCard", "Point", "RegisterMap", "accuracy_table", "answer"]
__all__ += ["by_box", "check", "collisions", "conductors", "input_fault_table", "load_points"]
__all__ += ["point_table", "printed_system", "read_points", "volume_table"]
