"""Plans of an I/O list: each point to a cable, a module, a station and a bus, within its limits."""

from shipnet.design.plan.options import OPTIONS, Settings, mix, plan

__all__ = ["OPTIONS", "Settings", "mix", "plan"]
