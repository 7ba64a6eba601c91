"""The tables of an analysis: its summary, and one row for each field, phase, target, section, cycle, gap,
triangle or edge.

The field's own quantities in an analysis: each with σ, or with the reason why it is missing.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from grabberd.core.arrays import Array
from grabberd.core.chain.columns import Table, make_table
from grabberd_liner.analysis.estimate import Estimate, Finding
from grabberd_liner.analysis.load.empty_ramp import ramp_quantities
from grabberd_liner.analysis.load.liner_compression import QUANTITIES, liner_compression
from grabberd_liner.analysis.load.pressure import ChamberVacuum, PressureMap
from grabberd_liner.analysis.pulsation.phase_average import PhaseAverage
from grabberd_liner.analysis.pulsation.phases import (
    NO_CURVE,
    lag_quantities,
    movement_quantities,
    pulsator_limits,
    vacuum_quantities,
    wall_quantities,
)
from grabberd_liner.chain.analysis.analyse import Analysis, Cycle
from grabberd_liner.chain.analysis.columns import TABLES
from grabberd_liner.chain.analysis.inputs import CHAMBERS
from grabberd_liner.chain.analysis.vacuum_inputs import Vacuum
from grabberd_liner.chain.analysis.wall_series import ramp_values
from grabberd_liner.chain.analysis.wall_state import WallState

_NO_CYCLE = "there is no mean cycle"
_NO_WALL_PHASES = "the wall's movement has no four phases"
_NO_TEAT = "there is no teat: the capture is a ramp with the empty liner"
_NO_RAMP = "the capture is no ramp with the empty liner"
_NO_VALUES = "a ramp needs a reference, one material and both vacuums"
_NO_LAG = "the vacuum has no clock that a light, or the capture itself, relates to the camera's"


def quantities(analysis: Analysis) -> tuple[Finding, ...]:
    """All of them, in the order in which they are shown.

    Whatever shows or exports one of them takes it from here, so that it is the same number everywhere.
    """
    cycle, vacuum = analysis.cycle, analysis.source.phases if analysis.source else None
    wall, reason = cycle.wall if cycle else None, _without_phases(analysis)
    no_curve = _NO_TEAT if analysis.inputs.empty else NO_CURVE
    return (
        *_of_the_load(analysis),
        *movement_quantities(cycle.pulsation if cycle else None, reason),
        *wall_quantities(wall, reason),
        *vacuum_quantities(vacuum, no_curve),
        *pulsator_limits(vacuum, no_curve),
        *_lags(analysis),
        *_of_the_ramp(analysis),
    )


def left_out(reasons: Iterable[tuple[str, str]]) -> list[str]:
    """Quantities without a value, those that lack the same together, in sentences.

    Args:
        reasons: title of each quantity, and why it has no value; empty if it has one. What only captures of
            another kind have is not left out of this one.
    """
    lacking: dict[str, list[str]] = {}
    for title, reason in reasons:
        if reason and reason not in (_NO_RAMP, _NO_TEAT):
            lacking.setdefault(reason, []).append(title)
    return [f"{', '.join(titles)}: {reason}" for reason, titles in lacking.items()]


def _without_phases(analysis: Analysis) -> str:
    """The reason why there are no wall phases, where there are none."""
    if analysis.inputs.empty:
        return _NO_TEAT
    return _NO_WALL_PHASES if analysis.cycle else _NO_CYCLE


def _lags(analysis: Analysis) -> tuple[Finding, ...]:
    source, lag = analysis.source, analysis.source.lag if analysis.source else None
    if source is None or lag is None:
        return lag_quantities((), np.nan, _NO_TEAT if analysis.inputs.empty else _NO_LAG)
    shifts = ((lag.opening_shift_s, lag.opening_sigma_s), (lag.closing_shift_s, lag.closing_sigma_s))
    each = [Estimate.of(value, sigma) for value, sigma in shifts]
    return lag_quantities(each, source.time_sigma_s, "")


def _of_the_ramp(analysis: Analysis) -> tuple[Finding, ...]:
    empty = analysis.empty
    if empty is None:
        return ramp_quantities(None, None, (_NO_VALUES if analysis.inputs.empty else _NO_RAMP,) * 2)
    return ramp_quantities(empty.values, empty.collapse, empty.reasons)


def _of_the_load(analysis: Analysis) -> tuple[Finding, ...]:
    cycle = analysis.cycle
    if cycle is None or cycle.wall is None:
        reason = _without_phases(analysis)
        return tuple(Finding.missing(quantity, reason) for quantity in QUANTITIES.values())
    profiles = [state.pressure.profile if state.pressure else None for state in analysis.phases]
    flow_stop_kpa, alike = analysis.inputs.flow_stop_kpa, _correlation(cycle.average, analysis.phase)
    found = liner_compression(analysis.phase, profiles, cycle.wall, flow_stop_kpa, alike)
    if any(profiles):
        return found.findings
    # That no load is known has a cause, which the inputs may tell.
    lacks = [text.partition(":")[0] for text in analysis.inputs.lacks if " pressure" in text]
    if not lacks:
        return found.findings
    said = f"there is no pressure without {', '.join(dict.fromkeys(lacks))}"
    return tuple(one._replace(reason=said) if one.reason else one for one in found.findings)


def _correlation(average: PhaseAverage | None, phase: Array) -> Array | None:
    """(P, P) of the noise at those phases of a mean cycle that could be analysed."""
    if average is None:
        return None
    among = np.isin(average.phase, phase)
    return average.correlation[np.ix_(among, among)]


def quantity_values(found: Sequence[Finding]) -> dict[str, Any]:
    """Values of the table `quantities` by column name."""
    quantity = [one.quantity for one in found]
    return {
        **{name: np.array([getattr(one, name) for one in quantity]) for name in quantity[0]._fields},
        "value": Estimate(np.array([one.value for one in found]), np.array([one.sigma for one in found])),
        "sigma_common": np.array([one.common for one in found]),
        **{name: np.array([getattr(one, name) for one in found]) for name in ("verdict", "reason")},
    }


Keys = Mapping[str, NDArray[Any]]
Values = Mapping[str, Any]
"""Values by column name: an array, or an estimate if the column is measured."""
AnalysisTables = Mapping[str, Table]
"""Tables by name, in the order of `TABLES`; docs/reference/analysis.md describes each."""


def strain_tables(analysis: Analysis, keys: Keys) -> dict[str, dict[str, Any]]:
    """Values of the tables `triangles` and `edges`.

    They have no rows without a reference state, nor for fields that share no targets with it.

    Args:
        analysis: Analysis of the capture.
        keys: (F,) key columns of the fields.
    """
    strains = {at: state.strains for at, state in enumerate(analysis.states) if state.strains}
    grid = analysis.grid
    corners = grid.target[_joined_indices([grid.triangles[one.triangle] for one in strains.values()], (0, 3))]
    ends = grid.target[_joined_indices([one.edge for one in strains.values()], (0, 2))]
    stretch = _joined([one.triangle_stretch for one in strains.values()], 2)
    along = _joined([one.edge_stretch for one in strains.values()])
    return {
        "triangles": {
            **_keys(keys, {at: len(one.triangle) for at, one in strains.items()}),
            **{f"target{k + 1}": corners[:, k] for k in range(3)},
            "stretch1": Estimate(stretch.value[:, 0], stretch.sigma[:, 0]),
            "stretch2": Estimate(stretch.value[:, 1], stretch.sigma[:, 1]),
        },
        "edges": {
            **_keys(keys, {at: len(one.edge) for at, one in strains.items()}),
            **{f"target{k + 1}": ends[:, k] for k in range(2)},
            "stretch": along,
        },
    }


def _keys(keys: Keys, counts: Mapping[int, int]) -> dict[str, NDArray[Any]]:
    at = np.repeat(np.array(list(counts), np.intp), list(counts.values()))
    return {name: values[at] for name, values in keys.items()}


def _joined_indices(parts: list[NDArray[Any]], empty: tuple[int, ...]) -> NDArray[Any]:
    return np.concatenate(parts) if parts else np.empty(empty, np.intp)


_UNKNOWN = Estimate.of(np.nan, np.nan)
QUANTITY_COLUMNS = {
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
        **{column: found[name].estimate for column, name in QUANTITY_COLUMNS.items()},
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
        found = Estimate.of(light.offset_s, light.offset_sigma_s)
    elif offset:
        found = Estimate.of(offset.offset_s, offset.sigma_s)
    return {
        "offset_s": found,
        "clock_drift": Estimate.of(light.drift, light.drift_sigma) if light else _UNKNOWN,
        "light_switchings": light.edges if light else np.nan,
    }


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
        "period_s": Estimate.of(found.period_s, found.period_sigma_s),
        "residual_mm": found.residual_mm,
        "expected_mm": found.expected_mm,
        "period_spread_s": _spread(cycle.variation.lengths_s.value),
        "stroke_spread": _spread(cycle.variation.stroke.value),
    }


def _spread(values: Array) -> float:
    return float(np.std(values, ddof=1)) if len(values) > 1 else np.nan


def gap_values(analysis: Analysis) -> dict[str, NDArray[np.int64]]:
    """Values of the table `gaps`: fields without points between others that have some."""
    n = analysis.numbers
    missing = np.diff(n) - 1
    at = np.flatnonzero(missing)
    return {"after_n": n[at], "until_n": n[at + 1], "missing": missing[at]}


def tables(analysis: Analysis) -> AnalysisTables:
    """All tables of an analysis; a table without results has no rows."""
    fields = _Series(analysis.states, _field_keys(analysis), analysis.vacuum)
    phases = _Series(analysis.phases, {"phase": analysis.phase}, analysis.phase_vacuum)
    found = quantities(analysis)
    by_name = {one.quantity.name: one for one in found}
    values: dict[str, Values] = {
        "summary": summary_values(analysis, by_name),
        "fields": fields.keys | _of_fields(analysis, fields) | _wall(analysis, fields),
        "sections": _sections(fields),
        "profile": _profiles(fields),
        "targets": _targets(analysis, fields),
        "phases": phases.keys | _wall(analysis, phases),
        "phase_sections": _sections(phases),
        "phase_targets": _targets(analysis, phases),
        "phase_profile": _profiles(phases),
        "quantities": quantity_values(found),
        "cycles": _cycles(analysis),
        "gaps": gap_values(analysis),
        "ramp": ramp_values(analysis.empty, by_name),
        **strain_tables(analysis, fields.keys),
    }
    return {name: make_table(name, spec, values[name]) for name, spec in TABLES.items()}


class _Series(NamedTuple):
    """States of the fields or of the phases, with their key columns and the vacuum of each."""

    states: tuple[WallState, ...]
    keys: dict[str, NDArray[Any]]
    vacuum: tuple[ChamberVacuum, ...]

    @property
    def maps(self) -> list[PressureMap | None]:
        return [state.pressure for state in self.states]

    def repeated(self, counts: int | Sequence[int]) -> dict[str, NDArray[Any]]:
        """The keys, repeated for the rows of each state."""
        return {name: np.repeat(values, counts) for name, values in self.keys.items()}


def _field_keys(analysis: Analysis) -> dict[str, NDArray[Any]]:
    return {
        "n": np.array([field.n for field in analysis.fields], np.int64),
        "time_s": np.array([field.timed.time_s for field in analysis.fields]),
    }


def _of_fields(analysis: Analysis, fields: _Series) -> dict[str, Any]:
    time_s = fields.keys["time_s"]
    cycle, phase = np.full(len(time_s), np.nan), np.full(len(time_s), np.nan)
    if analysis.cycle is not None:
        moment = analysis.cycle.pulsation.at(time_s)
        cycle, phase = np.where(moment.run >= 0, moment.cycle, np.nan), moment.phase
    return {"cycle": cycle, "phase": phase, "movement_mm": _movement(analysis, time_s)}


def _movement(analysis: Analysis, time_s: Array) -> Estimate:
    """The movement at these times; NaN where it is unknown."""
    known = analysis.movement
    if known is None:
        return _none(len(time_s))
    # Fields and movement carry the very same time stamps, so that equality is safe here.
    index = np.minimum(np.searchsorted(known.time_s, time_s), len(known.time_s) - 1)
    there = known.time_s[index] == time_s
    return Estimate(*(np.where(there, part[index], np.nan) for part in (known.value_mm, known.sigma_mm)))


def _wall(analysis: Analysis, series: _Series) -> dict[str, Any]:
    maps, states = series.maps, series.states
    greatest = [_greatest(one) for one in maps]
    return {
        "area_mm2": _each([state.area.area_mm2 for state in states]),
        "covered": np.array([state.area.covered for state in states]),
        "volume_mm3": _each([state.volume_mm3 for state in states]),
        **_vacuum(series),
        "mean_contact_kpa": _each([one and one.mean_kpa for one in maps]),
        "greatest_contact_kpa": _each([_at(one, index) for one, index in zip(maps, greatest, strict=True)]),
        "greatest_contact_target": np.array(
            [np.nan if index is None else analysis.grid.target[index] for index in greatest]
        ),
        "determined": np.array([int(one.usable.sum()) if one else 0 for one in maps], np.int64),
        "load_misfit": np.array([one.misfit if one else np.nan for one in maps]),
        "method": np.array([state.method for state in states], object),
        "misfit": np.array([state.misfit for state in states]),
    }


def _vacuum(series: _Series) -> dict[str, Estimate]:
    """The vacuum; its σ includes that of the clocks' offset, multiplied by the slope of the vacuum."""
    if not series.vacuum:
        return {f"{name}_vacuum_kpa": _none(len(series.states)) for name in CHAMBERS}
    known = {name: np.array([getattr(one, name) for one in series.vacuum]) for name in ChamberVacuum._fields}
    return {
        f"{name}_vacuum_kpa": Estimate(
            known[f"{name}_kpa"],
            np.hypot(known[f"{name}_sigma_kpa"], known[f"{name}_slope_kpa_per_s"] * known["time_sigma_s"]),
        )
        for name in CHAMBERS
    }


