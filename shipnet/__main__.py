"""The command line: ``python -m shipnet``, also installed as ``shipnet``.

A command returns its answer, which is printed, or written as data with ``--json``, and saved with
``-o FILE`` in the form that the file's suffix names. Exit codes: 0 done and good, 1 done and the
answer is bad, 2 could not be done.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from textwrap import shorten
from typing import Any

from shipnet.answers import FORMS, Answer, check_output
from shipnet.errors import ArgumentError, InputError
from shipnet.lazy import pd

#: What the terminal shows of a transaction: title, column, width and digits.
_TRANSACTION = (
    ("ms", "start_ms", 9, 3),
    ("", "master_pause_bit", 5, 1),
    ("pauses", "slave_pause_bit", 6, 1),
    ("req V", "request_amplitude_V", 7, 2),
    ("resp V", "response_amplitude_V", 7, 2),
    ("weakest", "request_weakest", 9, 2),
    ("", "response_weakest", 5, 2),
    ("ringing", "request_ringing", 9, 2),
    ("", "response_ringing", 5, 2),
)

#: Rows of a table that the terminal shows, and the part of a record that a figure shows [s].
_ROWS = 40
_SHOWN = 400e-6

_LEDGER = """\
Show what the papers print beside what shipnet computes.

example:
  shipnet ledger kim2023 -o kim2023.csv
"""

_DECODE = """\
Decode an AS-i line voltage that an oscilloscope recorded: its CSV file,
.npy, .npz, or sigrok's .sr. DC or AC coupled, either way round, 1 MS/s or more.
It says which slaves suffer, what masters count, and the probable causes. A figure
shows the first 400 us.

example:
  shipnet decode scope.csv --channel CH2 -o transactions.csv -o transactions.png
"""

_CHECK = """\
Check the plan of an AS-i installation against every rule: lengths, addresses,
currents, voltages, and the signal at each slave. The plan is a CSV file with one
row per element.

example:
  shipnet check plan.csv -o findings.csv -o plan.png
"""

_CAN = """\
Analyse the messages of a CAN bus at several bit rates: load, longest responses, what
may be late, the lowest bit rate, and what a better order of identifiers gains. The
messages are a list (CSV or Excel), a DBC file, or those that a log shows. With --log,
compare them with a log instead: which are late, faster, missing or unknown.

examples:
  shipnet can messages.xlsx --rates 125k 250k 500k -o responses.png
  shipnet can ship.dbc --period 0.1 --log trip.blf
"""

_MODBUS = """\
Time how long a master on a serial line takes to read registers of all its slaves,
some of them dead, also at other bit rates.

example:
  shipnet modbus --slaves 24 --registers 20 --bit-rate 19.2k --dead 2 --limit 3 -o scan.png
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

A pseudo-terminal (pty) in place of a serial port has no parity: it needs
--character 8N1 or 8N2. It has no bit rate either: it passes all bytes on at once,
whatever rate the other end has set, so it shows neither a wrong rate nor the time
that a frame takes.

examples:
  shipnet serve ballast --valves 64 --fault 3:V1 --fault 7:P2:0.5
  shipnet serve ballast --serial /dev/ttyUSB0 --bit-rate 19.2k --speed 10
  shipnet serve ballast --serial /dev/pts/5 --character 8N1
  shipnet serve engine --port 1502 --fault 2:dead --fault ME-JB2-044:open
"""

_FLEET = """\
Simulate a fleet of ballast valves for months, with faults, and write what its sensors
read as labelled Parquet files by day: a synthetic data set for research on diagnosis.
The same command goes on where it stopped. It needs "shipnet[cluster]".

examples:
  shipnet fleet --valves 100 --days 7 --out fleet
  shipnet fleet --valves 1000 --days 365 --out fleet --scheduler tcp://10.0.0.1:8786
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
  shipnet design points.csv --set detour=1.3 --set "assumptions.labour_rate=[60, 65, 70]"

prices, allowances and limits of the buses can also be set in a file; to begin one from the
defaults:
  shipnet design --show-settings > own.toml
  shipnet design points.csv --settings own.toml -o report.html
