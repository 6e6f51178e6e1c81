"""Section 3.3: messages of more than four bits, and what they are too slow for."""

from __future__ import annotations

from shipnet.asi.analogue import least_cycles, transfer_cycles, transfer_time
from shipnet.asi.cycle import cycle_time, fastest_loop
from shipnet.papers.registry import check

__all__: list[str] = []


@check("kim2023-009", counter={"bits": 4})
def several_cycles(*, bits: int = 5) -> bool:
    """Whether so many bits, and a value of profile S-7.3, take several cycles."""
    return least_cycles(bits) > 1 and transfer_cycles("S-7.3") > 1


@check("kim2023-090", counter={"loop": 0.1})
def too_slow_for_loops(*, process: float = 1 / 60, loop: float = 10.0) -> bool:
    """Whether a value of 16 bits serves a process, but not a loop, of these bandwidths [Hz].

    A slow process is one a minute; ten a second is what a drive's speed loop needs at least.
    """
    fastest = fastest_loop(transfer_time("S-7.3", cycle_time(31)))
    return bool(process < fastest < loop)
