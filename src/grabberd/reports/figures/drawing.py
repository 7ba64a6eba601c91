"""From a function that draws to a figure inside the page: the same text for the same numbers."""

import io
import re
from collections.abc import Callable
from html import escape
from importlib.util import find_spec
from typing import TYPE_CHECKING, Any

from grabberd.errors import ExtraMissing
from grabberd.reports.markup import Html

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

MM_PER_INCH = 25.4
WIDTH_MM = 170.0
"""Of a figure: what A4 has between its margins."""

INK, GREY, FAINT, PALE = "#222222", "#6b6b6b", "#8a8a8a", "#e4e4e4"

_STYLE: dict[Any, Any] = {
    "svg.fonttype": "none",
    "font.family": "sans-serif",
    "font.size": 7.5,
    "text.color": INK,
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
"""Of lines: a hundredth of a point is seen by nobody."""
_NO_METADATA = {"Date": None, "Creator": None, "Format": None, "Type": None}


def require_matplotlib() -> None:
    """Whether figures can be drawn at all.

    Raises:
        ExtraMissing: matplotlib is not installed.
    """
    if find_spec("matplotlib") is None:
        raise ExtraMissing("a report with figures", "report")


def drawn(draw: "Callable[[Figure], None]", height_mm: float, label: str) -> Html:
    """A figure of the page's width as SVG.

    Args:
        draw: puts everything onto an empty figure.
        height_mm: of the figure.
        label: what is to be seen, for who cannot see it; one of its own for every figure of a page.
    """
    from matplotlib import rc_context, rcdefaults, rcParams  # noqa: PLC0415
    from matplotlib.figure import Figure  # noqa: PLC0415

    page = io.StringIO()
    with rc_context():
        rcdefaults()
        rcParams.update({**_STYLE, "svg.hashsalt": label})
        canvas = Figure(figsize=(WIDTH_MM / MM_PER_INCH, height_mm / MM_PER_INCH), dpi=72)
        draw(canvas)
        canvas.savefig(page, format="svg", facecolor="none", metadata=_NO_METADATA)
    return _inline(page.getvalue(), label)


def column_scale(axes: "Axes", lines: float, columns: float) -> None:
    """Axes of the whole picture: frame pixels, lines downwards, square."""
    axes.set_xlim(-0.5, columns - 0.5)
    axes.set_ylim(lines - 0.5, -0.5)
    axes.set_aspect("equal")
    axes.set_xlabel("column [px]")
    axes.set_ylabel("frame line [px]")


def nice(value: float) -> float:
    """The largest 1, 2 or 5 times a power of ten that is not above the value."""
    power = 10.0 ** int(f"{value:e}".split("e")[1])
    return max(step for step in (1, 2, 5) if step * power <= value * (1 + 1e-9)) * power


def _inline(page: str, label: str) -> Html:
    """The drawing alone: no prologue, no style of its own, and only the ids and digits that are of use."""
    svg = page[page.index("<svg") :]
    svg = re.sub(r"<style.*?</style>", "", svg, flags=re.DOTALL)
    used = set(re.findall(r'(?:url\(|href=")#([^)"]+)', svg))
    svg = re.sub(r' id="([^"]+)"', lambda found: found.group() if found.group(1) in used else "", svg)
    svg = re.sub(r' d="[^"]+"', lambda found: _DIGITS.sub(r"\1", found.group()), svg)
    return Html(svg.replace("<svg", f'<svg role="img" aria-label="{escape(label, quote=True)}"', 1))
