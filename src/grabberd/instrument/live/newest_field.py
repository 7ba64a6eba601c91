"""A device's newest field: its illumination, and the field as a picture."""

import threading

from grabberd.archive.export.grey_png import grey_png
from grabberd.archive.measure_setups import location_settings, nominal_rig, settings_of
from grabberd.core.chain.light import light_of
from grabberd.core.chain.target_sizes import px_per_mm, sized
from grabberd.core.geometry.document_reader import is_number
from grabberd.core.measurement import LocationSettings
from grabberd.documents.devices import LightDocument, ViewLightDocument
from grabberd.errors import NotReady
from grabberd.instrument.device.threshold_keeper import Shown
from grabberd.instrument.instrument import Instrument
from grabberd.instrument.setup import DeviceSetup

FIELD_WITHIN_S = 0.5
USUAL_MM = 1.5
"""Diameter of the paper's targets, assumed while no object is configured."""


def light_document(instrument: Instrument, threshold: int | None) -> LightDocument:
    """Illumination of the newest field, with targets at the given threshold or at the one in force.

    Raises:
        NotReady: The device delivers no field.
    """
    shown = _newest(instrument)
    level = instrument.pipeline.thresholds.in_force.level if threshold is None else threshold
    views = instrument.setup.config.rig.views
    columns = {name: (one.first_column, one.end_column) for name, one in views}
    lights = light_of(shown.field, level, columns, _location(instrument.setup))
    described = {
        name: ViewLightDocument.model_validate(one, from_attributes=True) for name, one in lights.items()
    }
    return LightDocument(threshold=level, views=described)


def _location(setup: DeviceSetup) -> LocationSettings:
    """Settings of target location, for targets of the configured object as the nominal rig shows them."""
    scale = px_per_mm(nominal_rig(setup.config.rig))
    stated = (setup.documents.get("object") or {}).get("target_diameter_mm")
    # Light is set before there is a calibration or an object, whose document may be invalid, too.
    diameter_mm = float(stated) if is_number(stated) and stated > 0 else USUAL_MM
    return sized(location_settings(settings_of(setup.config), scale), scale, diameter_mm)


class PreviewPicture:
    """The newest field of one device as a PNG, encoded once for all clients; any thread may call."""

    def __init__(self, instrument: Instrument) -> None:
        self._instrument = instrument
        self._encoding = threading.Lock()
        self._of: Shown | None = None
        self._png = b""

    def png(self) -> bytes:
        """The newest field in 8 bits, with its lines as recorded.

        Raises:
            NotReady: The device delivers no field.
        """
        shown = _newest(self._instrument)
        with self._encoding:
            if self._of is not shown:
                self._of, self._png = shown, grey_png(shown.field.luma)
            return self._png


def _newest(instrument: Instrument) -> Shown:
    shown = instrument.pipeline.newest.recent(FIELD_WITHIN_S)
    if shown is None:
        status = instrument.board.now
        raise NotReady(
            f"device {instrument.name} is {status.state} and has delivered no field for {FIELD_WITHIN_S:g} s",
            status.hint or "wait until its state is ready: GET /api/v1/state",
        )
    return shown
