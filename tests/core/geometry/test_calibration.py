import json
from dataclasses import fields

import numpy as np
import pytest

from core.geometry.rigs import calibration
from grabberd.core.field import LARGEST_SIDE_PX
from grabberd.core.geometry import Calibration
from grabberd.core.geometry import calibration as calibration_module
from grabberd.core.geometry.calibration import image_model
from grabberd.errors import CalibrationMismatch, InputError

GLASS = {"thickness_mm": 3.0, "refractive_index": 1.52}


def covariance():
    root = np.random.default_rng(3).normal(size=(36, 36)) * 10.0 ** np.random.default_rng(4).uniform(
        -6, 0, (36, 1)
    )
    product = root @ root.T
    return (product + product.T) / 2


def document():
    return calibration(covariance=covariance()).to_document() | {"glass": GLASS, "details": {"note": "kept"}}


def put(holder, path, value):
    *way, last = path.split(".")
    for key in way:
        holder = holder[key]
    holder[last] = value


def test_a_document_gives_back_the_same_calibration_bit_for_bit():
    text = json.dumps(document())
    again = Calibration.from_document(json.loads(text))
    assert json.dumps(again.to_document()) == text
    assert np.array_equal(again.covariance, covariance())
    assert again.left == calibration().left
    assert again.details == {"note": "kept"}


def test_the_meaning_of_the_polynomials_is_stated_only_where_it_is_not_the_usual_one():
    usual = document()
    assert "polynomial" not in usual["views"]["left"]
    usual["views"]["right"]["polynomial"] = "correction"
    read = Calibration.from_document(usual)
    assert (read.left.polynomial, read.right.polynomial) == ("distortion", "correction")
    assert read.to_document()["views"] == usual["views"]


def test_a_calibration_that_was_not_adjusted_has_no_covariance_in_its_document():
    plain = calibration().to_document()
    assert plain["covariance"] is None
    assert not Calibration.from_document(plain).covariance.any()


def test_details_may_be_left_out():
    shorter = document()
    del shorter["details"], shorter["glass"], shorter["sigma0_px"]
    read = Calibration.from_document(shorter)
    assert read.details == {}
    assert read.glass is None
    assert read.sigma0_px is None


def test_every_field_of_a_calibration_is_in_its_document():
    views = dict.fromkeys(("left", "right", "local_fields"), "views")
    kept = {"columns": "image", "lines": "image", **views}
    assert {kept.get(f.name, f.name) for f in fields(Calibration)} | {"schema"} == set(document())


def test_the_details_say_what_the_images_were_taken_for():
    read = Calibration.from_document(document() | {"details": image_model((0.6, -0.9))})
    assert (read.disc_centres, read.local_correlation) == (True, (0.6, -0.9))
    assert read.to_document()["details"] == image_model((0.6, -0.9))


def test_a_calibration_of_before_was_made_of_the_pictures_middles():
    read = Calibration.from_document(document())
    assert (read.disc_centres, read.local_correlation) == (False, (0.0, 0.0))


@pytest.mark.parametrize(
    ("path", "value", "said"),
    [
        ("details.image_model", 1, "details.image_model: is 1, expected a mapping"),
        ("details.image_model", {"disc": 1}, "details.image_model.disc: unknown key"),
        ("details.image_model", {"disc_centres": 1}, "disc_centres: is 1, expected true or false"),
        ("details.image_model", {"local_correlation": [0.5]}, "expected 2 finite numbers"),
        ("details.image_model", {"local_correlation": [0.5, -1.0]}, "is not between -1 and 1"),
        ("schema", "grabberd/calibration/9", "schema: is 'grabberd/calibration/9'"),
        ("created_utc", "yesterday", "created_utc: is 'yesterday', expected a time in ISO 8601"),
        ("id", "", "id: is ''"),
        ("image.columns", 4097, "image.columns: is 4097, expected a whole number from 1 to 4096"),
        ("image.columns", 0, "image.columns: is 0, expected a whole number from 1"),
        ("image.depth", 8, "image.depth: unknown key"),
        ("colour", True, "colour: unknown key"),
        ("views.left.f_mm", float("nan"), "views.left.f_mm: is nan, expected a number above 0"),
        ("views.left.f_mm", None, "views.left.f_mm: is missing"),
        ("views.right.pixel_x_mm", -0.1, "views.right.pixel_x_mm: is -0.1, expected a number above 0"),
        ("views.right.x0_px", "360", "views.right.x0_px: is '360', expected a finite number"),
        ("views.right.x0_px", True, "views.right.x0_px: is True"),
        ("views.left.handedness", 0, "views.left.handedness: is 0, expected 1 or -1"),
        ("views.left.polynomial", "inverse", "views.left.polynomial: is 'inverse', expected 'distortion' or"),
        ("views.left.b", [0.0] * 8, "views.left.b: is [0.0"),
        ("views.left.first_column", 12.5, "views.left.first_column: is 12.5, expected a whole number"),
        ("views.middle", {}, "views.middle: unknown key"),
        ("views.left", 7, "views.left: is 7, expected a mapping"),
        ("covariance", [[1.0]], "covariance: is [[1.0]], expected 36 x 36 finite numbers"),
        ("covariance", "none", "covariance: is 'none'"),
        ("sigma0_px", "small", "sigma0_px: is 'small'"),
        ("glass", {"thickness_mm": 3.0}, "glass.refractive_index: is missing"),
        ("glass", {"thickness_mm": 0, "refractive_index": 1.5}, "glass.thickness_mm: is 0"),
        ("details", [], "details: is [], expected a mapping"),
    ],
)
def test_a_wrong_value_is_named_with_its_key(path, value, said):
    wrong = document()
    put(wrong, path, value)
    with pytest.raises(InputError) as caught:
        Calibration.from_document(wrong)
    assert said in caught.value.message
    assert caught.value.hint