def _greatest(one: PressureMap | None) -> int | None:
    if one is None or not one.usable.any():
        return None
    return int(np.argmax(np.where(one.usable, one.contact_kpa.value, -np.inf)))


def _at(one: PressureMap | None, index: int | None) -> Estimate | None:
    if one is None or index is None:
        return None
    return Estimate(one.contact_kpa.value[index], one.contact_kpa.sigma[index])


def _sections(series: _Series) -> dict[str, Any]:
    all_of_them = [section for state in series.states for section in state.sections]
    measured = ("distance_mm", "area_mm2", "length_mm", "chord_mm", "least_width_mm", "opposite_mm")
    return {
        **series.repeated([len(state.sections) for state in series.states]),
        "height_mm": np.array([section.x_mm for section in all_of_them]),
        **{name: _each([getattr(section, name) for section in all_of_them]) for name in measured},
    }


def _profiles(series: _Series) -> dict[str, Any]:
    """Rows of the load over height; states without it have none."""
    profiles = [one.profile if one else None for one in series.maps]
    known = [one for one in profiles if one]
    return {
        **series.repeated([len(one.x_mm) if one else 0 for one in profiles]),
        "x_mm": _rows([one.x_mm for one in known]),
        "compression_kpa": _joined([one.compression_kpa.estimate for one in known]),
        "load_n_per_mm": _joined([one.load_n_per_mm.estimate for one in known]),
        "gap_mm": _joined([one.gap_mm for one in known]),
    }


