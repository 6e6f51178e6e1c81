"""The command line: ``python -m shipnet``, also installed as ``shipnet``."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from functools import partial
from textwrap import shorten
from typing import Any

from shipnet.errors import InputError

__all__ = ["main"]

#: Groups of faults of a file that are told.
_FAULTS = 100

_LEDGER = """\
Show what the papers print beside what shipnet computes.

example:
  shipnet ledger --paper kim2023 --csv kim2023.csv
"""

_DECODE = """\
Decode an AS-i line voltage that an oscilloscope recorded: its CSV file,
.npy, .npz, or sigrok's .sr. DC or AC coupled, either way round, 1 MS/s or more.

example:
  shipnet decode scope.csv --channel CH2 --csv transactions.csv --figure transactions.png
"""

_SERVE = """\
Serve simulated devices over Modbus/TCP, or its frames in datagrams, or on a
serial port. Ctrl-C stops it.

ballast: unit id n is valve n. Function code 6 writes its command to register
0x4001, code 4 reads its status from 0x4020 to 0x4023: position in percent and
flags, operating time, motor temperature and pump pressure, motor current and
operating pressure.

engine: unit ids 2 and 3 are junction boxes with all 99 points of an engine, whose
values are synthetic. Function code 3 reads registers 0 to 98, temperatures in
tenths of a degree.

examples:
  shipnet serve ballast --valves 64 --fault 3:V1 --fault 7:P2:0.5
  shipnet serve ballast --serial /dev/ttyUSB0 --bit-rate 19200 --speed 10
  shipnet serve engine --port 1502
"""

_DESIGN = """\
Plan the points of an I/O list in several ways and compare what they take: cables,
hours, money, response, the rules, and what one failure costs. The list is a CSV
file or an Excel workbook: tag, signal or type, and x, y, z or the length of the
cable to the cabinet. A design aid, not class approval.

examples:
  shipnet design points.csv -o report.html
  shipnet design points.xlsx --cabinet 26,6,14 --trays trays.csv --rules BV -o report.html
  shipnet design points.csv --options "home runs,CAN" --mix DI=AS-i --mix AI=CAN --redundant

prices, allowances and limits of the buses are set in a file; to begin one from the defaults:
  shipnet design --show-settings > own.toml
  shipnet design points.csv --settings own.toml -o report.html
