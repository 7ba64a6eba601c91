"""A liner's own quantities, read from its table."""

import pytest

from grabberd_fake.wall_states import buckling_kpa, teat_load, touch_kpa, wall_states


def test_walls_meet_after_the_liner_has_buckled_and_press_each_other_from_then_on() -> None:
    empty = wall_states("reference-empty")
    touch = touch_kpa(empty)
    assert buckling_kpa(empty) < touch
    assert empty.contact_kpa(touch - 0.5).max() == 0
    assert empty.contact_kpa(touch + 1.5).max() > 1


def test_thinner_wall_buckles_and_closes_earlier() -> None:
    thin, reference = wall_states("thin-empty"), wall_states("reference-empty")
    assert buckling_kpa(thin) < buckling_kpa(reference)
    assert touch_kpa(thin) < touch_kpa(reference)


def test_load_grows_with_the_pressure_difference() -> None:
    loads = [teat_load(wall_states("reference-round"), kpa) for kpa in (0.0, 20.0, 42.0)]
    for name in ("mean_kpa", "peak_kpa", "peak_n_per_mm", "force_n"):
        values = [getattr(load, name) for load in loads]
        assert values == sorted(values)
    assert loads[-1].mean_kpa < loads[-1].peak_kpa


def test_force_is_the_load_per_height_times_the_height_it_acts_on() -> None:
    round_ = wall_states("reference-round")
    load = teat_load(round_, 42.0)
    height_mm = round_.about["teat"]["end_x_mm"] - round_.x_mm[0]
    assert load.force_n < load.peak_n_per_mm * height_mm


@pytest.mark.parametrize("quantity", [touch_kpa, buckling_kpa])
def test_touch_and_buckling_belong_to_the_empty_liner(quantity) -> None:
    with pytest.raises(ValueError, match="reference-round has a teat: choose the empty liner"):
        quantity(wall_states("reference-round"))


def test_empty_liner_has_no_teat_load() -> None:
    with pytest.raises(ValueError, match="reference-empty has no teat"):
        teat_load(wall_states("reference-empty"), 42.0)
