"""Truth of the liner's quantities, against its places, its load and its trapezoid, read in other ways."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from grabberd_fake import WallPlaces, truth_at, truth_of_liner
from grabberd_fake.liner_options import LinerOptions
from grabberd_fake.liner_truth import closed_liner_quantities, quantities_of
from grabberd_fake.wall_states import buckling_kpa, teat_load, touch_kpa, wall_states

CLOSED_NS = 900_000_000
MS = 1_000_000


def crest_mm(options: dict[str, object]) -> np.ndarray:
    """Height of the target that moves most, every millisecond of a period."""
    heights = np.array([truth_at(options, ms * MS).xyz_mm[:, 2] for ms in range(1000)])
    return heights[:, np.ptp(heights, axis=0).argmax()]


def test_the_wall_takes_so_long_from_a_tenth_to_nine_tenths_of_its_stroke() -> None:
    found = quantities_of(LinerOptions("wide-round"))
    places = [truth_at({"liner": {"wall": "wide-round"}}, ms * MS).xyz_mm.ravel() for ms in range(1000)]
    moved = np.array(places) - np.mean(places, axis=0)
    # The movement that explains most is the leading eigenvector of what the moments have in common.
    share = np.linalg.eigh(moved @ moved.T)[1][:, -1]
    share = share if share[400] > share[900] else -share
    share = (share - share.min()) / np.ptp(share)
    moving_s = np.count_nonzero((share > 0.1) & (share < 0.9)) / 1000
    assert found["liner_opening_s"] + found["liner_closing_s"] == pytest.approx(moving_s, abs=0.002)
    assert found["massage_time_s"] == pytest.approx(np.count_nonzero(share < 0.1) / 1000, abs=0.002)
    phases = ("liner_opening_s", "liner_open_s", "liner_closing_s", "massage_time_s")
    assert sum(found[name] for name in phases) == pytest.approx(1.0)
    assert found["wall_ratio"] == pytest.approx(found["liner_opening_s"] + found["liner_open_s"])


def test_the_wall_lags_by_the_same_whatever_the_period_begins_with() -> None:
    found = quantities_of(LinerOptions())
    halfway = np.diff(crest_mm({"liner": {"wall": "reference-round"}}))
    rise_s, fall_s = 0.06, 0.66  # the trapezoid is halfway up and down there
    assert abs(halfway.argmax() / 1000 - rise_s - found["opening_lag_s"]) < 0.02
    assert abs(halfway.argmin() / 1000 - fall_s - found["closing_lag_s"]) < 0.02


def test_the_vacuum_has_its_phases_by_thresholds_of_4_kpa() -> None:
    found = quantities_of(LinerOptions())
    kpa = np.array([truth_of_liner({}, ms * MS).pulsation_kpa for ms in range(1000)])
    assert found["phase_b_s"] == pytest.approx(np.count_nonzero(kpa >= 38) / 1000, abs=0.002)
    assert found["phase_d_s"] == pytest.approx(np.count_nonzero(kpa <= 4) / 1000, abs=0.002)
    assert found["pulsator_ratio"] == pytest.approx(found["phase_a_s"] + found["phase_b_s"])
    assert found["rate_per_min"] == 60


def test_compression_is_the_contact_pressure_over_the_arc() -> None:
    truth = truth_of_liner({}, CLOSED_NS, WallPlaces(np.arange(-55.0, 30.0), np.linspace(-0.8, 0.8, 33)))
    over_arc = truth.contact_kpa.reshape(-1, 33).mean(axis=1)
    found = closed_liner_quantities(LinerOptions(), [truth.rest_kpa])
    assert found["liner_compression_greatest_kpa"] == pytest.approx(over_arc.max(), abs=1.0)
    on_teat = truth.x_mm.reshape(-1, 33)[:, 0] < found["teat_end_x_mm"]
    assert found["liner_compression_mean_kpa"] == pytest.approx(over_arc[on_teat].mean(), abs=1.0)
    end = over_arc[np.argmin(np.abs(truth.x_mm.reshape(-1, 33)[:, 0] - found["teat_end_x_mm"]))]
    assert end == pytest.approx(over_arc.max() / 2, rel=0.2)


def test_the_load_is_that_of_the_teat_but_for_what_is_beyond_its_end_and_the_targets() -> None:
    whole = teat_load(wall_states("reference-round"), 42.0)
    found = closed_liner_quantities(LinerOptions(), [42.0])
    assert 0.85 * whole.force_n < found["teat_load_n"] < whole.force_n
    assert found["teat_load_peak_n_per_mm"] == pytest.approx(whole.peak_n_per_mm, rel=0.25)


def test_pressure_beyond_flow_stop_is_that_of_the_fullest_closure() -> None:
    options = LinerOptions()
    at_rest = closed_liner_quantities(options, [42.0])["liner_compression_teat_end_kpa"]
    found = quantities_of(options, 9.0)
    assert found["teat_end_beyond_flow_stop_kpa"] == pytest.approx(at_rest - 9.0, abs=0.5)
    assert not {name for name in quantities_of(options) if "flow" in name or "overpressure" in name}


def test_overpressure_is_the_difference_in_phase_d_less_that_at_flow_stop() -> None:
    options = LinerOptions()
    found = quantities_of(options, 9.0, 34.0)
    assert found["overpressure_derived_kpa"] == pytest.approx(42.0 - 34.0)
    flows = [truth_of_liner({}, ms * MS).difference_kpa < 34.0 for ms in range(1000)]
    assert found["flow_duration_s"] == pytest.approx(np.count_nonzero(flows) / 1000, abs=0.002)
    stop_kpa = found["flow_stop_map_kpa"]
    assert found["overpressure_map_kpa"] == pytest.approx(42.0 - stop_kpa)
    at_end = closed_liner_quantities(options, [stop_kpa])["liner_compression_teat_end_kpa"]
    assert at_end == pytest.approx(9.0, abs=2.5)


def test_compression_above_atmosphere_is_less_by_the_liner_s_vacuum() -> None:
    found = closed_liner_quantities(LinerOptions(), [42.0])
    for name in ("liner_compression_mean", "liner_compression_teat_end"):
        assert found[f"{name}_above_atmosphere_kpa"] == pytest.approx(found[f"{name}_kpa"] - 42.0)


def test_a_millimetre_is_that_of_the_target_that_moves_most() -> None:
    found = quantities_of(LinerOptions())
    places = np.array([truth_at({}, ms * MS).xyz_mm for ms in range(1000)])
    moved = (places - places.mean(axis=0)).reshape(1000, -1)
    share = np.linalg.eigh(moved @ moved.T)[1][:, -1]
    # How far each target goes with the movement that explains most.
    each_mm = np.linalg.norm((share @ moved / (share @ share)).reshape(-1, 3), axis=1).max() * share
    each_mm = each_mm if each_mm[400] > each_mm[900] else -each_mm
    moving = (each_mm > each_mm.min() + 1.0) & (each_mm < each_mm.max() - 1.0)
    times = found["liner_opening_1mm_s"] + found["liner_closing_1mm_s"]
    assert times == pytest.approx(np.count_nonzero(moving) / 1000, abs=0.003)
    words = ("opening", "open", "closing", "closed")
    assert sum(found[f"liner_{word}_1mm_s"] for word in words) == pytest.approx(1.0)


def test_an_empty_liner_has_its_own_values() -> None:
    states = wall_states("thin-empty")
    found = quantities_of(LinerOptions("thin-empty"))
    assert_allclose(list(found.values()), [touch_kpa(states), buckling_kpa(states), 2.4 * 2.0**3 / 9])


def test_a_teat_without_a_vacuum_has_none() -> None:
    options = LinerOptions(vacuum=LinerOptions().vacuum.__class__(system_kpa=0.0, liner_kpa=0.0))
    with pytest.raises(ValueError, match="system_kpa: 0 moves no liner"):
        quantities_of(options)
