"""The engine monitoring system of lee2012: points, junction boxes, two field buses, their rules."""

from shipnet.engine.age import marking, worst_age
from shipnet.engine.ams import switch_over, timeout_for
from shipnet.engine.assessment import fault_table
from shipnet.engine.can_messages import CanLayout, volume_table
from shipnet.engine.faults import single_faults
from shipnet.engine.firmware import Firmware
from shipnet.engine.points import Point, by_box, load_points, point_table, read_points
from shipnet.engine.response import response_readings
from shipnet.engine.screen import SyntheticValues, screen
from shipnet.engine.simulation import simulate
from shipnet.engine.system import System
from shipnet.engine.timeline import timeline
from shipnet.engine.wiring import Conductors, conductors

__all__ = ["CanLayout", "Conductors", "Firmware", "Point", "SyntheticValues", "System", "by_box"]
__all__ += ["conductors", "fault_table", "load_points", "marking", "point_table", "read_points"]
__all__ += ["response_readings", "screen", "simulate", "single_faults", "switch_over", "timeline"]
__all__ += ["timeout_for", "volume_table", "worst_age"]
