"""The command line: ``python -m shipnet``, also installed as ``shipnet``."""

from __future__ import annotations

import argparse
import json
import re
import sys
import tomllib
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from difflib import get_close_matches
from importlib.resources import files
from pathlib import Path
from shutil import copyfile
from textwrap import shorten
from typing import Any, NoReturn, TextIO

from shipnet.errors import ArgumentError, InputError, load_extra
from shipnet.files import as_file, complete
from shipnet.lazy import pd
from shipnet.results import FORMS, Answer, check_output, encodable, printable
from shipnet.tables import as_csv, save_suffix

#: Columns of the transactions on the terminal: title, name, width and digits.
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

#: Maximum number of table rows on the terminal, and length of the record shown in a figure [s].
_ROWS = 40
_SHOWN = 400e-6


def number(text: str) -> float:
    """Return the number in text that may end in an SI prefix, such as 125k or 100n."""
    power = {"M": 6, "k": 3, "m": -3, "u": -6, "n": -9}.get(text[-1:])
    return float(text if power is None else f"{text[:-1]}e{power}")


def numbers(text: str) -> list[float]:
    """Return the numbers in text, separated by commas."""
    return [number(part) for part in text.split(",")]


def _ledger(arguments: argparse.Namespace) -> Answer:
    from shipnet.papers.judging import Ledger, computed_text

    ledger = Ledger(arguments.paper)
    counts = ledger.counts()
    tables, lines = {"counts": counts.reset_index()}, []
    if not arguments.summary:
        table = ledger.table().reset_index()
        tables = {"claims": table, **tables}
        lines = [
            f"{'claim':<15}{'published':>16}  {'computed':<14}{'grade':<15}{'verdict':<20}what"
        ]
        for row in table.to_dict("records"):
            published = shorten(row["published"], 16, placeholder="..")
            computed = computed_text(row)
            unit = f" [{row['unit']}]" if row["unit"] else ""
            as_printed = row["holds_under"] in ("", "as printed")
            verdict = f"{row['verdict'] or row['kind']}{'' if as_printed else '*'}"
            condition = "" if as_printed else f" ({row['holds_under']})"
            instead = f" -> {row['corrected']}" if row["corrected"] else ""
            lines.append(
                f"{row['id']:<15}{published:>16}  {computed:<14}{row['grade']:<15}{verdict:<20}"
                f"{row['claim']}{unit}{instead}{condition}"
            )
        lines += ["", "->: correction; *: holds under the condition in the last brackets", ""]
    return Answer(
        ok=not counts["open"].any(),
        verdict=str(ledger),
        text="\n".join([*lines, counts.to_string()]),
        numbers={str(name): (int(value), "") for name, value in counts.sum().items()},
        tables=tables,
        draw=ledger.plot,
    )


