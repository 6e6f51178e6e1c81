"""What is fuzzed: every reader and decoder of the package, with good inputs to start from.

A target takes bytes, as a file or a line would hold them. It may refuse them with an error of
`shipnet.errors`; any other exception is a defect.
"""

from __future__ import annotations

import io
import os
import tempfile
import zipfile
from collections.abc import Callable, Iterable
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from shipnet import (
    asi,
    ballast,
    can,
    crc,
    datasets,
    design,
    engine,
    fuzzy,
    line,
    modbus,
    remote_control,
)
from shipnet.ballast.plant import Fault
from shipnet.engine.serving import parse_fault
from shipnet.errors import ArgumentError, FrameError, InputError
from shipnet.modbus.slave import answer as answer_of
from shipnet.modbus.wire import WireFault
from shipnet.tools import can_load, ship_design
from shipnet.tools._view import read_link, read_state, write_state

#: Files of a target live in memory where the system has a place for that.
_FOLDER = Path(
    tempfile.mkdtemp(prefix="fuzz-", dir="/dev/shm" if os.access("/dev/shm", os.W_OK) else None)
)


class Target(NamedTuple):
    """One function under test: what it does with bytes, and good inputs."""

    run: Callable[[bytes], Any]
    seeds: Callable[[], Iterable[bytes]]


def _file(suffix: str, read: Callable[[Path], Any]) -> Callable[[bytes], Any]:
    """Return a target that reads a file with these bytes."""
    path = _FOLDER / f"input{suffix}"

    def run(data: bytes) -> Any:
        path.write_bytes(data)
        return read(path)

    return run


def _text(parse: Callable[[str], Any]) -> Callable[[bytes], Any]:
    """Return a target that takes text: any bytes are some text in Latin-1."""
    return lambda data: parse(data.decode("latin-1"))


def _bits(parse: Callable[[str], Any]) -> Callable[[bytes], Any]:
    """Return a target that takes bits as text; other characters come through now and then."""
    return lambda data: parse("".join(chr(48 + (b & 1)) if b < 250 else chr(b) for b in data))


def _data(*names: str) -> Callable[[], Iterable[bytes]]:
    return lambda: [datasets.path(name).read_bytes() for name in names]


def _saved(suffix: str, *things: Callable[[Path], Any]) -> Callable[[], Iterable[bytes]]:
    """Return what our own writers write."""

    def seeds() -> Iterable[bytes]:
        for save in things:
            path = _FOLDER / f"seed{suffix}"
            save(path)
            yield path.read_bytes()

    return seeds


def _log(path: Path) -> None:
    can.simulate(can.example(), 125e3, until=0.1).log().save(path)


def _foreign_log(path: Path) -> None:
    """Write a log with python-can, in the format of the suffix."""
    import can as python_can

    with python_can.Logger(path) as logger:
        for k in range(20):
            logger(
                python_can.Message(
                    timestamp=0.01 * k,
                    arbitration_id=0x100 + k,
                    is_extended_id=k % 3 == 0,
                    is_remote_frame=k % 7 == 6,
                    channel=0,
                    data=b"" if k % 7 == 6 else bytes(range(k % 9)),
                )
            )


def _capture(path: Path) -> None:
    heard = asi.line(50, slaves=(5,)).waveform(
        asi.Request.data_exchange(5, 3), "5 m", before=20e-6, after=296e-6
    )
    heard.save(path)


def _strokes(path: Path) -> None:
    """Write the first strokes of the shipped recording."""
    held = dict(np.load(datasets.path("vtnsi_actuator_strokes.npz")))
    np.savez(path, **{key: x if key == "channels" else x[:2] for key, x in held.items()})


def _sigrok(levels: bytes, metadata: str, **others: bytes) -> bytes:
    """Return a session of sigrok with one logic channel."""
    made = io.BytesIO()
    with zipfile.ZipFile(made, "w") as file:
        file.writestr("metadata", f"[device 1]\ncapturefile=logic-1\n{metadata}\n")
        file.writestr("logic-1-1", levels)
        for name, content in others.items():
            file.writestr(name, content)
    return made.getvalue()


