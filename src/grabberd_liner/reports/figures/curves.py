"""Curves with bands of one σ, panel under panel, over time, phase of the mean cycle or height."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from grabberd.core.arrays import Array
from grabberd.reports.figures.drawing import FAINT, GREY, WIDTH_MM, Svg, drawn
from grabberd.reports.notation import fixed
from grabberd_liner.reports.columns import Columns

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_COLOURS = ("#0072b2", "#b34700", "#007a5a", "#8a4f7d", "#7a6a00")
_TOP_MM, _BOTTOM_MM, _PANEL_MM, _GAP_MM = 8.0, 11.0, 27.0, 9.0
_LEFT_MM, _RIGHT_MM = 17.0, 3.0
# Names in the legend of the columns that share a panel.
_PRESSURE = {"mean_contact_kpa": "mean", "greatest_contact_kpa": "greatest"}
_PROFILE = {"load [N/mm]": "load_n_per_mm", "compression [kPa]": "compression_kpa", "gap [mm]": "gap_mm"}
_VACUUM = {"pulsation_vacuum_kpa": "pulsation chamber", "liner_vacuum_kpa": "liner"}


class Curve(NamedTuple):
    """A line of (R,) values over `x` with their σ; NaN where they are not known."""

    name: str
    x: Array
    value: Array
    sigma: Array

    @classmethod
    def of(cls, name: str, columns: Columns, x: str, column: str) -> "Curve":
        """Take a curve from a table's columns."""
        return cls(name, columns.numbers(x), columns.numbers(column), columns.sigma(column))

    def broken(self) -> "Curve":
        """Return the curve with a gap where fields are missing, which a line must not bridge."""
        steps = np.diff(self.x)
        usual = np.median(steps) if len(steps) else 0.0
        at = np.flatnonzero(steps > 1.5 * usual) + 1  # one missing field makes a step of 2
        return Curve(self.name, *(np.insert(part, at, np.nan) for part in self[1:]))


class Panel(NamedTuple):
    """Curves that share an axis, such as "distance [mm]"."""

    label: str
    curves: Sequence[Curve]


def time_svg(tables: Mapping[str, Columns], label: str) -> Svg:
    """Draw vacuum, movement, sections, area and pressure over the time of the capture."""
    fields = tables["fields"]
    movement = _panel("movement [mm]", fields, "time_s", {"movement_mm": "target that moves most"})
    first, *others = _panels(fields, tables["sections"], "time_s")
    return _svg([first, movement, *others], "time [s]", label)


def phase_svg(tables: Mapping[str, Columns], wall_phases: Sequence[Mapping[str, Any]], label: str) -> Svg:
    """Draw vacuum, sections, area and pressure over the phase of the mean cycle.

    Args:
        tables: the document's tables.
        wall_phases: first, end and letter of each wall phase, which are marked.
        label: alternative text.
    """
    panels = _panels(tables["phases"], tables["phase_sections"], "phase")
    return _svg(panels, "phase of the mean cycle", label, wall_phases)


def profile_svg(
    tables: Mapping[str, Columns], wall_phases: Sequence[Mapping[str, Any]] | None, label: str
) -> Svg:
    """Draw load, compression and gap over height, in the middle of each wall phase.

    Args:
        tables: the document's tables, of which `phase_profile` has rows.
        wall_phases: first, end, letter and name of each wall phase; without them, one phase stands for all.
        label: alternative text.
    """
    profile = tables["phase_profile"]
    panels = [
        Panel(title, [_in_phase(profile, column, *chosen) for chosen in _middles(profile, wall_phases)])
        for title, column in _PROFILE.items()
    ]
    return _svg(panels, "height x on the mounted tube [mm]", label)


def _middles(profile: Columns, wall_phases: Sequence[Mapping[str, Any]] | None) -> list[tuple[float, str]]:
    """The known phase nearest to the middle of each wall phase, with its name."""
    known = np.unique(profile.numbers("phase"))
    if not wall_phases:
        return [(float(known[0]), f"phase {fixed(float(known[0]), 2)}")]
    named = [((one["first"] + one["end"]) / 2, f"{one['name']} ({one['phase']})") for one in wall_phases]
    return [(float(known[np.abs(known - middle).argmin()]), name) for middle, name in named]


def _in_phase(profile: Columns, column: str, phase: float, name: str) -> Curve:
    at = profile.numbers("phase") == phase
    whole = Curve.of(name, profile, "x_mm", column)
    return Curve(name, *(part[at] for part in whole[1:]))


