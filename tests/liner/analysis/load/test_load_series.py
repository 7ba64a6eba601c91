"""The load in state after state: from what is known nearby, or from the open wall."""

import numpy as np
import pytest

from grabberd.errors import AnalysisError
from grabberd_liner.analysis.load import pressure
from grabberd_liner.analysis.load.load_fit import NEAR_MM, fit_load
from grabberd_liner.analysis.load.pressure import EXACT_MM
from grabberd_liner.analysis.load.wall_model import USUAL, Difference
from liner.analysis.fitted_liner import FittedLiner
from liner.analysis.walls import EIGHT_BITS_MM


@pytest.fixture
def case():
    return FittedLiner("reference-round")


def test_a_search_that_fails_nearby_begins_again_from_the_open_wall(case, monkeypatch):
    """Of states that were seen rarely enough, one lies across a fold from all that are known."""
    expected = case.fitted(30.0)
    again = FittedLiner("reference-round")
    again.fitted(0.0)

    def across_a_fold(model, sights, difference, start=None, mean=USUAL, near_mm=NEAR_MM):
        if start is not None and not tried:
            tried.append(start)
            raise AnalysisError("no load explains the sights", "")
        return fit_load(model, sights, difference, start, mean, near_mm)

    tried = []
    monkeypatch.setattr(pressure, "fit_load", across_a_fold)
    found = again.fitted(30.0)
    assert len(tried) == 1
    assert found.j == pytest.approx(expected.j, rel=0.05)
    assert found.places_mm == pytest.approx(expected.places_mm, abs=0.01)


def test_what_is_summed_hardly_depends_on_the_states_that_were_met_before():
    """Of places known as well as those of a mean cycle; without it, means differ by .13 kPa."""
    means_kpa = []
    for met_kpa in (32.0, 36.0, 42.0):
        case = FittedLiner("tapered-round")
        case.fitted(met_kpa)
        sights = case.mounting.sights(case.liner.points(40.0, 0, EIGHT_BITS_MM / 4), case.liner.grid)
        found = case.series.load(sights, Difference(40.0, 0.5), reach_mm=EXACT_MM)
        means_kpa.append(found.contact_kpa(case.model.targets)[0].mean())
    assert np.ptp(means_kpa) < 0.04
