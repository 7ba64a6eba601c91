"""The documents of a run's coverage, from what its file says."""

import math
from collections.abc import Mapping
from typing import Any

from grabberd.core.reconstruction.coverage.words import finding_in_words, miss_in_words
from grabberd.documents.coverage import CoverageDocument, CoverageSummary, TargetCoverage

AXES = ("x", "y", "z")


def coverage_summary(stored: Mapping[str, Any] | None) -> CoverageSummary | None:
    """The coverage in short; None for a run that was not counted.

    Raises:
        ValueError: The file's document is invalid.
    """
    return None if stored is None else CoverageSummary.model_validate(_summary(stored))


def whole_coverage(stored: Mapping[str, Any] | None) -> CoverageDocument | None:
    """The coverage with its targets; None for a run that was not counted.

    Raises:
        KeyError, ValueError: The file's document is invalid.
    """
    if stored is None:
        return None
    targets = [_target(stored["targets"], i) for i in range(len(stored["targets"]["target"]))]
    known = {**_summary(stored), "targets": targets, "worst_fields": stored["worst_fields"]}
    return CoverageDocument.model_validate(known)


def _summary(stored: Mapping[str, Any]) -> dict[str, Any]:
    names = ("verdict", "share", "fields", "missing_fields", "residual_px", "residual_sigma")
    findings = [
        {**one, "in_words": finding_in_words(one["code"], one["values"], one["miss"])}
        for one in stored["findings"]
    ]
    return {name: stored[name] for name in names} | {
        "findings": findings,
        "in_words": findings[0]["in_words"],
    }


def _target(columns: Mapping[str, Any], i: int) -> TargetCoverage:
    misses = {reason: counts[i] for reason, counts in columns["misses"].items() if counts[i]}
    reason = max(misses, key=misses.__getitem__) if misses else None
    offset_mm = [axis[i] for axis in columns["offset_mm"]]
    displaced_mm = math.hypot(*offset_mm) if columns["displaced"][i] else None
    return TargetCoverage.model_validate(
        {
            "target": columns["target"][i],
            "expected": columns["expected"][i],
            "found": columns["found"][i],
            "misses": misses,
            "reason": reason,
            "in_words": miss_in_words(reason, displaced_mm) if reason else "",
            **{f"offset_{axis}_mm": value for axis, value in zip(AXES, offset_mm, strict=True)},
            "offset_sigma_mm": columns["offset_sigma_mm"][i],
            "offset_fields": columns["offset_fields"][i],
        }
    )
