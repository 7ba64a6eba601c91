"""What the calibration was made from, and how its targets were told apart."""

from collections.abc import Mapping, Sequence
from typing import Any

from grabberd.reports.markup import Html, absent, element, facts, joined, paragraph, table
from grabberd.reports.names import label, spelled
from grabberd.reports.numbers import count, significant

Document = Mapping[str, Any]

_HOW = {"lattice": "the lattice of the targets, without a hand", "hand": "hand"}


def project(document: Document) -> Html:
    """Capture, calibration frame, glass, picture and settings."""
    return element(
        "div",
        _part(document, "capture", "Capture", "No capture is named: the image points came from elsewhere."),
        _calibration_frame(document),
        _part(document, "image", "Picture [px]", "The size of the picture is not recorded."),
        _part(document, "glass", "Glass", "The rig was calibrated without glass in the path of the rays."),
        _part(document, "settings", "Settings", "The settings of the adjustment are not recorded."),
        class_="beside",
    )


def identification(document: Document) -> Html:
    """How blobs were assigned to targets, and how clearly."""
    found = document.get("identification")
    if not found:
        return absent("How the targets were identified is not recorded.")
    views = [view["name"] for view in document["views"]]
    rows = [
        (view, *(_of_view(found, key, view) for key in ("handedness", "found", "unmatched_blobs")),
         *(_rms(found, key, view) for key in ("rms_px", "runner_up_rms_px")))
        for view in views
    ]  # fmt: skip
    heads = ["View", "Handedness", "Targets found", "Blobs unmatched", "RMS [px]", "Runner-up's RMS [px]"]
    return joined(
        _how(found, views),
        table(f"Identification of {count(found.get('of'))} targets", heads, rows),
        paragraph(
            "RMS is the misfit of the hypothesis that was taken, runner-up's that of the next best: the "
            "further apart they are, the clearer the identification. Handedness −1 is a view whose light was "
            "reflected an odd number of times."
        ),
    )


def _how(found: Mapping[str, Any], views: Sequence[str]) -> Html:
    if by := found.get("by"):
        return paragraph(f"Identified by {_HOW.get(by, by)}.")
    described = found.get("description") or {}
    return joined(*(paragraph(f"{view}: {described[view]}.") for view in views if described.get(view)))


def _part(document: Document, key: str, caption: str, otherwise: str) -> Html:
    part = document.get(key)
    if not part:
        return absent(otherwise)
    return facts(caption, [(label(name), spelled(value)) for name, value in part.items()])


def _calibration_frame(document: Document) -> Html:
    known = document.get("calibration_frame")
    if not known:
        return absent("The calibration frame is not recorded.")
    certificate = known.get("certificate")
    own = {key: value for key, value in known.items() if key != "certificate"}
    table_ = _part({"calibration_frame": own}, "calibration_frame", "Calibration frame", "")
    otherwise = "The calibration frame has no certificate."
    return joined(
        table_,
        _part({"certificate": certificate}, "certificate", "Certificate of the calibration frame", otherwise),
    )


def _of_view(found: Mapping[str, Any], key: str, view: str) -> str:
    value = (found.get(key) or {}).get(view)
    return f"{value:+d}".replace("-", "−") if key == "handedness" and value is not None else count(value)


def _rms(found: Mapping[str, Any], key: str, view: str) -> str:
    return significant((found.get(key) or {}).get(view))
