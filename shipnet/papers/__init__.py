"""The five papers: every claim, recomputed where it can be, with its verdict."""

from shipnet.papers.ledger import counts, ledger, show

__all__ = ["counts", "ledger", "show"]
