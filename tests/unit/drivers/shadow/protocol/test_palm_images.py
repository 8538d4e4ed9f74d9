from __future__ import annotations

import json
import random
from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from drivers.core.errors import CodecError
from drivers.shadow.protocol.palm_codec import CanFrame, PalmAuxiliary, PalmCommand, PalmStatus
from drivers.shadow.protocol.palm_images import PALMS, PalmImage, describe_product, palm_of_product

EVERY = pytest.mark.parametrize("palm", PALMS.values(), ids=PALMS.keys())


def plain(value: object) -> object:
    """Dataclasses of arrays as something that compares."""
    if isinstance(value, PalmStatus | PalmCommand | PalmAuxiliary):
        return {field.name: plain(getattr(value, field.name)) for field in fields(value)}
    return np.asarray(value).tolist() if isinstance(value, np.ndarray | tuple) else value


@pytest.mark.parametrize("name", ["0220", "0230", "0240"])
def test_register_bytes_are_those_of_shadows_master(name: str, lab_data: Path) -> None:
    golden = json.loads((lab_data / "golden_vectors.json").read_text())
    palm = PALMS[name]  # type: ignore[index]
    assert [each.encode().hex() for each in palm.sync_managers()] == golden[f"shadow_{name}_sm"]
    if name == "0220":
        assert [each.encode().hex() for each in palm.fmmus()] == golden["shadow_0220_fmmu"]


@pytest.mark.parametrize(
    ("product", "name"),
    [(6, "0220"), (9, "0240"), (10, "0250"), (0x01000000, "0230"), (0x01000001, "0230"), (5, None), (77, None)],
)
def test_the_image_is_chosen_by_product_code(product: int, name: str | None) -> None:
    palm = palm_of_product(product)
    assert (palm and palm.name) == name


def test_products_are_told_in_words() -> None:
    assert describe_product(9) == "a 0240 palm"
    assert "muscle hand" in describe_product(0x01000002)
    assert describe_product(0) == "a bridge, not a palm"
    assert "does not know" in describe_product(77)


@EVERY
@settings(max_examples=25, derandomize=True, deadline=None)
@given(data=st.data())
def test_decoding_a_command_undoes_encoding(palm: PalmImage, data: st.DataObject) -> None:
    payload = data.draw(st.binary(min_size=palm.command_bytes, max_size=palm.command_bytes))
    command = palm.decode_command(payload)
    assert palm.encode_command(command) == payload
    assert plain(palm.decode_command(palm.encode_command(command))) == plain(command)


@EVERY
@settings(max_examples=25, derandomize=True, deadline=None)
@given(data=st.data())
def test_decoding_a_status_undoes_encoding(palm: PalmImage, data: st.DataObject) -> None:
    payload = data.draw(st.binary(min_size=palm.status_bytes, max_size=palm.status_bytes))
    status = palm.decode_status(payload)
    assert palm.encode_status(status) == payload
    assert plain(palm.decode_status(palm.encode_status(status))) == plain(status)


@EVERY
def test_any_bytes_decode_or_are_refused_in_our_words(palm: PalmImage) -> None:
    rng = random.Random(5)
    for decode, size in ((palm.decode_command, palm.command_bytes), (palm.decode_status, palm.status_bytes)):
        for _ in range(200):
            length = rng.choice((size, size, rng.randrange(500)))
            payload = rng.randbytes(length)
            if length == size:
                decode(payload)
            else:
                with pytest.raises(CodecError, match=f"{length} bytes instead of {size}"):
                    decode(payload)


def test_fields_of_the_0240_lie_where_its_header_says() -> None:
    command = PalmCommand(1, 3, 1, 2, tuple(range(20)), 7, CanFrame(2, 1, 0x604, bytes(8)), 1, (2, 3))
    payload = PALMS["0240"].encode_command(command)
    assert payload[:58] == PALMS["0220"].encode_command(command)[:58]
    assert payload[58:62] == bytes.fromhex("01000203")
    assert payload[62:66] == bytes.fromhex("02010406")


def test_fields_of_the_0250_lie_where_its_header_says() -> None:
    palm = PALMS["0250"]
    assert (palm.command_bytes, palm.status_bytes) == (62 + 12, 530 + 12)
    status = palm.decode_status(bytes(palm.status_bytes))
    places = {"tactile_data_type": 78, "tactile_valid": 82, "motor_data_type": 474, "which_motors": 478}
    places |= {"arrived": 480, "had_errors": 484, "idle_time_us": 528}
    for name, at in places.items():
        assert palm.encode_status(replace(status, **{name: 1}))[at] == 1
    tips = np.zeros((5, 78), np.uint8)
    tips[4, 77] = 9
    assert palm.encode_status(replace(status, tactile=tips))[84 + 389] == 9


def test_fields_of_the_0230_lie_where_its_header_says() -> None:
    palm = PALMS["0230"]
    command = PalmCommand(1, 3, 1, 2, tuple(range(20)), 7, aux_data_type=9)
    payload = palm.encode_command(command)
    assert (payload[14], payload[18], payload[24]) == (7, 9, 1)
    status = palm.decode_status(bytes(palm.status_bytes))
    places = {
        "motor_data_type": 360,
        "which_motors": 364,
        "arrived": 366,
        "had_errors": 370,
        "idle_time_us": 414,
        "tactile_data_type": 158,
        "tactile_valid": 162,
    }
    for name, at in places.items():
        assert palm.encode_status(replace(status, **{name: 1}))[at] == 1


def test_a_0230_status_needs_its_auxiliary_part_and_whole_slots() -> None:
    palm = PALMS["0230"]
    status = palm.decode_status(bytes(palm.status_bytes))
    with pytest.raises(CodecError, match="auxiliary"):
        palm.encode_status(replace(status, auxiliary=None))
    with pytest.raises(CodecError, match="wrong length"):
        palm.encode_status(replace(status, tactile=np.zeros((5, 16), np.uint8)))
