"""A network that tests build step by step."""

import math
from itertools import pairwise

import numpy as np

from shipnet.line.cable import CABLES
from shipnet.line.network import CableRun, Load, Network

DEVICE = {"r": 13.5e3, "l": 13.5e-3, "c": 50e-12}
SUPPLY = {"r": 78.0, "l": 100e-6}
CABLE = CABLES["as-i 1.5"]


class Net:
    """Collects cables and loads, and passes everything else to the network that they form."""

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


def subdivided(network, longest):
    """Return a network without arrays, with every run cut into sections of at most `longest`."""
    fine = []
    for run in network.runs:
        count = math.ceil(run.length / longest - 1e-9)
        stops = [run.a, *(f"{run.a}-{run.b}:{k}" for k in range(1, count)), run.b]
        fine += [CableRun(a, b, run.length / count, run.cable) for a, b in pairwise(stops)]
    return Network(fine, network.loads)


def dense_transfer(network, root, s):
    """Return `Network.transfer` of one network by solving its nodal equations."""
    matrix = np.zeros((len(s), len(network.nodes), len(network.nodes)), dtype=complex)
    conductance, per_henry, capacitance = network.shunts()[..., 0]
    each = range(len(network.nodes))
    matrix[:, each, each] = conductance + per_henry / s[:, None] + capacitance * s[:, None]
    for run in network.runs:
        cable, ends = run.made_of, [network.index(run.a), network.index(run.b)]
        angle = cable.propagation(s) * run.length
        wave = np.sqrt(cable.shunt_admittance(s) / cable.series_impedance(s))
        for i, j in (ends, ends[::-1]):
            matrix[:, i, i] += wave / np.tanh(angle)
            matrix[:, i, j] -= wave / np.sinh(angle)
    unit = np.zeros((len(network.nodes), 1))
    unit[network.index(root)] = 1
    return np.linalg.solve(matrix, unit)[..., 0].T
