"""Whether fields follow one another in time as they are delivered."""

import numpy as np
import pytest

from grabberd.core.chain.field_order import check
from grabberd.core.field import BOTTOM, TOP, Field, quantise, unpack
from grabberd.core.reconstruction.field_order import Order
from grabberd_fake.options import FakeOptions
from grabberd_fake.world import World

FIELDS = 200


def seen(count=FIELDS, **options):
    """Fields of the simulated camera in the order of time, top first."""
    picture = {"stamp": False, **options.pop("picture", {})}
    world = World(FakeOptions.read({"scene": "ellipse", "picture": picture, **options}))
    fields = []
    for number in range(count):
        luma = np.empty((288, 720), np.uint8)
        world.picture(number, luma)
        fields.append(Field.intact(luma, number % 2))
    return fields


def exchanged(fields):
    """Of each frame the newer field first."""
    return [field for pair in zip(fields[1::2], fields[::2], strict=True) for field in pair]


def doubled(fields, noise=0.0):
    """Of each frame the top field, and a bottom field that is made of it."""
    random, made = np.random.default_rng(1), []
    for top in fields[::2]:
        below = np.vstack((top.luma[1:], top.luma[-1:])).astype(np.float32)
        bottom = (top.luma + below) / 2
        if noise:
            bottom += noise * random.standard_normal(below.shape, np.float32)
        made += [top, Field.intact(np.clip(np.rint(bottom), 0, 255).astype(np.uint8), BOTTOM)]
    return made


MOVEMENTS = {
    "liner": {},
    "slow": {"ellipse": {"period_s": 3.0}},
    "fast": {"ellipse": {"period_s": 0.5}},
    "little": {"ellipse": {"deflection_mm": 1.0}},
    "without rest": {"ellipse": {"opening": 0.5, "open": 0.0, "closing": 0.5}},
    "noise": {"picture": {"noise": 0.1}},
    "line jitter": {"picture": {"jitter_px": 0.5}},
}


@pytest.fixture(scope="module")
def liner():
    return seen(**MOVEMENTS["liner"])


@pytest.fixture(scope="module", params=MOVEMENTS)
def fields(request, liner):
    return liner if request.param == "liner" else seen(**MOVEMENTS[request.param])


@pytest.fixture(scope="module")
def finding(fields):
    return check(fields)


def test_fields_as_the_camera_takes_them_are_right(finding):
    assert finding.order is Order.RIGHT
    assert finding.fields == FIELDS
    assert abs(finding.top_to_bottom.value - finding.bottom_to_top.value) < 0.5


def test_fields_that_change_places_within_their_frames_are_reversed(fields):
    finding = check(exchanged(fields))
    assert finding.order is Order.REVERSED
    assert 6 < finding.top_to_bottom.value < 10
    assert -0.5 < finding.bottom_to_top.value < 2


@pytest.mark.parametrize("noise", [0.0, 4.0])
def test_a_field_that_is_made_of_the_other_is_of_the_same_instant(fields, noise):
    finding = check(doubled(fields, noise))
    assert finding.order is Order.SAME_INSTANT
    assert abs(finding.top_to_bottom.value) < 0.25
    assert abs(finding.bottom_to_top.value - 4) < 1


def test_it_does_not_matter_which_parity_is_first(fields):
    assert check(fields[1:]).order is Order.RIGHT
    assert check(exchanged(fields)[1:]).order is Order.REVERSED


def test_parities_named_the_wrong_way_round_change_nothing_of_the_order(liner):
    renamed = [Field.intact(field.luma, 1 - field.parity) for field in liner]
    assert check(renamed).order is Order.RIGHT


@pytest.mark.parametrize("scene", ["blank", "calibration_frame", "accuracy_object"])
def test_where_nothing_moves_nothing_is_said(scene):
    still = seen(100, scene=scene)
    for fields in (still, exchanged(still), doubled(still)):
        finding = check(fields)
        assert finding.order is Order.NO_MOVEMENT
        assert finding.top_to_bottom is None


def test_movement_that_hides_in_noise_leads_to_no_wrong_verdict():
    faint = seen(ellipse={"deflection_mm": 0.4}, picture={"noise": 0.05})
    assert check(faint).order in {Order.RIGHT, Order.UNCLEAR, Order.NO_MOVEMENT}
    assert check(exchanged(faint)).order in {Order.REVERSED, Order.UNCLEAR, Order.NO_MOVEMENT}


def test_movement_too_fast_to_follow_leads_to_no_wrong_verdict():
    fields = seen(ellipse={"period_s": 0.3, "deflection_mm": 8})
    assert check(exchanged(fields)).order in {Order.REVERSED, Order.UNCLEAR}


def test_lost_fields_are_passed_over(liner):
    assert check([field for n, field in enumerate(liner) if n % 23]).order is Order.RIGHT


@pytest.fixture(scope="module", params=["reference-round", "wide-empty"])
def pulsating(request):
    """Three pulsations of a solved wall: it closes within a few fields, and rests for most of a second."""
    return seen(150, scene="liner", liner={"wall": request.param})


@pytest.mark.parametrize("bits", [8, 1])
def test_a_liner_whose_movement_is_fast_and_rare_tells_it(pulsating, bits):
    packed = [unpack(quantise(field, bits, 60)) for field in pulsating]
    assert check(packed).order is Order.RIGHT
    assert check(exchanged(packed)).order is Order.REVERSED
    assert check(exchanged(packed)[1:]).order is Order.REVERSED


def test_a_liner_whose_bottom_field_is_made_of_the_top_one_is_of_one_instant(pulsating):
    assert check(doubled(pulsating)).order in {Order.SAME_INSTANT, Order.UNCLEAR}


def test_a_gap_between_closures_is_passed_over(pulsating):
    gap = [*pulsating[:40], None, *pulsating[53:]]
    assert check(gap).order is Order.RIGHT
    assert check(gap).fields == 137


@pytest.mark.parametrize("count", [0, 1, 5, 40])
def test_a_few_fields_are_not_enough(liner, count):
    finding = check(liner[:count])
    assert finding.order is Order.UNCLEAR
    assert finding.fields == count
    assert f"{count} fields" in finding.evidence


def test_nor_are_fields_of_one_parity(liner):
    tops = [field for field in liner if field.parity == TOP]
    assert check(tops).order is Order.UNCLEAR


def test_a_drivers_buffer_may_be_written_over_after_each_field(liner):
    buffer = np.empty((288, 720), np.uint8)

    def delivered():
        for field in liner:
            buffer[:] = field.luma
            yield Field.intact(buffer, field.parity)

    assert check(delivered()) == check(liner)


def test_the_evidence_is_a_sentence_with_both_numbers(finding):
    assert f"top to bottom {finding.top_to_bottom}" in finding.evidence
    assert f"bottom to top {finding.bottom_to_top}" in finding.evidence
