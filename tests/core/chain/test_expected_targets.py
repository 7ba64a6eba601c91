"""Who is expected to be seen does not depend on the moment of the movement at which a capture begins."""

import pytest

from core.chain.fake_scene import take_scene
from grabberd.core.chain.measure import measure_fields
from grabberd.core.reconstruction import CoverageTally
from grabberd.core.reconstruction.coverage import CoverageVerdict, judge

FIELDS = 48
"""A little less than a cycle of the liner."""


@pytest.mark.parametrize("begun_at", [0.08, 0.42, 0.70])
def test_a_corner_that_turns_away_before_it_was_ever_seen_is_not_missed(begun_at):
    """The wall's last corners face both views at no time, but are predicted there while it closes."""
    scene = take_scene(FIELDS, liner={"start_s": 1.0 - begun_at})
    tally = CoverageTally(scene.setup.calibration, scene.setup.object_model)
    list(measure_fields(scene.packed(8, "field"), scene.setup, tally))
    coverage = tally.result()
    assert coverage.target[coverage.found < coverage.expected].tolist() == []
    assert judge(coverage)[0].verdict is CoverageVerdict.WELL
