"""The engine monitoring system of lee2012: points, junction boxes, two field buses, their rules."""

from shipnet.engine.can_messages import CanLayout, volume_table
from shipnet.engine.points import Point, by_box, load_points, point_table, read_points
from shipnet.engine.wiring import Conductors, conductors

__all__ = ["CanLayout", "Conductors", "Point", "by_box", "conductors", "load_points"]
__all__ += ["point_table", "read_points", "volume_table"]
