"""A line simulated telegram by telegram: slaves, their master, and what goes wrong."""

from shipnet.asi.simulation.master import Master
from shipnet.asi.simulation.run import simulate
from shipnet.asi.simulation.slave import Slave

__all__ = ["Master", "Slave", "simulate"]
