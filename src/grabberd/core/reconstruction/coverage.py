"""Coverage of a run: the counts of its targets and fields, the verdict on how well it was measured, and what
speaks against it; as a JSON document, and in English sentences.
"""

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from enum import StrEnum
from typing import Any

import numpy as np
from numpy.typing import NDArray

from grabberd.core.arrays import Array, Mask
from grabberd.core.reconstruction.points import Miss

Counts = NDArray[np.int64]

CERTAIN = 3.0
"""An offset is taken for a displacement of the target if it is more than this many of its σ."""


@dataclass(frozen=True, slots=True, eq=False)
class Coverage:
    """Coverage of a run's F fields and of the M targets of its object.

    Attributes:
        target: (M,) ids, ascending.
        expected: (M,) number of fields in which both views should see the target.
        misses: (M, len(Miss)) number of those fields by `Miss`; the first column counts those in which it was
            found.
        unexpected: (M, len(Miss)) number of all other fields by the reason why a view could not show it.
        offset_mm: (M, 3) mean offset of the target from where its neighbours put it, by some of the fields;
            NaN if it was not seen in any of these.
        offset_sigma_mm: (M,) its standard deviation, in space; NaN if it is from fewer than two fields.
        looks: (M,) number of fields that it is from.
        n: (F,) numbers of the fields that were measured.
        field_expected: (F,) number of targets that both views should see.
        field_found: (F,) number of those found.
        field_residual_px: (F,) root mean square image residual; NaN without points.
        residual_px: The same over all points; NaN without points.
        residual_sigma: In units of its expected standard deviation.
        corrections: Number of the first field of each correction of the rig, and its document.
    """

    target: NDArray[np.int32]
    expected: Counts
    misses: Counts
    unexpected: Counts
    offset_mm: Array
    offset_sigma_mm: Array
    looks: Counts
    n: Counts
    field_expected: Counts
    field_found: Counts
    field_residual_px: Array
    residual_px: float
    residual_sigma: float
    corrections: tuple[tuple[int, Mapping[str, Any]], ...] = ()

    @property
    def found(self) -> Counts:
        """(M,) number of fields in which each target was found."""
        return self.misses[:, Miss.FOUND]

    @property
    def share(self) -> float:
        """Share found of all that were expected; NaN if nothing was."""
        expected = int(self.expected.sum())
        return float(self.found.sum() / expected) if expected else np.nan

    @property
    def target_share(self) -> Array:
        """(M,) share of its expected fields in which each target was found; NaN if it never was expected."""
        with np.errstate(invalid="ignore"):
            share: Array = self.found / self.expected
        return share

    @property
    def chief_miss(self) -> Counts:
        """(M,) most frequent reason why each target was not found; `Miss.FOUND` if it never was missed."""
        missed = self.misses[:, 1:]
        return np.where(missed.any(axis=1), missed.argmax(axis=1) + 1, int(Miss.FOUND))

    @property
    def distance_mm(self) -> Array:
        """(M,) length of the mean offset."""
        return np.sqrt((self.offset_mm * self.offset_mm).sum(axis=1))

    @property
    def displaced(self) -> Mask:
        """(M,) True for targets whose offset is certain: their place in the object file is wrong."""
        return self.distance_mm > CERTAIN * self.offset_sigma_mm


# The limits of the verdict; documented in docs/reference/coverage.md.
WELL_SHARE, MEASURED_SHARE = 0.95, 0.5
"""Least shares found of all that was expected, for a run that is measured well, and at all."""
WELL_FIELDS_SHARE, MEASURED_FIELDS_SHARE = 0.98, 0.5
"""Least shares of the fields that must have come whole, likewise."""
TARGET_SHARE = 0.8
"""Least share of its fields in which each target must be found."""
COUNTED_SHARE, COUNTED_FIELDS = 0.1, 10
"""Least share and number of the fields in which a target must be expected to count by itself."""
MOST_RESIDUAL_SIGMA = 1.6
"""Greatest root mean square image residual, in units of its standard deviation."""
MOST_APART_SHARE = 0.03
"""Greatest share of all expected targets whose rays do not meet."""


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


_GRAVEST = (CoverageVerdict.NOT, CoverageVerdict.GAPS, CoverageVerdict.WELL)


