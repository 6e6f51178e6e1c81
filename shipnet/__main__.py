"""The command line: ``python -m shipnet``, also installed as ``shipnet``."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from textwrap import shorten

__all__ = ["main"]

_LEDGER = """\
Show what the papers print beside what shipnet computes.

example:
  shipnet ledger --paper kim2023 --csv kim2023.csv
"""


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
    return parser


def _ledger(arguments: argparse.Namespace) -> None:
    from shipnet.papers.ledger import counts, format_computed, ledger

    table = ledger(arguments.paper)
    if not arguments.summary:
        print(f"{'claim':<15}{'published':>16}  {'computed':<14}{'verdict':<19}what")
        for row in table.to_dict("records"):
            published = shorten(row["published"], 16, placeholder="..")
            computed = format_computed(row["computed"])
            unit = f" [{row['unit']}]" if row["unit"] else ""
            verdict = row["verdict"] or row["kind"]
            print(
                f"{row['id']:<15}{published:>16}  {computed:<14}{verdict:<19}{row['claim']}{unit}"
            )
        print()
    print(counts(arguments.paper).to_string())
    if arguments.csv:
        table.to_csv(arguments.csv, index=False)
        print(f"\n{len(table)} claims written to {arguments.csv}")


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command.

    Parameters
    ----------
    arguments : sequence of str, optional
        The words after the program's name; those of the process if omitted.

    Returns
    -------
    int
        0, or 2 after a user's mistake, which is told in one line on standard error.
    """
    parsed = _parser().parse_args(arguments)
    try:
        parsed.run(parsed)
    except BrokenPipeError:
        # Whoever reads the output has had enough; the interpreter must not complain at its end.
        sys.stdout = None
    except (ValueError, OSError) as mistake:
        print(f"shipnet: {mistake}", file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main())
