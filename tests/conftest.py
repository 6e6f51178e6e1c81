"""Hypothesis profiles, and the count of tests that keeps any from vanishing unnoticed."""

import json
import os
from collections import Counter
from pathlib import Path

import pytest
from hypothesis import settings

# Fewer examples on every push; the weekly run draws many, and new ones.
settings.register_profile("ci", deadline=None, derandomize=True, max_examples=30)
settings.register_profile("random", deadline=None, max_examples=500)
settings.load_profile(os.environ.get("HYPOTHESIS_PROFILE", "ci"))

EXPECTED = Path(__file__).with_name("expected_counts.json")


def pytest_addoption(parser):
    group = parser.getgroup("shipnet")
    group.addoption("--counts", metavar="SUITE", help="compare tests a file with those recorded")
    group.addoption("--counts-write", action="store_true", help="record them instead")


def pytest_configure(config):
    on_the_controller = not hasattr(config, "workerinput")
    if config.getoption("--counts") and on_the_controller:
        config.pluginmanager.register(Counts(config))


class Counts:
    """Counts every test that ran or was skipped, by file."""

    def __init__(self, config):
        self.suite = config.getoption("--counts")
        self.write = config.getoption("--counts-write")
        self.seen = set()
        self.problems = []

    def pytest_runtest_logreport(self, report):
        self.seen.add(report.nodeid)

    @pytest.hookimpl(trylast=True)
    def pytest_sessionfinish(self, session):
        counted = dict(sorted(Counter(node.split("::")[0] for node in self.seen).items()))
        recorded = json.loads(EXPECTED.read_text()) if EXPECTED.exists() else {}
        if self.write:
            recorded[self.suite] = counted
            EXPECTED.write_text(json.dumps(recorded, indent=2, sort_keys=True) + "\n")
            return
        expected = recorded.get(self.suite, {})
        self.problems = [
            f"{file}: {counted.get(file, 0)} tests, but {expected.get(file, 0)} are recorded"
            for file in sorted(counted.keys() | expected.keys())
            if counted.get(file, 0) != expected.get(file, 0)
        ]
        if self.problems and session.exitstatus == pytest.ExitCode.OK:
            session.exitstatus = pytest.ExitCode.TESTS_FAILED

    def pytest_terminal_summary(self, terminalreporter):
        if self.problems:
            terminalreporter.section("tests came or went: `make counts` records it", red=True)
            for problem in self.problems:
                terminalreporter.line(problem)