def judge(coverage: Coverage, missing: int = 0) -> list[Finding]:
    """Judge a run: its findings, the gravest first, whose verdict is that of the run; never none.

    Args:
        coverage: Its coverage.
        missing: Number of fields that should have come and could not be measured: lost, damaged, without a
            signal.
    """
    findings = sorted(_findings(coverage, missing), key=lambda one: _GRAVEST.index(one.verdict))
    if not findings:
        values = {"share": coverage.share, "targets": float(np.count_nonzero(coverage.expected))}
        findings = [Finding(CoverageVerdict.WELL, FindingCode.ALL_FOUND, values)]
    return findings


def _findings(coverage: Coverage, missing: int) -> Iterator[Finding]:
    measured = len(coverage.n)
    if not measured:
        yield Finding(CoverageVerdict.NOT, FindingCode.NO_FIELDS, {"missing": missing})
        return
    if not coverage.expected.any():
        yield Finding(CoverageVerdict.NOT, FindingCode.NOTHING_EXPECTED, {})
        return
    yield from _of_shares(coverage)
    yield from _of_rays(coverage)
    yield from _of_targets(coverage)
    yield from _of_fields(measured, missing)  # last: the ledger says it, too


def _of_shares(coverage: Coverage) -> Iterator[Finding]:
    if coverage.share < WELL_SHARE:
        is_poor = coverage.share < MEASURED_SHARE
        misses = coverage.misses[:, 1:].sum(axis=0)
        values = {"share": coverage.share, "of_misses": float(misses.max() / misses.sum())}
        verdict = CoverageVerdict.NOT if is_poor else CoverageVerdict.GAPS
        yield Finding(verdict, FindingCode.FEW_FOUND, values, Miss(int(misses.argmax()) + 1))


def _of_fields(measured: int, missing: int) -> Iterator[Finding]:
    share = measured / (measured + missing)
    if share < WELL_FIELDS_SHARE:
        verdict = CoverageVerdict.NOT if share < MEASURED_FIELDS_SHARE else CoverageVerdict.GAPS
        yield Finding(verdict, FindingCode.FIELDS_MISSING, {"missing": missing, "fields": measured + missing})


def _of_rays(coverage: Coverage) -> Iterator[Finding]:
    apart = float(coverage.misses[:, Miss.RAYS_APART].sum() / coverage.expected.sum())
    if apart > MOST_APART_SHARE or coverage.residual_sigma > MOST_RESIDUAL_SIGMA:
        values = {"apart": apart, "residual_sigma": coverage.residual_sigma}
        yield Finding(CoverageVerdict.GAPS, FindingCode.RAYS_DO_NOT_MEET, values)


def _of_targets(coverage: Coverage) -> Iterator[Finding]:
    counts = coverage.expected >= max(COUNTED_SHARE * len(coverage.n), COUNTED_FIELDS)
    poor = counts & (coverage.target_share < TARGET_SHARE)
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


MOST_CORRECTIONS = 1000
"""Corrections of the rig that a run lists."""
WORST_FIELDS = 20
"""Number of fields listed, those of which least was found."""
_DIGITS = 4


def coverage_document(coverage: Coverage, missing: int = 0) -> dict[str, Any]:
    """Make the document.

    Args:
        coverage: The coverage.
        missing: Number of fields that should have come and could not be measured.
    """
    findings = judge(coverage, missing)
    return {
        "verdict": str(findings[0].verdict),
        "findings": [_finding(one) for one in findings],
        "share": known(coverage.share),
        "fields": len(coverage.n),
        "missing_fields": missing,
        "residual_px": known(coverage.residual_px),
        "residual_sigma": known(coverage.residual_sigma),
        "targets": _targets(coverage),
        "worst_fields": _worst_fields(coverage),
        **_corrections(coverage),
    }


def _corrections(coverage: Coverage) -> dict[str, Any]:
    """Corrections of the rig by marks; nothing for a run without marks."""
    if not coverage.corrections:
        return {}
    # Those beyond are of a rig that is shaken all the time: their number says so.
    kept = [{"n": n, **document} for n, document in coverage.corrections[:MOST_CORRECTIONS]]
    return {"corrections": kept, "corrections_not_listed": len(coverage.corrections) - len(kept)}


def _finding(one: Finding) -> dict[str, Any]:
    values = {name: known(value) for name, value in one.values.items()}
    miss = None if one.miss is None else one.miss.key
    return {"verdict": str(one.verdict), "code": str(one.code), "values": values, "miss": miss}


