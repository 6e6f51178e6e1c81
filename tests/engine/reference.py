"""The engine system once more, event by event: slow, simple and independent of the package.

Every job of every CPU is simulated; a Modbus interrupt suspends all other work.
"""

from collections import deque
from math import inf
from operator import itemgetter

import networkx

from shipnet.engine.faults import (
    BusOff,
    CanBreak,
    DeadBox,
    DeadPort,
    LostCanFrames,
    LostModbusFrames,
    ModbusBreak,
)


def ns(seconds):
    return round(seconds * 1e9)


CABLE, BOX = (ModbusBreak, DeadPort), (DeadBox,)


def requests(system, duration, phase, faults):
    """Return (start, channel, fate) of all requests, by following each along the line.

    A fate is served, damaged (the AMS receives only the beginning of a response), unread (the box
    works, but the AMS receives nothing) or deaf.
    """
    bits, answered = system.serial.frame_time, ns(system.poll.time)
    silent = ns(bits(8) + system.timeout)

    def works(kinds, channel, begin, end, closed=True):
        """Return whether line and port, or the box, work at both ends and each change between."""
        names = {str(channel + 1), system.boxes[0 if channel == 0 else -1]}
        changes = {t for fault in faults for t in fault.span if begin < t < end}
        return not any(
            type(fault) in kinds and fault.where in names and fault.span[0] <= t < fault.span[1]
            for fault in faults
            for t in [begin, *changes, *([end] if closed else [])]
        )

    def lost(what, channel, time):
        losses = [f for f in faults if type(f) is LostModbusFrames and f.where == str(channel + 1)]
        assert {chance for f in losses for chance in (f.request, f.response)} <= {0.0, 1.0}
        return any(f.span[0] <= time < f.span[1] and getattr(f, what) for f in losses)

    def fate(start, channel):
        read = start + ns(bits(8) + system.serial.t35)
        first = start + ns(bits(8) + system.serial.t35 + system.firmware.processing)
        last = start + ns(system.poll.time - system.serial.t35)
        # The first instant of a frame on the line is included, its last one is not.
        sent = works(CABLE, channel, start, start + ns(bits(8)), closed=False)
        if not sent or not works(BOX, channel, start, read) or lost("request", channel, start):
            return "deaf"
        # The box processes the request; when the response begins, the AMS waits for its end.
        if not works(BOX, channel, read, first) or not works(CABLE, channel, first, first):
            return "unread"
        whole = works(CABLE + BOX, channel, first, last, closed=False)
        return "served" if whole and not lost("response", channel, first) else "damaged"

    def port(channels):
        favourite, tick = channels[0], phase
        while tick < ns(duration):
            now = tick
            order = [favourite, *(c for c in channels if c != favourite)]
            for channel in order:
                for _ in range(system.retries + 1):
                    what = fate(now, channel)
                    yield now, channel, what
                    now += silent if what in ("deaf", "unread") else answered
                    if what == "served":
                        break
                if what == "served":
                    favourite = channel
                    break
            tick += ns(system.poll_period)
            while tick < now:
                tick += ns(system.poll_period)

    both = system.polled == "both"
    return sorted([*port([0]), *port([1])] if both else port([0, 1]))


class Box:
    def __init__(self, system, number, phase, warm):
        self.system, self.number = system, number
        own = [p for p in range(len(system.points)) if system.box_of[p] == number]
        steps = {int(system.offset_ns[p]): [] for p in own}
        for p in own:
            steps[int(system.offset_ns[p])].append(p)
        self.steps = sorted(steps.items())
        self.convert, self.loop = int(system.convert_ns[number]), int(system.loop_ns[number])
        period = int(system.period_ns[number])
        self.period, self.tick = period, phase - (phase + warm) // period * period
        self.clear()

    def clear(self):
        self.modbus_until = -inf
        self.waiting = 0  # rounds that are due
        self.left = None  # steps of the present round: [work, step]
        self.jobs = deque()  # CAN interrupts: [work, message, samples]
        self.marking = []  # timer interrupts: [work, sender]
        self.deadline = {}
        self.table = {}
        self.samples = {}

    def begin_round(self):
        if self.left is None and self.waiting:
            self.waiting -= 1
            marks = [(at, ("sample", points)) for at, points in self.steps]
            marks += [(self.convert, ("converted", None)), (self.loop, ("queued", None))]
            marks.sort(key=lambda mark: mark[0])
            self.left, before = deque(), 0
            for at, what in marks:
                self.left.append([at - before, what])
                before = at
            self.samples = {}

    def pending(self):
        work = [job[0] for job in self.marking]
        work += [self.left[0][0]] if self.left else []
        work += [self.jobs[0][0]] if self.jobs else []
        return work

    def spend(self, time):
        for job in self.marking:
            job[0] -= time
        if self.left:
            self.left[0][0] -= time
        if self.jobs:
            self.jobs[0][0] -= time


def islands(system, faults, now):
    """Return, for each box, the boxes that it can reach on CAN, itself included."""

    def broken(kinds, where):
        return any(
            type(f) in kinds and f.where == where and f.span[0] <= now < f.span[1] for f in faults
        )

    bus = networkx.empty_graph(system.boxes)
    intact = [segment for segment in system.segments if not broken((CanBreak,), segment)]
    bus.add_edges_from(segment.split("-") for segment in intact)
    able = {box for box in system.boxes if not broken((DeadBox, BusOff), box)}
    parts = [networkx.node_connected_component(bus, box) & able for box in system.boxes]
    return [
        {system.boxes.index(other) for other in part} if box in part else set()
        for box, part in zip(system.boxes, parts, strict=True)
    ]


