"""The load in state after state: from what is known nearby, or from the open wall."""

import pytest

from grabberd.errors import AnalysisError
from grabberd_liner.analysis.load import pressure
from grabberd_liner.analysis.load.load_fit import fit_load
from grabberd_liner.analysis.load.wall_model import USUAL
from liner.analysis.fitted_liner import FittedLiner


@pytest.fixture
def case():
    return FittedLiner("reference-round")


def test_a_search_that_fails_nearby_begins_again_from_the_open_wall(case, monkeypatch):
    """Of states that were seen rarely enough, one lies across a fold from all that are known."""
    expected = case.fitted(30.0)
    again = FittedLiner("reference-round")
    again.fitted(0.0)

    def across_a_fold(model, sights, difference, start=None, mean=USUAL):
        if start is not None and not tried:
            tried.append(start)
            raise AnalysisError("no load explains the sights", "")
        return fit_load(model, sights, difference, start, mean)

    tried = []
    monkeypatch.setattr(pressure, "fit_load", across_a_fold)
    found = again.fitted(30.0)
    assert len(tried) == 1
    assert found.j == pytest.approx(expected.j, rel=0.05)
    assert found.places_mm == pytest.approx(expected.places_mm, abs=0.01)
