"""A network that tests put together step by step."""

from shipnet.line.cable import CABLES
from shipnet.line.network import CableRun, Load, Network

DEVICE = {"r": 13.5e3, "l": 13.5e-3, "c": 50e-12}
SUPPLY = {"r": 78.0, "l": 100e-6}
CABLE = CABLES["as-i 1.5"]


class Net:
    """Collects cables and loads; everything else it asks of the network that they make."""

    def __init__(self):
        self.runs, self.loads = [], {}
        self.network = Network()

    def line(self, a, b, length, cable=CABLE):
        runs = [*self.runs, CableRun(a, b, length, cable)]
        self.network, self.runs = Network(runs, self.loads), runs

    def load(self, node, **values):
        load = Load(**values)
        loads = {**self.loads, node: self.loads[node] + load if node in self.loads else load}
        self.network, self.loads = Network(self.runs, loads), loads

    def terminator(self, node, ohms):
        self.load(node, r=ohms)

    def __getattr__(self, name):
        return getattr(self.network, name)
