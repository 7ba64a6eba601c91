"""Another method's pressures laid over a map: read, registered by a known shift, refused with the reason."""

from dataclasses import replace

import numpy as np
import pytest

from grabberd.errors import AnalysisError, InputError
from grabberd_liner.analysis.agreement import agreement
from grabberd_liner.analysis.estimate import Estimate, Joint
from grabberd_liner.analysis.load.teat_map import TeatMap
from grabberd_liner.analysis.other_method import Offsets, Record, overlay, read_record

RADIUS_MM = 9.0
SHIFT_MM, TURN_DEG = 15.0, 8.0
GIVEN = Offsets(Estimate.of(SHIFT_MM, 0.0), Estimate.of(TURN_DEG, 0.0))
NEITHER = Offsets(None, None)


def true_kpa(x_mm, round_deg):
    """A teat that is pressed most before its end, and less to its sides."""
    along = 8 + 40 * np.exp(-(((x_mm - 4) / 9) ** 2)) / (1 + np.exp((x_mm - 14) / 1.5))
    return along * (1 - (round_deg / 85) ** 2)


def teat_map(kpa=true_kpa, sigma_kpa=0.0, supported=lambda x_mm, round_deg: x_mm < 18):
    """A map whose errors neighbours share."""
    x_mm, round_deg = (
        one.ravel() for one in np.meshgrid(np.arange(-50.0, 21.0, 2), np.arange(-65.0, 66.0, 13))
    )
    places = np.column_stack([x_mm, np.deg2rad(round_deg) * RADIUS_MM])
    apart = ((places[:, None] - places) ** 2).sum(axis=2)
    covariance = sigma_kpa**2 * (np.exp(-0.5 * apart / 4.5**2) + 1e-6 * np.eye(len(x_mm))) + 1e-9 * np.eye(
        len(x_mm)
    )
    joint = Joint(kpa(x_mm, round_deg), covariance)
    return TeatMap(x_mm, round_deg, RADIUS_MM, joint, supported(x_mm, round_deg))


def drawn(teat, random):
    """A map that is wrong by a draw of its errors."""
    value, covariance = teat.contact_kpa
    error = np.linalg.cholesky(covariance) @ random.normal(size=len(value))
    return replace(teat, contact_kpa=Joint(value + error, covariance))


def record_of(teat, random):
    """What the other method would measure, were the truth a draw from what the map allows."""
    places = record(random)
    weights, inside = teat.weights(places.along_mm + SHIFT_MM, places.round_deg + TURN_DEG, places.cell_mm)
    true = weights @ drawn(teat, random).contact_kpa.value
    measured = true + places.sigma_kpa * random.normal(size=len(true))
    return Record(*(one[inside] for one in places._replace(pressure_kpa=measured)[:-1]), "liner")


def record(random, sigma_kpa=1.0, cell_mm=0.0, kpa=true_kpa):
    """Places whose origin is shifted and turned, each the mean over its cell."""
    along, turned = (one.ravel() for one in np.meshgrid(np.arange(-50.0, 0, 4), np.arange(-45.0, 46, 15)))
    part = (np.arange(40) + 0.5) / 40 - 0.5
    beside_mm, beside_deg = np.meshgrid(part * cell_mm, np.rad2deg(part * cell_mm / RADIUS_MM))
    at = along[:, None] + SHIFT_MM + beside_mm.ravel(), turned[:, None] + TURN_DEG + beside_deg.ravel()
    measured = kpa(*at).mean(axis=1) + sigma_kpa * random.normal(size=len(along))
    return Record(
        along, turned, measured, np.full(len(along), sigma_kpa), np.full(len(along), cell_mm), "liner"
    )


def judged(found):
    return agreement(found.difference_kpa, found.map_kpa, found.other_kpa, found.chi2, found.dof)


def test_a_known_shift_and_turn_are_found() -> None:
    found = overlay(teat_map(), record(np.random.default_rng(1), 0.2), NEITHER)
    assert float(found.offsets[0].value) == pytest.approx(SHIFT_MM, abs=0.1)
    assert float(found.offsets[1].value) == pytest.approx(TURN_DEG, abs=0.7)
    assert found.estimated == [0, 1]


def test_offsets_are_found_wherever_a_difference_that_is_the_same_everywhere_lies() -> None:
    other = record(np.random.default_rng(1), 0.2)
    found = overlay(teat_map(), other._replace(pressure_kpa=other.pressure_kpa + 12), NEITHER)
    assert float(found.offsets[0].value) == pytest.approx(SHIFT_MM, abs=0.1)
    assert float(judged(found).bias.value) == pytest.approx(-12, abs=0.3)


def test_over_many_draws_the_errors_are_as_large_as_their_sigma() -> None:
    random, chi2, ratios, teat = np.random.default_rng(2), [], [], teat_map(sigma_kpa=3.0)
    for _ in range(60):
        found = overlay(teat, record_of(teat, random), GIVEN._replace(x_mm=None))
        bias = judged(found).bias
        chi2.append(found.chi2 / found.dof)
        # What the map errs by in its own places along the teat is no part of these draws.
        sigma_mm = np.sqrt(float(found.offsets[0].sigma) ** 2 - 0.5**2)
        ratios.append([(float(found.offsets[0].value) - SHIFT_MM) / sigma_mm, bias.value / bias.sigma])
    for squares in (chi2, *np.square(ratios).T):
        assert 0.7 < np.mean(squares) < 1.4


