"""Markers against CRC, by number of items: the comparison that chung1998 asks others to make."""

from shipnet.remote_control.experiment.recommendation import Criterion, candidates, recommend
from shipnet.remote_control.experiment.residual import Shares, crc_residual, packet_shares
from shipnet.remote_control.experiment.staleness import simulate_switch, switch_staleness
from shipnet.remote_control.experiment.transmission import Trial, compare_checks, transmit

__all__ = ["Criterion", "Shares", "Trial", "candidates", "compare_checks", "crc_residual"]
__all__ += ["packet_shares", "recommend", "simulate_switch", "switch_staleness", "transmit"]