"""


#: Rows of a table that the terminal shows, and the part of a record that a figure does [s].
_ROWS = 40
_SHOWN = 400e-6


def _parser() -> argparse.ArgumentParser:
    from shipnet import __version__

    parser = argparse.ArgumentParser(
        prog="shipnet",
        description="Field buses of a ship, and the papers that use them, recomputed.",
        epilog="example: shipnet ledger --paper kim2023",
    )
    parser.add_argument("--version", action="version", version=f"shipnet {__version__}")
    commands = parser.add_subparsers(title="commands", required=True, metavar="COMMAND")

    ledger = commands.add_parser(
        "ledger",
        help="what the papers print, what we compute, and the verdict",
        description=_LEDGER,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    ledger.add_argument("--paper", metavar="KEY", help="one paper only, such as kim2023")
    ledger.add_argument("--csv", metavar="FILE", help="also write all columns to this file")
    ledger.add_argument("--summary", action="store_true", help="only the counts of each paper")
    ledger.set_defaults(run=_ledger)

    decode = commands.add_parser(
        "decode",
        help="the transactions in an oscilloscope's record of an AS-i line",
        description=_DECODE,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    decode.add_argument("file", metavar="FILE", help="the record")
    decode.add_argument("--channel", metavar="NAME", help="title or column number of the channel")
    decode.add_argument(
        "--sample-interval", metavar="S", type=float, help="time between two samples, such as 1e-7"
    )
    decode.add_argument(
        "--threshold", metavar="X", type=float, default=0.5, help="a pulse, over the first one: 0.5"
    )
    decode.add_argument("--csv", metavar="OUT", help="also write the whole table to this file")
    decode.add_argument("--figure", metavar="OUT", help="also draw the first 400 us to this file")
    decode.set_defaults(run=_decode)

    serving = commands.add_parser(
        "serve",
        help="simulated devices that real Modbus clients talk to",
        description=_SERVE,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    serving.add_argument(
        "device", choices=["ballast", "engine"],
        help="what to simulate: ballast valves, or the junction boxes of an engine",
    )  # fmt: skip
    serving.add_argument(
        "--valves", metavar="N", type=int, default=64, help="how many valves, 1..247 (default 64)"
    )
    serving.add_argument(
        "--host", metavar="ADDRESS", default="127.0.0.1", help="address (default this machine only)"
    )
    serving.add_argument(
        "--port",
        metavar="N",
        type=int,
        default=5020,
        help="port (default 5020; 0: any free one)",
    )
    serving.add_argument("--udp", action="store_true", help="datagrams instead of TCP")
    serving.add_argument("--serial", metavar="DEVICE", help="RTU on this serial port instead")
    serving.add_argument(
        "--bit-rate", metavar="N", type=float, default=9600, help="of the serial port: 9600"
    )
    serving.add_argument(
        "--character", metavar="C", default="8E1", help="of the serial port: 8E1, 8O1, 8N2 or 8N1"
    )
    serving.add_argument(
        "--fault", metavar="FAULT", action="append", default=[],
        help="a fault of valve V as V:CODE:SEVERITY, such as 3:P2:0.5, or of the engine, such as "
        "'box dead JB2'; may be repeated",
    )  # fmt: skip
    serving.add_argument(
        "--speed", metavar="FACTOR", type=float, default=1.0, help="model seconds a second: 1"
    )
    serving.add_argument(
        "--watchdog", metavar="SECONDS", type=float,
        help="stop a motor whose valve has had no request for so long, 0.1..3600 (default never)",
    )  # fmt: skip
    serving.set_defaults(run=_serve)

    design = commands.add_parser(
        "design",
        help="cables, cost, response and rules of an I/O list, planned in several ways",
        description=_DESIGN,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    design.add_argument("list", metavar="LIST", nargs="?", help="the I/O list: .csv or .xlsx")
    design.add_argument("-o", "--output", metavar="FILE", help="also write a report, as HTML")
    design.add_argument(
        "--sheet", metavar="NAME",
        help="sheet of a workbook (default the first that is not hidden and holds a list)",
    )  # fmt: skip
    design.add_argument(
        "--cabinet", metavar="X,Y,Z",
        help="where the cables end, in m, or the name of a cabinet in the file of trays (default "
        "found from the lengths in the list)",
    )  # fmt: skip
    design.add_argument("--trays", metavar="FILE", help="cable trays, as CSV")
    design.add_argument(
        "--rules", metavar="SET", default="DNV",
        help="DNV, BV, IMO, lee2012, or a file of your own (default DNV)",
    )  # fmt: skip
    design.add_argument(
        "--options", metavar="A,B,..",
        help="home runs, junction boxes, AS-i, CAN, Modbus RTU (default all)",
    )  # fmt: skip
    design.add_argument(
        "--mix", metavar="WHAT=OPTION", action="append", default=[],
        help="one way more: points of this type, signal, system, category or tag by this option, "
        "the others by home runs; may be repeated",
    )  # fmt: skip
    design.add_argument("--redundant", action="store_true", help="two lines for CAN and Modbus")
    design.add_argument(
        "--settings", metavar="FILE",
        help="prices (low, nominal, high), detour, tails, spare, bit rates, time of the host and "
        "all other limits, as TOML; what it does not name stays as it is",
    )  # fmt: skip
    design.add_argument(
        "--show-settings", action="store_true",
        help="print all of these as such a file, each with what it is and may be, and stop",
    )  # fmt: skip
    design.add_argument("--title", metavar="TEXT", help="of the report")
    design.add_argument("--date", metavar="TEXT", help="printed on the report (default none)")
    design.set_defaults(run=_design)
    return parser


def _ledger(arguments: argparse.Namespace) -> None:
    from shipnet.papers.judging import Ledger, format_computed

    ledger = Ledger(arguments.paper)
    if arguments.summary and arguments.csv is None:
        print(ledger.counts().to_string())
        return
    table = ledger.table().reset_index()
    # The file comes first: whoever reads the output may stop reading.
    if arguments.csv is not None:
        table.to_csv(arguments.csv, index=False)
    if not arguments.summary:
        print(f"{'claim':<15}{'published':>16}  {'computed':<14}{'verdict':<19}what")
        for row in table.to_dict("records"):
            published = shorten(row["published"], 16, placeholder="..")
            computed = format_computed(row["computed"], row["published"])
            unit = f" [{row['unit']}]" if row["unit"] else ""
            verdict = row["verdict"] or row["kind"]
            print(
                f"{row['id']:<15}{published:>16}  {computed:<14}{verdict:<19}{row['claim']}{unit}"
            )
        print()
    print(ledger.counts().to_string())
    if arguments.csv is not None:
        print(f"\n{len(table)} claims written to {arguments.csv}")


def _decode(arguments: argparse.Namespace) -> None:
    from shipnet.asi.capture import decode
    from shipnet.line.scope_file import read_waveform

    waveform = read_waveform(
        arguments.file, channel=arguments.channel, sample_interval=arguments.sample_interval
    )
    capture = decode(waveform.u, waveform.dt, threshold=arguments.threshold)
    if not capture.telegrams:
        raise InputError(arguments.file, f"no AS-i telegram in channel {waveform.names[0]}")
    rows = capture.transactions
    # The files come first: whoever reads the output may stop reading.
    written = []
    if arguments.csv is not None:
        rows.to_csv(arguments.csv, index=False)
        written.append(f"{len(rows)} transactions written to {arguments.csv}")
    if arguments.figure is not None:
        from shipnet import style

        start = max(0.0, float(rows["start_s"].iloc[0]) - 20e-6)
        shown = partial(capture.plot, start=start, stop=start + _SHOWN)
        style.save(arguments.figure, shown, figsize=(10, 3.2))
        written.append(f"first {_SHOWN * 1e6:g} us drawn to {arguments.figure}")
    print(waveform.description)
    print(
        f"{'ms':>9}{'pauses':>11}{'req V':>7}{'resp V':>7}{'weakest':>9}{'ringing':>9}  transaction"
    )
    for row in rows.head(_ROWS).to_dict("records"):
        pauses = f"{_number(row['master_pause_bit'], 1)} {_number(row['slave_pause_bit'], 1):>5}"
        print(
            f"{row['start_s'] * 1e3:>9.3f}{pauses:>11}{_number(row['request_amplitude_V'], 2):>7}"
            f"{_number(row['response_amplitude_V'], 2):>7}{_number(row['weakest_pulse'], 2):>9}"
            f"{_number(row['ringing'], 2):>9}  {row['text']}"
        )
    if len(rows) > _ROWS:
        print(f"... and {len(rows) - _ROWS} more")
    summary = capture.summary()
    print(f"\n{summary}\n\n{summary.slaves.round(2).to_string(na_rep='-')}")
    if written:
        print("\n" + "\n".join(written))


def _serve(arguments: argparse.Namespace) -> None:
    import logging
    from threading import Event

    from shipnet.ballast.live import serve
    from shipnet.ballast.valve_faults import Fault
    from shipnet.engine.faults import parse_fault as parse_engine_fault
    from shipnet.engine.serving import serve as serve_engine
    from shipnet.engine.system import System
    from shipnet.errors import ArgumentError
    from shipnet.modbus.uart import SerialLine

    # What goes wrong is told in one line, not in the library's log besides.
    logging.getLogger("pymodbus").addHandler(logging.NullHandler())
    n_valves = arguments.valves
    options: dict[str, Any] = {"host": arguments.host, "port": arguments.port}
    if arguments.serial is not None:
        if arguments.udp:
            raise ArgumentError("--udp and --serial exclude each other")
        line = SerialLine(arguments.bit_rate, arguments.character)
        options = {"transport": "rtu", "serial_port": arguments.serial, "line": line}
    elif arguments.udp:
        options["transport"] = "udp"
    if arguments.device == "engine":
        if arguments.watchdog is not None:
            raise ArgumentError("--watchdog stops the motor of a valve; the engine has none here")
        system, units = System(), "unit ids 2 and 3"
        broken = [parse_engine_fault(system, words) for words in arguments.fault]
        server = serve_engine(system, faults=broken, speed=arguments.speed, **options)
    else:
        units = "unit id 1" if n_valves == 1 else f"unit ids 1..{n_valves}"
        faults = [Fault.parse(text, n_valves) for text in arguments.fault]
        server = serve(
            n_valves,
            faults=faults,
            speed=arguments.speed,
            watchdog=arguments.watchdog,
            **options,
        )
    try:
        with server:
            where = f"{arguments.host}, port {server.port} ({'UDP' if arguments.udp else 'TCP'})"
            if arguments.serial is not None:
                where = f"{arguments.serial}, {line.bit_rate:g} bit/s {line.character}"
            print(f"listening on {where}: {units}; Ctrl-C stops", flush=True)
            Event().wait()
    except KeyboardInterrupt:
        print("stopped", flush=True)


def _design(arguments: argparse.Namespace) -> None:
    from shipnet.design.command import run

    run(arguments)


def _number(value: float, digits: int) -> str:
    """Return a number, or a dash where there is none."""
    return "-" if value != value else f"{value:.{digits}f}"


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command.

    Parameters
    ----------
    arguments : sequence of str, optional
        The words after the program's name; those of the process if omitted.

    Returns
    -------
    int
        0, or 2 after a user's mistake, which is told on standard error; of a file, a line a fault.
    """
    parsed = _parser().parse_args(arguments)
    try:
        parsed.run(parsed)
    except BrokenPipeError:
        # Whoever reads the output has had enough; the interpreter must not complain at its end.
        sys.stdout = None
    except (ValueError, OSError, ImportError) as mistake:
        told = [str(mistake)]
        if isinstance(mistake, InputError) and len(lines := mistake.lines(_FAULTS)) > 1:
            told = [f"{mistake.file}:", *lines]
        print("shipnet:", "\n  ".join(told), file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main())
