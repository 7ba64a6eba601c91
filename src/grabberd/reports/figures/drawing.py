"""Figures as SVG inside the page: the same text for the same numbers.

Enlarged arrows over the picture: residuals, distortion, local residual field.
"""

import io
import re
from collections.abc import Callable, Mapping, Sequence
from html import escape
from importlib.util import find_spec
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from grabberd.errors import ExtraMissing
from grabberd.reports.notation import colour, significant

if TYPE_CHECKING:
    from matplotlib.figure import Figure
if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Array = NDArray[np.float64]

MM_PER_INCH = 25.4
WIDTH_MM = 170.0
"""Width of a figure, which fits between the margins of A4."""

INK, GREY, FAINT, PALE = "#222222", "#6b6b6b", "#8a8a8a", "#e4e4e4"

_STYLE: dict[Any, Any] = {
    # Lettering stays text: it can be searched and takes the font of the page.
    "svg.fonttype": "none",
    "font.family": "sans-serif",
    "font.size": 7.5,
    "text.color": INK,
    # A dollar sign in the name of a view or a state is not the beginning of a formula.
    "text.parse_math": False,
    "axes.edgecolor": FAINT,
    "axes.labelcolor": INK,
    "axes.labelsize": 7.5,
    "axes.linewidth": 0.5,
    "axes.spines.right": False,
    "axes.spines.top": False,
    "axes.titlesize": 8,
    "axes.titleweight": "bold",
    "axes.titlelocation": "left",
    "axes.unicode_minus": True,
    "xtick.color": FAINT,
    "xtick.labelcolor": INK,
    "xtick.major.size": 2.5,
    "xtick.major.width": 0.5,
    "ytick.color": FAINT,
    "ytick.labelcolor": INK,
    "ytick.major.size": 2.5,
    "ytick.major.width": 0.5,
    "legend.frameon": False,
    "legend.fontsize": 7.5,
    "lines.linewidth": 0.8,
    "hatch.linewidth": 0.4,
}
_DIGITS = re.compile(r"(\.\d\d)\d+")
"""Decimals of a path's coordinates from the third on: nobody sees a hundredth of a point."""
_NO_METADATA = {"Date": None, "Creator": None, "Format": None, "Type": None}


class Svg(str):
    """A figure's markup; only `drawn` makes it, and templates insert it as it is, without escaping."""

    __slots__ = ()

    def __html__(self) -> str:
        """Tell Jinja2 that this is markup already."""
        return self


def require_matplotlib() -> None:
    """Check that figures can be drawn.

    Raises:
        ExtraMissing: matplotlib is not installed.
    """
    if find_spec("matplotlib") is None:
        raise ExtraMissing("a report with figures", "report")


def drawn(draw: "Callable[[Figure], None]", height_mm: float, label: str) -> Svg:
    """Draw a figure of the page's width as SVG.

    Args:
        draw: draws onto an empty figure.
        height_mm: height of the figure.
        label: alternative text for readers who cannot see the figure. It is unique on its page, since the ids
            inside the figure are derived from it.
    """
    from matplotlib import rc_context, rcdefaults, rcParams  # noqa: PLC0415
    from matplotlib.figure import Figure  # noqa: PLC0415

    page = io.StringIO()
    # A user's matplotlibrc must not change reports, and the salt makes ids the same in every run.
    with rc_context():
        rcdefaults()
        rcParams.update({**_STYLE, "svg.hashsalt": label})
        canvas = Figure(figsize=(WIDTH_MM / MM_PER_INCH, height_mm / MM_PER_INCH), dpi=72)
        draw(canvas)
        canvas.savefig(page, format="svg", facecolor="none", metadata=_NO_METADATA)
    return _inline(page.getvalue(), label)


def nice(value: float) -> float:
    """Round down to 1, 2 or 5 times a power of ten."""
    power = 10.0 ** int(f"{value:e}".split("e")[1])
    return max(step for step in (1, 2, 5) if step * power <= value * (1 + 1e-9)) * power