def test_the_sigma_of_a_given_offset_enters_where_pressures_are_steep() -> None:
    other = record(np.random.default_rng(3))
    sure, vague = (
        overlay(teat_map(), other, GIVEN._replace(x_mm=Estimate.of(SHIFT_MM, sigma))) for sigma in (0.0, 2.0)
    )
    more = vague.difference_kpa.estimate.sigma / sure.difference_kpa.estimate.sigma
    steep = np.abs(sure.x_mm - 13) < 3
    assert more[steep].mean() > 2 > more[np.abs(sure.x_mm + 25) < 10].mean()


def test_the_map_is_averaged_over_the_cells_of_the_other_method() -> None:
    other = record(np.random.default_rng(4), 0.2, cell_mm=8.0)
    averaged = overlay(teat_map(), other, GIVEN)
    points = overlay(teat_map(), other._replace(cell_mm=np.zeros_like(other.cell_mm)), GIVEN)
    inside = np.isin(points.x_mm * 1000 + points.round_deg, averaged.x_mm * 1000 + averaged.round_deg)
    assert np.std(averaged.difference_kpa.value) < 0.4 * np.std(points.difference_kpa.value[inside])


def test_a_cell_counts_only_if_all_of_it_is_supported() -> None:
    other = record(np.random.default_rng(5), cell_mm=10.0)
    teat = teat_map(supported=lambda x_mm, round_deg: x_mm < 0)
    found = overlay(teat, other, GIVEN)
    assert found.x_mm.max() <= -2 - 5
    assert found.inside.sum() == len(found.x_mm) < len(other.along_mm)


def test_places_beside_the_map_are_refused_with_both_reaches() -> None:
    with pytest.raises(AnalysisError, match=r"0 of 91 places .* x -50 to 16 mm .* reach from 150 to 198 mm"):
        overlay(teat_map(), record(np.random.default_rng(6)), GIVEN._replace(x_mm=Estimate.of(200, 0)))


@pytest.mark.parametrize("sigma_kpa", [0.0, 3.0])
def test_an_offset_that_uniform_pressures_do_not_determine_is_refused(sigma_kpa) -> None:
    random = np.random.default_rng(7)
    flat = lambda x_mm, round_deg: np.full(np.broadcast(x_mm, round_deg).shape, 20.0)  # noqa: E731
    teat = drawn(teat_map(flat, sigma_kpa), random)
    with pytest.raises(AnalysisError, match="do not determine the offset along") as refused:
        overlay(teat, record(random, kpa=flat), GIVEN._replace(x_mm=None))
    assert "along: {x_mm: …" in refused.value.hint


def test_a_pattern_round_the_teat_alone_does_not_determine_the_offset_along_it() -> None:
    random = np.random.default_rng(8)
    same = lambda x_mm, round_deg: true_kpa(4.0, round_deg + 0 * x_mm)  # noqa: E731
    with pytest.raises(AnalysisError, match="do not determine the offset along"):
        overlay(drawn(teat_map(same, 2.0), random), record(random, kpa=same), NEITHER)


def test_places_that_count_the_other_way_are_told() -> None:
    other = record(np.random.default_rng(9))
    with pytest.raises(AnalysisError, match="count the other way"):
        overlay(teat_map(), other._replace(along_mm=-other.along_mm), GIVEN._replace(x_mm=None))


ROWS = [f"{-5 * k},{10 * (k % 5) - 20},{20 + k},1.5,5,liner" for k in range(12)]
HEAD = "along_mm,round_deg,pressure_kpa,sigma_kpa,cell_mm,above"


def table(head=HEAD, rows=ROWS):
    return "\n".join([head, *rows])


def test_a_table_is_read_with_its_cells_and_what_its_pressures_are_above() -> None:
    found = read_record(table())
    assert (found.along_mm[1], found.round_deg[1], found.pressure_kpa[1]) == (-5, -10, 21)
    assert (found.sigma_kpa[1], found.cell_mm[1], found.above) == (1.5, 5, "liner")


def test_units_may_stand_in_brackets_and_cells_and_reference_may_lack() -> None:
    rows = [";".join(row.split(",")[:4]).replace(".", ",") for row in ROWS]
    found = read_record(table("along [mm];round [deg];pressure [kPa];sigma [kPa]", rows))
    assert (found.sigma_kpa[0], found.cell_mm[0], found.above) == (1.5, 0, "")


@pytest.mark.parametrize(
    ("head", "rows", "why"),
    [
        (HEAD.replace("sigma_kpa", "error"), ROWS, "has no column sigma_kpa"),
        (HEAD.replace("pressure_kpa", "pressure [mmHg]"), ROWS, "has no column pressure_kpa"),
        (HEAD.replace("round_deg", "round [rad]"), ROWS, "has no column round_deg"),
        (HEAD, [row.replace(",1.5,", ",0,") for row in ROWS], "sigma_kpa has to be above 0"),
        (HEAD, [row.replace(",1.5", "00,1.5") for row in ROWS], "pressure_kpa is up to .* another unit"),
        (HEAD, [f"9{row}" for row in ROWS], "along_mm"),
        (HEAD, ROWS[:9], "9 places, expected 10 to 1000"),
        (HEAD, [*ROWS[:-1], ROWS[-1].replace("liner", "atmosphere")], "'atmosphere', 'liner'"),
        (HEAD, [*ROWS[:-1], ROWS[-1].replace("1.5", "often")], "line 13: sigma_kpa is 'often'"),
    ],
)
def test_a_wrong_table_is_refused_with_its_cause(head, rows, why) -> None:
    with pytest.raises(InputError, match=why) as refused:
        read_record(table(head, rows))
    assert refused.value.hint
