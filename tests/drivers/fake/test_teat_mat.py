"""The simulated mat of pressure sensors, beside the truth of the wall that it lies under."""

import csv

import numpy as np
import pytest

from grabberd_fake.liner_options import LinerOptions
from grabberd_fake.teat_mat import CSV_HEADER, Mat, mat_lines
from grabberd_fake.wall_states import teat_load, wall_states

LINER, CLOSED_KPA = "reference-round", 34.0


def mat(of: Mat, wall: str = LINER, seed: int = 1) -> dict[str, np.ndarray]:
    lines = list(mat_lines(LinerOptions(wall=wall), CLOSED_KPA, of, seed))
    assert lines[0] == CSV_HEADER
    rows = list(csv.DictReader(lines))
    assert {row["above"] for row in rows} == {"liner"}
    return {name: np.array([float(row[name]) for row in rows]) for name in CSV_HEADER.split(",")[:-1]}


def test_cells_lie_side_by_side_from_the_teats_end_to_its_base() -> None:
    cells = mat(Mat(4.0, 0.5))
    assert np.unique(np.diff(np.unique(cells["along_mm"]))).tolist() == [4.0]
    assert cells["along_mm"].max() == -2
    width_mm = (
        np.deg2rad(np.diff(np.unique(cells["round_deg"]))) * wall_states(LINER).about["teat"]["radius_mm"]
    )
    assert width_mm == pytest.approx(np.full(len(width_mm), 4.0), abs=1e-3)
    assert set(cells["sigma_kpa"]) == {0.5}


def test_its_readings_are_the_walls_contact_pressure() -> None:
    cells = mat(Mat(2.0, 1e-6))
    true = teat_load(wall_states(LINER), CLOSED_KPA)
    assert 0.85 * true.peak_kpa < cells["pressure_kpa"].max() <= true.peak_kpa
    assert -12 < cells["along_mm"][cells["pressure_kpa"].argmax()] < -4


def test_a_mat_that_lies_turned_reads_less_on_that_side() -> None:
    straight, turned = (mat(Mat(4.0, 1e-6, degrees)) for degrees in (0.0, 15.0))
    side = np.sign(straight["round_deg"])
    assert abs((side * straight["pressure_kpa"]).sum()) < 0.02 * straight["pressure_kpa"].sum()
    assert (side * turned["pressure_kpa"]).sum() < -0.1 * straight["pressure_kpa"].sum()


def test_the_noise_is_of_its_sigma_and_anew_with_another_seed() -> None:
    noisy = [mat(Mat(4.0, 2.0), seed=seed)["pressure_kpa"] for seed in (1, 2)]
    assert np.std(np.subtract(*noisy)) == pytest.approx(2 * np.sqrt(2), rel=0.25)


@pytest.mark.parametrize(
    ("of", "wall", "why"),
    [
        (Mat(), "reference-empty", "no teat"),
        (Mat(noise_kpa=0.0), LINER, "--noise-kpa"),
        (Mat(cell_mm=0.0), LINER, "--cell-mm"),
    ],
)
def test_a_mat_that_cannot_be_is_refused(of: Mat, wall: str, why: str) -> None:
    with pytest.raises(ValueError, match=why):
        mat(of, wall)