def _decode(arguments: argparse.Namespace) -> Answer:
    from shipnet.asi.capture import decode
    from shipnet.asi.plan import read_plan

    plan = read_plan(arguments.plan) if arguments.plan else None
    slaves = plan.slaves if plan else ()
    capture = decode(
        arguments.file,
        channel=arguments.channel,
        sample_interval=arguments.sample_interval,
        threshold=arguments.threshold,
        extended={slave.address for slave in slaves if slave.half},
    )
    causes = capture.causes(plan)
    if not capture.telegrams and causes.empty:
        raise InputError(arguments.file, f"no AS-i telegram in channel {capture.wave.names[0]}")
    rows, summary, findings = capture.transactions, capture.summary(), capture.check(plan)
    counters = capture.counters()
    shown = rows.head(_ROWS).assign(start_ms=1e3 * rows["start_s"])
    titles = "".join(f"{title:>{width}}" for title, _, width, _ in _TRANSACTION)
    lines = [capture.wave.description, f"{titles}  transaction"]
    for row in shown.to_dict("records"):
        cells = (f"{row[name]:{width}.{digits}f}" for _, name, width, digits in _TRANSACTION)
        lines.append(f"{''.join(cells).replace('nan', '  -')}  {row['text']}")
    if len(rows) > _ROWS:
        lines.append(f"... and {len(rows) - _ROWS} more")
    lines += ["", str(summary), "", summary.slaves.round(2).to_string(na_rep="-"), ""]
    for name, value, light, meaning in counters.itertuples():
        number = f"{value:.1%}" if name == "repetitions" else f"{value:g}"
        lines.append(f"{name:<21}{number.replace('nan', '-'):>6}  {light:<7}{meaning}")
    lines += ["", str(findings), ""]
    for rank, (cause, slave, _, evidence) in enumerate(causes.itertuples(), 1):
        lines.append(f"probable cause {rank}: {cause} {slave}".rstrip() + f"; {evidence}")
    cause, slave = next(iter(zip(causes.index, causes["slave"], strict=True)), ("", ""))
    start = max(0.0, capture.first_sign(cause, slave) - 20e-6)
    counts = {str(name).replace(" ", "_"): (n, "") for name, n in counters["value"].items()}
    bits = rows[["request", "response"]]
    marked = bits.where(bits == "", "0b" + bits)  # so that no program reads them as decimals
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
            "transactions": rows.assign(**marked),
            "slaves": summary.slaves.reset_index(),
            "counters": counters.reset_index(),
            "causes": causes.reset_index(),
        },
        draw=lambda ax: capture.plot(ax, start=start, stop=start + _SHOWN),
        findings=findings,
    )


def _answer(
    result: Any, numbers: Mapping[str, tuple[float, str]], text: str = "", **tables: pd.DataFrame
) -> Answer:
    """Return an Answer with `text` (default: the verdict) and the non-empty tables as its text."""
    look: dict[str, Any] = {"index": False, "na_rep": "-", "max_rows": _ROWS}
    blocks = [
        f"{name.replace('_', ' ')}:\n" + table.round(3).to_string(**look)
        for name, table in tables.items()
        if len(table) and name != "findings"
    ]
    text = "\n\n".join([text or result.verdict, *blocks])
    return Answer(result.ok, result.verdict, text, numbers, tables, lambda ax: result.plot(ax=ax))


def _check(arguments: argparse.Namespace) -> Answer:
    from shipnet.asi.plan import read_plan

    plan = read_plan(arguments.plan)
    result = plan.check()
    numbers = {"checks": (len(result), ""), "violated": (len(result.violated()), "")}
    columns = ["rule", "object", "value", "low", "high", "unit", "margin"]
    rules = result.worst().reset_index()[columns]
    reading = pd.DataFrame({"how the plan was read": plan.remarks})
    answer = _answer(
        result, numbers, str(result), findings=result.table(), rules=rules, reading=reading
    )
    if arguments.improve:
        save_suffix(arguments.improve, ".csv", ".xlsx")
        better = plan.improve()
        with complete(arguments.improve) as new:
            better.plan.save(new)
        tables = {**answer.tables, "proposal": better.added}
        text = f"{answer.text}\n\nproposal: {better.verdict}\nwritten: {arguments.improve}"
        answer = answer._replace(text=text, tables=tables)
    return answer._replace(findings=result)


