"""Evaluation of a test by its recipe, after the needs of every test: all of a capture's fields, a
calibration, the liner's profile, the vacuum, and a wall that stands still where the recipe says so.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence

import numpy as np

from grabberd.core.arrays import Array
from grabberd.errors import AnalysisError
from grabberd_liner.analysis.estimate import Estimate
from grabberd_liner.analysis.pulsation.movement import first_movement
from grabberd_liner.analysis.pulsation.pulsation import fit_pulsation
from grabberd_liner.chain.analysis.wall_state import FieldPoints
from grabberd_liner.chain.guided_tests.artificial_teat import artificial_teat_test, known_kpa
from grabberd_liner.chain.guided_tests.milking_test import milking_test
from grabberd_liner.chain.guided_tests.outcome import FAILED, Check, Evidence, Outcome, Question, exact
from grabberd_liner.chain.guided_tests.overpressure_test import overpressure_test
from grabberd_liner.chain.guided_tests.ramp_test import ramp_test
from grabberd_liner.chain.guided_tests.recipes import RECIPES, Recipe
from grabberd_liner.chain.guided_tests.reference_test import reference_test
from grabberd_liner.chain.guided_tests.wear_test import wear_test

_SEEN_IN = 0.5
"""Share of the fields in which a target has to be seen to count."""


def unrest_mm(fields: Sequence[FieldPoints]) -> Estimate:
    """Standard deviation over time of the targets' mean movement towards the cameras, less that of noise.

    Args:
        fields: of one capture; NaN comes of fewer than three.
    """
    z_mm, sigma_mm = _heights(fields) if fields else (np.empty(0), np.empty(0))
    if len(z_mm) < 3 or not z_mm.size:
        return Estimate.of(np.nan, np.nan)
    with np.errstate(invalid="ignore"):
        from_mean = z_mm - np.nanmean(z_mm, axis=0)
        seen = np.isfinite(z_mm).sum(axis=1)
        common_mm = np.nanmean(from_mean, axis=1)
        noise = np.sqrt(np.nansum(np.square(sigma_mm), axis=1)) / seen
    beyond = max(float(np.nanvar(common_mm, ddof=1) - np.nanmean(np.square(noise))), 0.0)
    # σ of a standard deviation, of what is left of it and of what was taken off.
    sigma = float(np.nanstd(common_mm, ddof=1)) / np.sqrt(2 * (len(common_mm) - 1))
    return Estimate.of(np.sqrt(beyond), sigma)


def _heights(fields: Sequence[FieldPoints]) -> tuple[Array, Array]:
    """(F, N) heights of the targets that are seen often enough, and their σ; NaN where one is not seen."""
    targets = np.unique(np.concatenate([one.timed.points.target for one in fields]))
    z_mm = np.full((len(fields), len(targets)), np.nan)
    sigma_mm = z_mm.copy()
    for row, one in enumerate(fields):
        at = np.searchsorted(targets, one.timed.points.target)
        z_mm[row, at] = one.timed.points.xyz_mm[:, 2]
        sigma_mm[row, at] = np.sqrt(one.timed.points.covariance_mm2[:, 2, 2])
    often = np.isfinite(z_mm).mean(axis=0) >= _SEEN_IN
    seen = np.isfinite(z_mm[:, often]).any(axis=1)
    return z_mm[seen][:, often], sigma_mm[seen][:, often]


_MOST_MISSING = 0.02
"""Of the fields: what is found from the others is then as good."""
_LEAST_FIELDS = 20
_STILL_MM = 0.05
"""Standard deviation of the wall's movement that counts as still: .5 % of a stroke."""
_UNJUDGED = "the calibration was never judged"

COMPLETE = Question(
    "capture_complete",
    "all fields were received",
    "look at the capture's ledger for the cause, such as a cable or a busy computer, and capture again",
    "%",
)
CALIBRATED = Question(
    "calibration", "calibration accepted", "calibrate the rig (docs/howto/calibrate.md), and measure again"
)
PROFILED = Question(
    "liner_profile",
    "liner's profile found",
    "label the capture with the liner's name, and store its profile: grabberd profile add FILE",
)
ANALYSED = Question("analysed", "capture analysed", "put right what the reason says, and test again")
VACUUM = Question(
    "vacuum_known",
    "vacuum known at every field",
    "record the capture with the logger running (docs/howto/loggers.md), or give the vacuum with --inputs",
)
FIELDS = Question(
    "fields", "enough fields", "capture for as long as the recipe says, with the targets in view"
)
STILL = Question(
    "wall_still",
    "wall stands still",
    "stop the pulsator, let nothing touch the cup, and capture again",
    "mm",
)
PULSATES = Question(
    "wall_pulsates", "wall pulsates", "capture while the pulsator runs, two cycles at the least"
)


