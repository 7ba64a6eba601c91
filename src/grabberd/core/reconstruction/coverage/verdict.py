"""The verdict on how well a run was measured, and what speaks against it."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from grabberd.core.reconstruction.coverage.coverage import Coverage
from grabberd.core.reconstruction.miss import Miss


class CoverageVerdict(StrEnum):
    """Verdict on a run."""

    WELL = "measured_well"
    GAPS = "measured_with_gaps"
    NOT = "not_measured"


class FindingCode(StrEnum):
    """Code of a finding: what speaks against a run, or that nothing does."""

    ALL_FOUND = "all_found"
    NO_FIELDS = "no_fields"
    NOTHING_EXPECTED = "nothing_expected"
    FIELDS_MISSING = "fields_missing"
    FEW_FOUND = "few_found"
    TARGETS_MISSED = "targets_missed"
    RAYS_DO_NOT_MEET = "rays_do_not_meet"


@dataclass(frozen=True, slots=True)
class CoverageLimits:
    """Limits of the verdict; documented in docs/reference/coverage.md.

    Attributes:
        well: Least share found of all that was expected, for a run that is measured well.
        measured: Likewise for one that is measured at all.
        target: Least share of its fields in which each target must be found.
        often: Least share of the fields in which a target must be expected to count by itself.
        seldom: Least number of these fields.
        fields_well: Least share of the fields that must have come whole, for a run that is measured well.
        fields_measured: Likewise for one that is measured at all.
        residual_sigma: Greatest root mean square image residual, in units of its standard deviation.
        apart: Greatest share of all expected targets whose rays do not meet.
    """

    well: float = 0.95
    measured: float = 0.5
    target: float = 0.8
    often: float = 0.1
    seldom: int = 10
    fields_well: float = 0.98
    fields_measured: float = 0.5
    residual_sigma: float = 1.6
    apart: float = 0.03


LIMITS = CoverageLimits()


@dataclass(frozen=True, slots=True)
class Finding:
    """A finding with the numbers that it rests on.

    Attributes:
        verdict: Verdict that it alone would lead to.
        code: What it says.
        values: Its numbers; a share is from 0 to 1.
        miss: Most frequent reason why targets were not found, or None.
    """

    verdict: CoverageVerdict
    code: FindingCode
    values: Mapping[str, float]
    miss: Miss | None = None


@dataclass(frozen=True, slots=True)
class Judgement:
    """The verdict, and its findings, the gravest first; never none."""

    verdict: CoverageVerdict
    findings: tuple[Finding, ...]


_GRAVEST = (CoverageVerdict.NOT, CoverageVerdict.GAPS, CoverageVerdict.WELL)


def judge(coverage: Coverage, missing: int = 0, limits: CoverageLimits = LIMITS) -> Judgement:
    """Judge a run.

    Args:
        coverage: Its coverage.
        missing: Number of fields that should have come and could not be measured: lost, damaged, without a
            signal.
        limits: Limits to judge by.
    """
    findings = sorted(_findings(coverage, missing, limits), key=lambda one: _GRAVEST.index(one.verdict))
    if not findings:
        values = {"share": coverage.share, "targets": float(np.count_nonzero(coverage.expected))}
        findings = [Finding(CoverageVerdict.WELL, FindingCode.ALL_FOUND, values)]
    return Judgement(findings[0].verdict, tuple(findings))


def _findings(coverage: Coverage, missing: int, limits: CoverageLimits) -> Iterator[Finding]:
    measured = len(coverage.n)
    if not measured:
        yield Finding(CoverageVerdict.NOT, FindingCode.NO_FIELDS, {"missing": missing})
        return
    if not coverage.expected.any():
        yield Finding(CoverageVerdict.NOT, FindingCode.NOTHING_EXPECTED, {})
        return
    yield from _of_shares(coverage, limits)
    yield from _of_rays(coverage, limits)
    yield from _of_targets(coverage, limits)
    yield from _of_fields(measured, missing, limits)  # last: the ledger says it, too


def _of_shares(coverage: Coverage, limits: CoverageLimits) -> Iterator[Finding]:
    if coverage.share < limits.well:
        is_poor = coverage.share < limits.measured
        misses = coverage.misses[:, 1:].sum(axis=0)
        values = {"share": coverage.share, "of_misses": float(misses.max() / misses.sum())}
        verdict = CoverageVerdict.NOT if is_poor else CoverageVerdict.GAPS
        yield Finding(verdict, FindingCode.FEW_FOUND, values, Miss(int(misses.argmax()) + 1))


def _of_fields(measured: int, missing: int, limits: CoverageLimits) -> Iterator[Finding]:
    share = measured / (measured + missing)
    if share < limits.fields_well:
        verdict = CoverageVerdict.NOT if share < limits.fields_measured else CoverageVerdict.GAPS
        yield Finding(verdict, FindingCode.FIELDS_MISSING, {"missing": missing, "fields": measured + missing})


def _of_rays(coverage: Coverage, limits: CoverageLimits) -> Iterator[Finding]:
    apart = float(coverage.misses[:, Miss.RAYS_APART].sum() / coverage.expected.sum())
    if apart > limits.apart or coverage.residual_sigma > limits.residual_sigma:
        values = {"apart": apart, "residual_sigma": coverage.residual_sigma}
        yield Finding(CoverageVerdict.GAPS, FindingCode.RAYS_DO_NOT_MEET, values)


def _of_targets(coverage: Coverage, limits: CoverageLimits) -> Iterator[Finding]:
    counts = coverage.expected >= max(limits.often * len(coverage.n), limits.seldom)
    poor = counts & (coverage.target_share < limits.target)
    if not poor.any() or (poor == counts).all():  # what concerns all of them is said of the run
        return
    worst = int(np.where(poor, coverage.target_share, np.inf).argmin())
    values = {
        "poor": float(np.count_nonzero(poor)),
        "targets": float(np.count_nonzero(counts)),
        "target": float(coverage.target[worst]),
        "share": float(coverage.target_share[worst]),
        "displaced_mm": float(coverage.distance_mm[worst]) if coverage.displaced[worst] else np.nan,
    }
    miss = Miss(int(coverage.chief_miss[worst]))
    yield Finding(CoverageVerdict.GAPS, FindingCode.TARGETS_MISSED, values, miss)
