"""A comparison as one page that can be sent, opened offline and printed."""

from shipnet.design.report.document import BANNER, report_html, write_report

__all__ = ["BANNER", "report_html", "write_report"]
