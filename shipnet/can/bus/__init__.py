"""A CAN bus event by event: arbitration, errors, and how long messages wait."""

from shipnet.can.bus.batch import BatchRun, simulate_batch
from shipnet.can.bus.messages import arbitration_key
from shipnet.can.bus.simulation import BusRun, simulate

__all__ = ["BatchRun", "BusRun", "arbitration_key", "simulate", "simulate_batch"]
