"""One wrong byte costs at most the chunk that it is in, whole recording or torn, and every count is true."""

from __future__ import annotations

import numpy as np
import pytest

from tests.support.flipped_bytes import make_recording, read_flipped


@pytest.mark.parametrize("whole", [True, False])
def test_a_wrong_byte_anywhere_costs_one_chunk_at_most(whole, tmp_path):
    made, random = make_recording(tmp_path, count=150, whole=whole), np.random.default_rng(7)
    for place in random.choice(len(made.content), 120, replace=False):
        lost, wrong = read_flipped(made, int(place), int(random.integers(1, 256)), tmp_path / "flipped.mcap")
        assert wrong == "", f"at {place}, chunk {made.chunk_at(place)}"
        chunk = made.chunk_at(place)
        assert {made.chunks[number] for number in lost} <= {chunk}


@pytest.mark.parametrize("whole", [True, False])
def test_a_wrong_bit_where_a_chunk_is_described_costs_nothing_or_that_chunk(whole, tmp_path):
    """Its opcode, its lengths, its checksum, its times, and the magic and header of the file: every byte of them."""
    made = make_recording(tmp_path, count=150, whole=whole)
    middle = made.spans[2][0]
    for place in (*range(40), *range(middle, middle + 53), *range(made.spans[2][1] - 40, made.spans[2][1])):
        lost, wrong = read_flipped(made, place, 0x10, tmp_path / "flipped.mcap")
        assert wrong == "", place
        assert {made.chunks[number] for number in lost} <= {2}
