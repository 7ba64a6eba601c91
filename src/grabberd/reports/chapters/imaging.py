"""How the views image: distortion, local field, and the geometry of the rig."""

from collections.abc import Mapping
from typing import Any

from grabberd.reports.figures import field_svg, geometry_svg
from grabberd.reports.markup import Html, absent, facts, figure, joined, paragraph, table
from grabberd.reports.numbers import count, fixed, significant

Document = Mapping[str, Any]


def distortion(document: Document) -> Html:
    """What lens and mirrors add to the ideal point."""
    grids = document.get("distortion")
    if not grids:
        return absent("The distortion of the views is not recorded.")
    drawn = field_svg(document, grids, "Distortion of both views as arrows and lines of equal length")
    return figure(
        drawn,
        "Distortion dx, dy of equations (6) and (7), added to the ideal point: arrows enlarged as the scale "
        "says, grey lines of equal length labelled in px.",
    )


def local_field(document: Document) -> Html:
    """What a smooth field over the picture adds to the global model, and whether held-out targets want it."""
    field = document.get("local_field")
    if not field:
        return absent("No local residual field was estimated: equations (4) to (7) describe the views alone.")
    accepted = "accepted: held-out targets are nearer with it" if field.get("accepted") else (
        "not accepted: held-out targets are not nearer with it, and it has no part in the calibration"
    )  # fmt: skip
    return joined(
        paragraph(f"The local residual field was {accepted}.", _gain(field)),
        _field_table(field),
        _field_figure(document),
    )


def geometry(document: Document) -> Html:
    """Cameras, rays and targets to scale."""
    known = document.get("geometry")
    if not known or not known.get("cameras") or not known.get("targets_mm"):
        return absent("The imaging geometry is not recorded.")
    drawn, scale = geometry_svg(known)
    caption = (
        f"Imaging geometry, 1 : {significant(scale, 2)} on A4. Virtual cameras with the rays of all targets, "
        "the fields of view of their halves (shaded) and their optical axes (dash-dotted)."
    )
    return joined(figure(drawn, caption), facts("Geometry of the rig", _lengths(known)), _cameras(known))


def _gain(field: Mapping[str, Any]) -> str:
    if field.get("gain") is None:
        return ""
    return f" The squares of their residuals change by {significant(-field['gain'])} standard errors with it."


def _field_table(field: Mapping[str, Any]) -> Html:
    held_out = field.get("held_out_rms_px") or {}
    lengths, signals = field.get("length_px") or {}, field.get("signal_px") or {}
    rows = [
        (view, *map(significant, (rms.get("without"), rms.get("with"), lengths.get(view), signals.get(view))))
        for view, rms in held_out.items()
    ]
    heads = ["View", "Held-out RMS without", "with", "Correlation length", "Signal"]
    return table("Local residual field [px]", heads, rows)


def _field_figure(document: Document) -> Html:
    grids = document["local_field"].get("grids")
    if not grids:
        return absent("The local field is not drawn: its grids are not recorded.")
    drawn = field_svg(
        document, grids, "Local residual field of both views as arrows and lines of equal length"
    )
    return figure(
        drawn, "Local residual field: arrows enlarged as the scale says, lines of equal length in px."
    )


def _lengths(known: Mapping[str, Any]) -> list[tuple[object, object]]:
    return [
        ("Base", f"{fixed(known.get('base_mm'), 2)} mm"),
        ("Distance from the base to the middle of the targets", f"{fixed(known.get('distance_mm'), 2)} mm"),
        ("Convergence of the middle rays of both halves", f"{fixed(known.get('convergence_deg'), 3)}°"),
        ("Departure from planar motion", f"{fixed(known.get('planar_motion_mm'), 3)} mm"),
        ("Targets", count(len(known["targets_mm"]))),
    ]


def _cameras(known: Mapping[str, Any]) -> Html:
    rows = [
        (camera["name"], *(fixed(x, 2) for x in camera["center_mm"]), *(fixed(x, 4) for x in camera["axis"]))
        for camera in known["cameras"]
    ]
    heads = ["View", "X₀ [mm]", "Y₀ [mm]", "Z₀ [mm]", "Axis X", "Axis Y", "Axis Z"]
    return table("Projection centres and directions of view, in the object's frame", heads, rows)
