"""Classic CAN bit by bit, from the wording of the specification, to compare with. Slow on purpose.

Nothing of the package is used. The CRC is the shift register that Bosch's specification spells out
in section 3.1.1; a stuff bit is sent whenever the last five bits on the line were equal.
"""


def number(value, width):
    return [int(bool(value & 1 << place)) for place in reversed(range(width))]


def check_sequence(bits):
    register = [0] * 15
    for bit in bits:
        next_bit = bit ^ register[0]
        register = [*register[1:], 0]
        if next_bit:
            register = [a ^ b for a, b in zip(register, number(0x4599, 15), strict=True)]
    return register


def line_bits(arbitration_id, data, extended, remote, dlc):
    if extended:
        head = [0, *number(arbitration_id >> 18, 11), 1, 1, *number(arbitration_id & 0x3FFFF, 18)]
        head += [int(remote), 0, 0]
    else:
        head = [0, *number(arbitration_id, 11), int(remote), 0, 0]
    message = head + number(dlc, 4)
    for byte in data:
        message += number(byte, 8)
    message += check_sequence(message)
    line = []
    # Bits since the frame began; a stuff bit is due as soon as five in a row are equal.
    for bit in message:
        line.append(bit)
        if len(line) >= 5 and len(set(line[-5:])) == 1:
            line.append(1 - bit)
    return "".join(map(str, [*line, 1, 0, 1, *[1] * 7]))
