"""From the points on board to a design: an I/O list planned in several ways, compared."""
