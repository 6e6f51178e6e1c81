"""Values taken out of the ring by index, as printed, and with indices that go round.

``REC_VAL[rec_no] = Ring_Buffer[get_no+1] | Ring_Buffer[get_no+2] << 8``: near the end of the ring
the two indices lie outside the array, and nothing asks whether both bytes have arrived.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

from shipnet.errors import ArgumentError
from shipnet.fields import check_whole
from shipnet.remote_control.items import Items, check_bytes
from shipnet.remote_control.packet import Markers

if TYPE_CHECKING:
    import pandas as pd

__all__ = ["extract_items", "extract_value", "extraction_table"]


def extract_value(cells: bytes, get_no: int, *, wrap: bool = False, beyond: bytes = b"\0\0") -> int:
    """Return the value whose number stands at a place of the ring.

    Parameters
    ----------
    cells : bytes
        The ring, 3 bytes or more.
    get_no : int
        Where the number stands, 0..len(cells) - 1.
    wrap : bool, default False
        Whether the indices go round; not so in the paper.
    beyond : bytes, default two zeros
        What stands in memory behind the ring, 2 bytes: nobody knows.

    Returns
    -------
    int
        The value, 0..65535.

    Raises
    ------
    ArgumentError
        If an argument is out of its range.

    References
    ----------
    .. [1] K. Y. Chung, K. S. Rhyu, "A study on the communication method for a ship main engine
       remote control system", J. Korean Soc. Marine Eng., 1998, section 4.3 and Fig 8(a).

    Examples
    --------
    The value 0x1234 of item 9 across the end of the ring:

    >>> cells = bytes([0x12, 0, 0, 0, 0, 0, 9, 0x34])
    >>> [hex(extract_value(cells, 6, wrap=wrap)) for wrap in (False, True)]
    ['0x34', '0x1234']
    """
    cells, beyond = check_bytes("cells", cells), check_bytes("beyond", beyond)
    size = len(cells)
    if size < 3 or len(beyond) != 2:
        raise ArgumentError(
            f"cells and beyond have {size} and {len(beyond)} bytes; they must have 3 or more, and 2"
        )
    place = check_whole("get_no", get_no, 0, size - 1)
    memory = cells + (cells[:2] if wrap else beyond)
    return memory[place + 1] | memory[place + 2] << 8


def extract_items(
    cells: bytes,
    get_no: int,
    n_items: int,
    packet_format: Markers | None = None,
    *,
    wrap: bool = False,
    beyond: bytes = b"\0\0",
) -> Items:
    """Return the items of a packet whose first marker stands at a place of the ring.

    Parameters
    ----------
    cells : bytes
        The ring, 3 bytes or more.
    get_no : int
        Where the packet begins, 0..len(cells) - 1.
    n_items : int
        How many items to take, 0..n_numbers.
    packet_format : Markers, optional
        Which way the figure is read; reading A with ten numbers if omitted.
    wrap : bool, default False
        Whether the indices of a value go round. That of a number always does, for ``get_no`` is
        raised one by one.
    beyond : bytes, default two zeros
        What stands in memory behind the ring, 2 bytes.

    Returns
    -------
    Items
        What the printed line puts into its table, whether or not the bytes have arrived.

    Raises
    ------
    ArgumentError
        If an argument is out of its range.

    Examples
    --------
    >>> packet = Markers().encode({0: 120, 1: 500})
    >>> extract_items(packet.ljust(128, b"?"), 0, 2)
    ((0, 120), (1, 500))

    Only seven bytes of it have arrived, the rest is older:

    >>> extract_items(packet[:7].ljust(128, b"?"), 0, 2)
    ((0, 120), (1, 16372))
    """
    form = packet_format or Markers()
    if len(check_bytes("cells", cells)) < 3:
        raise ArgumentError(f"cells has {len(cells)} bytes; it must have 3 or more")
    check_whole("n_items", n_items, 0, form.n_numbers)
    check_whole("get_no", get_no, 0, len(cells) - 1)
    head, step = len(form.head), len(form.lead) + 3
    first = get_no + head + len(form.lead)
    places = [(first + k * step) % len(cells) for k in range(n_items)]
    return tuple(
        (cells[place], extract_value(cells, place, wrap=wrap, beyond=beyond)) for place in places
    )


def extraction_table(
    items: Mapping[int, int],
    packet_format: Markers | None = None,
    *,
    size: int = 128,
    wrap: bool = False,
    beyond: bytes = b"\0\0",
) -> pd.DataFrame:
    """Return what becomes of a packet at every place of the ring.

    Parameters
    ----------
    items : mapping of int to int
        Numbers and values of the packet.
    packet_format : Markers, optional
        Which way the figure is read; reading A with ten numbers if omitted.
    size : int, default 128
        Size of the ring; the packet must fit into it.
    wrap : bool, default False
        Whether the indices go round.
    beyond : bytes, default two zeros
        What stands in memory behind the ring, 2 bytes.

    Returns
    -------
    pandas.DataFrame
        A row for each place of the packet's first byte, ``offset``: how many bytes were read
        ``outside`` the ring, and how many values came out ``wrong``.

    Raises
    ------
    ArgumentError
        If a packet cannot be sent, or is longer than the ring.

    Examples
    --------
    Ten data, a packet at each of 128 places:

    >>> table = extraction_table({number: 1000 for number in range(10)})
    >>> int((table.wrong > 0).sum()), int((table.outside > 0).sum()), len(table)
    (20, 20, 128)
    """
    import pandas as pd

    form = packet_format or Markers()
    packet = form.encode(items)
    check_whole("size", size, max(3, len(packet)), 65536, ", so that the packet fits into the ring")
    true = form.decode(packet)
    head, step = len(form.head) + len(form.lead), len(form.lead) + 3
    rows = []
    for offset in range(size):
        cells = bytearray(size)
        for place, byte in enumerate(packet, offset):
            cells[place % size] = byte
        found = extract_items(bytes(cells), offset, len(true), form, wrap=wrap, beyond=beyond)
        places = [(offset + head + k * step) % size for k in range(len(true))]
        outside = 0 if wrap else sum(max(0, place + 3 - size) for place in places)
        wrong = sum(one != other for one, other in zip(found, true, strict=True))
        rows.append((offset, outside, wrong))
    return pd.DataFrame(rows, columns=["offset", "outside", "wrong"])
