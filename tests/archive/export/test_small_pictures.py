"""A capture at a glance: a small picture of its middle, and few numbers of its wall's width."""

from pathlib import Path

import numpy as np
import pytest

from archive.captures import slots, write
from grabberd.archive.capture.reader import CaptureReader
from grabberd.archive.catalogue.capture_list import width_course
from grabberd.archive.export.field_pictures import smaller, thumbnail_png
from grabberd.errors import NotFound


def test_a_small_picture_has_a_quarter_of_a_frames_width_and_height(tmp_path: Path) -> None:
    path = write(tmp_path, slots(5), name="c")
    with CaptureReader(path) as reader:
        packed = reader.field(2).numbered.packed
    png = thumbnail_png(path)
    width, height = (int.from_bytes(png[at : at + 4], "big") for at in (16, 20))
    assert png.startswith(b"\x89PNG")
    assert (width, height) == (packed.columns // 4, packed.rows * packed.y_step // 4)


def test_a_white_disc_becomes_a_grey_one_and_is_not_passed_over() -> None:
    luma = np.zeros((8, 10), np.uint8)
    luma[1, 1] = 255
    small = smaller(luma, 2)
    assert small.shape == (4, 2)
    assert small[0, 0] == 255 // 8
    assert small.sum() == small[0, 0]


def test_a_capture_without_fields_has_no_picture(tmp_path: Path) -> None:
    path = write(tmp_path, [], name="empty")
    with pytest.raises(NotFound, match="no fields"):
        thumbnail_png(path)


def test_a_capture_without_points_has_no_widths(tmp_path: Path) -> None:
    assert width_course(write(tmp_path, slots(5), name="c")) == []
