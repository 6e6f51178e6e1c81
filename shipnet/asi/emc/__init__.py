"""Electromagnetic disturbances: their waveforms, the telegrams that they cost, what rules ask."""

from shipnet.asi.emc.disturbances import Burst, ConductedRF, Impulses, Noise
from shipnet.asi.emc.failures import burst_failures, independent_failures
from shipnet.asi.emc.immunity import immunity_margin, levels
from shipnet.asi.emc.monte_carlo import error_rate, noise_error_rate

__all__ = [
    "Burst",
    "ConductedRF",
    "Impulses",
    "Noise",
    "burst_failures",
    "error_rate",
    "immunity_margin",
    "independent_failures",
    "levels",
    "noise_error_rate",
]
