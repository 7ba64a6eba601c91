"""How well points can be measured with this calibration, predicted and put to the proof."""

from collections.abc import Iterator, Mapping
from statistics import median
from typing import Any

from grabberd.reports.chapters.head import alpha
from grabberd.reports.figures import validation_svg, volume_svg
from grabberd.reports.markup import Html, absent, element, figure, joined, paragraph, table
from grabberd.reports.numbers import chance, count, fixed, significant

Document = Mapping[str, Any]

_SHARES = {"calibration": "calibration alone", "total": "pointing and calibration"}


def volume(document: Document) -> Html:
    """Propagated σ of X, Y, Z in planes through the measuring volume."""
    known = document.get("volume")
    if not known or not known.get("planes"):
        return absent("The standard deviations over the measuring volume were not computed.")
    figures = [
        figure(
            volume_svg(known, share, f"Standard deviation of X, Y and Z in planes of the volume, {said}"),
            f"Standard deviation of X, Y and Z in planes of equal Z: {said}. Grey: not seen by both views.",
        )
        for share, said in _SHARES.items()
    ]
    return joined(paragraph(_pointing(known)), _planes(known), *figures)


def validation(document: Document) -> Html:
    """Targets held out of the adjustment, measured with it."""
    known = document.get("validation")
    if not known:
        return absent("No targets were held out, so the predicted σ have not been put to the proof.")
    return joined(paragraph(_outcome(known, alpha(document))), _summary(known), _points(known.get("points")))


def _pointing(known: Mapping[str, Any]) -> str:
    pointing = known.get("pointing_px")
    if not pointing:
        return "The pointing σ that the total contains is not recorded."
    x, y = map(significant, pointing)
    return (
        f"Total: one field with a pointing σ of {x} px in x and {y} px in y, and the calibration. The "
        "calibration's share is common to all fields: no averaging reduces it."
    )


def _planes(known: Mapping[str, Any]) -> Html:
    heads = ["Z [mm]", *(f"{axis}, {share}" for share in _SHARES for axis in "XYZ")]
    rows = [
        (fixed(plane["z_mm"], 1), *(_spread(plane[share][axis]) for share in _SHARES for axis in "xyz"))
        for plane in known["planes"]
    ]
    return table("σ in each plane [mm]: median (largest)", heads, rows)


def _spread(grid: Any) -> str:
    known = list(_known(grid))
    return f"{fixed(median(known), 4)} ({fixed(max(known), 4)})" if known else "not seen"


def _known(grid: Any) -> Iterator[float]:
    yield from (value for row in grid for value in row if value is not None)


def _outcome(known: Mapping[str, Any], level: float) -> str:
    blocks = (
        f"Targets were held out in {count(known.get('blocks'))} blocks in space, each measured with a "
        "calibration made without it."
    )
    if known.get("p") is None:
        return f"{blocks} Their errors were not tested."
    verdict = "are as large as predicted" if known["p"] >= level else "are not as predicted"
    return (
        f"{blocks} Their errors {verdict}: χ² = {significant(known.get('chi2'), 4)} with "
        f"{count(known.get('freedom'))} degrees of freedom, {chance(known['p'])}."
    )


def _summary(known: Mapping[str, Any]) -> Html:
    axes = ("x", "y", "z", "xyz")
    rows = [
        (said, *(fixed((known.get(key) or {}).get(axis), 4) for axis in axes))
        for key, said in (("rmse_mm", "RMSE observed"), ("predicted_mm", "RMSE predicted"))
    ]
    return table("Held-out targets [mm]", ["", *(axis.upper() for axis in axes)], rows)


def _points(points: Any) -> Html:
    if not points:
        return absent("The single errors are not recorded.")
    drawn = figure(
        validation_svg(points),
        "Error of each held-out target over its predicted σ; 95 of 100 should lie inside the grey band.",
    )
    heads = ["Target", "Block", "X", "Y", "Z", "dX", "dY", "dZ", "σX", "σY", "σZ"]
    listed = table(
        "Held-out targets: place, error, predicted σ [mm]",
        heads,
        [_listed(p) for p in points],
        class_="dense",
    )
    return joined(drawn, element("details", element("summary", f"{len(points)} held-out targets"), listed))


def _listed(row: Mapping[str, Any]) -> list[object]:
    axes = ("x", "y", "z")
    return [
        count(row["target"]), count(row.get("block")),
        *(fixed(row.get(f"{axis}_mm"), 3) for axis in axes),
        *(fixed(row[f"d{axis}_mm"], 4) for axis in axes),
        *(fixed(row[f"sigma_{axis}_mm"], 4) for axis in axes),
    ]  # fmt: skip
