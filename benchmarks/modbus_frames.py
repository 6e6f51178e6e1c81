"""How fast Modbus frames are made and read: ours, pymodbus and minimalmodbus, in one run."""

from timeit import repeat

import minimalmodbus
import numpy as np
from pymodbus.framer import FramerRTU
from pymodbus.pdu import DecodePDU
from pymodbus.pdu.register_message import ReadHoldingRegistersRequest

from shipnet.crc import crc, crc_batch
from shipnet.modbus.batch import check_frames, encode_requests
from shipnet.modbus.frame import decode_rtu, encode_rtu
from shipnet.modbus.reader import decode_response
from shipnet.modbus.request import ReadRequest
from shipnet.modbus.response import ReadRegistersResponse

NUMBER = 1_000_000
SAMPLE = 3_000  # what the loops get; their time is scaled up
REGISTERS = 38  # all points of the largest junction box of lee2012


def seconds(function, repeats=3):
    """Return the shortest of several times: the one least disturbed by other work."""
    return min(repeat(function, number=1, repeat=repeats))


def report(title, per_item):
    """Print rates, and each one against the first of its kind."""
    print(f"{title:<44}{'per second':>12}{'first is faster by':>20}")
    first = next(iter(per_item.values()))
    for name, time in per_item.items():
        print(f"  {name:<42}{1 / time:>12.3g}{time / first:>19.1f}x")


def main():
    rng = np.random.default_rng(2024)
    unit, address = rng.integers(1, 248, NUMBER), rng.integers(0, 65536, NUMBER)
    quantity = rng.integers(1, 126, NUMBER)
    some = list(zip(*(c[:SAMPLE].tolist() for c in (unit, address, quantity)), strict=True))
    framer, reader = FramerRTU(DecodePDU(True)), FramerRTU(DecodePDU(False))

    def ours():
        return [encode_rtu(u, ReadRequest(3, a, n).pdu) for u, a, n in some]

    def theirs():
        make = ReadHoldingRegistersRequest
        return [framer.buildFrame(make(address=a, count=n, dev_id=u)) for u, a, n in some]

    def minimal():
        return [
            minimalmodbus._embed_payload(u, "rtu", 3, a.to_bytes(2, "big") + n.to_bytes(2, "big"))
            for u, a, n in some
        ]

    batch = encode_requests(unit, 3, address, quantity).frames
    frames = [row.tobytes() for row in batch[:SAMPLE]]
    assert ours() == theirs() == minimal() == frames
    report(
        "requests of function code 3, made",
        {
            "batch": seconds(lambda: encode_requests(unit, 3, address, quantity)) / NUMBER,
            "ours, one by one": seconds(ours) / SAMPLE,
            "pymodbus": seconds(theirs) / SAMPLE,
            "minimalmodbus": seconds(minimal) / SAMPLE,
        },
    )

    for size, number in ((6, NUMBER), (253, NUMBER // 20)):
        rows = rng.integers(0, 256, (number, size), dtype=np.uint8)
        bodies = [row.tobytes() for row in rows[:SAMPLE]]
        expected = crc_batch("CRC-16/MODBUS", rows[:SAMPLE]).tolist()
        assert [crc("CRC-16/MODBUS", body) for body in bodies] == expected
        swapped = [FramerRTU.compute_CRC(body) for body in bodies]
        assert [value >> 8 | (value & 255) << 8 for value in swapped] == expected
        small = [int.from_bytes(minimalmodbus._calculate_crc(b), "little") for b in bodies]
        assert small == expected

        def each(function, bodies=bodies):
            return seconds(lambda: [function(body) for body in bodies]) / SAMPLE

        report(
            f"CRC of {size} bytes",
            {
                "batch": seconds(lambda rows=rows: crc_batch("CRC-16/MODBUS", rows)) / number,
                "ours, one by one": each(lambda body: crc("CRC-16/MODBUS", body)),
                "pymodbus": each(FramerRTU.compute_CRC),
                "minimalmodbus": each(minimalmodbus._calculate_crc),
            },
        )

    values = rng.integers(0, 65536, (SAMPLE, REGISTERS))
    answers = [encode_rtu(1, ReadRegistersResponse(3, row).pdu) for row in values]
    request = ReadRequest(3, 0, REGISTERS)
    rows = np.array([list(frame) for frame in answers] * 10, np.uint8)

    def read():
        return [decode_response(decode_rtu(frame).pdu, request).registers for frame in answers]

    def their_read():
        return [tuple(reader.handleFrame(frame, 1, 0)[1].registers) for frame in answers]

    assert read() == their_read() == [tuple(row) for row in values.tolist()]
    report(
        f"responses with {REGISTERS} registers",
        {
            "batch, checked only": seconds(lambda: check_frames(rows)) / len(rows),
            "ours, read and compared with the request": seconds(read) / SAMPLE,
            "pymodbus, read": seconds(their_read) / SAMPLE,
        },
    )


if __name__ == "__main__":
    main()
