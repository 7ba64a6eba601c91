"""A check of a test: what was found, against its limit, with a verdict."""

import math
from collections.abc import Iterable
from typing import NamedTuple

from grabberd_liner.analysis import Estimate

PASSED, FAILED, NOT_CERTAIN, NOT_CHECKED = "passed", "failed", "not certain", "not checked"
_CERTAIN = 2.0
"""σ that a value has to be away from its limit, or may be away from an equal value."""
_UNEQUAL = 3.0
"""σ from which two values contradict each other; between the two it is not certain."""


class Check(NamedTuple):
    """Outcome of a check; `reason` and `remedy` are empty where it passed.

    Attributes:
        name: name, which never changes.
        title: what is checked, in a few words.
        verdict: one of `PASSED`, `FAILED`, `NOT_CERTAIN`, `NOT_CHECKED`.
        value: what was found; NaN if the check is no number.
        sigma: one standard deviation.
        unit: of both.
        limit: in words.
        reason: why it did not pass.
        remedy: what to do about it.
    """

    name: str
    title: str
    verdict: str
    value: float = math.nan
    sigma: float = math.nan
    unit: str = ""
    limit: str = ""
    reason: str = ""
    remedy: str = ""


class Question(NamedTuple):
    """Question of a check, and what helps where the answer is no."""

    name: str
    title: str
    remedy: str
    unit: str = ""

    def not_checked(self, reason: str) -> Check:
        """The check without what it needs."""
        return Check(self.name, self.title, NOT_CHECKED, reason=reason)

    def answered(self, yes: bool, reason: str = "", limit: str = "") -> Check:
        """The check whose answer is no number."""
        if yes:
            return Check(self.name, self.title, PASSED, limit=limit)
        return Check(self.name, self.title, FAILED, limit=limit, reason=reason, remedy=self.remedy)

    def at_most(self, found: Estimate, limit: float, reason: str = "") -> Check:
        """The check of a greatest value."""
        return self._by_margin(found, limit - float(found.value), f"at most {self._with_unit(limit)}", reason)

    def at_least(self, found: Estimate, limit: float, reason: str = "") -> Check:
        """The check of a least value."""
        return self._by_margin(
            found, float(found.value) - limit, f"at least {self._with_unit(limit)}", reason
        )

    def within(self, found: Estimate, expected: float, tolerance: float, reason: str = "") -> Check:
        """The check of a value that may be away from another one by a tolerance."""
        words = f"{expected:.4g} ± {self._with_unit(tolerance)}"
        margin = tolerance - abs(float(found.value) - expected)
        return self._by_margin(found, margin, words, reason)

    def agrees(self, found: Estimate, expected: float, sigma: float, reason: str = "") -> Check:
        """The check of a value that has to be another one, but for the σ of their difference."""
        words = f"{self._with_unit(expected)} within {_CERTAIN:g} σ"
        if not math.isfinite(float(found.value)):
            return self.not_checked(reason or "it was not found")
        off = abs(float(found.value) - expected) / sigma
        verdict = PASSED if off <= _CERTAIN else NOT_CERTAIN if off <= _UNEQUAL else FAILED
        said = f"it is {off:.1f} σ away; σ of the difference is {sigma:.2g} {self.unit}".strip()
        return self._judged(found, verdict, words, said + (f"; {reason}" if reason else ""))

    def _by_margin(self, found: Estimate, margin: float, limit: str, reason: str) -> Check:
        if not math.isfinite(margin):
            return self.not_checked(reason or "it was not found")
        sigma = float(found.sigma) if math.isfinite(float(found.sigma)) else 0.0
        if abs(margin) < _CERTAIN * sigma:
            near = f"it is within {_CERTAIN:g} σ of its limit"
            return self._judged(found, NOT_CERTAIN, limit, f"{near}; {reason}" if reason else near)
        return self._judged(found, PASSED if margin >= 0 else FAILED, limit, reason)

    def _judged(self, found: Estimate, verdict: str, limit: str, reason: str) -> Check:
        passed = verdict == PASSED
        return Check(
            self.name,
            self.title,
            verdict,
            float(found.value),
            float(found.sigma),
            self.unit,
            limit,
            "" if passed else reason or f"it is {self._with_unit(float(found.value))}",
            "" if passed else self.remedy,
        )

    def _with_unit(self, value: float) -> str:
        return f"{value:.3g} {'' if self.unit == '1' else self.unit}".strip()


def worst(checks: Iterable[Check]) -> str:
    """The worst verdict of the checks that could be made; `NOT_CHECKED` if none could."""
    verdicts = {one.verdict for one in checks}
    return next((one for one in (FAILED, NOT_CERTAIN, PASSED) if one in verdicts), NOT_CHECKED)
