"""How much faster remote-control packets are encoded and decoded in batches than in loops."""

import numpy as np
from _timing import seconds

from shipnet.remote_control import CobsFormat, MarkerFormat

NUMBER, ITEMS = 200_000, 10
SAMPLE = 2_000  # packets in the loops, whose times are scaled up


def main():
    values = np.random.default_rng(2024).integers(0, 0x10000, (NUMBER, ITEMS))
    some = [dict(enumerate(line)) for line in values[:SAMPLE].tolist()]
    print(f"{f'packets of {ITEMS} data':<44}{'per second':>12}{'batch is faster by':>20}")
    for name, form in {
        "markers": MarkerFormat(),
        "markers + CRC": MarkerFormat(crc=True),
        "COBS + CRC": CobsFormat(),
    }.items():
        rows = form.encode_batch(range(ITEMS), values)
        packets = [form.encode(items) for items in some]
        assert packets == [row.tobytes() for row in rows[:SAMPLE]]
        stream = b"".join(packets)
        assert len(form.parser().feed(stream)) == SAMPLE

        def build(form=form):
            return form.encode_batch(range(ITEMS), values)

        def check(form=form, rows=rows):
            return form.decode_batch(rows)

        def build_each(form=form):
            return [form.encode(items) for items in some]

        def check_each(form=form, packets=packets):
            return [form.decode(packet) for packet in packets]

        def parse(form=form, stream=stream):
            return form.parser().feed(stream)

        built, checked = seconds(build) / NUMBER, seconds(check) / NUMBER
        rates = {
            "encode, batch": (built, built),
            "encode, loop": (seconds(build_each) / SAMPLE, built),
            "decode, batch": (checked, checked),
            "decode, loop": (seconds(check_each) / SAMPLE, checked),
            "parser on a stream": (seconds(parse) / SAMPLE, checked),
        }
        for what, (time, best) in rates.items():
            print(f"{f'{name}: {what}':<44}{1 / time:>12.3g}{time / best:>19.1f}x")


if __name__ == "__main__":
    main()
