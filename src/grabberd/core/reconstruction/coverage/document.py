"""The coverage of a run as a JSON document: the verdict with its findings, and a column for each count."""

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from grabberd.core.reconstruction.coverage.coverage import Coverage
from grabberd.core.reconstruction.coverage.verdict import Finding, judge
from grabberd.core.reconstruction.miss import Miss

WORST_FIELDS = 20
"""Number of fields listed, those of which least was found."""
_DIGITS = 4


def coverage_document(coverage: Coverage, missing: int = 0) -> dict[str, Any]:
    """Make the document.

    Args:
        coverage: The coverage.
        missing: Number of fields that should have come and could not be measured.
    """
    judgement = judge(coverage, missing)
    return {
        "verdict": str(judgement.verdict),
        "findings": [_finding(one) for one in judgement.findings],
        "share": known(coverage.share),
        "fields": len(coverage.n),
        "missing_fields": missing,
        "residual_px": known(coverage.residual_px),
        "residual_sigma": known(coverage.residual_sigma),
        "targets": _targets(coverage),
        "worst_fields": _worst_fields(coverage),
    }


def _finding(one: Finding) -> dict[str, Any]:
    values = {name: known(value) for name, value in one.values.items()}
    miss = None if one.miss is None else one.miss.key
    return {"verdict": str(one.verdict), "code": str(one.code), "values": values, "miss": miss}


def _targets(coverage: Coverage) -> dict[str, Any]:
    """Columns with an entry for each target; reasons that never occurred are left out."""
    misses = {miss.key: coverage.misses[:, miss].tolist() for miss in Miss if coverage.misses[:, miss].any()}
    return {
        "target": coverage.target.tolist(),
        "expected": coverage.expected.tolist(),
        "misses": {key: counts for key, counts in misses.items() if key != Miss.FOUND.key},
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


def _column(values: NDArray[np.float64]) -> list[float | None]:
    return [known(value) for value in values.tolist()]


def known(value: float) -> float | None:
    """A number for JSON, which has none for what is unknown."""
    return round(float(value), _DIGITS) if math.isfinite(value) else None