def run_reference(system, duration, faults, phases):
    """Return [(seen, {message: (samples, earliest) or None})] for every answer."""
    warm = 4 * int(system.period_ns.max()) + 10**9
    boxes = [Box(system, k, ns(phases[b]), warm) for k, b in enumerate(system.boxes)]
    silence = ns(system.serial.frame_time(8) + system.serial.t35)
    answered = ns(system.poll.time)
    reads = deque(
        (start + silence, (0, len(boxes) - 1)[channel], start + answered, what, channel)
        for start, channel, what in requests(system, duration, ns(phases["AMS"]), faults)
        if what != "deaf"
    )
    gap = round(3e9 / system.can_bit_rate)
    kinds = (CanBreak, DeadBox, BusOff)
    borders = deque(sorted({t for f in faults if type(f) in kinds for t in f.span if t < 1 << 61}))
    deaths = [(f.span, f.where) for f in faults if type(f) is DeadBox]
    dead = set()
    now = -warm
    reach = islands(system, faults, now)
    queued, wires = [], {}  # wires: island -> [arrival, free, message, samples, done]
    hops = {k: system.hop_ns(k) for k in range(len(boxes))}
    limit, receive = ns(system.stale_limit), ns(system.firmware.receive)
    mark = ns(system.firmware.mark)
    answers = []
    last = max((read[0] for read in reads), default=0)
    while now <= last:
        # Find the next event of any kind.
        times = [reads[0][0]] if reads else [last + 1]
        times += [borders[0]] if borders else []
        for box in boxes:
            times.append(box.tick)
            if box.modbus_until > now:
                times.append(box.modbus_until)
            else:
                times += [now + work for work in box.pending()]
            times += list(box.deadline.values())
        times += [wire[0] if not wire[4] else wire[1] for wire in wires.values()]
        then = min(times)
        for box in boxes:
            if box.modbus_until <= now:
                box.spend(then - now)
        now = then
        # Finish completed work.
        for k, box in enumerate(boxes):
            if k in dead or box.modbus_until > now:
                continue
            while box.left and box.left[0][0] == 0:
                what, points = box.left.popleft()[1]
                if what == "sample":
                    for p in points:
                        box.samples[p] = now
                elif what == "converted":
                    for message in (system.sender == k).nonzero()[0].tolist():
                        box.table[message] = (dict(box.samples), now - int(hops[k][message]))
                elif len(reach[k]) > 1:
                    for message in (system.sender == k).nonzero()[0].tolist():
                        queued.append((message, k, dict(box.samples), now))
                if not box.left:
                    box.left = None
            while box.jobs and box.jobs[0][0] == 0:
                _, message, samples = box.jobs.popleft()
                box.table[message] = (samples, now - int(hops[k][message]))
                box.deadline[int(system.sender[message])] = now + limit
        for wire in wires.values():
            if wire[0] == now and not wire[4]:
                wire[4] = True
                message, sender, samples, since = wire[2]
                for k in wire[3] - {sender}:
                    gone = any(
                        type(f) is LostCanFrames
                        and f.where == system.boxes[sender]
                        and f.span[0] <= since < f.span[1]
                        for f in faults
                    )
                    if not gone:
                        boxes[k].jobs.append([receive, message, samples])
        for k, box in enumerate(boxes):
            if box.modbus_until <= now:
                for job in [job for job in box.marking if job[0] == 0]:
                    box.marking.remove(job)
                    for message in (system.sender == job[1]).nonzero()[0].tolist():
                        box.table.pop(message, None)
            for sender in [s for s, deadline in box.deadline.items() if deadline == now]:
                del box.deadline[sender]
                if system.coding == "printed":
                    box.marking.append([mark, sender])
            # Count the rounds that are due.
            if box.tick == now:
                box.tick += box.period
                if not any(span[0] <= now < span[1] and w == system.boxes[k] for span, w in deaths):
                    box.waiting += 1
            box.begin_round()
        for island in [i for i, wire in wires.items() if wire[1] == now]:
            del wires[island]
        if borders and borders[0] == now:
            borders.popleft()
            reach = islands(system, faults, now)
            queued, wires = [], {}
            for span, where in deaths:
                k = system.boxes.index(where)
                if span[0] == now:
                    waiting_tick = boxes[k].tick
                    boxes[k].clear()
                    boxes[k].tick = waiting_tick
                    dead.add(k)
                if span[1] == now:
                    dead.discard(k)
        # Process Modbus, then CAN.
        while reads and reads[0][0] == now:
            _, k, seen, what, channel = reads.popleft()
            boxes[k].modbus_until = now + system.service_ns
            if what == "served":
                answers.append((seen, channel, dict(boxes[k].table)))
        for island in {frozenset(group) for group in reach if len(group) > 1}:
            ready = [frame for frame in queued if frame[1] in island]
            if ready and island not in wires:
                frame = min(ready, key=lambda f: (f[0], f[3]))
                queued.remove(frame)
                free = now + int(system.frame_ns[frame[0]])
                wires[island] = [free - gap, free, frame, set(island), False]
    # The AMS shows the newest values that it holds from either channel.
    held, rows = {}, {}
    for seen, channel, table in sorted(answers, key=lambda answer: answer[0]):
        held[channel] = table
        tables = list(held.values()) if system.polled == "both" else [table]
        rows[seen] = {
            message: max(
                (t[message] for t in tables if message in t), key=itemgetter(1), default=None
            )
            for message in range(len(system.sender))
        }
    return sorted(rows.items())
