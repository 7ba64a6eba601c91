"""Needs of every test: all of a capture's fields, a calibration, the liner's profile, the vacuum."""

from collections.abc import Iterator

from grabberd.errors import AnalysisError
from grabberd_liner.analysis import first_movement, fit_pulsation
from grabberd_liner.chain.guided_tests.check import FAILED, Check, Question
from grabberd_liner.chain.guided_tests.outcome import Evidence, exact
from grabberd_liner.chain.guided_tests.recipes import Recipe
from grabberd_liner.chain.guided_tests.stillness import unrest_mm

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
