"""Electromagnetic disturbances: their waveforms, the telegrams that they cost, what rules ask."""

from shipnet.asi.emc.disturbance import conducted_rf, impulses, noise
from shipnet.asi.emc.error_rate import Telegrams, all_telegrams, monte_carlo, telegram_error_rate
from shipnet.asi.emc.fast_transient import burst
from shipnet.asi.emc.levels import gap, levels
from shipnet.asi.emc.noise_theory import noise_error_rate
from shipnet.asi.emc.repetition import cycle_effect, error_series

__all__ = ["Telegrams", "all_telegrams", "burst", "conducted_rf", "cycle_effect", "error_series"]
__all__ += ["gap", "impulses", "levels", "monte_carlo", "noise", "noise_error_rate"]
__all__ += ["telegram_error_rate"]
