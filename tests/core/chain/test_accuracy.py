"""The accuracy investigation on fields of the simulated grabber, against its truth."""

import numpy as np
import pytest

from core.chain.fake_scene import take_scene
from grabberd.core.chain.accuracy import InvestigationSettings, investigate, requantised
from grabberd.core.chain.measure import measure_fields
from grabberd.core.field import BOTTOM, TOP, Field, NumberedField, double_lines, quantise, unpack
from grabberd.core.reconstruction.accuracy import Truth
from grabberd.errors import InputError, MeasurementError

PERFECT_MIRRORS = {"mirror_error_px": 0.0}


@pytest.fixture(scope="module")
def at_rest():
    return take_scene(32, scene="accuracy_object", rig=PERFECT_MIRRORS)


@pytest.fixture(scope="module")
def pulsating():
    return take_scene(60, scene="ellipse", rig=PERFECT_MIRRORS)


def investigated(scene, bits, lines, **settings):
    points = ((one.n, one.time_ns, one.points) for one in scene.measured(bits, lines))
    return investigate(points, scene.truth, InvestigationSettings(bits=bits, **settings))


@pytest.mark.slow
@pytest.mark.parametrize("bits", [1, 8])
@pytest.mark.parametrize("scene", ["at_rest", "pulsating"])
def test_the_smoothed_points_have_the_sigma_that_they_are_given(scene, bits, request):
    result = investigated(request.getfixturevalue(scene), bits, "doubled" if bits == 1 else "field")
    assert 0.65 < np.sqrt(result.smoothed.chi2) < 1.25


@pytest.mark.slow
def test_smoothing_betters_every_axis_at_rest_and_in_movement(at_rest, pulsating):
    for scene in (at_rest, pulsating):
        for bits, lines in ((1, "doubled"), (8, "field")):
            result = investigated(scene, bits, lines)
            better = np.array(result.smoothed.accuracy.rmse) / np.array(result.single.accuracy.rmse)
            assert (better < 0.85).all()


def test_at_one_bit_32_fields_at_rest_are_not_32_times_as_good(at_rest):
    result = investigated(at_rest, 1, "doubled")
    white = 32**-0.5
    assert result.smoothed.accuracy.rmse.xyz_mm > 1.15 * white * result.single.accuracy.rmse.xyz_mm
    assert result.smoothed.sigma.xyz_mm > 1.5 * white * result.single.sigma.xyz_mm


def test_eight_bits_at_rest_reach_hundredths_of_a_millimetre(at_rest):
    assert investigated(at_rest, 8, "field").smoothed.accuracy.rmse.xyz_mm < 0.02


def test_the_object_at_rest_has_a_pointing_precision_and_a_verdict(at_rest):
    result = investigated(at_rest, 1, "doubled")
    x, y = result.pointing.both_px
    assert 0.03 < x < 0.170
    assert 0.03 < y < 0.225
    assert result.pointing.targets == 60
    assert result.single.lengths.passed
    assert abs(result.smoothed.lengths.greatest_mm) < abs(result.single.lengths.greatest_mm)


def test_a_moving_object_has_neither_pointing_precision_nor_repeatability(pulsating):
    result = investigated(pulsating, 1, "doubled")
    assert result.pointing is None
    assert result.single.accuracy.precision is None


def test_a_fit_is_made_for_single_and_smoothed_points_alike(at_rest):
    result = investigated(at_rest, 8, "field", fit=True)
    for compared in (result.single, result.smoothed):
        assert compared.accuracy.fitted.angle_deg < 0.05
        assert np.abs(compared.accuracy.fitted.shift_mm).max() < 0.05


def test_where_there_are_too_few_targets_it_says_why_there_is_no_verdict(at_rest):
    few = at_rest.truth.target <= 5
    truth = Truth(*(getattr(at_rest.truth, name)[few] for name in Truth.__slots__))
    points = [(one.n, one.time_ns, one.points) for one in at_rest.measured(8, "field")]
    result = investigate(points, truth, InvestigationSettings(bits=8))
    assert result.single.lengths is None
    assert "7 are needed" in result.single.no_lengths


def test_without_any_point_nothing_is_made_up(at_rest):
    with pytest.raises(MeasurementError, match="no point in 0 fields"):
        investigate([], at_rest.truth, InvestigationSettings())


GREY = Field.intact(np.random.default_rng(1).integers(0, 256, (20, 32), dtype=np.uint8), TOP)


def eight_bits(field=GREY, n=4):
    return NumberedField(n, 1000, 7, quantise(field, 8, 100))


@pytest.mark.parametrize("bits", [1, 2, 3, 4, 5, 6, 8])
@pytest.mark.parametrize("doubled", [True, False])
def test_an_8_bit_field_quantised_anew_is_as_if_taken_so(bits, doubled, at_rest):
    _, field = at_rest.fields[0]
    (again,) = requantised([eight_bits(field)], bits, doubled=doubled)
    taken = quantise(double_lines(field) if doubled else field, bits, again.packed.threshold)
    assert np.array_equal(again.packed.data, taken.data)
    assert (again.packed.bits, again.packed.y0, again.packed.y_step) == (bits, taken.y0, taken.y_step)
    assert (again.n, again.time_ns, again.sequence) == (4, 1000, 7)


def test_seven_bits_are_kept_in_eight_with_every_level_in_its_middle(at_rest):
    _, field = at_rest.fields[0]
    (again,) = requantised([eight_bits(field)], 7, doubled=False)
    assert np.array_equal(unpack(again.packed).luma, field.luma // 2 * 2 + 1)


def test_the_threshold_is_chosen_once_and_for_the_bits(at_rest):
    fields = [eight_bits(field, n) for n, (_, field) in enumerate(at_rest.fields[:3])]
    one, eight = (list(requantised(fields, bits, doubled=False)) for bits in (1, 8))
    assert len({each.packed.threshold for each in one}) == 1
    assert eight[0].packed.threshold < one[0].packed.threshold


@pytest.mark.parametrize(("bits", "doubled"), [(1, False), (6, False), (8, True)])
def test_fields_of_fewer_bits_or_doubled_lines_cannot_be_quantised_anew(bits, doubled):
    field = double_lines(GREY) if doubled else GREY
    taken = NumberedField(0, 0, 0, quantise(field, bits, 100))
    with pytest.raises(InputError, match="cannot be requantised") as refusal:
        list(requantised([taken], 1, doubled=False))
    assert "--bits 8" in refusal.value.hint


@pytest.mark.slow
def test_more_bits_are_better_up_to_five(at_rest):
    raw = [eight_bits(field, n) for n, (_, field) in enumerate(at_rest.fields[:12])]
    fields = [one._replace(time_ns=time_ns) for one, (time_ns, _) in zip(raw, at_rest.fields, strict=False)]
    rmse = {}
    for bits in (1, 3, 5, 7, 8):
        measured = measure_fields(requantised(fields, bits, doubled=False), at_rest.setup)
        points = ((one.n, one.time_ns, one.points) for one in measured)
        result = investigate(points, at_rest.truth, InvestigationSettings(bits=bits))
        rmse[bits] = result.single.accuracy.rmse.xyz_mm
    assert rmse[1] > 1.5 * rmse[3] > 1.5 * rmse[5]
    assert rmse[5] < 1.15 * rmse[8]
    assert rmse[7] < 1.05 * rmse[8]


def test_parities_alternate_in_what_the_simulator_delivers(at_rest):
    assert [field.parity for _, field in at_rest.fields[:4]] in ([TOP, BOTTOM] * 2, [BOTTOM, TOP] * 2)