def _joined(estimates: Sequence[Estimate], *columns: int) -> Estimate:
    return Estimate(*(_rows([one[part] for one in estimates], *columns) for part in (0, 1)))


def _targets(analysis: Analysis, series: _Series) -> dict[str, Any]:
    grid, states, maps = analysis.grid, series.states, series.maps
    count = len(grid)

    def stacked(pick: Callable[[WallState], Estimate | None], columns: int) -> list[Estimate]:
        return _stacked([pick(state) for state in states], count, columns)

    x, y, z = stacked(lambda state: state.xyz_mm, 3)
    kappa1, kappa2 = stacked(lambda state: state.curvature_per_m, 2)
    strain1, strain2 = stacked(lambda state: state.strain, 2)
    tension1, tension2 = stacked(lambda state: state.tension_n_per_m, 2)
    return {
        **series.repeated(count),
        **{name: np.tile(getattr(grid, name), len(states)) for name in ("target", "row", "column")},
        "x_mm": x,
        "y_mm": y,
        "z_mm": z,
        "kappa1_per_m": kappa1,
        "kappa2_per_m": kappa2,
        "strain1": strain1,
        "strain2": strain2,
        "tension1_n_per_m": tension1,
        "tension2_n_per_m": tension2,
        "contact_kpa": _stacked([one and _usable(one, one.contact_kpa) for one in maps], count)[0],
        "above_atmosphere_kpa": _stacked(
            [one and _usable(one, one.above_atmosphere_kpa) for one in maps], count
        )[0],
        "unseen_kpa": _rows([_unseen_kpa(one, count) for one in maps]),
        "reason": np.array(
            [reason for one in maps for reason in (one.reason if one else ("",) * count)], object
        ),
    }