"""


def number(text: str) -> float:
    """Return a number that may end in a prefix of SI, such as 125k or 100n."""
    power = {"M": 6, "k": 3, "m": -3, "u": -6, "n": -9}.get(text[-1:])
    return float(text if power is None else f"{text[:-1]}e{power}")


def _option(
    parser: argparse.ArgumentParser, words: str, help: str, default: Any = None, **more: Any
) -> None:
    """Add an argument: ``FILE``, ``--channel NAME``, or ``--udp``, which has no value."""
    flags, _, metavar = words.rpartition(" ")
    if words.startswith("-") and not flags:
        parser.add_argument(words, action="store_true", help=help)
        return
    if isinstance(default, list):
        more, help = {"action": "append", **more}, f"{help}; may be repeated"
    elif default is not None:
        kind = number if isinstance(default, float) else type(default)
        more, help = {"type": kind, **more}, f"{help} (default {default})"
    names = flags.split(", ") if flags else [metavar.lower()]
    parser.add_argument(*names, metavar=metavar, help=help, default=default, **more)


def _parser() -> argparse.ArgumentParser:
    from shipnet import __version__

    parser = argparse.ArgumentParser(
        prog="shipnet",
        description="Field buses of a ship, and the papers that use them, recomputed.",
        epilog="example: shipnet ledger kim2023",
    )
    parser.add_argument("--version", action="version", version=f"shipnet {__version__}")
    commands = parser.add_subparsers(
        title="commands", required=True, metavar="COMMAND", dest="command"
    )

    def command(
        run: Callable[[argparse.Namespace], object], text: str, help: str, *forms: str
    ) -> Callable[..., None]:
        """Add a command, and return the function that adds its options."""
        form = argparse.RawDescriptionHelpFormatter
        name = run.__name__.strip("_")
        made = commands.add_parser(name, help=help, description=text, formatter_class=form)
        made.set_defaults(run=run, output=[], json=False, forms=forms)
        if forms:
            ends = ", ".join(forms)
            said = f"also write a file {ends}, or a folder with all tables"
            _option(made, "-o, --output FILE", said, default=[])
            _option(made, "--json", "print the answer as data, for a program")
        return partial(_option, made)

    option = command(
        _ledger, _LEDGER, "what the papers print, what we compute, and the verdict", *FORMS
    )
    option("PAPER", "one paper, such as kim2023 (default all)", nargs="?")
    option("--paper KEY", "the same as PAPER", dest="key")
    option("--summary", "print only the counts of each paper")

    option = command(
        _decode, _DECODE, "the transactions in an oscilloscope's record of an AS-i line", *FORMS
    )
    option("FILE", "the record")
    option("--channel NAME", "title or column number of the channel")
    option("--sample-interval S", "time between two samples, such as 100n", type=number)
    option("--threshold X", "height of a pulse, over that of the first one", 0.5)

    option = command(
        _check, _CHECK, "the rules that the plan of an AS-i installation meets", *FORMS
    )
    option("PLAN", "the plan: .csv")

    said = "load, response times and lowest bit rate of CAN messages, or a log against them"
    option = command(_can, _CAN, said, *FORMS)
    option("MESSAGES", "the messages: .csv, .xlsx, .dbc, or a log")
    option("--rates RATE", "bit rates (default all usual ones)", nargs="+", type=number)
    option("--log FILE", "compare the messages with this log: candump, ASC, BLF, TRC or CSV")
    option("--period SECONDS", "period of messages for which the file has none", type=number)
    option(
        "--column TITLE=NAME", "what a title of a list means, such as Every=period_ms, or "
        "Pin=note for one to leave out", [],
    )  # fmt: skip
    option("--overlook", "leave out messages of a DBC file that have faults, and list them")

    said = "time of a Modbus scan, with dead slaves, at several bit rates"
    option = command(_modbus, _MODBUS, said, *FORMS)
    option("--slaves, --devices N", "how many slaves, 1..247", type=int, required=True)
    option("--registers N", "how many registers of each, 1..65536", type=int, required=True)
    option("--bit-rate, --rate N", "of the line", 9600.0)
    option(
        "--character, --parity C", "8E1, 8O1, 8N2 or 8N1; E, O and N mean the first three", "8E1"
    )
    option("--dead N", "how many of the slaves do not answer", 0)
    option("--processing SECONDS", "how long a slave works on its answer", 0.0)
    option("--timeout SECONDS", "how long the master waits for an answer", 1.0)
    option("--retries N", "how many more times it asks a slave that is silent", 0)
    option("--limit SECONDS", "longest time that the scan may take", type=number)

    option = command(_serve, _SERVE, "simulated devices that real Modbus clients talk to")
    option("DEVICE", "ballast: valves; engine: its junction boxes", choices=["ballast", "engine"])
    option("--valves N", "how many valves, 1..247", 64)
    option("--host ADDRESS", "address, by default of this machine only", "127.0.0.1")
    option("--port N", "port; 0 is any free one", 5020)
    option("--udp", "datagrams instead of TCP")
    option("--serial DEVICE", "RTU on this serial port instead")
    option("--bit-rate N", "of the serial port", 9600.0)
    option("--character C", "of the serial port: 8E1, 8O1, 8N2 or 8N1", "8E1")
    option(
        "--fault FAULT", "a fault of valve V as V:CODE:SEVERITY, such as 3:P2:0.5, or of the "
        "engine as WHERE:WHAT, such as 2:dead, 3:cut or ME-JB2-044:stuck (also open, short)", [],
    )  # fmt: skip
    option("--speed FACTOR", "model seconds per second", 1.0)
    option(
        "--watchdog SECONDS", "stop a motor whose valve has had no request for this long, "
        "0.1..3600 (default never)", type=number,
    )  # fmt: skip

    option = command(_fleet, _FLEET, "labelled sensor data of a fleet of valves, as Parquet files")
    option("--valves N", "how many valves, 1..100000", 1000)
    option("--days N", "how many days, 1..3650", 365)
    option("--out DIR", "folder of the files", required=True)
    option("--faults N", "mean number of faults of a valve in a year, 0..50", 2.0)
    option("--seed N", "source of the random numbers", 2024)
    option("--scheduler ADDRESS", "Dask scheduler whose workers do the work (default this machine)")

    said = "cables, cost, response and rules of an I/O list, planned in several ways"
    option = command(_design, _DESIGN, said, *FORMS, ".html")
    option("LIST", "the I/O list: .csv or .xlsx", nargs="?")
    option("--sheet NAME", "sheet of a workbook (default the one that looks most like a list)")
    option("--strict", "take every doubt about a row for a fault, such as one that is hidden")
    option("--faults FILE", "write the faults of the list as CSV: row, column, fault")
    option(
        "--cabinet X,Y,Z", "where the cables end, in m, or the name of a cabinet in the file of "
        "trays (default found from the lengths in the list)",
    )  # fmt: skip
    option("--trays FILE", "cable trays, as CSV")
    option("--rules SET", "DNV, BV, IMO, lee2012, or a file of your own", "DNV")
    option("--options A,B,..", "home runs, junction boxes, AS-i, CAN, Modbus RTU (default all)")
    option(
        "--mix WHAT=OPTION", "one more design: points of this type, signal, system, category or "
        "tag by this option, the others by home runs", [],
    )  # fmt: skip
    option("--redundant", "two lines for CAN and Modbus, as --set redundant=true")
    option(
        "--settings FILE", "prices (low, nominal, high), detour, tails, spare, bit rates, time of "
        "the host and all other limits, as TOML; the others keep their defaults",
    )  # fmt: skip
    option("--set NAME=VALUE", "one of these, as in such a file", [])
    option("--show-settings", "print all of these as such a file, with limits, and stop")
    option(
        "--tables FOLDER", "what a yard builds from, as CSV and Excel files in a folder: cables, "
        "terminals, devices, points, supplies, bill; the same as -o FOLDER", [], dest="output",
    )  # fmt: skip
    option("--title TEXT", "of the report")
    option("--date TEXT", "printed on the report (default none)")
    return parser


def _ledger(arguments: argparse.Namespace) -> Answer:
    from shipnet.papers.judging import Ledger, computed_text

    ledger = Ledger(arguments.paper or arguments.key)
    counts, table = ledger.counts(), ledger.table().reset_index()
    lines = []
    if not arguments.summary:
        lines = [f"{'claim':<15}{'published':>16}  {'computed':<14}{'by':<11}{'verdict':<20}what"]
        for row in table.to_dict("records"):
            published = shorten(row["published"], 16, placeholder="..")
            computed = computed_text(row)
            unit = f" [{row['unit']}]" if row["unit"] else ""
            as_printed = row["holds_under"] in ("", "as printed")
            verdict = f"{row['verdict'] or row['kind']}{'' if as_printed else '*'}"
            condition = "" if as_printed else f" ({row['holds_under']})"
            instead = f" -> {row['corrected']}" if row["corrected"] else ""
            lines.append(
                f"{row['id']:<15}{published:>16}  {computed:<14}{row['basis']:<11}{verdict:<20}"
                f"{row['claim']}{unit}{instead}{condition}"
            )
        lines += ["", "-> what should stand there; * under the condition in the last brackets", ""]
    return Answer(
        ok=not counts["open"].any(),
        verdict=str(ledger),
        text="\n".join([*lines, counts.to_string()]),
        numbers={str(name): (int(value), "") for name, value in counts.sum().items()},
        tables={"claims": table, "counts": counts.reset_index()},
        draw=ledger.plot,
    )


def _marked(transactions: pd.DataFrame) -> pd.DataFrame:
    """Return transactions whose bits begin with 0b, so that no reader takes them for a number."""
    bits = transactions[["request", "response"]]
    return transactions.assign(**bits.where(bits == "", "0b" + bits))


def _decode(arguments: argparse.Namespace) -> Answer:
    from shipnet.asi.capture import decode

    capture = decode(
        arguments.file,
        channel=arguments.channel,
        sample_interval=arguments.sample_interval,
        threshold=arguments.threshold,
    )
    causes = capture.causes()
    if not capture.telegrams and causes.empty:
        raise InputError(arguments.file, f"no AS-i telegram in channel {capture.wave.names[0]}")
    rows, summary, findings = capture.transactions, capture.summary(), capture.check()
    counters = capture.counters()
    shown = rows.head(_ROWS).assign(start_ms=1e3 * rows["start_s"])
    titles = "".join(f"{title:>{width}}" for title, _, width, _ in _TRANSACTION)
    lines = [capture.wave.description, f"{titles}  transaction"]
    for row in shown.to_dict("records"):
        cells = (
            f"{'-' if row[name] != row[name] else f'{row[name]:.{digits}f}':>{width}}"
            for _, name, width, digits in _TRANSACTION
        )
        lines.append(f"{''.join(cells)}  {row['text']}")
    if len(rows) > _ROWS:
        lines.append(f"... and {len(rows) - _ROWS} more")
    lines += ["", str(summary), "", summary.slaves.round(2).to_string(na_rep="-"), ""]
    for name, value, light, meaning in counters.itertuples():
        number = f"{value:.1%}" if name == "repetitions" else f"{value:g}"
        lines.append(f"{name:<21}{number.replace('nan', '-'):>6}  {light:<7}{meaning}")
    lines += ["", str(findings), ""]
    for rank, (cause, slave, _, evidence) in enumerate(causes.itertuples(), 1):
        lines.append(f"probable cause {rank}: {cause} {slave}".rstrip() + f"; {evidence}")
    start = 0.0 if rows.empty else max(0.0, float(rows["start_s"].min()) - 20e-6)
    counts = {str(name).replace(" ", "_"): (n, "") for name, n in counters["value"].items()}
    return Answer(
        ok=findings.ok,
        verdict=findings.verdict,
        text="\n".join(lines).rstrip(),
        numbers={
            "transactions": (len(rows), ""),
            "telegrams": (capture.telegrams, ""),
            "unanswered": (summary.unanswered, ""),
            "cycle_time": (summary.cycle_time, "s"),
            "supply_voltage": (capture.supply_voltage, "V"),
            **counts,
        },
        tables={
            "transactions": _marked(rows),
            "slaves": summary.slaves.reset_index(),
            "counters": counters.reset_index(),
            "causes": causes.reset_index(),
        },
        draw=lambda ax: capture.plot(ax, start=start, stop=start + _SHOWN),
        findings=findings,
    )


def _answer(
    found: Any, numbers: Mapping[str, tuple[float, str]], text: str = "", **tables: pd.DataFrame
) -> Answer:
    """Return what an answer of a front says, for the terminal with its tables that are not empty.

    Findings are said in words, by `text`.
    """
    look: dict[str, Any] = {"index": False, "na_rep": "-", "max_rows": _ROWS}
    blocks = [
        f"{name.replace('_', ' ')}:\n"
        + table.round(3).to_string(formatters={"arbitration_id": "0x{:X}".format}, **look)
        for name, table in tables.items()
        if len(table) and name != "findings"
    ]
    text = "\n\n".join([text or found.verdict, *blocks])
    return Answer(found.ok, found.verdict, text, numbers, tables, lambda ax: found.plot(ax=ax))


def _check(arguments: argparse.Namespace) -> Answer:
    from shipnet.asi.plan import read_plan

    found = read_plan(arguments.plan).check()
    numbers = {"checks": (len(found), ""), "violated": (len(found.violated()), "")}
    columns = ["rule", "object", "value", "low", "high", "unit", "margin"]
    rules = found.worst().reset_index()[columns]
    answer = _answer(found, numbers, str(found), findings=found.table(), rules=rules)
    return answer._replace(findings=found)


def _can(arguments: argparse.Namespace) -> Answer:
    from shipnet.can.analysis import analyse, compare, read_messages
    from shipnet.can.messages import BIT_RATES

    if arguments.log and arguments.rates:
        raise ArgumentError("--log and --rates exclude each other")
    for words in arguments.column:
        if "=" not in words:
            raise ArgumentError(f"--column is {words!r}; it must be TITLE=NAME")
    messages = read_messages(
        arguments.messages,
        columns=dict(words.rsplit("=", 1) for words in arguments.column),
        period=arguments.period,
        strict=not arguments.overlook,
    )
    left_out = pd.DataFrame({"fault": messages.overlooked})
    if arguments.log:
        compared = compare(messages, arguments.log)
        table = compared.table().reset_index()
        counts = table["verdict"].value_counts().items()
        numbers = {str(verdict): (int(count), "") for verdict, count in counts}
        return _answer(compared, numbers, messages=table, left_out=left_out)
    found = analyse(messages, arguments.rates or BIT_RATES)
    rates: dict[str, tuple[float, str]] = {
        "lowest_bit_rate": (found.lowest, "bit/s"),
        "lowest_bit_rate_in_best_order": (found.lowest_in_best_order, "bit/s"),
        "bit_rate_of_responses": (found.at_lowest.bit_rate, "bit/s"),
        "bus_time": (found.at_lowest.utilisation().bus_time, "1"),
    }
    gains = found.lowest_in_best_order < found.lowest
    order = found.best.messages.table().reset_index()[["name", "arbitration_id"]]
    return _answer(
        found,
        rates,
        bit_rates=found.table().reset_index(),
        responses=found.at_lowest.table().reset_index(),
        best_order=order if gains else order[:0],
        left_out=left_out,
    )


def _modbus(arguments: argparse.Namespace) -> Answer:
    from shipnet.modbus.polling import scan

    names = ("registers", "bit_rate", "dead", "processing", "timeout", "retries", "limit")
    character = {"E": "8E1", "O": "8O1", "N": "8N2"}.get(arguments.character, arguments.character)
    given = {name: getattr(arguments, name) for name in names}
    found = scan(arguments.slaves, character=character, **given)
    numbers = {
        "scan_time": (found.time, "s"),
        "slave_time": (found.slave_time, "s"),
        "dead_slave_time": (found.dead_time, "s"),
        "bus_time": (found.bus_time, "1"),
    }
    return _answer(found, numbers, bit_rates=found.table().reset_index())


def _design(arguments: argparse.Namespace) -> Answer | None:
    from shipnet.design.command import compared, settings_of

    settings = settings_of(arguments)
    if arguments.show_settings:
        print(settings.text(), end="")
        return None
    found = compared(arguments, settings)
    costs = {} if found.best is None else {"total_cost": found.best.quantities()["total_cost_eur"]}
    return Answer(
        ok=found.ok,
        verdict=found.verdict,
        text=str(found),
        numbers={
            "designs": (len(found.designs), ""),
            "designs_meeting_every_rule": (len(found.meeting), ""),
            **{name: (value, "EUR") for name, value in costs.items()},
        },
        tables={
            "comparison": found.table().reset_index(),
            "failures": found.failures(),
            "reading": found.iolist.reading(),
        },
        draw=lambda ax: found.plot(ax=ax),
        findings=found.findings(),
        forms={
            ".html": lambda file: found.report(file, title=arguments.title, date=arguments.date),
            "": found.save,
        },
    )


def _serve(arguments: argparse.Namespace) -> None:
    from shipnet.fields import check_scalar, check_whole

    # The models and the library take a while to load, so what needs neither is checked first.
    engine = arguments.device == "engine"
    if arguments.udp and arguments.serial is not None:
        raise ArgumentError("--udp and --serial exclude each other")
    if engine and arguments.watchdog is not None:
        raise ArgumentError("--watchdog stops the motor of a valve; the engine has none here")
    n_valves = check_whole("--valves", arguments.valves, 1, 247)
    check_whole("--port", arguments.port, 0, 0xFFFF)
    check_scalar("--speed", arguments.speed, "", 0, 1e4)
    check_scalar("--bit-rate", arguments.bit_rate, "bit/s", 50, 10e6)
    if arguments.watchdog is not None:
        check_scalar("--watchdog", arguments.watchdog, "s", 0.1, 3600)

    import logging
    from threading import Event

    from shipnet.modbus.uart import SerialLine

    # Faults are reported in one line, not in the library's log besides.
    logging.getLogger("pymodbus").addHandler(logging.NullHandler())
    where = f"{arguments.host}, port {{}} (TCP)"
    options: dict[str, Any] = {"host": arguments.host, "port": arguments.port}
    if arguments.serial is not None:
        line = SerialLine(arguments.bit_rate, arguments.character)
        options = {"transport": "rtu", "serial_port": arguments.serial, "line": line}
        where = f"{arguments.serial}, {line.bit_rate:g} bit/s {line.character}"
    elif arguments.udp:
        options["transport"] = "udp"
        where = where.replace("TCP", "UDP")
    options["speed"] = arguments.speed
    if engine:
        from shipnet.engine.serving import FAULT_UNIT, parse_fault
        from shipnet.engine.serving import serve as serve_engine
        from shipnet.engine.system import System

        system, units = System(), f"unit ids 2 and 3, faults on {FAULT_UNIT}"
        broken = [parse_fault(system, words) for words in arguments.fault]
        server = serve_engine(system, faults=broken, **options)
    else:
        from shipnet.ballast.live import serve
        from shipnet.ballast.plant import Fault

        units = "unit id 1" if n_valves == 1 else f"unit ids 1..{n_valves}"
        faults = [Fault.parse(text, n_valves) for text in arguments.fault]
        server = serve(n_valves, faults=faults, watchdog=arguments.watchdog, **options)
    try:
        with server:
            print(f"listening on {where.format(server.port)}: {units}; Ctrl-C stops", flush=True)
            Event().wait()
    except KeyboardInterrupt:
        print("stopped", flush=True)


def _fleet(arguments: argparse.Namespace) -> None:
    from shipnet.ballast.fleet import write_fleet

    found = write_fleet(
        arguments.out,
        arguments.valves,
        arguments.days,
        faults_per_year=arguments.faults,
        seed=arguments.seed,
        client=arguments.scheduler,
    )
    valves, faults, samples, strokes, size = found.sum().tolist()
    print(
        f"{valves} valves, {arguments.days} days, {faults} faults, {samples} samples, {strokes} "
        f"strokes: {size / 1e6:.1f} MB of synthetic data in {arguments.out}"
    )


def _run(arguments: argparse.Namespace) -> int:
    """Run a command, write its files first, since a reader of the output may stop, and print."""
    for file in arguments.output:
        check_output(file, arguments.forms)
    answer = arguments.run(arguments)
    if answer is None:
        return 0
    for file in arguments.output:
        answer.save(file, arguments.command)
    if arguments.json:
        print(answer.json(arguments.command), end="")
    else:
        print(answer.text)
        for place, file in enumerate(arguments.output):
            print("" if place else "\n", f"written: {file}", sep="")
    return 1 if answer.ok is False else 0


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command.

    Parameters
    ----------
    arguments : sequence of str, optional
        The words after the program's name; those of the process if omitted.

    Returns
    -------
    int
        0 done and good; 1 done, and the answer is bad; 2 after a user's mistake, which standard
        error reports, of a file with one line per fault; 130 after an interrupt.
    """
    parsed = _parser().parse_args(arguments)
    try:
        return _run(parsed)
    except BrokenPipeError:
        # Whoever reads the output has had enough; the interpreter must not complain at its end.
        sys.stdout = None
    except KeyboardInterrupt:
        return 130
    except (ValueError, OSError, ImportError) as mistake:
        lines = [str(mistake)]
        if isinstance(mistake, InputError) and len(mistake.faults) > 1:
            lines = [f"{mistake.file}:", *mistake.lines()]
        print("shipnet:", "\n  ".join(lines), file=sys.stderr)
        if parsed.json:
            faults = mistake.faults if isinstance(mistake, InputError) else ()
            print(json.dumps({"command": parsed.command, "error": str(mistake), "faults": faults}))
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main())
