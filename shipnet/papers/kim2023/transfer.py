"""Section 3.3: messages of more than four bits, and what they are too slow for."""

from __future__ import annotations

from shipnet.asi.cycle import Cycle, transfer_cycles
from shipnet.papers.registry import check

__all__: list[str] = []

#: Values that a period of a control loop's bandwidth needs; 10 to 30 are usual: K. J. Astrom,
#: B. Wittenmark, "Computer-Controlled Systems", 3rd ed., 1997, section 2.9.
SAMPLES = 20.0


def least_cycles(bits: int, *, bits_per_cycle: int = 4) -> int:
    """Return in how many cycles a message passes if every bit of every cycle carries it."""
    return -(-bits // bits_per_cycle)


@check("kim2023-009", counter={"bits": 4})
def several_cycles(*, bits: int = 5) -> bool:
    """Whether so many bits, and a value of profile S-7.3, take several cycles."""
    return least_cycles(bits) > 1 and transfer_cycles("S-7.3") > 1


@check("kim2023-090", counter={"loop": 0.1})
def too_slow_for_loops(*, process: float = 1 / 60, loop: float = 10.0) -> bool:
    """Whether a value of 16 bits serves a process, but not a loop, of these bandwidths [Hz].

    A slow process is one a minute; ten a second is what a drive's speed loop needs at least.
    """
    fastest = 1 / (SAMPLES * float(Cycle(31).transfer_time("S-7.3")))
    return bool(process < fastest < loop)
