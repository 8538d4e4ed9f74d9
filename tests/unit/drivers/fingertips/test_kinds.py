"""What the program asks a kind of fingertip: how the palm requests it, its body, and what a finger says of itself."""

from __future__ import annotations

import numpy as np
import pytest

from drivers.biotac.biotac import BioTacCalibration
from drivers.core.contacts import FINGERS
from drivers.core.errors import ConfigurationError
from drivers.core.fingertip import RigidTransform
from drivers.fingertips.biotac import BioTacKind, KnownBioTac, contradictions
from drivers.fingertips.kinds import FINGERTIPS, as_palm_kind, palm_kind
from drivers.fingertips.nano17 import Nano17Kind
from drivers.shadow.device.tactile_requests import TactileProtocol, TactileQuestion
from drivers.shadow.protocol.tactile_names import TactileNames
from tests.support.repository import SIMULATED_HAND


class Answers:
    """One sample in which all fingers answer a question alike."""

    def __init__(self, question: int, answer: bytes) -> None:
        self.tactile_type, self.tactile_valid = question, 0b11111
        self.tactile = answer.ljust(32, b"\0") * len(FINGERS)


def names(protocol: TactileProtocol, serial: str = "") -> TactileNames:
    told = TactileNames()
    told.take(Answers(TactileQuestion.PROTOCOL, int(protocol).to_bytes(2, "little")))
    if serial:
        told.take(Answers(TactileQuestion.SERIAL, serial.encode("ascii")))
    return told


def test_a_kind_is_found_by_how_the_palm_asks_for_it() -> None:
    assert palm_kind("biotac") == "biotac"
    assert palm_kind("none") is None
    assert isinstance(as_palm_kind("biotac"), BioTacKind)
    with pytest.raises(AssertionError, match="own transports"):
        as_palm_kind("nano17")


def test_the_body_of_a_force_fingertip_is_that_of_its_calibration() -> None:
    kind = FINGERTIPS["nano17"]
    assert isinstance(kind, Nano17Kind)
    calibration = kind.load({"fingertips": SIMULATED_HAND / kind.packaged})[FINGERS[1]]
    body = kind.body(FINGERS[1], calibration)
    assert body.semi_axes_m == calibration.semi_axes_m
    np.testing.assert_allclose(body.distal_T_skin.translation(), calibration.centre_distal_m)
    settings = kind.settings()
    assert kind.force_range_N(settings) == min(settings.force_range_N)


def test_a_biotac_without_an_ellipsoid_skin_cannot_be_simulated() -> None:
    bare = KnownBioTac(
        BioTacCalibration(electrodes=19, distal_T_sensor=RigidTransform(translation_m=(0.0, 0.0, 0.019)))
    )
    kind = BioTacKind()
    assert kind.surface(bare) is None
    with pytest.raises(ConfigurationError, match=f"{FINGERS[1]} has no ellipsoid skin"):
        kind.body(FINGERS[1], bare)


def test_what_a_finger_says_of_itself_is_compared_with_the_rig() -> None:
    said = names(TactileProtocol.BIOTAC, "BTSP-0042")
    assert contradictions(said, FINGERS[1]) == []
    assert contradictions(names(TactileProtocol.PST3), FINGERS[1]) == [
        "is not a BioTac: correct the fingertips in the rig file, or plug the sensor in"
    ]
    (swapped,) = contradictions(said, FINGERS[1], serial="BTSP-0043")
    assert swapped == "its serial number is BTSP-0042, not BTSP-0043: were two fingertips swapped?"
