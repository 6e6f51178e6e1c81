"""Simulations of redundant lines with faults at many instants, to verify the closed forms."""

from dataclasses import replace
from itertools import combinations

import numpy as np

from shipnet.modbus.redundancy import line_faults
from shipnet.modbus.simulation import Master, Run, simulate


def answer_times(run):
    """Return the end times of all responses, in order [s]."""
    poll = run.system.poll
    return run.events().query("answered")["start_s"].to_numpy() + poll.time - poll.line.t35


def sweep(system, faults, instants=None):
    """Return the longest gaps, (n_instants, n_slaves), with permanent faults that begin together.

    By default the instants are the ends of the answers of the second scan, which include the worst
    instant of all.
    """
    failed = line_faults(faults)
    if instants is None:
        begin, each = system.period, system.poll.time
        whole = simulate(system, until=begin + (system.n_slaves - 0.5) * each)
        instants = answer_times(whole)[-system.n_slaves :]
    # The master gives up a lost slave one scan later than it moves a slave.
    settled = 4 * (system.period + 2 * system.n_slaves * system.poll.timeout_time)
    at = np.atleast_1d(np.asarray(instants, dtype=float))
    gaps = np.empty((at.size, system.n_slaves))
    for row, instant in enumerate(at):
        begun = tuple(replace(fault, start=float(instant), stop=np.inf) for fault in failed)
        master, end, quiet = Master(system, begun), float(instant) + settled, 0
        while master.time < end and quiet < 2:
            before, tried = master.time, len(master.tries)
            master.scan(end)
            quiet = quiet + 1 if before > instant and master.last_failure < before else 0
            # All are lost.
            quiet = 2 if before > instant and len(master.tries) == tried else quiet
        gaps[row] = Run(system, begun, master.tries[-1][0], master.tries, master.port).gaps
    gaps[:, [slave - 1 for slave in system.reach(failed).lost]] = np.inf
    return gaps


def pairs(system):
    """Return all pairs of different single faults."""
    return list(combinations(system.single_faults(), 2))


def longest_recovery(system):
    """Return the longest time from a repair until every slave is back on its port [s].

    In the worst case a try through both ports has just begun; after its time-outs the rule waits,
    then it may take a scan until the next slave to be tried has its turn, and another scan until
    the last one has.
    """
    return system.recheck + 2 * system.period + 2 * system.poll.unanswered_time
