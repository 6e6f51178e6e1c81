"""What chung1998 prints, recomputed: the serial link of a main engine's remote control.

K. Y. Chung, K. S. Rhyu, "A study on the communication method for a ship main engine remote control
system", J. Korean Soc. Marine Eng., 1998. The text that we have lacks the drawings.
"""

from shipnet.papers.chung1998.link import deaths, send_loops
from shipnet.papers.chung1998.ring import extraction, given_up, recovered, ring_trials

__all__ = ["deaths", "extraction", "given_up", "recovered", "ring_trials", "send_loops"]