def _can(arguments: argparse.Namespace) -> Answer:
    from shipnet.can.analysis import analyse, compare, read_messages
    from shipnet.can.log_files import read_log
    from shipnet.can.messages import BIT_RATES

    if arguments.log and arguments.rates:
        raise ArgumentError("--log and --rates cannot be combined")
    if arguments.pgn and not arguments.log:
        raise ArgumentError("--pgn requires --log")
    for words in arguments.column:
        if "=" not in words:
            raise ArgumentError(f"--column is {words!r}; it must be TITLE=NAME")
    messages = read_messages(
        arguments.messages,
        columns=dict(words.rsplit("=", 1) for words in arguments.column),
        period=arguments.period,
        strict=not arguments.overlook,
    )
    more: Any = {
        "reading": pd.DataFrame({"how the list was read": messages.remarks}),
        "left_out": pd.DataFrame({"fault": messages.overlooked}),
    }
    if arguments.junit and not arguments.log:
        raise ArgumentError("--junit requires --log")
    if arguments.log:
        compared = compare(messages, arguments.log, pgn=arguments.pgn)
        table = compared.table().reset_index()
        counts = table["verdict"].value_counts().items()
        numbers = {str(verdict): (int(count), "") for verdict, count in counts}
        cases = [
            (str(name), "" if verdict == "as planned" else str(verdict), False)
            for name, verdict in zip(table["name"], table["verdict"], strict=True)
        ]
        return _answer(compared, numbers, messages=table, **more)._replace(cases=cases)
    result = analyse(messages, arguments.rates or BIT_RATES)
    rates: dict[str, tuple[float, str]] = {
        "lowest_bit_rate": (result.lowest, "bit/s"),
        "lowest_bit_rate_in_best_order": (result.lowest_in_best_order, "bit/s"),
        "bit_rate_of_responses": (result.at_lowest.bit_rate, "bit/s"),
        "bus_time": (result.at_lowest.utilisation().bus_time, "1"),
    }
    observed = pd.DataFrame() if messages.observed is None else messages.observed
    if len(observed) and any(message.extended for message in messages):
        whole = read_log(arguments.messages).assemble()
        kinds = whole.messages.groupby(["pgn", "name", "source", "frames"])
        more["messages_by_pgn"] = kinds.size().reset_index(name="messages")
        unlisted = [f"PGN {pgn} may be a fast packet" for pgn in whole.unlisted]
        more["not_put_together"] = pd.DataFrame({"reason": [*whole.faults, *unlisted]})
    gains = result.lowest_in_best_order < result.lowest
    order = result.best.messages.table().reset_index()[["name", "arbitration_id"]]
    return _answer(
        result,
        rates,
        f"{result.verdict}\nresponse times are at {result.at_lowest.bit_rate / 1e3:g} kbit/s",
        bit_rates=result.table().reset_index(),
        messages_of_log=observed.reset_index(),
        responses=result.at_lowest.table().reset_index(),
        best_order=order if gains else order[:0],
        **more,
    )


def _modbus(arguments: argparse.Namespace) -> Answer:
    from shipnet.modbus.electrical import Rs485
    from shipnet.modbus.polling import scan

    if (arguments.table is None) == (arguments.slaves is None):
        raise ArgumentError("give either a TABLE or --slaves and --registers")
    loads, bias = arguments.unit_loads, arguments.bias
    stub, rise = arguments.stub, arguments.rise_time
    names = ("registers", "bit_rate", "dead", "processing", "timeout", "retries", "limit")
    character = {"E": "8E1", "O": "8O1", "N": "8N2"}.get(arguments.character, arguments.character)
    options = {name: getattr(arguments, name) for name in names}
    result = scan(arguments.table or arguments.slaves, character=character, **options)
    if arguments.junit and result.ok is None and arguments.length is None:
        raise ArgumentError("--junit requires --limit, --length or a table with wanted periods")
    if arguments.length is None and any((loads, bias, stub, rise)):
        raise ArgumentError("--unit-loads, --bias, --stub and --rise-time require --length")
    numbers = {
        "scan_time": (result.time, "s"),
        "slave_time": (result.slave_time, "s"),
        "dead_slave_time": (result.dead_time, "s"),
        "bus_time": (result.bus_time, "1"),
    }
    slaves = result.slaves().reset_index()
    judged = slaves.loc[slaves["met"].notna(), ["slave", "met"]].to_numpy()
    cases = [(str(name), "" if met else "updated too late", False) for name, met in judged]
    if arguments.limit is not None:
        late = result.time > arguments.limit
        cases.append(("scan", f"{result.time:.3f} s exceeds {arguments.limit:g} s" * late, False))
    more: Any = {"slaves": slaves} if arguments.table else {}
    more |= {"bit_rates": result.table().reset_index()}
    more |= {"reading": pd.DataFrame({"how the table was read": result.remarks})}
    answer = _answer(result, numbers, **more)._replace(cases=cases)
    if arguments.length is None:
        return answer
    serial = {row.unit: row.number for row in result.rows if not row.unit[0]}
    loads = sum(serial.values()) + 1 if loads is None else loads
    ends = arguments.terminator or None
    line = Rs485(arguments.length, arguments.bit_rate, loads, ends, bias, stub, rise)
    findings = line.check()
    return answer._replace(
        ok=findings.ok if result.ok is None or findings.ok is False else result.ok,
        verdict=f"{answer.verdict}; RS-485: {findings.verdict}",
        text=f"{answer.text}\n\nRS-485: {findings}",
        tables={**answer.tables, "rs485": findings.table()},
        findings=findings,
    )


