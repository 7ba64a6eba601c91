"""Setups for measuring points, from the documents and settings stored in a capture."""

from collections.abc import Mapping
from dataclasses import fields
from typing import Any

from grabberd.config import DeviceConfig, RigConfig
from grabberd.core.chain.locating import px_per_mm_of
from grabberd.core.chain.measure import MeasureSetup
from grabberd.core.geometry import Calibration, NominalRig
from grabberd.core.measurement import METHODS, LocationSettings
from grabberd.core.measurement.locators import Locator
from grabberd.core.measurement.settings import AUTOMATIC
from grabberd.core.reconstruction import ObjectModel
from grabberd.documents.document import JsonObject
from grabberd.errors import CalibrationMismatch, DriverMissing, InputError
from grabberd.registry import Registry

INSTALLED_LOCATORS: Registry[Locator] = Registry("grabberd.locators", "locator")
"""Locators from other packages."""
INCLUDE_DAMAGED = "include_damaged"
"""Setting of a run: True if damaged fields were measured, too."""
TARGETS = "targets"
"""Setting of a measurement: limits of the targets' sizes on the object."""


def measure_setup(documents: JsonObject, settings: JsonObject) -> MeasureSetup:
    """Makes a setup from documents and settings as stored in a capture file.

    Raises:
        InputError: A document or a setting is invalid.
    """
    calibration = Calibration.from_document(documents["calibration"])
    location = location_settings(settings, px_per_mm_of(calibration.views))
    return MeasureSetup(
        calibration=calibration,
        object_model=ObjectModel.from_document(documents["object"]),
        line_jitter_px=location.line_jitter_px,
        location=location,
    )


def settings_of(config: DeviceConfig) -> JsonObject:
    """The settings of a measurement as stored in a capture file."""
    own: JsonObject = {"line_jitter_px": config.line_jitter_px, "spread_px": config.spread_px}
    limits = config.targets.model_dump(exclude_none=True)
    return own | config.location.model_dump() | ({TARGETS: limits} if limits else {})


def settings_of_capture(config: Mapping[str, Any]) -> JsonObject:
    """The same settings, from a device's configuration stored in a capture file."""
    own = {key: config[key] for key in ("line_jitter_px", "spread_px", TARGETS) if key in config}
    return own | dict(config.get("location") or {})


def location_settings(settings: JsonObject, scale: float | None = None) -> LocationSettings:
    """Settings of the locators; missing ones get the defaults of `LocationSettings`.

    Args:
        settings: Settings as stored in a capture file.
        scale: Pixels per millimetre on the object; without it, limits of the targets' sizes are ignored.

    Raises:
        InputError: A setting is invalid.
    """
    known = {one.name for one in fields(LocationSettings)} - {"locator"}
    own = {key: settings[key] for key in settings if key in known}
    limits = settings.get(TARGETS) or {}
    for name, key in (("min_diameter_px", "least_mm"), ("max_diameter_px", "most_mm")):
        if scale is not None and limits.get(key) is not None:
            own[name] = scale * limits[key]
    try:
        return LocationSettings(**own, locator=_installed_locator(own.get("method", AUTOMATIC)))
    except ValueError as error:
        raise InputError(str(error), "'automatic' suits most fields") from error


def _installed_locator(method: str) -> Locator | None:
    """The locator of another package, by name; None for built-in methods.

    Raises:
        InputError: The name is unknown, or the package is broken.
    """
    if method in METHODS:
        return None
    installed = INSTALLED_LOCATORS.available()
    if method not in installed:
        known = ", ".join((*METHODS, *installed))
        raise InputError(
            f"unknown method {method!r}; choose from {known}",
            "correct the name, or install the package that brings it in the entry point group "
            f"'{INSTALLED_LOCATORS.group}'; 'automatic' suits most fields",
        )
    try:
        return INSTALLED_LOCATORS.load(method)
    except DriverMissing as error:
        raise InputError(error.message, error.hint) from error


def misfit(rig: RigConfig, columns: int, lines: int) -> InputError:
    """The error for pictures that do not have the rig's size."""
    return InputError(
        f"the pictures have {columns}x{lines} pixels, the rig's {rig.columns}x{rig.lines}: its views "
        "would be in the wrong places",
        "give their size and views under 'rig' in the configuration: 'grabberd inspect' writes them",
    )


def nominal_rig(rig: RigConfig) -> NominalRig:
    """Converts a configured rig to the core's type."""
    left, right = rig.views.left, rig.views.right
    return NominalRig(
        left=(left.first_column, left.end_column),
        right=(right.first_column, right.end_column),
        handedness=(left.handedness, right.handedness),
        **rig.model_dump(exclude={"views", "exposure_ms", "glass"}),
    )


def check_rig(calibration: Calibration, rig: RigConfig) -> None:
    """Checks that a calibration is for this rig.

    Raises:
        CalibrationMismatch: Picture size, glass or the views' columns differ.
    """
    glass = rig.glass.model_dump() if rig.glass else None
    calibration.check_fits(rig.columns, rig.lines, glass)
    _check_views(calibration, rig)


def _check_views(calibration: Calibration, rig: RigConfig) -> None:
    for view, columns in zip(calibration.views, (rig.views.left, rig.views.right), strict=True):
        has, wants = (view.first_column, view.end_column), (columns.first_column, columns.end_column)
        if has != wants:
            raise CalibrationMismatch(
                f"the calibration's {view.name} view has columns {has[0]} to {has[1]}, "
                f"the rig's {wants[0]} to {wants[1]}",
                "use the calibration of this rig, or fix rig.views",
            )
