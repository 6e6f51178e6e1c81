"""Lines: cables, trees of them with loads, their transfer, waveforms and voltage drop."""

from shipnet.line.cable import CABLES, Cable
from shipnet.line.characteristics import simulate
from shipnet.line.dc import solve_dc
from shipnet.line.drivers import CurrentDriver, TheveninDriver
from shipnet.line.laplace import laplace_grid, synthesize
from shipnet.line.network import Network

__all__ = ["CABLES", "Cable", "CurrentDriver", "Network", "TheveninDriver"]
__all__ += ["laplace_grid", "simulate", "solve_dc", "synthesize"]