def _diagnose(arguments: argparse.Namespace) -> Answer:
    from shipnet.ballast.log_file import read_log
    from shipnet.ballast.rule_table import rule_base
    from shipnet.fuzzy.rule_file import read_rules
    from shipnet.fuzzy.terms import NORMAL

    rules = read_rules(arguments.rules) if arguments.rules else rule_base()
    log = read_log(arguments.log, rules)
    result = rules.decide(log, k=3, n=5)
    samples = result.table().set_index(log.index).reset_index()
    top = samples["top"]
    changes = samples.assign(sample=samples.index).groupby((top != top.shift()).cumsum())
    spans = changes.agg(
        start_s=("time_s", "first"),
        end_s=("time_s", "last"),
        top=("top", "first"),
        samples=("top", "size"),
        reason=("sample", lambda rows: result.explain(rows.iloc[0])),
    )
    numbers = {str(code): (int(count), "") for code, count in top.value_counts().items()}
    reading = pd.DataFrame({"how the log was read": log.attrs["remarks"]})
    not_normal = spans[spans["top"] != NORMAL]
    answer = _answer(result, numbers, not_normal=not_normal, reading=reading)
    return answer._replace(tables={"samples": samples, **answer.tables})


def _design(arguments: argparse.Namespace) -> Answer | None:
    from shipnet.design.command import compared, settings_of

    settings = settings_of(arguments)
    if arguments.show_settings:
        _print(settings.text(), end="")
        return None
    result = compared(arguments, settings)
    best = {}
    if result.best is not None:
        cost = result.best.quantities()["total_cost_eur"]
        chance = result.chances[result.best.name]
        best = {"total_cost": (cost, "EUR"), "probability_cheapest": (chance, "")}
    return Answer(
        ok=result.ok,
        verdict=result.verdict,
        text=str(result),
        numbers={
            "designs": (len(result.designs), ""),
            "designs_meeting_every_rule": (len(result.meeting), ""),
            **best,
        },
        tables={
            "comparison": result.table().reset_index(),
            "failures": result.failures(),
            "reading": result.iolist.reading(),
        },
        draw=lambda ax: result.plot(ax=ax),
        findings=result.findings(),
        forms={
            ".html": lambda file: result.report(file, title=arguments.title, date=arguments.date),
            "": result.save,
        },
    )


