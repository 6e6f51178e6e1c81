"""Electromagnetic disturbances: their waveforms, the telegrams that they cost, what rules ask."""

from shipnet.asi.emc.disturbances import burst, conducted_rf, impulses, noise
from shipnet.asi.emc.failures import cycle_effect, error_series
from shipnet.asi.emc.immunity import gap, levels
from shipnet.asi.emc.monte_carlo import (
    Telegrams,
    all_telegrams,
    monte_carlo,
    noise_error_rate,
    telegram_error_rate,
)

__all__ = ["Telegrams", "all_telegrams", "burst", "conducted_rf", "cycle_effect", "error_series"]
__all__ += ["gap", "impulses", "levels", "monte_carlo", "noise", "noise_error_rate"]
__all__ += ["telegram_error_rate"]
