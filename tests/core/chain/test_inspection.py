"""Pictures of unknown origin tell of their lines, of where the views meet, and of their targets."""

import cv2
import numpy as np
import pytest

from core.chain.drawn_footage import footage
from grabberd.core.chain.inspection import Interlacing, inspect, inspect_fields
from grabberd.core.chain.layout import Layout, LayoutKind
from grabberd.core.field import TOP, Field

PAL = {"columns": 720, "lines": 576, "split": 360, "diameter_px": 5.0, "pitch_px": 24.0}
VGA = {"columns": 640, "lines": 480, "split": 300, "diameter_px": 5.0, "pitch_px": 24.0}
HD = {"columns": 1920, "lines": 1080, "split": 985, "diameter_px": 15.0, "pitch_px": 70.0}


@pytest.mark.parametrize("scene", [PAL, VGA], ids=["pal", "vga"])
@pytest.mark.parametrize("kind", ["progressive", "top_first", "bottom_first"])
def test_lines_views_and_targets_are_told_by_what_the_pictures_show(kind, scene):
    found = inspect(list(footage(kind, 40, **scene)))
    assert (found.columns, found.lines) == (scene["columns"], scene["lines"])
    assert found.interlacing == kind
    assert found.split.sure
    assert found.split.column == pytest.approx(scene["split"], abs=scene["pitch_px"] / 2)
    assert found.split.left == pytest.approx(0.5, abs=0.1)
    assert found.targets.diameter_px == pytest.approx(5.0, rel=0.25)
    assert found.targets.contrast == pytest.approx(150, rel=0.2)
    assert found.targets.background == pytest.approx(25, abs=2)


@pytest.mark.parametrize("kind", ["top_first", "bottom_first"])
def test_frames_turned_by_a_quarter_are_not_progressive(kind):
    found = inspect([np.ascontiguousarray(np.rot90(one)) for one in footage(kind, 40, **PAL)])
    assert (found.interlacing, found.layout) == (Interlacing.UNKNOWN, Layout(LayoutKind.TURNED))


def test_upright_progressive_pictures_are_progressive():
    found = inspect([np.ascontiguousarray(np.rot90(one)) for one in footage("progressive", 40, **PAL)])
    assert (found.interlacing, found.layout) == (Interlacing.PROGRESSIVE, None)


def test_large_pictures_with_large_targets_are_not_dark():
    found = inspect(list(footage("progressive", 8, **HD)))
    assert found.targets.diameter_px == pytest.approx(15.0, rel=0.2)
    assert found.split.column == pytest.approx(985, abs=35)


def test_where_nothing_moves_the_lines_do_not_tell():
    still = next(footage("progressive", 1, **PAL))
    noise = np.random.default_rng(1)
    shown = [np.clip(still + noise.normal(0, 2, still.shape), 0, 255).astype(np.uint8) for _ in range(40)]
    found = inspect(shown)
    assert found.interlacing is Interlacing.UNKNOWN
    assert found.targets is not None


def test_without_targets_nothing_is_made_up():
    noise = np.random.default_rng(2)
    dark = [noise.normal(20, 3, (480, 640)).clip(0, 255).astype(np.uint8) for _ in range(5)]
    found = inspect(dark)
    assert found.targets is None
    assert found.split is None


def test_a_single_view_is_not_split_with_certainty():
    found = inspect(list(footage("progressive", 10, **{**VGA, "split": 639})))
    assert not found.split.sure
    assert found.split.column == 320


def test_a_gap_that_leaves_most_targets_on_one_side_is_not_where_views_meet():
    left, right = [30, 54, 78, 102, 282, 306], range(340, 520, 24)  # some of the left view's are not lit
    picture = np.full((480, 640), 25, np.uint8)
    for x in (*left, *right):
        for y in range(60, 420, 24):
            cv2.circle(picture, (x, y), 3, 180, -1, cv2.LINE_AA)
    noise = np.random.default_rng(1).normal(0, 2, (4, *picture.shape))
    found = inspect(list(np.clip(cv2.GaussianBlur(picture, (0, 0), 0.7) + noise, 0, 255).astype(np.uint8)))
    assert (found.split.sure, found.split.column) == (False, 320)


def test_fields_of_a_known_parity_are_taken_as_they_are():
    fields = [Field.intact(frame[::2], TOP) for frame in footage("top_first", 10, **PAL)]
    found = inspect_fields(fields)
    assert (found.lines, found.interlacing) == (576, Interlacing.UNKNOWN)
    whole = [Field.progressive(frame) for frame in footage("progressive", 10, **VGA)]
    found = inspect_fields(whole)
    assert (found.lines, found.interlacing) == (480, Interlacing.PROGRESSIVE)
