"""The pressure over the teat's surface, on a wall that was solved as a solid, and beside a simulated mat."""

import numpy as np
import pytest

from grabberd_fake.liner_options import LinerOptions
from grabberd_fake.teat_mat import Mat, mat_lines
from grabberd_liner.analysis.agreement import agreement
from grabberd_liner.analysis.estimate import Estimate, Joint
from grabberd_liner.analysis.load.pressure import ChamberVacuum, PressureModel
from grabberd_liner.analysis.load.teat_map import TeatMap
from grabberd_liner.analysis.other_method import Offsets, overlay, read_record
from liner.analysis.walls import solved

LINER, CLOSED_KPA, LINER_KPA = "reference-round", 34.0, 42.0
END_MM, TURNED_DEG = 15.0, 8.0


@pytest.fixture(scope="module")
def teat() -> TeatMap:
    liner = solved(LINER)
    reference = liner.points(0.0, 1, np.full(3, 0.005))
    model = PressureModel(liner.grid, liner.zones(), reference, 1.0)
    vacuum = ChamberVacuum(LINER_KPA - CLOSED_KPA, LINER_KPA, 0.35, 0.35)
    settled = model.settled(liner.points(CLOSED_KPA, 2), vacuum)
    return model.over_teat(settled, model.of_settled(settled, np.ones(len(liner.grid), bool), vacuum))


def mat(seed: int):
    return read_record(
        "\n".join(mat_lines(LinerOptions(wall=LINER), CLOSED_KPA, Mat(5.0, 1.0, TURNED_DEG), seed))
    )


def test_it_reaches_to_the_teats_end_and_not_to_walls_that_meet(teat: TeatMap) -> None:
    low, high = teat.reach
    assert low[0] < -50
    assert END_MM - 7 < high[0] < END_MM + 2


def test_places_are_present_ones_on_a_teat_narrower_than_the_liner(teat: TeatMap) -> None:
    assert 7 < teat.radius_mm < 9.8
    beside = teat.round_deg[teat.supported]
    mounted_deg = np.rad2deg(np.abs(solved(LINER).theta).max())
    assert np.abs(beside).max() > mounted_deg + 5


def test_a_mat_on_the_solved_teat_is_registered_and_agrees(teat: TeatMap) -> None:
    found = overlay(teat, mat(3), Offsets(None, None))
    for offset, true in zip(found.offsets, (END_MM, TURNED_DEG), strict=True):
        assert abs(float(offset.value) - true) < 2.5 * float(offset.sigma)
    assert float(found.offsets[0].sigma) < 1
    result = agreement(found.difference_kpa, found.map_kpa, found.other_kpa, found.chi2, found.dof)
    assert abs(result.bias.value) < 2 * result.bias.sigma
    assert result.sd < 1.5 * result.expected_sd
    assert abs(result.slope.value) < 2 * result.slope.sigma


def test_a_mat_that_reads_too_much_is_found_out(teat: TeatMap) -> None:
    true = mat(3)
    found = overlay(teat, true._replace(pressure_kpa=1.4 * true.pressure_kpa + 5), Offsets(None, None))
    result = agreement(found.difference_kpa, found.map_kpa, found.other_kpa, found.chi2, found.dof)
    assert result.p < 1e-3
    assert result.bias.value < -2.5 * result.bias.sigma
    assert result.slope.value < -2 * result.slope.sigma


def flat_map(supported: np.ndarray | None = None) -> TeatMap:
    """A pressure that grows evenly along and round."""
    x_mm, round_deg = (one.ravel() for one in np.meshgrid(np.arange(0.0, 21, 2), np.arange(-60.0, 61, 12)))
    value = 3 + 0.5 * x_mm + 0.1 * round_deg
    shown = np.ones(len(value), bool) if supported is None else supported(x_mm)
    return TeatMap(x_mm, round_deg, 9.0, Joint(value, np.eye(len(value))), shown)


def test_means_over_cells_of_what_is_linear_are_its_values_in_their_middles() -> None:
    teat = flat_map()
    x_mm, round_deg = np.array([5.3, 11.1, 14.0]), np.array([-20.0, 3.0, 31.0])
    for cell_mm in (0.0, 4.0):
        weights, inside = teat.weights(x_mm, round_deg, np.full(3, cell_mm))
        assert inside.all()
        assert weights @ teat.contact_kpa.value == pytest.approx(3 + 0.5 * x_mm + 0.1 * round_deg)
        assert weights.sum(axis=1) == pytest.approx(np.ones((3, 1)))


def test_larger_cells_are_better_known() -> None:
    teat = flat_map()
    sigma = [
        float(np.sqrt((weights @ weights.T).toarray()[0, 0]))
        for cell_mm in (0.0, 3.0, 8.0)
        for weights, _ in [teat.weights(np.array([10.0]), np.array([1.0]), np.array([cell_mm]))]
    ]
    assert sigma[0] > sigma[1] > sigma[2]


def test_what_is_not_supported_has_no_weight() -> None:
    teat = flat_map(lambda x_mm: x_mm < 9)
    weights, inside = teat.weights(np.array([4.0, 12.0, 40.0]), np.zeros(3), np.zeros(3))
    assert inside.tolist() == [True, False, False]
    assert weights[1:].sum() == 0


def test_an_offset_may_be_given(teat: TeatMap) -> None:
    given = Offsets(Estimate.of(END_MM, 0.3), Estimate.of(TURNED_DEG, 1.0))
    found = overlay(teat, mat(4), given)
    assert (found.offsets, found.estimated) == (tuple(given), [])
    assert found.dof == len(found.x_mm) - 1
