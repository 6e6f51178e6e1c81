"""The ship as cables see it: a cabinet, trays, and the ways along them."""

from shipnet.design.site.site import Site
from shipnet.design.site.trays import Tray, Trays, load_trays, parse_trays

__all__ = ["Site", "Tray", "Trays", "load_trays", "parse_trays"]
