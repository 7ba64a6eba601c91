"""What a new capture says of itself."""

from collections.abc import Mapping
from dataclasses import asdict

from grabberd import __version__
from grabberd.acquisition.device import StreamInfo
from grabberd.config import DeviceConfig
from grabberd.service.capture.capture_group import Moment
from grabberd.service.capture.capture_request import Planned
from grabberd.service.device.configured_ring import ConfiguredRing
from grabberd.storage import CaptureMeta


def capture_meta(
    planned: Planned,
    device: tuple[str, DeviceConfig, StreamInfo],
    armed: ConfiguredRing,
    start: Moment,
    *,
    site: Mapping[str, str],
    trigger_n: int,
) -> CaptureMeta:
    """The meta data of a capture that begins.

    Args:
        planned: what is asked for.
        device: its name, its configuration, and what the driver granted.
        armed: the ring.
        start: when it begins; the same for all captures of a group.
        site: of the configuration.
        trigger_n: how many fields lie before this moment, which is also the number of the first after it.
    """
    name, config, stream = device
    request, group = planned.request, planned.group
    return CaptureMeta(
        id=planned.id,
        created_utc=start.utc,
        start_ns=start.ns,
        device={"name": name, "driver": config.driver, "options": config.options, "stream": asdict(stream)},
        config=config.model_dump(mode="json"),
        site=site,
        labels=request.labels,
        note=request.note,
        bits=armed.bits,
        lines=armed.lines,
        rate_hz=stream.rate_hz,
        version=__version__,
        extra={
            "on_interruption": request.on_interruption or config.capture.on_interruption,
            "trigger": {"utc": start.utc, "n": trigger_n, "armed_utc": planned.armed_utc},
            "group": None if group is None else group.document(start).model_dump(),
        },
    )
