"""Section 3.4: the bits of a request and of a response, and their parity."""

from __future__ import annotations

from shipnet import datasets
from shipnet.asi.calls import Call
from shipnet.asi.profile import IO_CONFIGURATIONS
from shipnet.asi.telegram import RESPONSE_BITS, Request, Response, frame
from shipnet.errors import FrameError
from shipnet.papers.registry import check, numeric

__all__ = ["DATASHEET_FRAMES", "EXAMPLE_REQUEST", "EXAMPLE_RESPONSE", "even_ones"]

_EXAMPLES = datasets.read("kim2023_examples.csv").set_index("name")["bits"]

#: The request of Fig 5, as it is printed.
EXAMPLE_REQUEST = str(_EXAMPLES["request"])

#: The response of Fig 5, as it is printed.
EXAMPLE_RESPONSE = str(_EXAMPLES["response"])

#: Frames that a chip maker prints whole: the independent witnesses of the parity rule.
DATASHEET_FRAMES = tuple(datasets.read("asi_datasheet_frames.csv")["bits"])


@numeric("kim2023-008", "icn2007-022")
def bits_per_cycle(*, response: int = RESPONSE_BITS) -> int:
    """User bits of a response: what start, parity and end bit leave of it."""
    return response - len(frame(""))


@numeric("kim2023-026", "icn2007-011")
def request_length(*, layout: str = Call.DATA_EXCHANGE.rule.pattern) -> int:
    """Bits of a request: control, address and information within the frame."""
    return len(frame("0" * len(layout)))


@numeric("kim2023-027", "icn2007-012")
def response_length(*, ports: tuple[str, ...] = IO_CONFIGURATIONS[0]) -> int:
    """Bits of a response: one for each port within the frame."""
    return len(frame("0" * len(ports)))


@numeric("kim2023-036")
def example_length(*, bits: str = EXAMPLE_REQUEST) -> int:
    """Bits of the example."""
    return len(bits)


@numeric("kim2023-037", "icn2007-017")
def example_address(*, bits: str = EXAMPLE_REQUEST) -> int:
    """A4..A0 of the example, read in place: as a whole it breaks the parity rule."""
    return int(bits[2:7], 2)


@numeric("kim2023-038", "icn2007-041")
def example_data(*, bits: str = EXAMPLE_REQUEST) -> int:
    """D3..D0 of the example."""
    return int(bits[8:12], 2)


@numeric("kim2023-039", "icn2007-042")
def example_answer(*, bits: str = EXAMPLE_RESPONSE) -> int:
    """Data of the example response."""
    return Response.parse(bits).data


def even_ones(bits: str, *, end_bit: bool = False) -> bool:
    """Tell whether a telegram has an even number of ones, the end bit counted or not.

    Parameters
    ----------
    bits : str
        A telegram, right or wrong.
    end_bit : bool, default False
        Whether the last bit counts.

    Returns
    -------
    bool
        True if the number is even.

    Examples
    --------
    The response of the paper follows the rule of the data sheets, its request does not:

    >>> even_ones(EXAMPLE_RESPONSE), even_ones(EXAMPLE_REQUEST)
    (True, False)
    """
    return (bits if end_bit else bits[:-1]).count("1") % 2 == 0


@check("kim2023-040", "icn2007-037", counter={"bits": Request.data_exchange(21, 0xE).bits})
def example_request_parity(*, bits: str = EXAMPLE_REQUEST) -> bool:
    """Whether the example request obeys the parity rule of the standard."""
    try:
        Request.parse(bits)
    except FrameError:
        return False
    return True


@check("kim2023-041", "icn2007-043", counter={"bits": "0011011"})
def example_response_parity(*, bits: str = EXAMPLE_RESPONSE) -> bool:
    """Whether the example response obeys the parity rule of the standard."""
    return even_ones(bits)


@check("kim2023-081", counter={"frames": (EXAMPLE_REQUEST,)})
def parity_counts_all_bits(*, frames: tuple[str, ...] = DATASHEET_FRAMES) -> bool:
    """Whether frames of a chip maker have even ones when the end bit counts too."""
    return all(even_ones(bits, end_bit=True) for bits in frames)


@check("kim2023-082", counter={"request": Request.data_exchange(21, 0xE).bits})
def one_rule_for_both(*, request: str = EXAMPLE_REQUEST, response: str = EXAMPLE_RESPONSE) -> bool:
    """Whether any single rule passes both example telegrams."""
    return any(
        even_ones(request, end_bit=rule) and even_ones(response, end_bit=rule)
        for rule in (False, True)
    )


@check("kim2023-084", counter={"start": "1"})
def start_0_end_1(*, start: str = "0", end: str = "1") -> bool:
    """Whether every request and every response starts and ends with these bits."""
    telegrams = [Response(data).bits for data in range(16)]
    telegrams += [Request.data_exchange(a, d).bits for a in range(1, 32) for d in range(16)]
    return all(bits[0] == start and bits[-1] == end for bits in telegrams)
