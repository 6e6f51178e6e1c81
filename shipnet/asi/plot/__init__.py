"""Figures of AS-i: telegrams and captures, and the traffic of a whole line."""

from shipnet.asi.plot.network import plot_exchange, plot_states
from shipnet.asi.plot.telegrams import (
    REQUEST_PARTS,
    RESPONSE_PARTS,
    plot_capture,
    plot_io_codes,
    plot_modulation,
    plot_slots,
    plot_telegram,
    plot_transaction,
    save_capture,
)

__all__ = [
    "REQUEST_PARTS",
    "RESPONSE_PARTS",
    "plot_capture",
    "plot_exchange",
    "plot_io_codes",
    "plot_modulation",
    "plot_slots",
    "plot_states",
    "plot_telegram",
    "plot_transaction",
    "save_capture",
]
