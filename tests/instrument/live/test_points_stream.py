"""The description of a points stream says what holds now, and is numbered by what it says."""

import json
from types import SimpleNamespace
from typing import Any, cast

import pytest

from grabberd.instrument.instrument import Instrument
from grabberd.instrument.live.field_streams import PointsEncoder
from grabberd.runtime import UtcClock


def setup_with(calibration_id: str) -> SimpleNamespace:
    return SimpleNamespace(documents={"calibration": {"id": calibration_id}, "object": {"name": "liner"}})


@pytest.fixture
def device() -> SimpleNamespace:
    return SimpleNamespace(name="cup", pipeline=SimpleNamespace(rate_hz=50.0), setup=setup_with("rig-7"))


@pytest.fixture
def encoder(device: SimpleNamespace) -> PointsEncoder:
    return PointsEncoder(cast("Instrument", device), cast("UtcClock", None))


def described(encoder: PointsEncoder) -> dict[str, Any]:
    document = json.loads(encoder.description())
    assert isinstance(document, dict)
    return document


def test_a_stream_that_is_opened_again_at_another_rate_is_described_anew(
    device: SimpleNamespace, encoder: PointsEncoder
) -> None:
    before = described(encoder)
    device.pipeline.rate_hz = 59.94
    after = described(encoder)
    assert (before["rate_hz"], after["rate_hz"]) == (50.0, 59.94)
    assert after["number"] == before["number"] + 1


def test_another_calibration_is_described_anew(device: SimpleNamespace, encoder: PointsEncoder) -> None:
    before = described(encoder)
    device.setup = setup_with("rig-8")
    after = described(encoder)
    assert after["calibration_id"] == "rig-8"
    assert after["number"] == before["number"] + 1


def test_a_setup_that_says_the_same_keeps_its_number(device: SimpleNamespace, encoder: PointsEncoder) -> None:
    before = described(encoder)
    device.setup = setup_with("rig-7")
    assert described(encoder) == before