def _panels(table: Columns, sections: Columns, x: str) -> list[Panel]:
    return [
        _panel("vacuum [kPa]", table, x, _VACUUM),
        _section_panel(sections, x),
        _panel("area [cm²]", table, x, {"area_mm2": "outer face"}, per_unit=100.0),
        _panel("pressure [kPa]", table, x, _PRESSURE),
    ]


def _panel(label: str, table: Columns, x: str, names: Mapping[str, str], per_unit: float = 1.0) -> Panel:
    """The columns that are known, each with its name in the legend, divided by what makes one unit."""
    known = [column for column in names if table.is_known(column)]
    curves = [Curve.of(names[column], table, x, column) for column in known]
    return Panel(label, [Curve(c.name, c.x, c.value / per_unit, c.sigma / per_unit) for c in curves])


def _section_panel(sections: Columns, x: str) -> Panel:
    """The distance from the plane at each height, or the length of the outline where there is no plane."""
    is_distance = sections.is_known("distance_mm")
    column, label = ("distance_mm", "distance [mm]") if is_distance else ("length_mm", "outline [mm]")
    heights = np.unique(sections.numbers("height_mm")) if sections.is_known(column) else ()
    return Panel(label, [_at_height(sections, x, column, height) for height in heights])


def _at_height(sections: Columns, x: str, column: str, height: float) -> Curve:
    at = sections.numbers("height_mm") == height
    whole = Curve.of(f"x = {fixed(float(height), 1)} mm", sections, x, column)
    return Curve(whole.name, *(part[at] for part in whole[1:]))


def _svg(panels: Sequence[Panel], x_label: str, label: str, phases: Sequence[Mapping[str, Any]] = ()) -> Svg:
    """Draw the panels that have a curve, over a common axis."""
    panels = [panel for panel in panels if panel.curves]
    height_mm = _TOP_MM + _BOTTOM_MM + len(panels) * _PANEL_MM + (len(panels) - 1) * _GAP_MM
    width = (WIDTH_MM - _LEFT_MM - _RIGHT_MM) / WIDTH_MM

    def draw(canvas: "Figure") -> None:
        first: Axes | None = None
        for index, panel in enumerate(panels):
            bottom = height_mm - _TOP_MM - (index + 1) * _PANEL_MM - index * _GAP_MM
            box = (_LEFT_MM / WIDTH_MM, bottom / height_mm, width, _PANEL_MM / height_mm)
            axes = canvas.add_axes(box, sharex=first)
            first = first or axes
            _draw_panel(axes, panel, phases)
            axes.tick_params(labelbottom=index == len(panels) - 1)
            if index == len(panels) - 1:
                axes.set_xlabel(x_label)

    return drawn(draw, height_mm, label)


def _draw_panel(axes: "Axes", panel: Panel, phases: Sequence[Mapping[str, Any]]) -> None:
    for curve, colour in zip(map(Curve.broken, panel.curves), _COLOURS * len(panel.curves), strict=False):
        low, high = curve.value - curve.sigma, curve.value + curve.sigma
        axes.fill_between(curve.x, low, high, color=colour, alpha=0.22, linewidth=0)
        axes.plot(curve.x, curve.value, color=colour, label=curve.name)
    axes.margins(x=0.0, y=0.16 if phases else 0.05)  # the letters of the phases need room above the curves
    axes.set_ylabel(panel.label)
    axes.locator_params(axis="y", nbins=5)
    axes.axhline(0.0, color=FAINT, linewidth=0.4) if _spans_zero(axes) else None
    _mark(axes, phases)
    axes.legend(loc="lower left", bbox_to_anchor=(0.0, 0.97), ncols=5, borderaxespad=0.0, handlelength=1.4)


def _spans_zero(axes: "Axes") -> bool:
    low, high = axes.get_ylim()
    return low < 0 < high


def _mark(axes: "Axes", phases: Sequence[Mapping[str, Any]]) -> None:
    for phase in phases:
        axes.axvline(phase["end"], color=FAINT, linewidth=0.4, linestyle=(0, (3, 2)))
        middle = (phase["first"] + phase["end"]) / 2
        axes.text(middle, 0.98, phase["phase"], transform=axes.get_xaxis_transform(), ha="center", va="top",
                  color=GREY, size=7,
                  bbox={"facecolor": "white", "edgecolor": "none", "pad": 0.4})  # fmt: skip
