"""Setup: from the configuration to the parts of each instrument, with the problems of all devices at once."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from typing import Any, TypeVar

import yaml

from grabberd.acquisition import GRABBERS, INSTALLED_LOCATORS
from grabberd.acquisition.device import Grabber
from grabberd.bounded_documents import parse_yaml, read_text
from grabberd.config import Config, DeviceConfig, RigConfig
from grabberd.documents.named_types import JsonObject
from grabberd.errors import CalibrationMismatch, ConfigError, DriverMissing, InputError, Problem
from grabberd.geometry import Calibration, NominalRig
from grabberd.measurement import METHODS, LocationSettings
from grabberd.measurement.locators import Locator
from grabberd.measurement.settings import AUTOMATIC
from grabberd.processes.measure import MeasureSetup
from grabberd.processes.target_sizes import px_per_mm_of
from grabberd.reconstruction import ObjectModel
from grabberd.storage.json_value import read_json

T = TypeVar("T")
_LOADER = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
"""The loader in C if PyYAML has it: it reads an object model ten times as fast, so a daemon starts sooner."""
INCLUDE_DAMAGED = "include_damaged"
"""Setting of a run: True if damaged fields were measured too."""
TARGETS = "targets"
"""Setting of a measurement: limits of the targets' sizes on the object."""
_EXAMPLES = "see the examples of calibrations, objects and calibration frames in the folder configs/"


@dataclass(frozen=True, slots=True)
class DeviceSetup:
    """Parts of an instrument.

    Attributes:
        name: Name of the device.
        config: The device's part of the configuration.
        grabber: The grabber, not opened yet.
        measuring: Setup that points are measured with, or None without a calibration or an object model.
        documents: Documents of the calibration and the object model, copied into every capture.
        analysis_inputs: What its captures are analysed with; None if the configuration names none.
        made_with: The same and the settings: all that points are made with, as a run stores it.
    """

    name: str
    config: DeviceConfig
    grabber: Grabber
    measuring: MeasureSetup | None
    documents: JsonObject
    analysis_inputs: JsonObject | None = None
    made_with: JsonObject = field(init=False)

    def __post_init__(self) -> None:
        made_with = {**self.documents, "settings": settings_of(self.config)}
        # The class is frozen; this value follows from the others.
        object.__setattr__(self, "made_with", made_with)

    def with_calibration(self, document: Mapping[str, Any] | None) -> "DeviceSetup":
        """The same setup with another calibration, or with none.

        Raises:
            InputError: The document is not a calibration.
            CalibrationMismatch: It is for another rig.
        """
        documents = {**self.documents, "calibration": document}
        return replace(self, documents=documents, measuring=_measuring(self.config, documents))


def set_up(config: Config, file: Path) -> dict[str, DeviceSetup]:
    """Makes every device's setup, by name.

    Raises:
        ConfigError: Some devices have problems; it lists those of all.
    """
    problems: list[Problem] = []
    setups = {name: _device(name, device, file, problems) for name, device in config.devices.items()}
    if problems:
        raise ConfigError(problems)
    return {name: setup for name, setup in setups.items() if setup}


def _device(name: str, config: DeviceConfig, file: Path, problems: list[Problem]) -> DeviceSetup | None:
    def attempt(key: str, make: Callable[[], T]) -> T | None:
        try:
            return make()
        except DriverMissing as error:
            key, messages = "driver", [f"{error.message}; {error.hint}"]
        except InputError as error:
            messages = [f"{error.message}; {error.hint}"]
        except ValueError as error:
            messages = str(error).splitlines()
        problems.extend(Problem(str(file), f"devices.{name}.{key}", message) for message in messages)
        return None

    grabber = attempt("options", lambda: GRABBERS.create(config.driver, config.options))
    inputs = attempt("analysis.inputs", lambda: _if_named(config.analysis.inputs))
    documents = attempt("calibration", lambda: read_documents(config.calibration, config.object))
    located = attempt("location", lambda: location_settings(settings_of(config)))
    # By itself: there may be no calibration yet, and it is not to be found wrong only after there is one.
    usable = attempt("object", lambda: _checked_object(documents or {}))
    measured = documents if usable else {**(documents or {}), "object": None}
    measuring = attempt("calibration", lambda: _measuring(config, measured or {})) if located else None
    if grabber is None or documents is None:
        return None
    return DeviceSetup(name, config, grabber, measuring, documents, inputs)


