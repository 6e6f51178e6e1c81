"""The engine monitoring system of lee2012: points, junction boxes, two field buses, their rules."""

from shipnet.engine.age import marking, worst_age
from shipnet.engine.ams import switch_over, timeout_for
from shipnet.engine.assessment import fault_table
from shipnet.engine.can_messages import CanLayout, volume_table
from shipnet.engine.coding import CODINGS, collisions
from shipnet.engine.converters import Adc, InputCard
from shipnet.engine.faults import single_faults
from shipnet.engine.firmware import Firmware
from shipnet.engine.points import by_box, load_points, point_table, read_points
from shipnet.engine.screen import SyntheticValues, screen
from shipnet.engine.simulation import simulate
from shipnet.engine.system import System
from shipnet.engine.timeline import timeline
from shipnet.engine.wiring import conductors

__all__ = ["CODINGS", "Adc", "CanLayout", "Firmware", "InputCard", "SyntheticValues", "System"]
__all__ += ["by_box", "collisions", "conductors", "fault_table", "load_points", "marking"]
__all__ += ["point_table", "read_points", "screen", "simulate", "single_faults", "switch_over"]
__all__ += ["timeline", "timeout_for", "volume_table", "worst_age"]
