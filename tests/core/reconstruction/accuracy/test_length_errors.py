import numpy as np
import pytest

from grabberd.core.reconstruction.accuracy import length_errors, measuring_lines
from grabberd.errors import MeasurementError

X, Y = np.meshgrid(np.arange(-4, 5) * 10.0, np.arange(-2, 3) * 8.0, indexing="ij")
PLACES = np.stack([X.ravel(), Y.ravel(), 2.0 * np.cos(X.ravel() * Y.ravel())], axis=1)
IDS = np.arange(100, 100 + len(PLACES), dtype=np.int32)


def lines_of(places):
    lines = measuring_lines(places)
    return lines, places[lines[:, -1]] - places[lines[:, 0]]


def test_there_are_seven_lines_of_five_lengths_between_different_targets():
    lines = measuring_lines(PLACES)
    assert lines.shape == (7, 6)
    assert all(len(set(line)) == 6 for line in lines.tolist())


def test_the_lengths_of_a_line_grow_in_about_equal_steps():
    for line in measuring_lines(PLACES):
        lengths = np.linalg.norm(PLACES[line[1:]] - PLACES[line[0]], axis=1)
        assert np.allclose(lengths / lengths[-1], np.arange(1, 6) / 5, atol=0.12)


def test_the_first_line_goes_through_the_whole_volume():
    _, along = lines_of(PLACES)
    assert (np.abs(along[0]) >= np.ptp(PLACES, axis=0) * (0.85, 0.85, 0.5)).all()


def test_the_lines_go_in_different_directions():
    _, along = lines_of(PLACES)
    unit = along / np.ptp(PLACES, axis=0)
    unit /= np.linalg.norm(unit, axis=1, keepdims=True)
    cosines = np.abs(unit @ unit.T)[np.triu_indices(7, 1)]
    assert cosines.max() < 0.9


def test_a_length_that_is_off_decides_the_verdict():
    true = np.tile(PLACES, (3, 1, 1))
    measured = true.copy()
    last = measuring_lines(PLACES)[0, -1]
    first = measuring_lines(PLACES)[0, 0]
    outwards = PLACES[last] - PLACES[first]
    measured[1, last] += 0.25 * outwards / np.linalg.norm(outwards)
    result = length_errors(IDS, measured, true, 0.2)
    assert result.greatest_mm == pytest.approx(0.25, abs=1e-6)
    assert not result.passed
    assert length_errors(IDS, measured, true, 0.3).passed
    assert result.measured == 3 * 35
    assert result.lines[0].targets[-1] == IDS[last]


def test_a_motion_as_a_whole_changes_no_length():
    true = np.tile(PLACES, (2, 1, 1))
    assert length_errors(IDS, true + np.array([3.0, -4.0, 5.0]), true, 0.2).greatest_mm == pytest.approx(
        0.0, abs=1e-9
    )


def test_a_wrong_scale_is_seen_in_full():
    true = PLACES[np.newaxis]
    result = length_errors(IDS, 1.01 * true, true, 0.2)
    longest = max(max(line.length_mm) for line in result.lines)
    assert result.greatest_mm == pytest.approx(0.01 * longest)


def test_targets_that_were_never_found_are_not_in_a_line():
    true = np.tile(PLACES, (2, 1, 1))
    measured = true.copy()
    measured[:, 0] = np.nan
    measured[0, 3] = np.nan
    used = {target for line in length_errors(IDS, measured, true, 0.2).lines for target in line.targets}
    assert IDS[0] not in used


def test_targets_that_were_never_found_together_give_no_verdict():
    true = np.tile(PLACES, (2, 1, 1))
    measured = true.copy()
    first, last = measuring_lines(PLACES)[0, [0, -1]]
    measured[0, first] = measured[1, last] = np.nan
    with pytest.raises(MeasurementError, match="never found together"):
        length_errors(IDS, measured, true, 0.2)


@pytest.mark.parametrize("places", [PLACES[:0], PLACES[:5], np.outer(np.arange(30.0), [1, 0, 0])])
def test_too_few_targets_are_refused(places):
    with pytest.raises(MeasurementError, match="7 are needed"):
        measuring_lines(places)