def _inline(page: str, label: str) -> Svg:
    """The drawing without prologue and style, whose rules would reach the whole page, or unused ids."""
    svg = page[page.index("<svg") :]
    svg = re.sub(r"<style.*?</style>", "", svg, flags=re.DOTALL)
    used = set(re.findall(r'(?:url\(|href=")#([^)"]+)', svg))
    svg = re.sub(r' id="([^"]+)"', lambda found: found.group() if found.group(1) in used else "", svg)
    svg = re.sub(r' d="[^"]+"', lambda found: _DIGITS.sub(r"\1", found.group()), svg)
    return Svg(svg.replace("<svg", f'<svg role="img" aria-label="{escape(label, quote=True)}"', 1))


Document = Mapping[str, Any]

_RESIDUAL_PX, _FIELD_PX = 40.0, 44.0
"""Length in the picture that nearly all arrows stay below."""
_SCALE = 1.3
"""Length of the scale's arrow, by the longest ones."""
_MOST_ARROWS = 12
"""Arrows of a field in a row or a column of a view: more of them would overlap."""
_HEIGHT_MM = 122.0
_BOX = (0.08, 0.14, 0.90, 0.81)


def residuals_svg(document: Document, label: str) -> Svg:
    """Draw the whole picture with the residuals of both views; blunders are ringed and named."""

    def draw(canvas: "Figure") -> None:
        axes = canvas.add_axes(_BOX)
        _picture(axes, document)
        _residuals(axes, document["residuals"])
        _blunders(axes, document)

    return drawn(draw, _HEIGHT_MM, label)


def field_svg(document: Document, grids: Sequence[Mapping[str, Any]], label: str) -> Svg:
    """Draw displacements on grids as arrows and lines of equal length in px; a grid's rows are its lines."""

    def draw(canvas: "Figure") -> None:
        axes = canvas.add_axes(_BOX)
        _picture(axes, document)
        lengths = np.concatenate([np.hypot(*_displacements(grid)).ravel() for grid in grids])
        enlarged = enlargement(lengths, _FIELD_PX)
        for grid in grids:
            _contours(axes, grid)
            _field(axes, grid, enlarged)
        _scale_arrow(axes, enlarged, _FIELD_PX * _SCALE)

    return drawn(draw, _HEIGHT_MM, label)


def enlargement(lengths_px: Sequence[float] | Array, longest_px: float) -> float:
    """Choose the factor 1, 2, 5, 10 … that keeps nearly all vectors below a length.

    The 98 % quantile decides, so that a single blunder does not shrink all other arrows to dots.
    """
    lengths = np.asarray(lengths_px, dtype=np.float64)
    typical = float(np.quantile(lengths[np.isfinite(lengths)], 0.98)) if np.isfinite(lengths).any() else 0.0
    return nice(longest_px / typical) if typical > 0 else 1.0


def _picture(axes: "Axes", document: Document) -> None:
    """The outline of the picture with its views: their limits, and their names in their colours."""
    columns, lines = _size(document)
    axes.set_xlim(-0.5, columns - 0.5)
    axes.set_ylim(lines - 0.5, -0.5)
    axes.set_aspect("equal")
    axes.set_xlabel("column [px]")
    axes.set_ylabel("frame line [px]")
    for view in document["views"]:
        if view["first_column"] > 0:
            axes.axvline(view["first_column"] - 0.5, color=FAINT, linewidth=0.5, linestyle=(0, (4, 3)))
        middle = (view["first_column"] + view["end_column"] - 1) / 2
        paint = colour(view["name"])
        axes.text(middle, -8, view["name"], color=paint, ha="center", va="bottom", weight="bold", size=8)
    axes.spines[["top", "right"]].set_visible(True)


def _size(document: Document) -> tuple[float, float]:
    """The picture's columns and lines; where they are not given, the reach of views and image points."""
    image = document.get("image") or {}
    columns = image.get("columns") or max(view["end_column"] for view in document["views"])
    lines = image.get("lines") or 1 + max(
        (row["y_px"] for row in document.get("residuals") or []), default=575
    )
    return float(columns), float(lines)