def _serve(arguments: argparse.Namespace) -> None:
    from shipnet.fields import check_scalar, check_whole

    # The models and pymodbus load slowly, so arguments that need neither are checked first.
    engine, table = arguments.device == "engine", arguments.device not in ("ballast", "engine")
    if arguments.udp and arguments.serial is not None:
        raise ArgumentError("--udp and --serial cannot be combined")
    if table and not arguments.device.endswith((".csv", ".xlsx")):
        raise ArgumentError(
            f"DEVICE is {arguments.device!r}; it must be ballast, engine or a table"
        )
    if table and arguments.fault:
        raise ArgumentError("--fault applies to ballast and engine; a table has columns for faults")
    if arguments.device != "ballast" and arguments.watchdog is not None:
        raise ArgumentError("--watchdog applies to ballast only, where it stops a valve's motor")
    n_valves = check_whole("--valves", arguments.valves, 1, 247)
    check_whole("--port", arguments.port, 0, 0xFFFF)
    check_scalar("--speed", arguments.speed, "", 0, 1e4)
    check_scalar("--bit-rate", arguments.bit_rate, "bit/s", 300, 10e6)
    if arguments.watchdog is not None:
        check_scalar("--watchdog", arguments.watchdog, "s", 0.1, 3600)

    import logging
    from threading import Event

    from shipnet.modbus.uart import SerialLine
    from shipnet.modbus.wire import WireFault

    # Errors are reported in one line, so pymodbus's own log is silenced.
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
    options["wire_faults"] = [WireFault.parse(text) for text in arguments.wire_fault]
    if table:
        from shipnet.modbus.server import serve as serve_table

        server = serve_table(arguments.device, **options)
        units = f"unit ids {', '.join(map(str, server.slaves))}"
    elif engine:
        from shipnet.engine.serving import FAULT_UNIT, parse_fault
        from shipnet.engine.serving import serve as serve_engine
        from shipnet.engine.system import System

        system, units = System(), f"unit ids 2 and 3, and {FAULT_UNIT} for faults"
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
            _print(f"listening on {where.format(server.port)}: {units}; Ctrl-C stops")
            local = arguments.host in ("localhost", "::1") or arguments.host.startswith("127.")
            if arguments.serial is None and not local:
                _print("Anybody on the network can now operate the simulated devices.")
            Event().wait()
    except KeyboardInterrupt:
        _print("stopped")


def _grade(arguments: argparse.Namespace) -> Answer:
    from shipnet.exercises.grading import as_html, grade

    grades, verdicts = map(encodable, grade(arguments.folder))
    correct = grades.drop(columns=["name", "file", "points", "flags"]).sum()
    count = f"{len(grades)} notebook{'' if len(grades) == 1 else 's'}"
    verdict = f"{count}, {(grades['flags'] != '').sum()} with a flag"
    rows = grades.astype(object).fillna("-").to_string(index=False)
    return Answer(
        ok=None,
        verdict=verdict,
        text=f"{rows}\n\n{verdict}",
        numbers={"notebooks": (len(grades), ""), "points": (int(grades["points"].sum()), "")},
        tables={"grades": grades, "verdicts": verdicts},
        draw=lambda ax: correct.plot.bar(ax=ax, xlabel="exercise", ylabel=f"correct of {count}"),
        forms={".html": lambda file: as_html(file, grades, verdicts)},
    )


def _fleet(arguments: argparse.Namespace) -> None:
    from shipnet.ballast.fleet import write_fleet

    with ExitStack() as stack:
        workers: Any = arguments.workers
        if arguments.scheduler:
            distributed = load_extra("distributed", "distributed")
            try:
                client = stack.enter_context(distributed.Client(arguments.scheduler, timeout=10))
            except (OSError, ValueError) as problem:
                raise ArgumentError(
                    f"--scheduler is {arguments.scheduler!r}; no scheduler responds there"
                ) from problem
            workers = client.get_executor().map
        blocks = write_fleet(
            arguments.out,
            arguments.valves,
            arguments.days,
            faults_per_year=arguments.faults_per_year,
            seed=arguments.seed,
            workers=workers,
        )
    valves, faults, samples, strokes, size = blocks.sum().tolist()
    _print(
        f"{valves} valves, {arguments.days} days, {faults} faults, {samples} samples, {strokes} "
        f"strokes: {size / 1e6:.1f} MB of synthetic data in {arguments.out}"
    )


def _read_as(parse: Callable[[str], Any], word: str, legal: str) -> Any:
    """Return what `parse` makes of a word of the command line."""
    try:
        return parse(word)
    except ValueError:
        raise ArgumentError(f"WORD is {word!r}; it must be {legal}") from None


