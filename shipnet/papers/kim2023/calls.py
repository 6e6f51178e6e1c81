"""Section 3.4, Tables 4 to 7: what the calls look like, and how the tables are labelled."""

from __future__ import annotations

from shipnet import datasets
from shipnet.asi.calls import Call
from shipnet.asi.profile import Profile
from shipnet.asi.telegram import Half, Request, frame
from shipnet.papers.items import PrintedTable
from shipnet.papers.kim2023.telegrams import DATASHEET_FRAMES
from shipnet.papers.registry import check, numeric

_TABLE_5 = PrintedTable("kim2023", "Table 5")


@check("kim2023-085", counter={"calls": (Call.DATA_EXCHANGE, Call.RESET)})
def control_bit_0(
    *, calls: tuple[Call, ...] = (Call.DATA_EXCHANGE, Call.WRITE_PARAMETER, Call.ASSIGN_ADDRESS)
) -> bool:
    """Whether control bit 0 marks these requests, and no others."""
    return set(calls) == {call for call in Call if call.rule.pattern[0] == "0"}


@check("kim2023-042", counter={"half": "B"})
def masters_before_2_1(*, half: Half | None = None) -> bool:
    """Whether a control request sends 0 where S stands, and 1 where its inverse stands."""
    sent = {"s": "0", "S": "1"}
    for call in Call:
        layout = call.rule.pattern
        for letter in sent.keys() & set(layout):
            if Request(call, 1, half=half).bits[1 + layout.index(letter)] != sent[letter]:
                return False
    return True


@check("kim2023-043", counter={"half": "B"})
def a_slave_like_standard(*, half: Half = "A") -> bool:
    """Whether the requests to this half are those that a standard slave gets.

    Where an A/B slave has its inverted select bit, a standard slave has data bit 3: data 0 to
    the A half is data 8 to the standard slave.
    """
    for call in Call:
        if "s" in call.rule.layout(extended=True).lower():
            standard = Request(call, 21, 8 if call.rule.extended else 0)
            if Request(call, 21, 0, half).bits != standard.bits:
                return False
    return True


@check("kim2023-044", counter={"header": ("A4", "A3", "A2", "A1", "A0")})
def header_names_five_bits(*, header: tuple[str, ...] = ()) -> bool:
    """Whether the header of Table 5 names each address bit once, from the highest down."""
    columns = ["A4", "A3", "A2", "A1", "A0"]
    names = list(header) or _TABLE_5.printed.loc[["HEADER"], columns].to_numpy().ravel().tolist()
    return names == columns


@numeric("kim2023-045")
def calls_in_the_data_sheets(*, calls: tuple[Call, ...] = tuple(Call)) -> int:
    """Calls in the table of the data sheets; Table 5 lists one less."""
    return len(calls)


def _row_agrees(call: str, columns: list[str]) -> bool:
    printed, generated = _TABLE_5.printed, _TABLE_5.ours
    return bool((printed.loc[[call], columns] == generated.loc[[call], columns]).all(axis=None))


@check("kim2023-046", counter={"address": 0})
def write_id1_to_any_address(*, address: int = 21) -> bool:
    """Whether the bits of write ID code 1 may carry this address: then they mean that call.

    With another address than 0, and data 0, they are the bits of delete address.
    """
    return Request.parse(frame(f"1{address:05b}00000")).call is Call.WRITE_ID1


@check("kim2023-047", counter={"calls": ("READ_STATUS", "READ_ID")})
def select_marks(*, calls: tuple[str, ...] = ("DELETE_ADDRESS", "RESET")) -> bool:
    """Whether Table 5, as the stored text marks it, inverts select where the data sheets do."""
    return all(_row_agrees(call, ["I3"]) for call in calls)


@check("kim2023-048", counter={"call": "DATA_EXCHANGE"})
def parameter_letters(*, call: str = "WRITE_PARAMETER") -> bool:
    """Whether Table 5 gives the bits that this call carries their names."""
    return _row_agrees(call, ["I2", "I1", "I0"])


@check("kim2023-049", counter={"expected": "01111111010101"})
def broadcast_bits(*, expected: str = DATASHEET_FRAMES[0]) -> bool:
    """Whether Table 5's broadcast, with its parity, is the frame that a data sheet prints."""
    row = _TABLE_5.printed.loc[["BROADCAST_RESET"]].to_numpy().ravel().tolist()
    return frame("".join(row[1:-2])) == expected


@check("kim2023-051", counter={"data": "1", "parameter": "0"})
def information_bit_4(*, data: str = "0", parameter: str = "1") -> bool:
    """Whether I4 tells a data request from a parameter request, with these values."""
    bits = _TABLE_5.ours.loc[["DATA_EXCHANGE", "WRITE_PARAMETER"], "I4"]
    return list(bits) == [data, parameter]


@check("kim2023-086", counter={"call": Call.RESET})
def assigned_at_address_0(*, call: Call = Call.ASSIGN_ADDRESS) -> bool:
    """Whether this call can only go to a slave at address 0."""
    return call.rule.pattern[1:6] == "00000"


@check("kim2023-080", counter={"address": 1})
def address_0_refuses(*, address: int = 0) -> bool:
    """Whether data and parameter requests to this address are refused."""
    refused = 0
    for call in (Call.DATA_EXCHANGE, Call.WRITE_PARAMETER):
        try:
            Request(call, address)
        except ValueError:
            refused += 1
    return refused == 2


@numeric("kim2023-055")
def io_codes(*, bits: int = 4) -> int:
    """Codes that the four bits of a response can tell apart."""
    return 1 << bits


@check("kim2023-056", counter={"table": "Table 5"})
def io_code_cells(*, table: str = "Table 7") -> bool:
    """Whether all cells of the printed table are those that the code generates."""
    return PrintedTable("kim2023", table).differences().empty


@check("kim2023-007", counter={"cited": "Table 2"})
def cited_table_is_emc(*, cited: str = "Table 1") -> bool:
    """Whether the table that the text cites for EMC has a caption that speaks of it."""
    return "EMC" in _captions()[cited]


@check("kim2023-052", counter={"shift": 1})
def references_fit(*, shift: int = 0) -> bool:
    """Whether what the text says of each table it cites, by number, fits that table's caption."""
    said = {1: "EMC", 2: "steps", 4: "(detail)", 5: "Slave data map", 6: "I/O configuration"}
    return all(word in _captions()[f"Table {number + shift}"] for number, word in said.items())


@check("kim2023-096", counter={"modulation": "AMP"})
def caption_names_modulation(*, modulation: str = "APM") -> bool:
    """Whether the caption of Table 3 has the modulation's name as the text spells it."""
    return modulation in _captions()["Table 3"]


@check("kim2023-094", counter={"codes": (0xA,)})
def both_codes_share_an_address(*, codes: tuple[int, ...] = (0xA, 0xB)) -> bool:
    """Whether slaves with these ID codes share their address with another."""
    return all(Profile(7, code).extended for code in codes)


def _captions() -> dict[str, str]:
    items = datasets.read("figures_tables.csv")
    items = items[items["paper"] == "kim2023"]
    return dict(zip(items["item"], items["caption"], strict=True))
