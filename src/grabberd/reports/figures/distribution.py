"""The distribution of the residuals beside the normal one: histogram and quantiles."""

from collections.abc import Mapping, Sequence
from statistics import NormalDist
from typing import TYPE_CHECKING, Any

import numpy as np

from grabberd.reports.figures.drawing import FAINT, INK, Array, Svg, drawn
from grabberd.reports.names import colour

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


def distribution_svg(document: Mapping[str, Any], label: str) -> Svg:
    """Draw histogram and quantiles of the standardised residuals, x and y together, one colour per view."""
    samples = _samples(document["residuals"])

    def draw(canvas: "Figure") -> None:
        _histogram(canvas.add_axes((0.08, 0.20, 0.40, 0.70)), samples)
        _quantiles(canvas.add_axes((0.58, 0.20, 0.40, 0.70)), samples)

    return drawn(draw, 62.0, label)


def has_samples(residuals: Sequence[Mapping[str, Any]]) -> bool:
    """Return True if there are standardised residuals to draw."""
    return bool(_samples(residuals))


def _samples(residuals: Sequence[Mapping[str, Any]]) -> dict[str, Array]:
    samples: dict[str, list[float]] = {}
    for row in residuals:
        known = [row[axis] for axis in ("tau_x", "tau_y") if row.get(axis) is not None]
        samples.setdefault(row["view"], []).extend(known)
    return {view: np.array(values) for view, values in samples.items() if values}


def _histogram(axes: "Axes", samples: Mapping[str, Array]) -> None:
    values = np.concatenate(list(samples.values()))
    reach = max(4.0, float(np.ceil(np.abs(values).max() * 2) / 2))
    width = 0.5 if len(values) < 600 else 0.25
    edges = np.arange(-reach, reach + width / 2, width)
    axes.hist(
        list(samples.values()),
        bins=list(edges),
        stacked=True,
        color=[colour(view) for view in samples],
        label=list(samples),
        edgecolor="white",
        linewidth=0.25,
    )
    curve = np.linspace(-reach, reach, 121)
    density = np.exp(-0.5 * curve * curve) / np.sqrt(2 * np.pi) * len(values) * width
    axes.plot(curve, density, color=INK, label="normal")
    axes.set_xlim(-reach, reach)
    axes.set_xlabel("standardised residual τ")
    axes.set_ylabel("coordinates")
    axes.set_title("Histogram")
    axes.legend(loc="upper left", handlelength=1.2, borderaxespad=0.0)


def _quantiles(axes: "Axes", samples: Mapping[str, Array]) -> None:
    normal = NormalDist()
    reach = max(3.5, *(float(np.abs(values).max()) + 0.3 for values in samples.values()))
    axes.plot([-reach, reach], [-reach, reach], color=FAINT, linewidth=0.6)
    for view, values in samples.items():
        # Hazen's plotting positions: the first and the last stay finite.
        expected = [normal.inv_cdf((rank + 0.5) / len(values)) for rank in range(len(values))]
        axes.plot(expected, np.sort(values), "o", color=colour(view), markersize=2.2, mew=0, label=view)
    axes.set_xlim(-3.5, 3.5)
    axes.set_ylim(-reach, reach)
    axes.set_xlabel("expected of a normal distribution")
    axes.set_ylabel("observed")
    axes.set_title("Quantiles")
    axes.legend(loc="upper left", handlelength=1.0, borderaxespad=0.0)
