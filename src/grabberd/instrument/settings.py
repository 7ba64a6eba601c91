"""Settings by which an operator overrides the configuration; they survive restarts."""

import logging
from collections.abc import Mapping
from typing import Any

from pydantic import ValidationError

from grabberd.archive.state.state_database import StateStore
from grabberd.config import DeviceConfig, ThresholdConfig
from grabberd.config.section import without_secrets
from grabberd.documents.document import JsonObject
from grabberd.documents.state import DeviceSettings, SettingsDocument
from grabberd.errors import InputError
from grabberd.instrument.instrument import Instrument
from grabberd.instrument.setup import DeviceSetup

log = logging.getLogger(__name__)


class Settings:
    """Threshold of each device: the configuration's until another one is set.

    A capture keeps the one with which it began (docs/decisions/measurement.md).
    """

    def __init__(self, state: StateStore, instruments: Mapping[str, Instrument]) -> None:
        self._state = state
        self._instruments = instruments
        self._configured = {name: one.setup.config for name, one in instruments.items()}

    def open(self) -> None:
        """Applies the stored settings; called before the instruments start.

        Raises:
            StorageError: The state cannot be read.
        """
        for instrument in self._instruments.values():
            stored = self._state.get(_key(instrument.name))
            if stored is not None:
                self._apply(instrument, stored)

    def document(self) -> SettingsDocument:
        """The settings in force, by device."""
        return SettingsDocument(devices={name: self._of(one) for name, one in self._instruments.items()})

    def set_threshold(self, instrument: Instrument, threshold: ThresholdConfig | None) -> None:
        """Sets the rule for a device's threshold from now on; None: as configured.

        Raises:
            InputError: It does not suit the device's ring.
            CaptureRunning: A capture keeps its threshold from its first field to its last.
            StorageError: It cannot be stored.
        """
        config = self._config(instrument, threshold)
        with instrument.between_captures():
            # Stored first: if that fails, nothing changes for the device.
            self._store(instrument.name, threshold)
            instrument.configure(config)
        log.info("device %s: threshold %s", instrument.name, config.threshold.model_dump())

    def keep(self) -> None:
        """Stores the settings in force again, after the stored ones were lost.

        Raises:
            StorageError: It cannot be stored.
        """
        for name, setting in self.document().devices.items():
            self._store(name, None if setting.as_configured else setting.threshold)

    def _of(self, instrument: Instrument) -> DeviceSettings:
        threshold = instrument.setup.config.threshold
        configured = threshold == self._configured[instrument.name].threshold
        return DeviceSettings(threshold=threshold, as_configured=configured)

    def _config(self, instrument: Instrument, threshold: ThresholdConfig | None) -> DeviceConfig:
        configured = self._configured[instrument.name]
        if threshold is None:
            return configured
        if threshold.map and configured.ring.bits != 1:
            raise InputError(
                f"a threshold for every pixel needs a ring of 1 bit, and that of {instrument.name} has "
                f"{configured.ring.bits}",
                "set map to false, or ring.bits to 1 in the configuration",
            )
        return configured.model_copy(update={"threshold": threshold})

    def _store(self, device: str, threshold: ThresholdConfig | None) -> None:
        if threshold is None:
            self._state.remove(_key(device))
        else:
            self._state.put({_key(device): threshold.model_dump(mode="json")})

    def _apply(self, instrument: Instrument, stored: Any) -> None:
        """Applies a stored setting; one that no longer suits the configuration is ignored and logged."""
        try:
            instrument.configure(self._config(instrument, ThresholdConfig.model_validate(stored)))
        except (ValidationError, InputError) as error:
            reason = " ".join(str(error).split())
            log.error("device %s: the stored threshold cannot be used: %s", instrument.name, reason)


def _key(device: str) -> str:
    return f"threshold.{device}"


def configuration_document(setups: Mapping[str, DeviceSetup]) -> JsonObject:
    """The devices' configuration without secrets."""
    devices = {name: setup.config.model_dump(mode="json") for name, setup in setups.items()}
    return {"devices": without_secrets(devices)}
