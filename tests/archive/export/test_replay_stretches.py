"""Stretches of a capture for its replay, byte for byte as docs/reference/replay.md says."""

import struct

import cv2
import numpy as np
import pytest

from archive.captures import slot, slots, write
from grabberd.archive.capture.reader import CaptureReader
from grabberd.archive.export.page_documents import Stretch, replay_pictures, replay_points
from grabberd.core.field import unpack
from grabberd.core.ledger import Outcome
from grabberd.errors import CaptureFileError, NotFound


def read_points(message):
    """The fields of a message of points, by number: time, targets, places, residuals and images."""
    magic, version, size, first_n, fields, count, run = struct.unpack_from("<4sHHQIIQ", message)
    assert (magic, version, size) == (b"GRRP", 1, 32)
    at, columns = size, []
    for kind, number in (
        *(("<f8", fields), ("<u4", fields), ("<u4", fields), ("<u4", count)),
        *(("<f4", 3 * count), ("<f4", count), ("<f4", count), ("<f4", 4 * count)),
    ):
        columns.append(np.frombuffer(message, kind, number, at))
        at += columns[-1].nbytes
    assert at == len(message)
    time_s, n, counts, target, xyz, sigma, residual, image = columns
    ends = np.cumsum(counts)
    widths = zip((target, xyz, sigma, residual, image), (1, 3, 1, 1, 4), strict=True)
    parts = [np.split(one.reshape(-1, width), ends) for one, width in widths]
    return run, {int(first_n + k): (t, *rest) for k, t, *rest in zip(n, time_s, *parts, strict=False)}


def read_pictures(message):
    """The pictures of a message, by field: place in the frame, outcome, grey values."""
    magic, version, size, first_n, count, _ = struct.unpack_from("<4sHHQII", message)
    assert (magic, version, size) == (b"GRRF", 1, 24)
    found, at = {}, size + 16 * count
    for k in range(count):
        n, length, y0, y_step, outcome = struct.unpack_from("<IIHHBxxx", message, size + 16 * k)
        png = np.frombuffer(message, np.uint8, length, at)
        found[first_n + n] = (y0, y_step, outcome, cv2.imdecode(png, cv2.IMREAD_UNCHANGED))
        at += length
    assert at == len(message)
    return found


@pytest.fixture
def measured(tmp_path):
    """Sixty fields in several groups, of which the third is lost, and the points of the others."""
    taken = [*slots(2), slot(3, lost=1), *(slot(n) for n in range(4, 60))]
    return write(tmp_path, taken, measured=[one.n for one in taken], fields_a_commit=25)


def test_points_come_field_by_field_across_groups_as_they_are_in_the_file(measured):
    run, fields = read_points(replay_points(measured, None, Stretch(1, 55)))
    assert run == 1
    assert list(fields) == [1, *range(3, 55)]
    with CaptureReader(measured) as reader:
        begin_ns = reader.first_time_ns
        for n, time_ns, known in reader.timed_points(1, 1, 55):
            time_s, target, xyz, sigma, residual, image = fields[n]
            assert time_s == pytest.approx((time_ns - begin_ns) / 1e9)
            assert target[:, 0].tolist() == known.target.tolist()
            np.testing.assert_allclose(xyz, known.xyz_mm, rtol=1e-6)
            variance = np.trace(known.covariance_mm2, axis1=1, axis2=2)
            np.testing.assert_allclose(sigma[:, 0], np.sqrt(variance), rtol=1e-6)
            np.testing.assert_allclose(residual[:, 0], known.residual_px, rtol=1e-6)
            np.testing.assert_allclose(image, known.image_px.reshape(-1, 4), rtol=1e-6)


def test_beyond_the_capture_there_is_nothing(measured):
    assert read_points(replay_points(measured, 1, Stretch(500, 550))) == (1, {})
    assert read_pictures(replay_pictures(measured, Stretch(500, 550))) == {}


def test_a_run_that_is_not_there_is_named(measured):
    with pytest.raises(NotFound, match="no run 7"):
        replay_points(measured, 7, Stretch(0, 50))


def test_a_capture_that_was_not_measured_has_pictures_alone(tmp_path):
    path = write(tmp_path, slots(5))
    with pytest.raises(NotFound, match="no points"):
        replay_points(path, None, Stretch(0, 50))
    assert list(read_pictures(replay_pictures(path, Stretch(0, 50)))) == [0, 1, 2, 3, 4]


@pytest.mark.parametrize(("bits", "doubled"), [(1, True), (1, False), (8, False)])
def test_each_picture_says_where_it_lies_in_the_frame(tmp_path, bits, doubled):
    taken = slots(4, bits=bits, doubled=doubled)
    found = read_pictures(replay_pictures(write(tmp_path, taken), Stretch(1, 3)))
    assert list(found) == [1, 2]
    for one in taken[1:3]:
        packed = one.numbered.packed
        y0, y_step, outcome, luma = found[one.numbered.n]
        assert (y0, y_step, outcome) == (packed.y0, packed.y_step, 0)
        np.testing.assert_array_equal(luma, unpack(packed).luma)


def test_lost_fields_are_left_out_and_damaged_ones_are_told(tmp_path):
    taken = [slot(0), slot(4, lost=3), slot(5, Outcome.DAMAGED, "repeated")]
    found = read_pictures(replay_pictures(write(tmp_path, taken), Stretch(0, 50)))
    assert {n: outcome for n, (_, _, outcome, _) in found.items()} == {0: 0, 4: 0, 5: 1}


def test_a_file_that_is_gone_is_named(tmp_path):
    with pytest.raises(CaptureFileError):
        replay_pictures(tmp_path / "gone.grab", Stretch(0, 25))
