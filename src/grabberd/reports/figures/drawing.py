"""Figures as SVG inside the page: the same text for the same numbers."""

import io
import re
from collections.abc import Callable
from html import escape
from importlib.util import find_spec
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from grabberd.errors import ExtraMissing

if TYPE_CHECKING:
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