def test_all_problems_are_named_at_once():
    wrong = document()
    put(wrong, "views.left.f_mm", 0)
    put(wrong, "image.lines", "many")
    with pytest.raises(InputError, match=r"image\.lines.*views\.left\.f_mm"):
        Calibration.from_document(wrong)


def test_a_covariance_that_is_none_is_refused():
    lopsided, negative = covariance(), covariance()
    lopsided[0, 1] *= 1.001
    negative[4, 4] *= -1
    huge, tiny = covariance(), covariance()
    huge[0, 1] = huge[1, 0] = 1e308
    tiny[0, 0] = tiny[1, 1] = 1e-320
    tiny[0, 1] = tiny[1, 0] = 1.0
    said_of = (
        (lopsided, "not symmetric"),
        (negative, "negative eigenvalue"),
        (huge, "36 x 36 finite numbers"),
    )
    for matrix, said in (*said_of, (tiny, "far beyond its variances")):
        with pytest.raises(InputError, match=said):
            Calibration.from_document(document() | {"covariance": matrix.tolist()})


def test_a_covariance_that_rounding_made_lopsided_is_read_as_symmetric():
    """Of parameters that are hardly told apart: inverting their normal equations costs many digits."""
    rounded = covariance()
    sigma = np.sqrt(np.diag(rounded))
    rounded[0, 1] += 5e-9 * sigma[0] * sigma[1]
    read = Calibration.from_document(document() | {"covariance": rounded.tolist()})
    assert np.array_equal(read.covariance, read.covariance.T)
    assert np.allclose(read.covariance, rounded, rtol=0, atol=1e-8 * sigma.max() ** 2)


@pytest.mark.parametrize(
    ("path", "value", "said"),
    [
        ("views.right.end_column", 721, "views.right: columns 360 to 721 do not lie inside"),
        ("views.left.first_column", 360, "views.left: columns 360 to 360"),
        ("views.right.first_column", 340, "left ends at column 360, right begins at 340"),
    ],
)
def test_views_that_do_not_share_the_picture_are_refused(path, value, said):
    wrong = document()
    put(wrong, path, value)
    with pytest.raises(InputError, match=said):
        Calibration.from_document(wrong)


def test_swapped_views_are_refused():
    swapped = document()
    swapped["views"] = {"left": swapped["views"]["right"], "right": swapped["views"]["left"]}
    with pytest.raises(InputError, match="overlap or are swapped"):
        Calibration.from_document(swapped)


def test_it_fits_its_own_pictures_and_glass():
    Calibration.from_document(document()).check_fits(720, 576, dict(GLASS))
    calibration().check_fits(720, 576, None)


@pytest.mark.parametrize(
    ("columns", "lines", "glass", "said"),
    [
        (640, 480, GLASS, "for pictures of 720 x 576, these are 640 x 480"),
        (720, 576, None, "through 3.0 mm of glass of index 1.52, but the rig is set up without glass"),
        (720, 576, GLASS | {"thickness_mm": 4.0}, "the rig is set up through 4.0 mm"),
    ],
)
def test_it_refuses_pictures_that_are_not_its_own(columns, lines, glass, said):
    with pytest.raises(CalibrationMismatch, match=said):
        Calibration.from_document(document()).check_fits(columns, lines, glass)


def test_a_picture_is_as_large_as_fields_may_be() -> None:
    assert calibration_module.LARGEST_SIDE_PX == LARGEST_SIDE_PX
