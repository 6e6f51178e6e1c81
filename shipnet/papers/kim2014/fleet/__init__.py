"""What a master shows of a fleet of valves, beside what is true of them."""

from shipnet.papers.kim2014.fleet.picture import (
    Picture,
    age_table,
    broken_loops,
    picture_table,
    seen_strokes,
)

__all__ = ["Picture", "age_table", "broken_loops", "picture_table", "seen_strokes"]
