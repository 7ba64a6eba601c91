"""Values of the summary of an analysis, and of the gaps of its capture."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from grabberd_liner.analysis import ChamberVacuum, Estimate
from grabberd_liner.analysis.quantity import Finding
from grabberd_liner.chain.analysis.analyse import Analysis, Cycle
from grabberd_liner.chain.analysis.vacuum_inputs import Vacuum

_UNKNOWN = Estimate(np.asarray(np.nan), np.asarray(np.nan))
QUANTITIES = {
    **{name: name for name in ("rate_per_min", "stroke_mm", "wall_ratio", "opening_lag_s", "closing_lag_s")},
    "iso_ratio": "pulsator_ratio",
    "wall_a_s": "liner_opening_s",
    "wall_b_s": "liner_open_s",
    "wall_c_s": "liner_closing_s",
    "wall_d_s": "massage_time_s",
    **{f"iso_{phase}_s": f"phase_{phase}_s" for phase in "abcd"},
}
"""Columns of the summary that are quantities of the field, by the names of the table `quantities`."""


def summary_values(analysis: Analysis, found: Mapping[str, Finding]) -> dict[str, Any]:
    """Values of the table `summary` by column name; NaN where unknown.

    Args:
        analysis: complete result of an analysis.
        found: its quantities by name.
    """
    touch = analysis.touch
    return {
        "fields": len(analysis.numbers),
        "analysed": len(analysis.fields),
        "missing": int(gap_values(analysis)["missing"].sum()),
        **{column: found[name].estimate for column, name in QUANTITIES.items()},
        **_pulsation(analysis.cycle),
        **_clocks(analysis.source),
        "clock_kpa": _clock_kpa(analysis.vacuum),
        "touch_n": analysis.fields[touch.field].n if touch else np.nan,
        "touch_target": analysis.grid.target[touch.place] if touch else np.nan,
    }


def _clocks(source: Vacuum | None) -> dict[str, Any]:
    """Relation of the clocks."""
    light = source.light.clock if source and source.light else None
    offset = source.offset if source else None
    found = _UNKNOWN
    if light:
        found = _estimate(light.offset_s, light.offset_sigma_s)
    elif offset:
        found = _estimate(offset.offset_s, offset.sigma_s)
    return {
        "offset_s": found,
        "clock_drift": _estimate(light.drift, light.drift_sigma) if light else _UNKNOWN,
        "light_switchings": light.edges if light else np.nan,
    }


def _estimate(value: float, sigma: float) -> Estimate:
    return Estimate(np.asarray(value), np.asarray(sigma))


def _clock_kpa(vacuum: Sequence[ChamberVacuum]) -> float:
    """Error of the vacuum on its steepest slope, by the clocks' σ; NaN where there is no second clock."""
    steepest = max((abs(one.pulsation_slope_kpa_per_s) * one.time_sigma_s for one in vacuum), default=np.nan)
    return steepest if steepest > 0 else np.nan


def _pulsation(cycle: Cycle | None) -> dict[str, Any]:
    if cycle is None:
        unknown = ("cycles", "residual_mm", "expected_mm", "period_spread_s", "stroke_spread")
        return {"period_s": _UNKNOWN, **dict.fromkeys(unknown, np.nan)}
    found = cycle.pulsation
    return {
        "cycles": found.cycles,
        "period_s": Estimate(np.asarray(found.period_s), np.asarray(found.period_sigma_s)),
        "residual_mm": found.residual_mm,
        "expected_mm": found.expected_mm,
        "period_spread_s": _spread(cycle.variation.lengths_s.value),
        "stroke_spread": _spread(cycle.variation.stroke.value),
    }


def _spread(values: NDArray[np.float64]) -> float:
    return float(np.std(values, ddof=1)) if len(values) > 1 else np.nan


def gap_values(analysis: Analysis) -> dict[str, NDArray[np.int64]]:
    """Values of the table `gaps`: fields without points between others that have some."""
    n = analysis.numbers
    missing = np.diff(n) - 1
    at = np.flatnonzero(missing)
    return {"after_n": n[at], "until_n": n[at + 1], "missing": missing[at]}