def _if_named(path: Path | None) -> JsonObject | None:
    return None if path is None else read_yaml(path)


def read_documents(calibration: Path | None, object_model: Path | None) -> JsonObject:
    """The documents in a calibration (JSON) and an object model (YAML) file, None without a file.

    Raises:
        InputError: A file is not valid JSON or YAML.
    """
    return {
        "calibration": None if calibration is None else _read(calibration, read_json),
        "object": None if object_model is None else read_yaml(object_model),
    }


def read_yaml(path: Path) -> JsonObject:
    """The document in a YAML file, such as an object model or a calibration frame.

    Raises:
        InputError: It cannot be read, or has no keys.
    """
    return _read(path, lambda text: parse_yaml(text, _LOADER))


def _read(path: Path, parse: Callable[[str], Any]) -> JsonObject:
    try:
        document = parse(read_text(path))
    except OSError as error:
        raise InputError(f"{path} cannot be read: {error.strerror}", "check the file's name") from error
    except ValueError as error:
        reason = " ".join(str(error).split())
        raise InputError(f"{path} cannot be read: {reason}", _EXAMPLES) from error
    if document is None:
        raise InputError(f"{path} is empty: it has no keys", _EXAMPLES)
    if not isinstance(document, dict):
        raise InputError(f"{path} has no keys: it is {str(document)[:40]!r}", _EXAMPLES)
    return document


def _checked_object(documents: JsonObject) -> bool:
    """True; an object model that cannot be used raises."""
    if documents.get("object") is not None:
        ObjectModel.from_document(documents["object"])
    return True


def _measuring(config: DeviceConfig, documents: JsonObject) -> MeasureSetup | None:
    if documents.get("calibration") is None:
        return None
    check_rig(Calibration.from_document(documents["calibration"]), config.rig)
    if documents.get("object") is None:
        return None
    return measure_setup(documents, settings_of(config))


def measure_setup(documents: JsonObject, settings: JsonObject) -> MeasureSetup:
    """Makes a measuring setup from documents and settings as a capture file stores them.

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
    """The settings of a measurement as a capture file stores them."""
    own: JsonObject = {"line_jitter_px": config.line_jitter_px, "spread_px": config.spread_px}
    limits = config.targets.model_dump(exclude_none=True)
    return own | config.location.model_dump() | ({TARGETS: limits} if limits else {})


def settings_of_capture(config: Mapping[str, Any]) -> JsonObject:
    """The same settings, from a device's configuration as a capture file stores it."""
    own = {key: config[key] for key in ("line_jitter_px", "spread_px", TARGETS) if key in config}
    return own | dict(config.get("location") or {})


def location_settings(settings: JsonObject, scale: float | None = None) -> LocationSettings:
    """Settings of the locators; missing ones take the defaults of `LocationSettings`.

    Args:
        settings: As a capture file stores them.
        scale: Pixels of the picture for a millimetre on the object; without it, limits of the targets' sizes
            are left out.

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
    """The locator of another package by its name; None for those of the program.

    Raises:
        InputError: There is none of that name, or its package is broken.
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
    """The error for pictures of another size than the rig's."""
    return InputError(
        f"the pictures have {columns}x{lines} pixels, the rig's {rig.columns}x{rig.lines}: its views "
        "would be in the wrong places",
        "give their size and views under 'rig' in the configuration: 'grabberd inspect' writes them",
    )


def nominal_rig(rig: RigConfig) -> NominalRig:
    """Converts a configured rig to the type that the core takes."""
    return NominalRig(
        columns=rig.columns,
        lines=rig.lines,
        left=(rig.views.left.first_column, rig.views.left.end_column),
        right=(rig.views.right.first_column, rig.views.right.end_column),
        distance_mm=rig.distance_mm,
        base_mm=rig.base_mm,
        convergence_deg=rig.convergence_deg,
        focal_length_mm=rig.focal_length_mm,
        pixel_x_mm=rig.pixel_x_mm,
        pixel_y_mm=rig.pixel_y_mm,
        handedness=(rig.views.left.handedness, rig.views.right.handedness),
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
