"""Hypotheses about the latest fields: which evidence rules one out at once."""

from itertools import pairwise

import pytest

from grabberd.instrument.acquisition.numbering.arrivals import Way
from grabberd.instrument.acquisition.numbering.paths import Paths, Seen


def after_an_interruption(periods, regular, **seen):
    """The hypotheses of a first field that comes and is stamped so many periods after the last one."""
    paths = Paths(0, Way(0.5, regular))
    of_stream = {"burst": False, "joined": False, "counted": None, "excused": True, "waited": False}
    paths.see(Seen(stamp=periods, arrival=periods + 0.4, **of_stream, **seen))
    return paths


@pytest.mark.parametrize(("regular", "is_certain"), [(1, False), (8, True)])
def test_after_an_interruption_arrivals_are_evidence_once_their_way_is_known(regular, is_certain):
    """A first field of the other parity: the camera has turned, or its stamp is late as those before."""
    paths = after_an_interruption(40.0, regular, stamped_on_arrival=False, parity=1)
    assert paths.settled() == is_certain


@pytest.mark.parametrize("parity", [0, 1])
def test_after_an_interruption_longer_than_any_queue_it_is_not_doubted_that_fields_are_missing(parity):
    """While the way is unknown, the first field may be late, but not by more than a driver has buffers."""
    assert after_an_interruption(188.0, 1, stamped_on_arrival=True, parity=parity).spread <= 1


@pytest.mark.parametrize(("way", "is_ever_less_likely"), [(0.0, True), (-0.44, False)])
def test_a_field_that_comes_before_its_exposure_is_unlikely_however_many_do(way, is_ever_less_likely):
    """Unless a clock that is ahead shows those with certain numbers as early."""
    paths, costs = Paths(None, Way(way, 1)), []
    of_stream = {"burst": False, "joined": False, "counted": None, "parity": None, "excused": False}
    for n in range(1, 9):
        paths.see(Seen(None, n - 0.44, stamped_on_arrival=False, waited=False, **of_stream))
        costs.append(paths.best.cost)
    assert [after > before + 1 for before, after in pairwise(costs)] == [is_ever_less_likely] * 7
