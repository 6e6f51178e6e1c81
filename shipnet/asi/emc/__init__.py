"""Electromagnetic disturbances: their waveforms, the telegrams that they cost, what rules ask."""

from shipnet.asi.emc.disturbances import Burst, ConductedRF, Impulses, Noise
from shipnet.asi.emc.error_rates import (
    burst_failures,
    count_errors,
    error_rate,
    independent_failures,
)
from shipnet.asi.emc.immunity import immunity_margin, levels
from shipnet.asi.emc.rare_errors import rare_error_rates

__all__ = [
    "Burst",
    "ConductedRF",
    "Impulses",
    "Noise",
    "burst_failures",
    "count_errors",
    "error_rate",
    "immunity_margin",
    "independent_failures",
    "levels",
    "rare_error_rates",
]
