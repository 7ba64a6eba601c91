import json
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.interpolate import make_interp_spline

from core.geometry.rigs import calibration
from grabberd.core.geometry import Calibration, LocalField, Rig
from grabberd.core.geometry.calibration import image_model
from grabberd.errors import InputError

STEP = 15.0
ORIGIN = (359.5, -0.5)
ROWS, COLUMNS = 40, 25
PLACES = st.tuples(st.floats(0, 1), st.floats(0, 1)).map(
    lambda share: np.array(
        [[ORIGIN[0] + share[0] * (COLUMNS - 1) * STEP, -0.5 + share[1] * (ROWS - 1) * STEP]]
    )
)


def nodes():
    x, y = np.meshgrid(ORIGIN[0] + STEP * np.arange(COLUMNS), ORIGIN[1] + STEP * np.arange(ROWS))
    return np.column_stack([x.ravel(), y.ravel()])


def field_of(function, sigma=0.02):
    values = function(nodes()).reshape(ROWS, COLUMNS, 2)
    return LocalField.through(ORIGIN, STEP, values, np.full(values.shape, sigma))


def wave(xy_px, length_px=60.0):
    turns = xy_px @ np.array([[0.8, -0.6], [0.6, 0.8]]) * (2 * np.pi / length_px)
    return 0.06 * np.cos(turns)


def uneven(seed=1):
    return np.random.default_rng(seed).normal(0, 0.06, (ROWS, COLUMNS, 2))


def plane(xy_px):
    return xy_px @ np.array([[2e-4, -1e-4], [3e-4, 5e-4]]) + (0.01, -0.03)


def test_it_goes_through_its_nodes():
    values = uneven()
    found = LocalField.through(ORIGIN, STEP, values, np.ones_like(values)).at(nodes())
    assert found == pytest.approx(values.reshape(-1, 2), abs=1e-8)


@given(PLACES)
def test_a_plane_stays_a_plane(place):
    assert field_of(plane).at(place) == pytest.approx(plane(place), abs=1e-9)


@given(PLACES)
def test_it_is_the_natural_cubic_spline(place):
    values, (x, y) = uneven(), (place[0] - ORIGIN) / STEP
    along_y = make_interp_spline(np.arange(ROWS), values, bc_type="natural")(y)
    expected = make_interp_spline(np.arange(COLUMNS), along_y, bc_type="natural")(x)
    found = LocalField.through(ORIGIN, STEP, values, np.ones_like(values)).at(place)[0]
    assert found == pytest.approx(expected, abs=1e-8)


def test_four_nodes_a_wave_follow_it_to_two_per_cent():
    inner = np.random.default_rng(2).uniform((400, 40), (690, 540), (500, 2))
    error = field_of(wave).at(inner) - wave(inner)
    assert np.sqrt((error**2).mean()) < 0.02 * 0.06


def test_beyond_the_half_its_edge_stands():
    field = LocalField.through(ORIGIN, STEP, uneven(), np.ones((ROWS, COLUMNS, 2)))
    outside = np.array([[300.0, 100.0], [400.0, -50.0], [900.0, 900.0]])
    edge = np.array([[359.5, 100.0], [400.0, -0.5], [719.5, 584.5]])
    assert field.at(outside) == pytest.approx(field.at(edge), abs=1e-8)


def test_sigma_lies_between_those_of_the_nodes_around():
    sigma = np.random.default_rng(3).uniform(0.01, 0.09, (ROWS, COLUMNS, 2))
    field = LocalField.through(ORIGIN, STEP, uneven(), sigma)
    found = field.sigma_at(np.random.default_rng(4).uniform((360, 0), (719, 575), (200, 2)))
    assert found.min() >= 0.01
    assert found.max() <= 0.09


def test_no_places_have_no_displacements():
    assert field_of(plane).at(np.empty((0, 2))).shape == (0, 2)


def document_with_a_field():
    known = replace(calibration(), local_fields=(None, field_of(wave)))
    return json.loads(json.dumps(known.to_document()))


def test_a_calibration_keeps_its_local_fields_bit_for_bit():
    again = Calibration.from_document(document_with_a_field())
    assert again.to_document() == document_with_a_field()
    assert again.local_fields[0] is None
    assert np.array_equal(again.local_fields[1].shift_px, field_of(wave).shift_px)
    assert np.array_equal(again.local_fields[1].sigma_px, field_of(wave).sigma_px)


def test_a_document_without_the_key_has_no_local_field():
    document = calibration().to_document()
    for view in document["views"].values():
        del view["local_field"]
    assert Calibration.from_document(document).local_fields == (None, None)


@pytest.mark.parametrize(
    ("key", "value", "said"),
    [
        ("step_px", 0, "views.right.local_field.step_px: is 0, expected a number above 0"),
        ("origin_px", [1.0], "views.right.local_field.origin_px: is [1.0], expected 2 finite numbers"),
        ("x_px", [[0.0] * 3] * 3, "views.right.local_field.x_px: is [[0.0, 0.0, 0.0]"),
        ("x_px", 7, "views.right.local_field.x_px: is 7, expected at least 4 rows of 4 numbers"),
        ("y_px", [[0.0] * 4] * 4, "expected 42 x 27 finite numbers"),
        ("y_px", None, "views.right.local_field.y_px: is None"),
        ("sigma_x_px", [[-1.0] * 27] * 42, "a standard deviation is below 0"),
        ("wave", 1, "views.right.local_field.wave: unknown key"),
    ],
)
def test_a_local_field_that_cannot_be_is_refused_by_name(key, value, said):
    document = document_with_a_field()
    document["views"]["right"]["local_field"][key] = value
    with pytest.raises(InputError) as refused:
        Calibration.from_document(document)
    assert said in str(refused.value)


def test_a_local_field_is_a_mapping():
    document = document_with_a_field()
    document["views"]["left"]["local_field"] = 3
    with pytest.raises(InputError, match=r"views\.left\.local_field: is 3, expected a mapping"):
        Calibration.from_document(document)


def test_a_rig_knows_the_sigma_of_the_views_that_have_a_field():
    rig = Rig.of(replace(calibration(), local_fields=(None, field_of(wave, sigma=0.03))))
    sigma = rig.local_sigma_px(np.full((2, 2, 5), 400.0))
    assert not sigma[:, 0].any()
    assert sigma[:, 1] == pytest.approx(0.03)


def test_errors_of_both_fields_correlate_as_stated():
    both = field_of(wave, sigma=0.03), field_of(wave, sigma=0.02)
    known = replace(calibration(), local_fields=both, details=image_model((0.6, -0.8)))
    errors = Rig.of(known).local_errors_px(np.full((2, 2, 1), 400.0))[..., 0].reshape(4, 4)
    x, y = (errors @ errors.T)[:2, :2], (errors @ errors.T)[2:, 2:]
    assert x == pytest.approx(np.array([[9e-4, 0.6 * 6e-4], [0.6 * 6e-4, 4e-4]]))
    assert y == pytest.approx(np.array([[9e-4, -0.8 * 6e-4], [-0.8 * 6e-4, 4e-4]]))
    assert not (errors[:2] @ errors[2:].T).any()


def test_a_rig_without_fields_says_so():
    assert Rig.of(calibration()).local_sigma_px(np.zeros((2, 2, 5))) is None
    assert Rig.of(calibration()).local_errors_px(np.zeros((2, 2, 5))) is None
