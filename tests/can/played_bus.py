"""A bus without any theory: frames, one after the other, the most urgent first, in bit times."""

from collections import deque


def simulate(frames, releases, *, foreign=None, faults=(), error_bits=31):
    """Send every instance and return the finish of each, by message.

    `releases` holds the queueing times of each message, the most urgent message first. `foreign`
    is a frame of (start, length) that nobody can push aside. A fault destroys the frame on the
    bus; an error frame follows, and the frame stands for arbitration again.
    """
    waiting = [deque(sorted(times)) for times in releases]
    faults = deque(sorted(faults))
    finish = [[] for _ in releases]
    now = min((times[0] for times in waiting if times), default=0)
    if foreign:
        now = sum(foreign)
    while any(waiting):
        ready = [m for m, times in enumerate(waiting) if times and times[0] <= now]
        if not ready:
            now = min(times[0] for times in waiting if times)
            continue
        m, end = ready[0], now + frames[ready[0]]
        # A fault on an idle bus or in an error frame destroys nothing.
        while faults and faults[0] <= now:
            faults.popleft()
        if faults and faults[0] <= end:
            now = faults.popleft() + error_bits
            continue
        now = end
        waiting[m].popleft()
        finish[m].append(end)
    return finish