def _unseen_kpa(one: PressureMap | None, count: int) -> Array:
    if one is None or one.unseen_kpa is None:
        return np.full(count, np.nan)
    return np.where(one.usable, one.unseen_kpa, np.nan)


def _usable(one: PressureMap, pressure: Estimate) -> Estimate:
    """The pressure where it is determined; NaN at targets that have a reason against it."""
    return Estimate(*(np.where(one.usable, part, np.nan) for part in pressure))


def _cycles(analysis: Analysis) -> dict[str, Estimate]:
    if analysis.cycle is None:
        return {"start_s": _none(0), "stroke": _none(0)}
    found = analysis.cycle.variation
    return {"start_s": found.start_s, "stroke": found.stroke}


def _none(count: int) -> Estimate:
    return Estimate(np.full(count, np.nan), np.full(count, np.nan))


def _each(estimates: Sequence[Estimate | None]) -> Estimate:
    """(S,) estimate made of single ones."""
    rows = [(np.nan, np.nan) if one is None else (float(one.value), float(one.sigma)) for one in estimates]
    return Estimate(*np.array(rows).reshape(-1, 2).T)


def _stacked(estimates: Sequence[Estimate | None], count: int, columns: int = 1) -> list[Estimate]:
    """Stack the estimates (N,) or (N, columns) of S states into one estimate (S · N,) per column."""
    empty = np.full((count, columns), np.nan)
    values, sigmas = (
        _rows([empty if one is None else one[part].reshape(count, columns) for one in estimates])
        for part in (0, 1)
    )
    return [
        Estimate(values.reshape(-1, columns)[:, k], sigmas.reshape(-1, columns)[:, k]) for k in range(columns)
    ]


def _rows(parts: Sequence[Array], *columns: int) -> Array:
    return np.concatenate(parts) if len(parts) else np.empty((0, *columns))
