"""Evaluation of a test by its recipe."""

from collections.abc import Callable, Mapping, Sequence

from grabberd_liner.chain.guided_tests.artificial_teat import artificial_teat_test, known_kpa
from grabberd_liner.chain.guided_tests.check import Check
from grabberd_liner.chain.guided_tests.milking_test import milking_test
from grabberd_liner.chain.guided_tests.outcome import Evidence, Outcome
from grabberd_liner.chain.guided_tests.preconditions import preconditions
from grabberd_liner.chain.guided_tests.ramp_test import ramp_test
from grabberd_liner.chain.guided_tests.recipes import RECIPES
from grabberd_liner.chain.guided_tests.reference_test import reference_test
from grabberd_liner.chain.guided_tests.wear_test import wear_test

_OF_ONE: Mapping[str, Callable[[Evidence], Outcome]] = {
    "reference": reference_test,
    "ramp": ramp_test,
    "milking": milking_test,
}
_OF_SEVERAL: Mapping[str, Callable[[Sequence[Evidence]], Outcome]] = {
    "artificial-teat": artificial_teat_test,
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