def _session() -> bytes:
    """Return a session of sigrok with a logic channel and an analogue one."""
    metadata = "total probes=1\nsamplerate=1 MHz\ntotal analog=1\nprobe1=D0\nanalog2=A0\nunitsize=1"
    analogue = np.sin(np.arange(400) / 3).astype("f4").tobytes()
    return _sigrok(bytes(range(256)), metadata, version=b"2", **{"analog-1-2-1": analogue})


def _levels_of_a_bus() -> np.ndarray:
    frames = [can.Frame(0x123, b"\x01\x02"), can.Frame(0x1ABCDEF, bytes(8), extended=True)]
    bits = "1" * 15 + ("1" * 11).join(frame.bits for frame in frames) + "1" * 15
    return np.repeat([int(bit) for bit in bits], 4).astype(np.uint8)


def _bus() -> bytes:
    """Return a session of sigrok that recorded a CAN bus."""
    return _sigrok(_levels_of_a_bus().tobytes(), "samplerate=1 MHz\nprobe1=RX")


def _serial() -> bytes:
    """Return a session of sigrok that recorded a serial line."""
    waveform = modbus.SerialLine(9600, "8N1").waveform(b"Hello, ship.", gap=0.002)
    at = np.searchsorted(waveform.time, np.arange(0, waveform.time[-1], 1e-5), side="right") - 1
    return _sigrok(waveform.level[at].astype("u1").tobytes(), "samplerate=100 kHz\nprobe1=TX")


def _bus_changes() -> bytes:
    """Return the changes of a CAN bus, as a logic analyser stores them."""
    levels = _levels_of_a_bus()
    rows = [0, *(np.flatnonzero(np.diff(levels.astype(int))) + 1), len(levels) - 1]
    return b"Time [s],Channel 0\n" + b"".join(b"%.7f,%d\n" % (k * 1e-6, levels[k]) for k in rows)


def _sheet(data: bytes) -> bytes:
    """Return a workbook whose only sheet has these bytes."""
    made = io.BytesIO()
    with zipfile.ZipFile(io.BytesIO(_workbook())) as good, zipfile.ZipFile(made, "w") as bad:
        for name in good.namelist():
            bad.writestr(name, data if name.endswith("sheet1.xml") else good.read(name))
    return made.getvalue()


def _workbook(csv: str = "tag,signal,x_m,y_m,z_m\nTI 101,rtd_3wire,1,2,3\n") -> bytes:
    """Return CSV text as a workbook."""
    import openpyxl

    book = openpyxl.Workbook()
    for row in csv.splitlines():
        book.active.append([float(cell) if cell.isdigit() else cell for cell in row.split(",")])
    made = io.BytesIO()
    book.save(made)
    return made.getvalue()


def _sheet_xml() -> Iterable[bytes]:
    with zipfile.ZipFile(io.BytesIO(_workbook())) as book:
        yield book.read("xl/worksheets/sheet1.xml")


_REQUESTS = [
    modbus.Request.read_holding_registers(0, 10),
    modbus.Request.read_coils(3, 17),
    modbus.Request.write_single_register(7, 0xABCD),
    modbus.Request.write_multiple_registers(1, [1, 2, 3]),
    modbus.Request.write_multiple_coils(1, [1, 0, 1]),
]


def _adus() -> Iterable[bytes]:
    for request in _REQUESTS:
        yield request.rtu(17)
        yield request.tcp(3, 17)


_SLAVE = modbus.Slave(
    coils=range(2), holding_registers=range(40), input_registers=range(9), limits={3: (0, 9)}
)


def _answered(data: bytes) -> Any:
    """Send bytes as a request with a correct CRC, which no fuzzer guesses."""
    frame = data + crc.MODBUS.of(data).to_bytes(2, "little")
    return answer_of({17: _SLAVE}, modbus.decode(frame))


def _answers() -> Iterable[bytes]:
    for request in _REQUESTS:
        answer = answer_of({17: _SLAVE}, modbus.decode(request.rtu(17)))
        if answer is not None:
            yield answer.pdu


def _can_bits() -> Iterable[bytes]:
    for frame in (can.Frame(0x123, b"\x01\x02"), can.Frame(0x1ABCDEF, bytes(8), extended=True)):
        yield frame.bits.encode()


def _judged(*record: Any) -> Any:
    """Decode a record of an AS-i line, and judge it as the command does."""
    capture = asi.decode(*record)
    capture.counters()
    capture.causes()
    return capture


