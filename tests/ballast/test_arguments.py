"""What a user may get wrong is named, whatever its type."""

import numpy as np
import pytest

from shipnet.ballast.diagnosis import diagnose_run
from shipnet.ballast.registers import RegisterMap
from shipnet.ballast.rule_table import rule_base
from shipnet.ballast.simulation import simulate
from shipnet.ballast.trials import fault_trials
from shipnet.errors import ArgumentError
from shipnet.intervals import share_interval

FIVE = np.zeros((5, 1))
MAP = RegisterMap()


def trials(*codes, **options):
    return fault_trials(*codes, rng=np.random.default_rng(1), **options).table()


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: MAP.command("Open"), "code is 'Open'; it must be one of Code.MANUAL"),
        (lambda: MAP.command(None), "code is None"),
        (lambda: MAP.command(5), "code is 5"),
        (lambda: diagnose_run(simulate(1, until=1), method=[]), r"method is \[\]"),
        (lambda: MAP.encode("abc", close=0, open=0), "five rows of numbers"),
        (lambda: MAP.encode([[1], [1, 2], [1], [1], [1]], close=0, open=0), "five rows of numbers"),
        (lambda: MAP.decode([[1, 2, 3, 4], [1]]), "rows of four whole numbers"),
        (lambda: MAP.encode(FIVE, close="no", open=0), "close is 'no'; it must be True or False"),
        (lambda: MAP.encode(FIVE, close=0, open=[2]), r"open is \[2\]"),
        (lambda: MAP.encode(FIVE, close=0, open=0, auto=None), "auto is None"),
        (lambda: MAP.encode(FIVE, close=0, open=[[0], [0, 1]]), "open is"),
        (lambda: MAP.encode(FIVE, close=0, open=0, operating_time="a"), "time does not fit"),
        (lambda: trials(methods=[]), "methods is empty"),
        (lambda: trials(n_valves=3, severity=[0.1, 0.2]), "severity is .*each of 3 valves"),
        (lambda: trials([]), "codes is empty"),
        (lambda: diagnose_run(simulate(1, until=1)).explain(1, None), "time is None"),
        (lambda: diagnose_run(simulate(1, until=1)).explain(1, "a"), "time is 'a'"),
        (lambda: share_interval("a", 2), "hits is 'a'"),
        (lambda: share_interval(None, 2), "hits is None"),
        (lambda: simulate(1, None, until=1), "commands is None"),
        (lambda: simulate(1, ["open"], until=1), r"commands is \['open'\]"),
        (lambda: rule_base().fire(None), "samples is None"),
        (lambda: rule_base().fire(5), "samples is 5"),
    ],
)
def test_a_wrong_argument_is_named_whatever_its_type(make, message):
    with pytest.raises(ArgumentError, match=message):
        make()
