"""Truth of the liner, against its own places and the balance of forces."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from grabberd_fake import WallPlaces, truth_at, truth_of_liner

OPEN_NS, CLOSING_NS, CLOSED_NS = 400_000_000, 655_000_000, 900_000_000
ROUND = {"liner": {"wall": "reference-round"}}
FINE = WallPlaces(np.linspace(-50, 50, 401), np.linspace(-1.5, 1.5, 301))
AROUND = WallPlaces(np.linspace(-60, 60, 25), np.linspace(-np.pi, np.pi, 73))


def test_targets_are_those_of_the_picture() -> None:
    for options in (ROUND, {"liner": {"target_thickness_mm": 0.3, "patch_x_mm": 2.0}}):
        truth = truth_of_liner(options, CLOSING_NS)
        shown = truth_at(options, CLOSING_NS)
        assert truth.ids.tolist() == shown.ids.tolist()
        assert_allclose(truth.target_mm, shown.xyz_mm, atol=1e-9)
        assert_allclose(truth.normal, shown.normals, atol=1e-9)


def test_bases_are_orthonormal_and_lie_in_the_face() -> None:
    truth = truth_of_liner(ROUND, CLOSED_NS)
    frame = np.concatenate([truth.basis, truth.normal[:, np.newaxis]], axis=1)
    assert_allclose(frame @ np.swapaxes(frame, 1, 2), np.tile(np.eye(3), (len(frame), 1, 1)), atol=1e-12)
    assert np.linalg.det(frame) == pytest.approx(1.0)


def test_open_liner_is_unstrained_and_shut_off_from_nothing_but_its_teat() -> None:
    truth = truth_of_liner(ROUND, OPEN_NS)
    assert (truth.difference_kpa, truth.rest_kpa) == (0, 0)
    assert (truth.pulsation_kpa, truth.liner_kpa) == (42, 42)
    assert_allclose(truth.strain, 0, atol=1e-12)
    assert truth.contact_kpa.max() < 1


@pytest.mark.parametrize("reference_ns", [None, CLOSING_NS])
def test_strain_is_that_of_small_distances_on_the_face(reference_ns: int | None) -> None:
    truth = truth_of_liner(ROUND, CLOSED_NS, FINE, reference_ns)
    before_ns = OPEN_NS if reference_ns is None else reference_ns
    before = truth_of_liner(ROUND, before_ns, FINE).face_mm.reshape(401, 301, 3)
    after = truth.face_mm.reshape(401, 301, 3)
    strain = truth.strain.reshape(401, 301, 2, 2)
    lengths = [np.linalg.norm(np.diff(face, axis=0), axis=-1) for face in (before, after)]
    along = ((lengths[1] / lengths[0]) ** 2 - 1) / 2
    told = (strain[1:, :, 0, 0] + strain[:-1, :, 0, 0]) / 2
    # At the elements' borders strain jumps.
    assert np.median(np.abs(along - told)) < 1e-4
    areas = [
        np.linalg.norm(np.cross(np.gradient(f, axis=0), np.gradient(f, axis=1)), axis=-1)
        for f in (before, after)
    ]
    told_area = np.sqrt(np.linalg.det(np.eye(2) + 2 * strain))
    assert np.median(np.abs(areas[1] / areas[0] - told_area)[1:-1, 1:-1]) < 1e-4


def test_opposite_sides_and_both_flanks_are_alike() -> None:
    truth = truth_of_liner(ROUND, CLOSED_NS, AROUND)
    contact = truth.contact_kpa.reshape(25, 73)
    assert_allclose(contact, contact[:, ::-1], atol=1e-9)
    assert_allclose(contact[:, :36], contact[:, 36:72], atol=20)
    y = truth.face_mm.reshape(25, 73, 3)[..., 1]
    assert_allclose(y, -y[:, ::-1], atol=1e-9)


def test_load_per_height_is_the_contact_pressure_over_the_wall_that_faces_the_cameras() -> None:
    half = WallPlaces(np.linspace(-64.9, 64.9, 521), np.linspace(-np.pi / 2, np.pi / 2, 361))
    truth = truth_of_liner(ROUND, CLOSED_NS, half)
    contact, face = (v.reshape(521, 361, -1) for v in (truth.contact_kpa, truth.face_mm))
    # Only the outer face is known: the wall between is as thick as ever to a few per cent.
    inner = face - 2.5 * truth.normal.reshape(521, 361, 3)
    width_mm = np.diff(inner[..., 1], axis=1)
    per_mm = ((contact[:, 1:, 0] + contact[:, :-1, 0]) / 2 * width_mm).sum(axis=1) / 1000
    told = np.interp(face[:, 180, 0], truth.load_x_mm, truth.load_n_per_mm)
    assert np.abs(per_mm - told)[40:-40].mean() < 0.06 * told.max()


def test_teat_bears_part_of_the_load_and_the_opposite_wall_the_rest() -> None:
    truth = truth_of_liner(ROUND, CLOSED_NS)
    assert truth.teat is not None
    assert 10 < truth.teat.force_n < truth.load_n
    empty = truth_of_liner({"liner": {"wall": "reference-empty"}}, CLOSED_NS)
    assert empty.teat is None
    assert empty.load_n > 10


def test_only_the_liner_has_this_truth() -> None:
    with pytest.raises(ValueError, match="'ellipse' is not the solved wall"):
        truth_of_liner({"scene": "ellipse"}, 0)
