"""Illumination of a device's newest field."""

from grabberd.documents.devices import LightDocument, ViewLightDocument
from grabberd.errors import NotReady
from grabberd.processes.light import ViewLight, light_of
from grabberd.service.instrument import Instrument

FIELD_WITHIN_S = 0.5


def light_document(instrument: Instrument, threshold: int | None) -> LightDocument:
    """Illumination of the newest field, with targets at the given threshold or at the one in force.

    Raises:
        NotReady: the device delivers no field.
    """
    shown = instrument.pipeline.newest.recent(FIELD_WITHIN_S)
    if shown is None:
        status = instrument.board.now
        raise NotReady(
            f"device {instrument.name} is {status.state} and has delivered no field for {FIELD_WITHIN_S:g} s",
            status.hint or "wait until its state is ready: GET /api/v1/state",
        )
    level = instrument.pipeline.thresholds.in_force.level if threshold is None else threshold
    views = instrument.setup.config.rig.views
    columns = {name: (one.first_column, one.end_column) for name, one in views}
    lights = light_of(shown.field, level, columns)
    return LightDocument(threshold=level, views={name: _view(light) for name, light in lights.items()})


def _view(light: ViewLight) -> ViewLightDocument:
    return ViewLightDocument(
        histogram=light.histogram.tolist(),
        targets=light.targets,
        diameter_px=light.diameter_px,
        background=light.background,
        brightest=light.brightest,
        clipped=light.clipped,
    )
