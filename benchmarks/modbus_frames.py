"""How fast Modbus frames are made and read by shipnet, pymodbus and minimalmodbus."""

from functools import partial
from time import process_time

import minimalmodbus
import numpy as np
from _timing import seconds as shortest
from pymodbus.framer import FramerRTU
from pymodbus.pdu import DecodePDU
from pymodbus.pdu.register_message import ReadHoldingRegistersRequest

from shipnet.crc import MODBUS
from shipnet.modbus.pdu import Request, Response, decode

seconds = partial(shortest, timer=process_time)

NUMBER = 1_000_000
SAMPLE = 3_000  # frames in the loops, whose times are scaled up
REGISTERS = 38  # all points of the largest junction box of lee2012


def report(title, per_item):
    """Print each rate, and the ratio of the first rate to it."""
    print(f"{title:<44}{'per second':>12}{'first is faster by':>20}")
    first = next(iter(per_item.values()))
    for name, time in per_item.items():
        print(f"  {name:<42}{1 / time:>12.3g}{time / first:>19.1f}x")


def main():
    rng = np.random.default_rng(2024)
    columns = [rng.integers(low, high, SAMPLE) for low, high in ((1, 248), (0, 65536), (1, 126))]
    some = list(zip(*(column.tolist() for column in columns), strict=True))
    framer, reader = FramerRTU(DecodePDU(True)), FramerRTU(DecodePDU(False))

    def ours():
        return [Request.read_holding_registers(a, n).rtu(u) for u, a, n in some]

    def theirs():
        make = ReadHoldingRegistersRequest
        return [framer.buildFrame(make(address=a, count=n, dev_id=u)) for u, a, n in some]

    def minimal():
        return [
            minimalmodbus._embed_payload(u, "rtu", 3, a.to_bytes(2, "big") + n.to_bytes(2, "big"))
            for u, a, n in some
        ]

    assert ours() == theirs() == minimal()
    report(
        "requests of function code 3, made",
        {
            "ours": seconds(ours) / SAMPLE,
            "pymodbus": seconds(theirs) / SAMPLE,
            "minimalmodbus": seconds(minimal) / SAMPLE,
        },
    )

    for size, number in ((6, NUMBER), (253, NUMBER // 20)):
        rows = rng.integers(0, 256, (number, size), dtype=np.uint8)
        bodies = [row.tobytes() for row in rows[:SAMPLE]]
        expected = MODBUS.of(rows[:SAMPLE]).tolist()
        assert [MODBUS.of(body) for body in bodies] == expected
        swapped = [FramerRTU.compute_CRC(body) for body in bodies]
        assert [value >> 8 | (value & 255) << 8 for value in swapped] == expected
        small = [int.from_bytes(minimalmodbus._calculate_crc(b), "little") for b in bodies]
        assert small == expected

        def each(function, bodies=bodies):
            return seconds(lambda: [function(body) for body in bodies]) / SAMPLE

        report(
            f"CRC of {size} bytes",
            {
                "batch": seconds(lambda rows=rows: MODBUS.of(rows)) / number,
                "ours, one by one": each(lambda body: MODBUS.of(body)),
                "pymodbus": each(FramerRTU.compute_CRC),
                "minimalmodbus": each(minimalmodbus._calculate_crc),
            },
        )

    values = rng.integers(0, 65536, (SAMPLE, REGISTERS))
    answers = [Response(3, registers=row).rtu(1) for row in values]
    request = Request.read_holding_registers(0, REGISTERS)

    def read():
        return [decode(frame).response(request).registers for frame in answers]

    def their_read():
        return [tuple(reader.handleFrame(frame, 1, 0)[1].registers) for frame in answers]

    assert read() == their_read() == [tuple(row) for row in values.tolist()]
    report(
        f"responses with {REGISTERS} registers",
        {
            "ours, read and compared with the request": seconds(read) / SAMPLE,
            "pymodbus, read": seconds(their_read) / SAMPLE,
        },
    )


if __name__ == "__main__":
    main()
