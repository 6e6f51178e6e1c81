from io import StringIO

import pandas as pd
import pytest

from shipnet.can import MessageSet, response_times, spread_offsets
from shipnet.tables import as_workbook
from shipnet.tools.can_load import EXAMPLE, CanLoad
from tests.support import load


def test_the_example_is_read_and_in_time():
    tool = CanLoad()
    assert len(tool.messages) == 10
    assert tool.result.late == []
    assert tool.load["no stuff bits"] < tool.load["random data"]
    assert tool.load["random data"] < tool.load["most stuff bits"] < 0.25
    assert tool.lowest == 125_000
    assert tool.numbers["lowest standard bit rate that meets all deadlines"] == "125 kbit/s"


def test_a_slow_bus_or_errors_make_messages_late():
    assert CanLoad(bit_rate=10_000).lowest == 125_000
    assert len(CanLoad(bit_rate=10_000).result.late) == 10
    calm, disturbed = CanLoad().result, CanLoad(errors_per_s=50).result
    pairs = zip(disturbed, calm, strict=True)
    assert all(more.response > less.response for more, less in pairs)
    hopeless = EXAMPLE.replace("shutdown,0x010,1,50,5", "shutdown,0x010,1,50,0.1")
    assert CanLoad(hopeless).numbers["lowest standard bit rate that meets all deadlines"] == "none"


def test_offsets_count_if_chosen_and_only_without_errors():
    messages = MessageSet.parse(EXAMPLE)
    longest = {}
    for way, timed in {"as listed": messages, "spread": spread_offsets(messages)}.items():
        tool = CanLoad(offsets=way)
        assert list(tool.result) == list(response_times(timed, 125_000, offsets=True))
        longest[way] = tool.result["bearings"].response
    assert longest["spread"] < 0.6 * longest["as listed"]
    assert longest["as listed"] == CanLoad().result["bearings"].response
    listed = CanLoad(text=tool.messages.text, offsets="as listed")
    assert list(listed.result) == list(tool.result)

    page = CanLoad(offsets="spread").explore()
    page.controls["errors_per_s"].value = 10
    assert "errors_per_s is 10; errors_per_s must be 0 if offsets are used" in page.text
    page.controls["offsets"].value = "not counted"
    assert "meet their deadlines" in page.text


def test_the_editor_reports_faults_and_keeps_the_text():
    page = CanLoad().explore()
    before = page.figure.value
    page.controls["bit_rate"].value = 50_000
    assert "speed" in page.text and page.figure.value != before
    page.controls["text"].value = "name,arbitration_id,dlc,period_ms\noil,1,9,10\n"
    assert "row 2" in page.text and page.controls["text"].value.startswith("name")
    load(page.uploads["load a message set"], b"name,arbitration_id,dlc,period_ms\noil,1,8,10\n")
    assert "all 1 messages meet their deadlines" in page.text


def test_a_dbc_is_loaded_as_text():
    pytest.importorskip("cantools")
    page = CanLoad().explore()
    head = b'VERSION ""\n\nBU_: JB1\n\nBO_ 256 Speed: 8 JB1\n\n'
    cycle = b'BA_DEF_ BO_ "GenMsgCycleTime" INT 0 65535;\nBA_DEF_DEF_ "GenMsgCycleTime" 0;\n'
    upload = page.uploads["load a message set"]
    load(upload, head + cycle + b'BA_ "GenMsgCycleTime" BO_ 256 20;\n', "ship.dbc")
    assert "all 1 messages meet their deadlines" in page.text
    assert "Speed,0x100,8,20,20,0,0,no,JB1," in page.controls["text"].value
    load(upload, head + cycle, "ship.dbc")
    assert "'Speed' has no cycle time" in page.note
    signals = b'BO_ 256 Speed: 1 JB1\n SG_ A : 0|8@1+ (1,0) [0|0] "" JB1\n SG_ B : 4|4@1+ (1,0)'
    both = head.replace(b"BO_ 256 Speed: 8 JB1\n", signals + b' [0|0] "" JB1\n')
    load(upload, both + cycle + b'BA_ "GenMsgCycleTime" BO_ 256 20;\n', "ship.dbc")
    assert page.controls["text"].value.startswith("# message 'Speed': The signals B and A are ove")
    assert "all 1 messages meet their deadlines" in page.text


def test_a_binary_file_changes_nothing_and_a_windows_text_is_read():
    page = CanLoad().explore()
    load(page.uploads["load a message set"], b"\x89PNG\0", "a.png")
    assert page.note == "a.png: this is not a text file"
    assert page.controls["text"].value == EXAMPLE and "meet their deadlines" in page.text
    load(page.uploads["load a message set"], EXAMPLE.replace("alarm", "\xf6l").encode("cp1252"))
    assert "\xf6l" in page.controls["text"].value and page.note == ""


def test_a_log_and_a_workbook_are_loaded_as_text_with_remarks():
    pytest.importorskip("openpyxl")
    page = CanLoad().explore()
    upload, editor = page.uploads["load a message set"], page.controls["text"]
    lines = [f"({k / 100:.6f}) can0 100#0102030405060708" for k in range(200)]
    lines += [f"({k / 100 + 0.001:.6f}) can0 2A0#01" for k in (3, 50, 51, 180)]
    log = "\n".join(sorted(lines)).encode()
    load(upload, log, "ship.log")
    assert editor.value.startswith("# from a log: 1 periodic, 1 unclear; if not")
    assert "0x100,0x100,8,10," in editor.value and page.note == ""
    assert "all 2 messages meet their deadlines" in page.text
    load(upload, log.replace(b"100#01", b"100#0102"), "ship.log")
    assert page.note.startswith("ship.log: line 1") and "all 2 messages" in page.text
    load(upload, as_workbook({"list": pd.read_csv(StringIO(EXAMPLE))}), "list.xlsx")
    assert MessageSet.parse(editor.value) == MessageSet.parse(EXAMPLE) and page.note == ""
    load(upload, EXAMPLE.encode(), "list.csv")
    assert editor.value == EXAMPLE
