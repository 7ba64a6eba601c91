"""What every test needs of a capture, and what is named where it is missing."""

import numpy as np
import pytest

from grabberd_liner.analysis.pulsation.movement import TimedPoints
from grabberd_liner.chain.analysis.wall_state import FieldPoints
from grabberd_liner.chain.guided_tests.evaluate import preconditions
from grabberd_liner.chain.guided_tests.recipes import RECIPES
from liner.analysis.ramps import empty
from liner.chain.guided_tests.evidence import FIELD_S, analysed, evidence, material_of, profile, still_fields

SHAPE = {"reference": "nominal", "average": 8}
AT_ATMOSPHERE = {name: {"kpa": 0.0, "sigma_kpa": 0.1} for name in ("pulsation", "liner")}


def checks(one, kind="reference"):
    return {check.name: check for check in preconditions(one, RECIPES[kind])}


@pytest.fixture(scope="module")
def complete():
    liner = empty("reference")
    return analysed(still_fields(liner), liner.grid, SHAPE | {"vacuum": AT_ATMOSPHERE})


def pulsating(liner, count=110):
    """Fields of a wall that opens and closes once a second."""
    kpa = 6.0 + 6.0 * np.sin(2 * np.pi * np.arange(count) * FIELD_S)
    return [FieldPoints(n, TimedPoints(n * FIELD_S, liner.points(at, n))) for n, at in enumerate(kpa)]


def test_a_complete_capture_of_a_still_wall_passes_all(complete):
    one = complete._replace(liner=profile(material=material_of(empty("reference"))))
    assert {check.verdict for check in checks(one).values()} == {"passed"}


@pytest.mark.parametrize(
    ("name", "changed", "said"),
    [
        ("capture_complete", {"ledger": {"total": 100, "received": 90}}, "10 of 100 fields are missing"),
        ("calibration", {"calibration": None}, "without a calibration"),
        ("calibration", {"acceptance": "failed"}, "acceptance of calibration rig failed"),
        ("liner_profile", {"liner": None, "labels": {}}, "no label liner"),
        ("liner_profile", {"liner": None, "labels": {"liner": "B"}}, "no profile in use is called 'B'"),
        ("liner_profile", {"liner": profile()}, "has no material yet"),
        ("fields", {"captured": ()}, "only 0 fields have points"),
        ("analysed", {"analysis": None, "problem": "profiles contradict the capture"}, "contradict"),
    ],
)
def test_what_is_missing_fails_and_is_named(complete, name, changed, said):
    check = checks(complete._replace(**changed))[name]
    assert check.verdict == "failed"
    assert said in check.reason
    assert check.remedy


def test_a_calibration_that_nobody_judged_is_not_checked(complete):
    assert checks(complete._replace(acceptance=None))["calibration"].verdict == "not checked"


def test_an_unknown_vacuum_fails():
    liner = empty("reference")
    check = checks(analysed(still_fields(liner, count=8), liner.grid, SHAPE))["vacuum_known"]
    assert check.verdict == "failed"
    assert "vacuum.pulsation" in check.reason


def test_a_pulsator_that_runs_is_named_with_its_rate():
    liner = empty("thin")
    one = analysed(pulsating(liner), liner.grid, SHAPE)
    check = checks(one)["wall_still"]
    assert check.verdict == "failed"
    assert check.value > 1.0
    assert "pulsates at 60 cycles a minute: the pulsator runs" in check.reason


def test_a_milking_whose_wall_pulsates_passes():
    liner = empty("thin")
    one = analysed(pulsating(liner), liner.grid, {"reference": "nominal"})
    assert checks(one, "milking")["wall_pulsates"].verdict == "passed"


def test_a_milking_whose_wall_stands_still_fails(complete):
    assert checks(complete, "milking")["wall_pulsates"].verdict == "failed"


def test_a_capture_that_was_not_analysed_leaves_the_rest_unchecked():
    found = checks(evidence(problem="it has no points"))
    assert {found[name].verdict for name in ("vacuum_known", "fields", "wall_still")} == {"not checked"}