def _frame(arguments: argparse.Namespace) -> None:
    from shipnet import asi, can, modbus

    first, *words = arguments.word
    call, text = first.upper().replace("-", "_"), "".join(arguments.word)
    calls = {"asi": asi.Call, "can": (), "modbus": modbus.FunctionCode}[arguments.bus]
    numbers: Any = ()
    if encoded := call in getattr(calls, "__members__", ()):
        legal = "a whole number such as 21 or 0xE"
        numbers = [_read_as(lambda word: int(word, 0), word, legal) for word in words]
    if arguments.bus == "asi":
        if encoded and not 1 <= len(numbers) <= 2:
            raise ArgumentError(f"{first} requires an address, and data if the call has data")
        if not encoded and set(text) - {"0", "1"}:
            raise ArgumentError(f"WORD is {first!r}; it must be bits, or a call such as reset")
        kind = asi.Request if len(text) > 7 else asi.Response
        telegram = asi.Request(asi.Call[call], *numbers) if encoded else kind.parse(text)
        lines = [telegram.bits, str(telegram)]
    elif arguments.bus == "can":
        identifier, sign, data = text.partition("#")
        if sign:
            number = _read_as(lambda word: int(word, 16), identifier, "an identifier such as 123")
            content = _read_as(bytes.fromhex, data, "bytes such as 0102")
        frame = can.Frame(number, content, len(identifier) > 3) if sign else can.decode(text)
        fields = pd.DataFrame(frame.fields)[["name", "value", "length"]]
        lines = [frame.bits, f"{frame}, {frame.length} bits", fields.to_string(index=False)]
    else:
        if encoded and (len(numbers) < 3 or ("READ" in call and len(numbers) > 3)):
            raise ArgumentError(f"{first} requires a unit id, an address, and a quantity or values")
        if encoded:
            unit, address, *values = numbers
            option = "coils" if "COIL" in call else "registers"
            content = {option: values} if "WRITE" in call else {"quantity": values[0]}
            rtu = modbus.Request(modbus.FunctionCode[call], address, **content).rtu(unit)
        else:
            rtu = _read_as(bytes.fromhex, text, "a call, or bytes such as 11 03 00")
        lines = [rtu.hex(" "), modbus.decode(rtu).table().to_string()]
    _print("\n".join(lines))


def _copy(arguments: argparse.Namespace) -> None:
    from shipnet import datasets

    home, target = datasets.path("claims.csv").parent.parent, Path(arguments.folder)
    if target.exists() and not (target.is_dir() and not any(target.iterdir())):
        raise ArgumentError(f"FOLDER is {arguments.folder!r}; it must be new or empty")
    teachers = {"solutions", ".ipynb_checkpoints"}
    for file in [*home.glob("notebooks/**/*.ipynb"), *home.glob("data/*.*")]:
        part = file.relative_to(home)
        if not teachers & set(part.parts):
            (target / part).parent.mkdir(parents=True, exist_ok=True)
            copyfile(file, target / part)
    _print(f"written: {target / 'notebooks'} and {target / 'data'}")


#: The function of each command in `commands.toml`.
_COMMANDS = {
    run.__name__[1:]: run
    for run in (
        *(_ledger, _decode, _check, _can, _modbus, _diagnose, _serve, _fleet, _design, _grade),
        *(_frame, _copy),
    )
}


#: The last line of every help.
_EXIT_CODES = "exit codes: 0 good, 1 done and the answer is bad, 2 could not be done"


class _Parser(argparse.ArgumentParser):
    """A parser that names the nearest option if one is unknown, and prints no escape sequences."""

    def parse_known_args(self, args: Any = None, namespace: Any = None) -> Any:
        """Parse the arguments of a command, and report an unknown one with the command's usage."""
        namespace, unknown = super().parse_known_args(args, namespace)
        if unknown:
            near = get_close_matches(unknown[0].partition("=")[0], self._option_string_actions, n=1)
            hint = f"; did you mean {near[0]}?" if near else ""
            if not unknown[0].startswith("-"):
                hint = "; lists have commas, such as 125k,250k"
            self.error(f"unknown argument {unknown[0]!r}{hint}")
        return namespace, unknown

    def error(self, message: str) -> NoReturn:
        """Print the usage and an error, and exit."""
        super().error(printable(message))


