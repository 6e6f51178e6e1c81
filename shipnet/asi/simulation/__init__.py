"""Masters and slaves at work on a line, telegram by telegram."""
