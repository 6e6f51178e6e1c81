"""How much faster the values of an engine are coded in one batch than row by row, in one run."""

import cantools.database as db
import numpy as np
from _timing import seconds
from pymodbus.client.mixin import ModbusClientMixin

from shipnet.engine import CanLayout, InputCard, RegisterMap, read_points

ROWS = 20_000  # one a second: five and a half hours
SAMPLE = 200  # what the loops get; their time is scaled up


def database(layout):
    """Describe the frames to cantools, from the table."""
    signals, switches = {}, {}
    for row in layout.table().itertuples():
        place = row.message, row.byte
        bit = 7 if row.bits > 1 else switches.setdefault(place, 0)
        if row.bits == 1:
            switches[place] += 1
        order = "big_endian" if row.bits > 1 else "little_endian"
        signal = db.can.signal.Signal(row.Index, 8 * row.byte + bit, row.bits, order)
        signals.setdefault(row.message, []).append(signal)
    messages = [
        db.can.Message(m.arbitration_id, m.name, m.dlc, signals[m.name]) for m in layout.messages()
    ]
    return db.can.Database(messages)


def main():
    points = read_points()
    rng = np.random.default_rng(2024)
    low, high = (np.array([getattr(point, end) for point in points]) for end in ("low", "high"))
    values = low + (high - low) * rng.random((ROWS, len(points)))
    switches = np.array([not point.analogue for point in points])
    values[:, switches] = values[:, switches].round()
    card, layout, registers = InputCard(points), CanLayout(points), RegisterMap(points)
    codes = card.code(card.signal(values))

    known = database(layout)
    tags = {m.name: [signal.name for signal in m.signals] for m in known.messages}
    place = {point.tag: k for k, point in enumerate(points)}

    def cantools_row(row):
        return {
            name: known.encode_message(name, {tag: int(row[place[tag]]) for tag in own})
            for name, own in tags.items()
        }

    own = layout.encode(codes[0])
    assert cantools_row(codes[0]) == {name: data.tobytes() for name, data in own.items()}

    # The 80 analogue values as pymodbus codes them, and ours without the switches.
    analogue = [k for k in range(len(points)) if not switches[k]]

    def pymodbus_row(row):
        kind = ModbusClientMixin.DATATYPE.INT16
        return ModbusClientMixin.convert_to_registers([round(10 * x) for x in row], kind)

    ours = registers.encode(values[:SAMPLE])[:, analogue]
    peer = [pymodbus_row(row) for row in values[:SAMPLE, analogue].tolist()]
    assert (ours == peer).mean() > 0.99  # of halves, round() takes the even neighbour

    some = values[:SAMPLE, analogue].tolist()
    per_row = {
        "frames, batch": seconds(lambda: layout.encode(codes)) / ROWS,
        "frames, cantools": seconds(lambda: [cantools_row(r) for r in codes[:SAMPLE]]) / SAMPLE,
        "registers, batch": seconds(lambda: registers.encode(values)) / ROWS,
        "registers, pymodbus": seconds(lambda: [pymodbus_row(row) for row in some]) / SAMPLE,
        "inputs, batch": seconds(lambda: card.code(card.signal(values))) / ROWS,
        "inputs, row by row": seconds(
            lambda: [card.code(card.signal(row)) for row in values[:SAMPLE]]
        )
        / SAMPLE,
    }
    print(f"{'99 points of an engine':<32}{'rows per second':>16}{'batch is faster by':>20}")
    for name, time in per_row.items():
        best = per_row[f"{name.split(',')[0]}, batch"]
        print(f"{name:<32}{1 / time:>16.3g}{time / best:>19.1f}x")


if __name__ == "__main__":
    main()
