"""Which targets of the calibration frame a capture shows."""

import pytest

from core.chain.fake_scene import take_scene
from core.shipped_models import PAPER, shipped_model
from grabberd.core.chain.calibration.frame_capture import identify
from grabberd.core.geometry import NominalRig
from grabberd.errors import MeasurementError

NOMINAL = NominalRig(720, 576, (0, 360), (360, 720), 240.0, 128.0, 30.0, 8.0, 0.0086, 0.0083)
FRAME = shipped_model(PAPER)


def test_every_target_is_named_in_both_views():
    fields = take_scene(4, scene="calibration_frame", seed=5).packed(8, "field")
    seen = identify(fields, NOMINAL, FRAME)
    assert seen.refusal is None
    for target in seen.target:
        assert sorted(target) == list(range(108))


def test_another_object_is_shown_unnamed_with_the_reason():
    fields = take_scene(4, scene="accuracy_object", seed=5).packed(8, "field")
    seen = identify(fields, NOMINAL, FRAME)
    assert seen.refusal is not None
    assert seen.refusal.hint
    for images, target in zip(seen.images, seen.target, strict=True):
        assert len(images) == len(target) > 0
        assert set(target) == {-1}


def test_what_moves_is_shown_as_it_was_at_first():
    fields = take_scene(40, scene="liner", seed=5).packed(8, "field")
    seen = identify(fields, NOMINAL, FRAME)
    assert seen.moved
    assert "moved" in seen.refusal.message
    assert all(len(images) for images in seen.images)


def test_nothing_shows_nothing():
    with pytest.raises(MeasurementError, match="no field"):
        identify([], NOMINAL, FRAME)
