"""How fast worst-case response times of CAN are computed, compared with two plain programs."""

import math
from functools import partial
from time import process_time

import numpy as np
from _timing import seconds as shortest

from shipnet.can import Message, MessageSet, audsley, response_times

seconds = partial(shortest, timer=process_time)
BIT_RATE = 250_000
BIT = 1 / BIT_RATE

#: Tolerance for rounding errors [s]; without it, `ceil` could count one instance too many.
DUST = 1e-12


def message_set(n, load, rng):
    """Return n messages with random periods, scaled to a given load."""
    dlc = rng.integers(0, 9, size=n)
    period = rng.choice([5, 10, 20, 25, 50, 100, 200, 500, 1000], size=n)
    factor = ((55 + 10 * dlc) * BIT / (period * 1e-3)).sum() / load
    period = np.sort(np.round(period * factor, 3)) * 1e-3
    return MessageSet(
        Message(f"m{k}", k, int(s), float(t), jitter=float(t) / 20)
        for k, (s, t) in enumerate(zip(dlc, period, strict=True))
    )


def plain(messages):
    """Compute the response times from the published equations, in floating point."""
    rows = [((55 + 10 * m.dlc) * BIT, m.period, m.jitter) for m in messages]
    responses = []
    for m, (c, t, j) in enumerate(rows):
        blocking = max((row[0] for row in rows[m + 1 :]), default=0.0)
        busy, before = c, -1.0
        while abs(busy - before) > DUST:
            before = busy
            busy = blocking + sum(
                math.ceil((before + jk) / tk - DUST / tk) * ck for ck, tk, jk in rows[: m + 1]
            )
        longest = 0.0
        for q in range(math.ceil((busy + j) / t - DUST / t)):
            w, before = blocking + q * c, -1.0
            while abs(w - before) > DUST:
                before = w
                w = (
                    blocking
                    + q * c
                    + sum(
                        math.ceil((before + jk + BIT) / tk - DUST / tk) * ck
                        for ck, tk, jk in rows[:m]
                    )
                )
            longest = max(longest, j + w - q * t + c)
        responses.append(longest)
    return responses


class EventModel:
    """The event functions of compositional analysis, for a message with period and jitter."""

    def __init__(self, period, jitter, frame):
        self.period, self.jitter, self.frame = period, jitter, frame

    def eta_plus(self, window):
        """Return the maximum number of events in a window."""
        return math.ceil((window + self.jitter) / self.period - DUST / self.period)

    def delta_min(self, q):
        """Return the shortest time from event 1 to event q [s]."""
        return max(0.0, (q - 1) * self.period - self.jitter)


def busy_window(messages):
    """Compute the response times from event models, instance by instance in each busy window."""
    tasks = [EventModel(m.period, m.jitter, (55 + 10 * m.dlc) * BIT) for m in messages]
    responses = []
    for place, task in enumerate(tasks):
        higher = tasks[:place]
        blocking = max((other.frame for other in tasks[place + 1 :]), default=0.0)
        longest, q = 0.0, 1
        while True:
            w = blocking + (q - 1) * task.frame
            while True:
                load = sum(other.eta_plus(w + BIT) * other.frame for other in higher)
                new = blocking + (q - 1) * task.frame + load
                if new <= w + DUST:
                    break
                w = new
            arrival = (q - 1) * task.period - task.jitter
            longest = max(longest, w + task.frame - arrival)
            if w + task.frame <= task.delta_min(q + 1) + DUST:
                break
            q += 1
        responses.append(longest)
    return responses


def read(messages):
    """Compute the response times and read them message by message."""
    return [one.response for one in response_times(messages, BIT_RATE)]


def main():
    rng = np.random.default_rng(2024)
    heads = ("exact", "exact and read", "plain floats", "event models", "audsley")
    print(f"{'messages, load':<16}" + "".join(f"{head:>19}" for head in heads))
    for n, load in ((20, 0.5), (20, 0.85), (100, 0.5), (100, 0.85), (10, 0.5)):
        messages = message_set(n, load, rng)
        ours = read(messages)
        for peer in (plain, busy_window):
            assert np.allclose(ours, peer(messages), rtol=0, atol=1e-10)
        exact = seconds(partial(response_times, messages, BIT_RATE))
        times = [exact, *(seconds(partial(peer, messages)) for peer in (read, plain, busy_window))]
        times.append(seconds(partial(audsley, messages, BIT_RATE), repeats=2))
        print(f"{n:>4}, {load:<10}", end="")
        print("".join(f"{t * 1e3:>8.2f} ms {t / exact:>5.1f}x " for t in times))


if __name__ == "__main__":
    main()
