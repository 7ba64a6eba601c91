"""Setup: from the configuration to the parts of each instrument; all problems are reported at once."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, TypeVar

from grabberd.archive.measure_setups import check_rig, location_settings, measure_setup, settings_of
from grabberd.config import Config, DeviceConfig
from grabberd.core.chain.measure import MeasureSetup
from grabberd.core.geometry import Calibration
from grabberd.core.reconstruction import ObjectModel
from grabberd.documents.document import JsonObject
from grabberd.errors import ConfigError, DriverMissing, InputError, Problem
from grabberd.files.reading import read_documents, read_yaml
from grabberd.instrument.acquisition import GRABBERS
from grabberd.instrument.acquisition.device import Grabber

T = TypeVar("T")


@dataclass(frozen=True, slots=True)
class DeviceSetup:
    """Parts of an instrument.

    Attributes:
        name: Name of the device.
        config: The device's part of the configuration.
        grabber: The grabber, not opened yet.
        measuring: Setup for measuring points, or None without a calibration or an object model.
        documents: Documents of the calibration and the object model, copied into every capture.
        analysis_inputs: Inputs for analysing its captures; None if the configuration names none.
        made_with: The same and the settings: all inputs of points, as stored by a run.
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
        # The class is frozen; this value is derived from the others.
        object.__setattr__(self, "made_with", made_with)

    def with_calibration(self, document: Mapping[str, Any] | None) -> "DeviceSetup":
        """The same setup with another calibration, or without one.

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
    named = config.analysis.inputs
    inputs = None if named is None else attempt("analysis.inputs", lambda: read_yaml(named))
    documents = attempt("calibration", lambda: read_documents(config.calibration, config.object))
    located = attempt("location", lambda: location_settings(settings_of(config)))
    # By itself: errors must be reported even if there is no calibration yet.
    usable = attempt("object", lambda: _checked_object(documents or {}))
    measured = documents if usable else {**(documents or {}), "object": None}
    measuring = attempt("calibration", lambda: _measuring(config, measured or {})) if located else None
    if grabber is None or documents is None:
        return None
    return DeviceSetup(name, config, grabber, measuring, documents, inputs)


def _checked_object(documents: JsonObject) -> bool:
    """Returns True; an unusable object model raises."""
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


def configured_calibrations(setups: Mapping[str, DeviceSetup]) -> dict[str, JsonObject]:
    """Documents of the calibrations that the configuration names, by device."""
    documents = ((name, setup.documents.get("calibration")) for name, setup in setups.items())
    return {name: document for name, document in documents if document}
