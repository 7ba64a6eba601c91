"""Values of the summary of an analysis, and of the gaps of its capture."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from grabberd.analysis import ChamberVacuum, Estimate, Phases
from grabberd.processes.analysis.analyse import Analysis, Cycle
from grabberd.processes.analysis.vacuum_inputs import Vacuum

_UNKNOWN = Estimate(np.asarray(np.nan), np.asarray(np.nan))
_PHASES = "abcd"


def summary_values(analysis: Analysis) -> dict[str, Any]:
    """Values of the table `summary` by column name; NaN where unknown."""
    cycle, touch = analysis.cycle, analysis.touch
    return {
        "fields": len(analysis.numbers),
        "analysed": len(analysis.fields),
        "missing": int(gap_values(analysis)["missing"].sum()),
        **_pulsation(cycle),
        **_phases("wall", cycle.wall if cycle else None),
        **_phases("iso", analysis.source.phases if analysis.source else None),
        **_clocks(analysis.source),
        "clock_kpa": _clock_kpa(analysis.vacuum),
        "touch_n": analysis.fields[touch.field].n if touch else np.nan,
        "touch_target": analysis.grid.target[touch.place] if touch else np.nan,
    }


def _clocks(source: Vacuum | None) -> dict[str, Any]:
    """Relation of the clocks, and with it the wall's lag."""
    light = source.light.clock if source and source.light else None
    offset, lag = (source.offset, source.lag) if source else (None, None)
    found = _UNKNOWN
    if light:
        found = _estimate(light.offset_s, light.offset_sigma_s)
    elif offset:
        found = _estimate(offset.offset_s, offset.sigma_s)
    unsure_s = source.time_sigma_s if source else np.nan
    return {
        "offset_s": found,
        "clock_drift": _estimate(light.drift, light.drift_sigma) if light else _UNKNOWN,
        "light_switchings": light.edges if light else np.nan,
        "opening_lag_s": _estimate(lag.opening_shift_s, np.hypot(lag.opening_sigma_s, unsure_s))
        if lag
        else _UNKNOWN,
        "closing_lag_s": _estimate(lag.closing_shift_s, np.hypot(lag.closing_sigma_s, unsure_s))
        if lag
        else _UNKNOWN,
    }


def _estimate(value: float, sigma: float) -> Estimate:
    return Estimate(np.asarray(value), np.asarray(sigma))


def _clock_kpa(vacuum: Sequence[ChamberVacuum]) -> float:
    """Error of the vacuum on its steepest slope, by the clocks' σ; NaN where there is no second clock."""
    steepest = max((abs(one.pulsation_slope_kpa_per_s) * one.time_sigma_s for one in vacuum), default=np.nan)
    return steepest if steepest > 0 else np.nan


def _pulsation(cycle: Cycle | None) -> dict[str, Any]:
    if cycle is None:
        unknown = ("stroke_mm", "residual_mm", "expected_mm", "period_spread_s", "stroke_spread")
        return {
            "cycles": np.nan,
            "period_s": _UNKNOWN,
            "rate_per_min": _UNKNOWN,
            **dict.fromkeys(unknown, np.nan),
        }
    found = cycle.pulsation
    return {
        "cycles": found.cycles,
        "period_s": Estimate(np.asarray(found.period_s), np.asarray(found.period_sigma_s)),
        "rate_per_min": found.rate_per_min,
        "stroke_mm": found.stroke_mm,
        "residual_mm": found.residual_mm,
        "expected_mm": found.expected_mm,
        "period_spread_s": _spread(cycle.variation.lengths_s.value),
        "stroke_spread": _spread(cycle.variation.stroke.value),
    }


def _spread(values: NDArray[np.float64]) -> float:
    return float(np.std(values, ddof=1)) if len(values) > 1 else np.nan


def _phases(before: str, phases: Phases | None) -> dict[str, Estimate]:
    names = [f"{before}_{phase}_s" for phase in _PHASES]
    if phases is None:
        return dict.fromkeys([*names, f"{before}_ratio"], _UNKNOWN)
    value, sigma = phases.durations_s
    each = {name: Estimate(value[k], sigma[k]) for k, name in enumerate(names)}
    return each | {f"{before}_ratio": phases.ratio}


def gap_values(analysis: Analysis) -> dict[str, NDArray[np.int64]]:
    """Values of the table `gaps`: fields without points between others that have some."""
    n = analysis.numbers
    missing = np.diff(n) - 1
    at = np.flatnonzero(missing)
    return {"after_n": n[at], "until_n": n[at + 1], "missing": missing[at]}