def _targets(coverage: Coverage) -> dict[str, Any]:
    """Columns with an entry for each target; reasons that never occurred are left out."""
    misses, unexpected = (
        {miss.key: of[:, miss].tolist() for miss in Miss if miss is not Miss.FOUND and of[:, miss].any()}
        for of in (coverage.misses, coverage.unexpected)
    )
    return {
        "target": coverage.target.tolist(),
        "expected": coverage.expected.tolist(),
        "misses": misses,
        "unexpected": unexpected,
        "found": coverage.found.tolist(),
        "offset_mm": [_column(column) for column in coverage.offset_mm.T],
        "offset_sigma_mm": _column(coverage.offset_sigma_mm),
        "offset_fields": coverage.looks.tolist(),
        "displaced": coverage.displaced.tolist(),
    }


def _worst_fields(coverage: Coverage) -> list[dict[str, Any]]:
    lacking = coverage.field_expected - coverage.field_found
    worst = np.argsort(-lacking, kind="stable")[:WORST_FIELDS]
    return [
        {
            "n": int(coverage.n[i]),
            "expected": int(coverage.field_expected[i]),
            "found": int(coverage.field_found[i]),
            "residual_px": known(float(coverage.field_residual_px[i])),
        }
        for i in sorted(worst[lacking[worst] > 0])
    ]


def _column(values: Array) -> list[float | None]:
    return [known(value) for value in values.tolist()]


def known(value: float) -> float | None:
    """A number for JSON, which has none for what is unknown."""
    return round(float(value), _DIGITS) if math.isfinite(value) else None


Values = Mapping[str, float | None]

_OF_A_FIELD = {
    "no_blob_left": "the left view shows no blob where it is predicted",
    "no_blob_right": "the right view shows no blob where it is predicted",
    "no_blob": "neither view shows a blob where it is predicted",
    "rays_apart": "the rays of its blobs do not meet",
    "off_place": "it is not where its neighbours put it",
    "unconfirmed": "it was seen only once after a long time",
    "not_identified": "no target of the object could be identified in the field",
    "cut_off": "the edge of the picture cuts it off",
    "unpredicted": "its neighbours were not seen, so that its place is unknown",
    "taken": "the blob where it is predicted is that of a neighbour",
}
_OF_A_RUN = {
    "no_blob_left": "the left view shows too few blobs; look at its light, mirror and threshold",
    "no_blob_right": "the right view shows too few blobs; look at its light, mirror and threshold",
    "no_blob": "the views show too few blobs; look at light, lens and threshold",
    "rays_apart": "the rays of both views do not meet: the calibration does not fit; check it",
    "off_place": "they are not where their neighbours put them: the object file does not fit the object",
    "unconfirmed": "they were seen too seldom",
    "not_identified": "the blobs do not agree with the object file; is it that of this object?",
    "cut_off": "the edge of the picture cuts them off",
    "unpredicted": "too few of their neighbours were seen",
    "taken": "the blobs where they are predicted are those of neighbours: the object file does not fit the "
    "object, or discs stand too close together",
}


def miss_in_words(miss: str, displaced_mm: float | None = None) -> str:
    """Reason why a target was not found.

    Args:
        miss: Key of the reason.
        displaced_mm: Distance from its place, if it certainly stands off it.
    """
    if miss == "off_place" and displaced_mm is not None:
        return f"it is {displaced_mm:.1f} mm from its place in the object file"
    return _OF_A_FIELD.get(miss, miss)


def finding_in_words(code: str, values: Values, miss: str | None) -> str:
    """One finding as a sentence without a full stop."""
    known = {name: 0.0 if value is None else value for name, value in values.items()}
    if code == "few_found":
        return f"{_percent(known['share'])} of what both views should see was found: {_OF_A_RUN[miss or '']}"
    if code == "targets_missed":
        reason = miss_in_words(miss or "", values.get("displaced_mm"))
        return (
            f"{known['poor']:.0f} of {known['targets']:.0f} targets were often missed; target "
            f"{known['target']:.0f} was found in {_percent(known['share'])} of its fields: {reason}"
        )
    shares = {name: _percent(known.get(name, 0.0)) for name in ("share", "apart")}
    return _SENTENCES[code].format_map({**known, **shares})


_SENTENCES = {
    "all_found": "{share} of what both views should see was found",
    "no_fields": "no field could be measured",
    "nothing_expected": "by calibration and object file no target lies in both views; do they belong "
    "together?",
    "fields_missing": "{missing:.0f} of {fields:.0f} fields could not be measured: lost, damaged or without "
    "a picture",
    "rays_do_not_meet": "the rays of both views meet badly ({residual_sigma:.1f} σ, {apart} not at all): "
    "the calibration does not fit; check it",
}


def _percent(share: float) -> str:
    """Rounded down: 99.9 % is not all."""
    return f"{int(100 * share)} %"