def _levels(data: bytes) -> Any:
    """Decode bytes as the samples of a record of an AS-i line, and judge them."""
    return _judged(np.frombuffer(data[: len(data) // 8 * 8], "f8"), 0.25e-6)


def _samples() -> Iterable[bytes]:
    yield np.sin(np.arange(900) / 3.7).tobytes()
    yield asi.line(60, slaves=2).record(1e-3, rng=1).u.tobytes()


def _packet(kind: Any) -> Target:
    """Return a packet format as a target: a stream of bytes, then one packet."""

    def run(data: bytes) -> None:
        # A trace has a row per byte, to be looked at; no ring holds more.
        kind.trace(data[:65536])
        kind.decode(data)

    return Target(run, lambda: [kind.encode({1: 500, 3: 0xFFFF}), kind.encode({}) * 2])


TARGETS: dict[str, Target] = {
    "asi request": Target(
        _bits(asi.Request.parse), lambda: [asi.Request.data_exchange(21, 14).bits.encode()]
    ),
    "asi response": Target(_bits(asi.Response.parse), lambda: [asi.Response(5).bits.encode()]),
    "asi capture.csv": Target(_file(".csv", asi.decode), _saved(".csv", _capture)),
    "asi capture.npz": Target(_file(".npz", _judged), _saved(".npz", _capture)),
    "asi capture.sr": Target(_file(".sr", asi.decode), lambda: [_session()]),
    "asi samples": Target(_levels, _samples),
    "asi plan": Target(
        _file(".csv", asi.read_plan),
        _data("synthetic_asi_plan_300m.csv", "synthetic_asi_plan_ballast.csv"),
    ),
    "can frame": Target(_bits(can.decode), _can_bits),
    "can capture.sr": Target(
        _file(".sr", lambda path: can.read_capture(path).loads()), lambda: [_bus()]
    ),
    "can capture.csv": Target(
        _file(".csv", lambda path: can.read_capture(path, 250e3).loads()), lambda: [_bus_changes()]
    ),
    "can log.log": Target(_file(".log", can.read_log), _saved(".log", _log)),
    "can log.asc": Target(_file(".asc", can.read_log), _saved(".asc", _foreign_log)),
    "can log.blf": Target(_file(".blf", can.read_log), _saved(".blf", _foreign_log)),
    "can log.trc": Target(_file(".trc", can.read_log), _saved(".trc", _foreign_log)),
    "can log.csv": Target(_file(".csv", can.read_log), _saved(".csv", _foreign_log)),
    "can log, printed": Target(
        _file(".txt", can.read_log),
        lambda: [
            b"1: (1.5)  can0  123   [2]  01 2A\n# on\n (2.0) can0 18FEF100 [3] remote request\n",
            b"  can0  123   [2]  01 2A   '.*'\n  can0  123  [12]  00 01\n",
            b"Time Stamp,ID,Extended,Dir,Bus,LEN,D1,D2,D3,D4,D5,D6,D7,D8\n"
            b"1500000,00000123,false,Rx,0,2,01,2A,\n",
        ],
    ),
    "can messages": Target(_text(can.MessageSet.parse), _data("synthetic_can_lee2012.csv")),
    "can messages.csv": Target(
        _file(".csv", can.read_messages),
        lambda: [
            b"Engine, rev. 3\n\nNo.;Message;CAN-ID (hex);DLC;Cycle [ms]\n1;Oil;18FF0100h;8;20\n",
            b"(1.5) can0 123#012A\n(1.6) can0 123#012A\n(2.0) can0 18FEF100#R3\n",
        ],
    ),
    "can log against messages": Target(
        _file(".log", lambda path: can.compare(can.example(), path).table()), _saved(".log", _log)
    ),
    "can messages.dbc": Target(
        _file(".dbc", can.read_messages),
        lambda: [
            b'VERSION ""\nNS_ :\nBS_:\nBU_: A B\nBO_ 291 Speed: 8 A\n SG_ rpm : 0|16@1+ (0.5,0)'
            b' [0|8000] "rpm" B\nBA_DEF_ BO_ "GenMsgCycleTime" INT 0 10000;\n'
            b'BA_DEF_DEF_ "GenMsgCycleTime" 100;\nBA_ "GenMsgCycleTime" BO_ 291 10;\n'
        ],
    ),
    "modbus rtu": Target(lambda data: modbus.decode(data, "rtu"), _adus),
    "modbus tcp": Target(lambda data: modbus.decode(data, "tcp"), _adus),
    "modbus request": Target(modbus.Request.parse, lambda: [request.pdu for request in _REQUESTS]),
    "modbus response": Target(modbus.Response.parse, _answers),
    "modbus answer": Target(_answered, lambda: [adu[:-2] for adu in _adus()]),
    "packet, marker": _packet(remote_control.MarkerFormat()),
    "packet, marker and CRC": _packet(remote_control.MarkerFormat(crc=True)),
    "packet, COBS": _packet(remote_control.CobsFormat()),
    "waveform.csv": Target(_file(".csv", line.Waveform.read), _saved(".csv", _capture)),
    "serial capture.sr": Target(_file(".sr", remote_control.read_capture), lambda: [_serial()]),
    "strokes.npz": Target(
        _file(".npz", lambda path: ballast.read_strokes(path).scores()), _saved(".npz", _strokes)
    ),
    "engine points": Target(
        _file(".csv", engine.read_points),
        _saved(".csv", lambda path: engine.read_points().table().to_csv(path)),
    ),
    "I/O list.csv": Target(_file(".csv", design.read_iolist), _data("synthetic_iolist_valves.csv")),
    "I/O list.xlsx": Target(_file(".xlsx", design.read_iolist), lambda: [_workbook()]),
    "sheet of a workbook": Target(
        lambda data: _file(".xlsx", design.read_iolist)(_sheet(data)), _sheet_xml
    ),
    "settings": Target(_text(design.Settings.parse), lambda: [design.Settings().text().encode()]),
    "rules": Target(_file(".toml", fuzzy.read_rules), _data("kim2014_assumed_rules.toml")),
    "log of a valve": Target(
        _file(".csv", ballast.read_log),
        lambda: [
            "Zeit;FP [bar];OT [\N{DEGREE SIGN}C]\n1.2.2026 12:00:01,5;90,5;-\n".encode("cp1252"),
            b"time_s,FP_bar,VPos_percent\n0.0,90.5,10\n1.5,91.5,20\n",
        ],
    ),
    "log of a valve.xlsx": Target(
        _file(".xlsx", ballast.read_log),
        lambda: [_workbook("time_s,FP_bar,VPos_percent\n0,90,10\n1,91,20\n")],
    ),
    "asi plan.xlsx": Target(
        _file(".xlsx", asi.read_plan),
        lambda: [_workbook(datasets.path("synthetic_asi_plan_300m.csv").read_text())],
    ),
    "can messages.xlsx": Target(
        _file(".xlsx", can.read_messages),
        lambda: [_workbook(datasets.path("synthetic_can_lee2012.csv").read_text())],
    ),
    "waveform.npy": Target(
        _file(".npy", line.Waveform.read),
        _saved(".npy", lambda path: np.save(path, np.column_stack(2 * [np.arange(9) * 1e-7]))),
    ),
    "state of a tool": Target(
        lambda data: read_state(data, "can_load", can_load.CanLoad),
        lambda: [write_state("can_load", can_load.CanLoad(), [can_load.CanLoad()]).encode()],
    ),
    "link to a tool": Target(
        _text(lambda text: read_link(text, can_load.CanLoad)),
        lambda: [b"bit_rate=250000&pin=bit_rate%3D125000"],
    ),
    "upload of messages": Target(
        lambda data: can_load._from_file(can_load.CanLoad(), "a.txt", data),
        _data("synthetic_can_lee2012.csv"),
    ),
    "upload of points": Target(
        lambda data: ship_design.from_file(ship_design.ShipDesign(), "a", data),
        _data("synthetic_iolist_valves.csv"),
    ),
    "fault of a valve": Target(_text(lambda text: Fault.parse(text, 9)), lambda: [b"3:P2:0.5"]),
    "fault of an engine": Target(
        _text(partial(parse_fault, engine.System())), lambda: [b"ME-JB2-044:stuck", b"2:dead"]
    ),
    "fault of a wire": Target(_text(WireFault.parse), lambda: [b"late:0.1:3"]),
    "class rules": Target(_file(".csv", design.RuleSet.read), _data("design_rules.csv")),
}

#: What a target may raise.
REFUSALS = (ArgumentError, FrameError, InputError)
