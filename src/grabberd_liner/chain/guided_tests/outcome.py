"""Evidence of a test, and what comes of it: checks against limits with their verdicts, quantities, curves,
an offer.
"""

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from grabberd.core.arrays import Array
from grabberd_liner.analysis.estimate import Estimate, Finding, Quantity
from grabberd_liner.analysis.wall.material import Material
from grabberd_liner.chain.analysis.analyse import Analysis
from grabberd_liner.chain.analysis.profile_inputs import Profile
from grabberd_liner.chain.analysis.tables import AnalysisTables
from grabberd_liner.chain.analysis.wall_state import FieldPoints

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
        value: what was found; NaN if the check has no numeric result.
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
        """The check without a numeric result."""
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

    def agrees(self, found: Estimate, expected: float, sigma: float) -> Check:
        """The check of a value that has to be another one, but for the σ of their difference."""
        words = f"{self._with_unit(expected)} within {_CERTAIN:g} σ"
        if not math.isfinite(float(found.value)):
            return self.not_checked("it was not found")
        off = abs(float(found.value) - expected) / sigma
        verdict = PASSED if off <= _CERTAIN else NOT_CERTAIN if off <= _UNEQUAL else FAILED
        said = f"it is {off:.1f} σ away; σ of the difference is {sigma:.2g} {self.unit}".strip()
        return self._judged(found, verdict, words, said)

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


LINE, POINTS, MARK = "line", "points", "mark"
"""How a curve is drawn: a mark is a place on the x axis."""


class Evidence(NamedTuple):
    """A capture of a test with its analysis.

    Attributes:
        id: of the capture.
        captured_utc: when it was captured, in ISO 8601.
        labels: of the capture.
        ledger: `total` number of fields, and how many were `received`.
        calibration: id of the calibration; None if it was measured without one.
        acceptance: verdict on that calibration; None if nobody has judged it.
        liner: profile that its label `liner` names; None if there is none.
        captured: its fields, as they were taken; empty if it could not be analysed.
        analysis: None if it could not be analysed.
        tables: of the analysis.
        problem: why it could not be analysed, in a sentence with what helps.
    """

    id: str
    captured_utc: str
    labels: Mapping[str, str]
    ledger: Mapping[str, int]
    calibration: str | None
    acceptance: str | None
    liner: Profile | None
    captured: Sequence[FieldPoints]
    analysis: Analysis | None
    tables: AnalysisTables
    problem: str = ""

    @property
    def material(self) -> Material | None:
        """The liner's material; None if it is unknown, or differs from zone to zone."""
        zones = self.analysis.inputs.zones if self.analysis else ()
        return zones[0].material if len(zones) == 1 else None

    def labelled(self, name: str) -> float:
        """Return a label as a number; NaN where there is none, or it is not finite."""
        try:
            value = float(self.labels.get(name, ""))
        except ValueError:
            return math.nan
        return value if math.isfinite(value) else math.nan

    def quantity(self, name: str) -> Estimate | None:
        """A quantity of the analysis; None if it was not found."""
        row = self._row_of(name)
        if row is None:
            return None
        table = self.tables["quantities"]
        value, sigma = (float(table.column(column)[row]) for column in ("value", "sigma_value"))
        return Estimate.of(value, sigma) if math.isfinite(value) else None

    def common(self, name: str) -> float:
        """Part of a quantity's σ that captures analysed with the same values share; 0 where it is unknown."""
        row, table = self._row_of(name), self.tables.get("quantities")
        if row is None or table is None or "sigma_common" not in [one.name for one in table.columns]:
            return 0.0
        found = float(table.column("sigma_common")[row])
        return found if math.isfinite(found) else 0.0

    def said(self, name: str, column: str) -> str:
        """Text of a quantity: its `title`, `unit`, `reason`, `verdict`, …; empty if there is no such one."""
        row = self._row_of(name)
        return "" if row is None else str(self.tables["quantities"].column(column)[row])

    def mean_contact_kpa(self) -> tuple[Estimate, float]:
        """Mean contact pressure on a wall at rest, over fields and targets, and the common part of its σ.

        Fields scatter by their noise; what σ has beyond that they share, and no number of them lessens it.
        """
        nothing = Estimate.of(math.nan, math.nan), math.nan
        if "fields" not in self.tables:
            return nothing
        fields = self.tables["fields"]
        value, sigma = fields.column("mean_contact_kpa"), fields.column("sigma_mean_contact_kpa")
        known = np.isfinite(value) & np.isfinite(sigma)
        if not known.any():
            return nothing
        value, count = value[known], int(known.sum())
        variance = float(np.mean(np.square(sigma[known])))
        own = min(float(np.var(value, ddof=1)), variance) if count > 1 else 0.0
        found = Estimate.of(value.mean(), math.sqrt(variance - own + own / count))
        return found, math.sqrt(variance - own)

    @property
    def no_pressure(self) -> str:
        """Reason why there is no pressure."""
        if self.analysis is None:
            return self.problem or "the capture was not analysed"
        said = [text for text in self.analysis.inputs.lacks if "pressure" in text]
        said += [text for text in self.analysis.problems if "equilibrium" in text or "no pressure" in text]
        return said[0] if said else "no field has a pressure"

    def value(self, table: str, name: str) -> Estimate:
        """A column's value in the only row of a table, with its σ; NaN where there is none."""
        found = self.tables.get(table)
        if found is None or not len(found.column(name)):
            return Estimate.of(math.nan, math.nan)
        names = [one.name for one in found.columns]
        sigma = float(found.column(f"sigma_{name}")[0]) if f"sigma_{name}" in names else 0.0
        return Estimate.of(float(found.column(name)[0]), sigma)

    def _row_of(self, name: str) -> int | None:
        table = self.tables.get("quantities")
        names = [] if table is None else table.column("name").tolist()
        return names.index(name) if name in names else None


class Curve(NamedTuple):
    """Values over another quantity, for a figure; NaN where there is none."""

    name: str
    title: str
    axes: tuple[tuple[str, str], tuple[str, str]]
    style: str
    x: Array
    y: Array
    sigma: Array


class Offer(NamedTuple):
    """A liner's profile with values that the test has found, and the version it was made from."""

    content: Mapping[str, Any]
    after: int


class Outcome(NamedTuple):
    """Result of a test."""

    checks: tuple[Check, ...]
    findings: tuple[Finding, ...] = ()
    curves: tuple[Curve, ...] = ()
    offer: Offer | None = None


def exact(value: float) -> Estimate:
    """A value that is counted, or known without σ."""
    return Estimate.of(value, 0.0)


def findings_of(one: Evidence, names: Sequence[str]) -> tuple[Finding, ...]:
    """These quantities, in this order; those that an analysis does not know are left out."""
    return tuple(_finding(one, name) for name in names if one.said(name, "title"))


def _finding(one: Evidence, name: str) -> Finding:
    texts = [one.said(name, column) for column in ("title", "unit", "definition", "source")]
    found = one.quantity(name)
    quantity = Quantity(name, *texts)
    if found is None:
        return Finding.missing(quantity, one.said(name, "reason"))
    return Finding(
        quantity,
        float(found.value),
        float(found.sigma) if math.isfinite(float(found.sigma)) else math.nan,
        verdict=one.said(name, "verdict"),
        common=one.common(name),
    )