def preconditions(one: Evidence, recipe: Recipe) -> list[Check]:
    """The checks of a capture that come before all others."""
    return [*_before_analysis(one), *_of_analysis(one, recipe)]


def _before_analysis(one: Evidence) -> Iterator[Check]:
    total, received = one.ledger["total"], one.ledger["received"]
    missing = 100 * (1 - received / total) if total else 100.0
    yield COMPLETE.at_most(
        exact(missing), 100 * _MOST_MISSING, f"{total - received} of {total} fields are missing"
    )
    if one.calibration is None:
        yield CALIBRATED.answered(False, "the capture was measured without a calibration")
    elif one.acceptance is None:
        yield CALIBRATED.not_checked(f"{_UNJUDGED}: {one.calibration}")
    else:
        failed = one.acceptance == "failed"
        yield CALIBRATED.answered(not failed, f"the acceptance of calibration {one.calibration} failed")
    yield _profiled(one)
    yield ANALYSED.answered(one.analysis is not None, one.problem)


def _profiled(one: Evidence) -> Check:
    label = one.labels.get("liner")
    if one.liner is not None:
        return PROFILED.answered(
            one.liner.content.get("material") is not None or one.material is not None,
            f"the {one.liner} has no material yet",
        )
    if one.material is not None:
        return PROFILED.not_checked("the inputs give the material themselves")
    if label is None:
        return PROFILED.answered(False, "the capture has no label liner")
    return PROFILED.answered(False, f"no profile in use is called {label!r}, as the label liner says")


def _of_analysis(one: Evidence, recipe: Recipe) -> Iterator[Check]:
    unknown = "the capture was not analysed"
    still = recipe.pulsates is False
    if one.analysis is None:
        asked = (VACUUM, FIELDS, *((STILL,) if still else (PULSATES,) if recipe.pulsates else ()))
        yield from (question.not_checked(unknown) for question in asked)
        return
    lacks = [text for text in one.analysis.inputs.lacks if text.startswith("vacuum")]
    lacks += [text for text in one.analysis.problems if "vacuum" in text]
    yield VACUUM.answered(one.analysis.source is not None, "; ".join(lacks) or "no vacuum was given")
    measured = sum(len(field.timed.points) > 0 for field in one.captured)
    yield FIELDS.at_least(exact(measured), _LEAST_FIELDS, f"only {measured} fields have points")
    if still:
        yield _stillness(one)
    elif recipe.pulsates:
        yield PULSATES.answered(one.analysis.cycle is not None, "no cycle was found in the wall's movement")


def _stillness(one: Evidence) -> Check:
    check = STILL.at_most(unrest_mm(one.captured), _STILL_MM, "it moves")
    return check._replace(reason=_mover(one)) if check.verdict == FAILED else check


def _mover(one: Evidence) -> str:
    """Cause of the movement: a pulsator by its rate, if the wall goes by one."""
    try:
        found = fit_pulsation(first_movement([[field.timed for field in one.captured]]))
    except AnalysisError:
        return "it moves"
    return f"it pulsates at {float(found.rate_per_min.value):.0f} cycles a minute: the pulsator runs"


_OF_ONE: Mapping[str, Callable[[Evidence], Outcome]] = {
    "reference": reference_test,
    "ramp": ramp_test,
    "milking": milking_test,
}
_OF_SEVERAL: Mapping[str, Callable[[Sequence[Evidence]], Outcome]] = {
    "artificial-teat": artificial_teat_test,
    "overpressure": overpressure_test,
    "wear": wear_test,
}


def evaluate(kind: str, captures: Sequence[Evidence]) -> Outcome:
    """Judges the captures of a test.

    Args:
        kind: the recipe.
        captures: the oldest first; one alone for a recipe that evaluates one.
    """
    recipe = RECIPES[kind]
    if not recipe.several:
        (one,) = captures
        outcome = _OF_ONE[kind](one)
        return outcome._replace(checks=(*preconditions(one, recipe), *outcome.checks))
    outcome = _OF_SEVERAL[kind](captures)
    each = zip(*(preconditions(one, recipe) for one in captures), strict=True)
    before = [_of_all(checks, captures) for checks in each]
    return outcome._replace(checks=(*before, *outcome.checks))


def _of_all(checks: Sequence[Check], captures: Sequence[Evidence]) -> Check:
    """One check for all captures: the worst, with the captures that it is true of."""
    order = ("failed", "not certain", "not checked", "passed")
    verdict = min((one.verdict for one in checks), key=order.index)
    chosen = [(one, of) for one, of in zip(checks, captures, strict=True) if one.verdict == verdict]
    first = chosen[0][0]
    if verdict == "passed":
        return first
    said = "; ".join(f"{_named(of)}: {one.reason}" for one, of in chosen)
    return first._replace(reason=said)


def _named(one: Evidence) -> str:
    known = known_kpa(one)
    return one.id if known is None else f"{known:g} kPa ({one.id})"
