"""How much faster the values of an engine are encoded in one batch than row by row."""

import numpy as np
from _timing import seconds
from pymodbus.client.mixin import ModbusClientMixin

from shipnet.engine import InputCard, RegisterMap, read_points

ROWS = 20_000  # one row per second for five and a half hours
SAMPLE = 200  # rows in the loops, whose times are scaled up


def main():
    points = read_points()
    rng = np.random.default_rng(2024)
    low, high = (np.array([getattr(point, end) for point in points]) for end in ("low", "high"))
    values = low + (high - low) * rng.random((ROWS, len(points)))
    switches = np.array([not point.analogue for point in points])
    values[:, switches] = values[:, switches].round()
    card, registers = InputCard(points), RegisterMap(points)

    # Compare the 80 analogue values with pymodbus; leave out the switches.
    analogue = [k for k in range(len(points)) if not switches[k]]

    def pymodbus_row(row):
        kind = ModbusClientMixin.DATATYPE.INT16
        return ModbusClientMixin.convert_to_registers([round(10 * x) for x in row], kind)

    ours = registers.encode(values[:SAMPLE])[:, analogue]
    peer = [pymodbus_row(row) for row in values[:SAMPLE, analogue].tolist()]
    assert (ours == peer).mean() > 0.99  # round() rounds halves to even numbers

    some = values[:SAMPLE, analogue].tolist()
    per_row = {
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