def parser() -> argparse.ArgumentParser:
    """Return the parser of the command line, from which shtab makes completions for shells."""
    from shipnet import __version__

    whole = _Parser(
        prog="shipnet",
        description="Simulate and design field buses for ships, and check papers about them.",
        epilog=f"example: shipnet ledger kim2023; {_EXIT_CODES}",
    )
    whole.add_argument("-V", "--version", action="version", version=f"shipnet {__version__}")
    commands = whole.add_subparsers(title="commands", metavar="COMMAND", dest="command")
    grammar = (files("shipnet") / "commands.toml").read_text(encoding="utf-8")
    for name, one in tomllib.loads(grammar).items():
        form = argparse.RawDescriptionHelpFormatter
        about = {"help": one["help"], "description": one["text"], "epilog": _EXIT_CODES}
        sub = commands.add_parser(name, formatter_class=form, **about)
        forms = (*FORMS, *one["forms"]) if "forms" in one else ()
        sub.set_defaults(
            run=_COMMANDS[name], output=[], json=False, junit=False, forms=forms, input=""
        )
        if forms:
            help = f"also write the result to a file ({', '.join(forms)}) or a folder of tables"
            _option(
                sub, "-o, --output FILE", f"{help}; - prints the first table as CSV", default=[]
            )
            _option(sub, "--json", "print the result as JSON, for programs")
        actions = [_option(sub, **option) for option in one["options"]]
        named = {action.dest: action.option_strings for action in actions if action.option_strings}
        sub.set_defaults(flags={name: strings[0] for name, strings in named.items()})
    return whole


def _option(
    parser: argparse.ArgumentParser,
    words: str,
    help: str,
    default: Any = None,
    type: str = "",
    input: bool = False,
    **more: Any,
) -> argparse.Action:
    """Add an argument such as ``FILE``, ``--channel NAME``, or ``--udp`` without a value.

    The command runs once for each file of an `input`.
    """
    flags, _, metavar = words.rpartition(" ")
    if words.startswith("-") and not flags:
        return parser.add_argument(words, action="store_true", help=help)
    if isinstance(default, list):
        more, help = {"action": "append", **more}, f"{help}; may be repeated"
    elif default is not None:
        shown = f"{default:g}" if isinstance(default, float) else default
        type, help = default.__class__.__name__, f"{help} (default {shown})"
    names = flags.split(", ") if flags else [metavar.lower()]
    kinds: dict[str, Callable[[str], Any]] = {
        "int": int,
        "number": number,
        "float": number,
        "numbers": numbers,
    }
    action = parser.add_argument(
        *names, metavar=metavar, help=help, default=default, type=kinds.get(type, str), **more
    )
    if input:
        parser.set_defaults(input=action.dest)
    return action


def _print(text: str, stream: TextIO | None = None, end: str = "\n") -> None:
    """Print text that may come from a file; what would command a terminal is shown as escapes."""
    stream = sys.stdout if stream is None else stream
    encoding = getattr(stream, "encoding", None) or "utf-8"
    text = printable(text).encode(encoding, "backslashreplace").decode(encoding)
    print(text, end=end, file=stream, flush=True)


@contextmanager
def _opened(name: str | None) -> Iterator[str | None]:
    """Yield the name of a file, if any; for -, that of a temporary copy of the standard input."""
    if name != "-":
        yield name
        return
    content = sys.stdin.buffer.read()
    suffix = ".xlsx" if content.startswith(b"PK") else ".csv"
    with as_file("standard input", content, f"standard input{suffix}") as file:
        yield str(file)