def _residuals(axes: "Axes", residuals: Sequence[Mapping[str, Any]]) -> None:
    lengths = [float(np.hypot(row["dx_px"], row["dy_px"])) for row in residuals]
    enlarged = enlargement(lengths, _RESIDUAL_PX)
    for view in sorted({row["view"] for row in residuals}):
        rows = [row for row in residuals if row["view"] == view]
        positions = np.array([(row["x_px"], row["y_px"]) for row in rows])
        vectors = np.array([(row["dx_px"], row["dy_px"]) for row in rows])
        axes.plot(*positions.T, ".", color=FAINT, markersize=1.5, markeredgewidth=0)
        _arrows(axes, positions, vectors, enlarged, colour(view))
    _scale_arrow(axes, enlarged, _RESIDUAL_PX * _SCALE)


def _blunders(axes: "Axes", document: Document) -> None:
    """Rings at the blunders' own positions, or at those of their image points where they stayed in."""
    positions = {(row["view"], row["target"]): (row["x_px"], row["y_px"]) for row in document["residuals"]}
    for row in document.get("blunders") or []:
        own = (row["x_px"], row["y_px"]) if row.get("x_px") is not None else None
        if position := own or positions.get((row["view"], row["target"])):
            axes.plot(*position, "o", mfc="none", mec=INK, markersize=13, mew=0.9)
            axes.annotate(f"{row['target']}", position, (8, 6), textcoords="offset points", weight="bold")


def _displacements(grid: Mapping[str, Any]) -> tuple[Array, Array]:
    return np.array(grid["dx_px"], dtype=np.float64), np.array(grid["dy_px"], dtype=np.float64)


def _contours(axes: "Axes", grid: Mapping[str, Any]) -> None:
    length = np.ma.masked_invalid(np.hypot(*_displacements(grid)))
    if min(length.shape) < 2 or length.count() < 4 or np.ptp(length) == 0:
        return
    lines = axes.contour(
        grid["columns"], grid["lines"], length, levels=6, colors=GREY, linewidths=0.5, zorder=1
    )
    axes.clabel(lines, fmt=lambda value: f"{value:.3g}", fontsize=6.5, inline_spacing=3, use_clabeltext=True)


def _field(axes: "Axes", grid: Mapping[str, Any], enlarged: float) -> None:
    dx, dy = _displacements(grid)
    chosen = tuple(slice(every // 2, None, every) for every in map(_stride, dx.shape))
    columns, lines = np.meshgrid(
        np.array(grid["columns"], dtype=np.float64), np.array(grid["lines"], dtype=np.float64)
    )
    positions = np.stack([columns[chosen].ravel(), lines[chosen].ravel()], axis=1)
    vectors = np.stack([dx[chosen].ravel(), dy[chosen].ravel()], axis=1)
    known = np.isfinite(vectors).all(axis=1)
    _arrows(axes, positions[known], vectors[known], enlarged, colour(grid["view"]))


def _stride(count: int) -> int:
    return -(-count // _MOST_ARROWS)


def _arrows(axes: "Axes", positions_px: Array, vectors_px: Array, enlarged: float, paint: str) -> None:
    """Vectors (N, 2) at their positions (N, 2), both in frame pixels."""
    axes.quiver(
        *positions_px.T,
        *vectors_px.T,
        angles="xy",
        scale_units="xy",
        scale=1 / enlarged,
        color=paint,
        width=0.0016,
        headwidth=4,
        headlength=5,
        headaxislength=4.5,
        clip_on=False,
    )


def _scale_arrow(axes: "Axes", enlarged: float, longest_px: float) -> None:
    """An arrow of a round length below the picture."""
    length = nice(longest_px / enlarged)
    line = axes.get_ylim()[0] * 1.13
    end = axes.get_xlim()[1]
    start = end - length * enlarged
    _arrows(axes, np.array([[start, line]]), np.array([[length, 0.0]]), enlarged, INK)
    text = f"{significant(length, 1)} px, enlarged {significant(enlarged, 1)} times"
    axes.text(start - 8, line, text, ha="right", va="center")
