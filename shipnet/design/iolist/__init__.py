"""I/O lists: read tolerantly, checked strictly, every fault of a file told at once."""

from shipnet.design.iolist.lists import (
    IoList,
    from_table,
    load_iolist,
    parse_iolist,
    save_iolist,
)

__all__ = ["IoList", "from_table", "load_iolist", "parse_iolist", "save_iolist"]