def _run(arguments: argparse.Namespace) -> int:
    """Run a command, once for each of its files, and print the results."""
    for file in arguments.output:
        if file != "-":
            check_output(file, arguments.forms)
    files_given = getattr(arguments, arguments.input) if arguments.input else None
    names = files_given if isinstance(files_given, list) else [files_given]
    for option in ("output", "improve"):
        if len(names) > 1 and getattr(arguments, option, None):
            flag = "-o" if option == "output" else f"--{option}"
            raise ArgumentError(f"{flag} requires one file; {len(names)} are given")
    if ("-" in arguments.output) + arguments.json + arguments.junit > 1:
        raise ArgumentError("-o -, --json and --junit cannot be combined")
    code, texts = 0, []
    for name in names:
        with _opened(name) as file:
            if arguments.input:
                setattr(arguments, arguments.input, file)
            answer = arguments.run(arguments)
        if answer is None:
            return 0
        code = max(code, 1 if answer.ok is False else 0)
        texts.append(_shown(arguments, answer, name if name and len(names) > 1 else ""))
    if arguments.junit:
        texts = ['<?xml version="1.0" encoding="UTF-8"?>\n<testsuites>', *texts, "</testsuites>"]
    _print("\n".join(texts))
    return code


def _shown(arguments: argparse.Namespace, answer: Answer, name: str) -> str:
    """Write the files of an answer, and return what is printed: CSV, JSON, JUnit XML or text."""
    # The files are written before anything is printed, because the reader of the output may stop.
    for file in arguments.output:
        if file != "-":
            with complete(file) as new:
                answer.save(new, arguments.command)
    if "-" in arguments.output:
        return as_csv(next(iter(answer.tables.values()))).decode("utf-8-sig").rstrip("\n")
    if arguments.junit:
        return answer.junit(arguments.command, name)
    if arguments.json:
        return answer.json(arguments.command).rstrip("\n")
    title = f"{name}:\n" if name else ""
    written = "".join(f"\nwritten: {file}" for file in arguments.output)
    return f"{title}{answer.text}" + (f"\n{written}" if written else "")


def _arguments(words: Sequence[str]) -> list[str]:
    """Return a command line whose values that begin with a minus, as -1,0,0, are not options."""
    joined: list[str] = []
    for word in words:
        if re.match(r"-[\d.]", word) and joined and joined[-1].startswith("--"):
            joined[-1] += f"={word}"
        else:
            joined.append(word)
    return joined


def _as_typed(message: str, flags: Mapping[str, str]) -> str:
    """Return a message on the argument of a function with the option that sets it."""
    name, is_, rest = message.partition(" is ")
    flag = flags.get(name, flags.get(name.removeprefix("n_"), name))
    return f"{flag}{is_}{rest}"


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command and return its exit code.

    The code is 1 if the result is bad, 2 after a user error, 130 after an interrupt, and otherwise
    0. A user error is printed to standard error, with one line per fault in a file.
    """
    whole = parser()
    parsed = whole.parse_args(_arguments(sys.argv[1:] if arguments is None else arguments))
    if parsed.command is None:
        whole.print_help()
        return 0
    try:
        return _run(parsed)
    except BrokenPipeError:
        # The program that reads the output has ended; the interpreter must not report this.
        sys.stdout = None
    except KeyboardInterrupt:
        return 130
    except (ValueError, OSError, ImportError) as mistake:
        message = str(mistake)
        if isinstance(mistake, ArgumentError):
            message = _as_typed(message, parsed.flags)
        lines = [message]
        if isinstance(mistake, InputError) and len(mistake.faults) > 1:
            lines = [f"{mistake.file}:", *mistake.lines()]
        _print("shipnet: " + "\n  ".join(lines), sys.stderr)
        if parsed.json:
            faults = mistake.faults if isinstance(mistake, InputError) else ()
            _print(json.dumps({"command": parsed.command, "error": message, "faults": faults}))
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main())
