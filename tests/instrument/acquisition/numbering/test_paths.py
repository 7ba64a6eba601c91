"""Hypotheses about the latest fields: which evidence rules one out at once."""

import pytest

from grabberd.instrument.acquisition.numbering.arrivals import Way
from grabberd.instrument.acquisition.numbering.paths import Paths, Seen


@pytest.mark.parametrize(("regular", "is_certain"), [(1, False), (8, True)])
def test_after_an_interruption_arrivals_are_evidence_once_their_way_is_known(regular, is_certain):
    """A first field of the other parity: the camera has turned, or its stamp is late as those before."""
    paths = Paths(0, Way(0.5, regular))
    paths.see(
        Seen(
            stamp=40.0,
            arrival=40.4,
            stamped_on_arrival=False,
            burst=False,
            joined=False,
            counted=None,
            parity=1,
            excused=True,
            waited=False,
        )
    )
    assert paths.settled() == is_certain
