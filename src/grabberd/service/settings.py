"""Settings that an operator has changed from the configuration; kept over restarts."""

import logging
from collections.abc import Mapping
from typing import Any

from pydantic import ValidationError

from grabberd.config import DeviceConfig, ThresholdConfig
from grabberd.documents.settings import DeviceSettings, SettingsDocument
from grabberd.errors import InputError
from grabberd.service.device.instrument import Instrument
from grabberd.storage.state.state_store import StateStore

log = logging.getLogger(__name__)


class Settings:
    """The configuration's threshold until another one is set; a capture keeps the one that it began with."""

    def __init__(self, state: StateStore, instruments: Mapping[str, Instrument]) -> None:
        self._state = state
        self._instruments = instruments
        self._configured = {name: one.setup.config for name, one in instruments.items()}

    def open(self) -> None:
        """Takes up what was set before; called before the instruments start.

        Raises:
            StorageError: the state cannot be read.
        """
        for instrument in self._instruments.values():
            kept = self._state.get(_key(instrument.name))
            if kept is not None:
                self._take_up(instrument, kept)

    def document(self) -> SettingsDocument:
        """The settings in force, by device."""
        return SettingsDocument(devices={name: self._of(one) for name, one in self._instruments.items()})

    def set_threshold(self, instrument: Instrument, threshold: ThresholdConfig | None) -> None:
        """Has a device's threshold be found in another way from now on; None: as it is configured.

        Raises:
            InputError: it does not go with the device's ring.
            CaptureRunning: a capture has the way it began with from its first field to its last.
            StorageError: it cannot be kept.
        """
        config = self._config(instrument, threshold)
        with instrument.between_captures():
            self._keep(instrument.name, threshold)
            instrument.configure(config)
        log.info("device %s: threshold %s", instrument.name, config.threshold.model_dump())

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

    def _keep(self, device: str, threshold: ThresholdConfig | None) -> None:
        if threshold is None:
            self._state.remove(_key(device))
        else:
            self._state.put({_key(device): threshold.model_dump(mode="json")})

    def _take_up(self, instrument: Instrument, kept: Any) -> None:
        """What no longer goes with the configuration is left, and said so."""
        try:
            instrument.configure(self._config(instrument, ThresholdConfig.model_validate(kept)))
        except (ValidationError, InputError) as error:
            words = " ".join(str(error).split())
            log.error("device %s: the threshold that was set cannot be used: %s", instrument.name, words)


def _key(device: str) -> str:
    return f"threshold.{device}"
