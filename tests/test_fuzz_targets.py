"""Every target of the fuzzer reads a good input, and refuses the others with an error of ours."""

import pytest

from tests.fuzz.targets import REFUSALS, TARGETS


@pytest.mark.parametrize("name", TARGETS)
def test_a_target_reads_a_seed_and_refuses_what_is_cut_off(name):
    run, seeds = TARGETS[name]
    read = 0
    for seed in seeds():
        for data in (seed, seed[: len(seed) // 2], b"", b"\xff" * 40):
            try:
                run(data)
                read += data == seed
            except REFUSALS as refusal:
                assert str(refusal)
    assert read
