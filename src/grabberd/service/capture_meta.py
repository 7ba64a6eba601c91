"""What a new capture says of itself."""

from collections.abc import Mapping
from dataclasses import asdict

from grabberd import __version__
from grabberd.acquisition.device import StreamInfo
from grabberd.config import DeviceConfig
from grabberd.service.armed import Armed
from grabberd.service.clock import Clock, iso_utc
from grabberd.service.recorder import CaptureRequest
from grabberd.storage import CaptureMeta


def capture_meta(
    capture_id: str,
    device: tuple[str, DeviceConfig, StreamInfo],
    request: CaptureRequest,
    armed: Armed,
    clock: Clock,
    *,
    site: Mapping[str, str],
    trigger_n: int,
    armed_utc: str | None,
) -> CaptureMeta:
    """The meta data of a capture that begins at this moment.

    Args:
        capture_id: of the capture.
        device: its name, its configuration, and what the driver granted.
        request: what is asked for.
        armed: the ring.
        clock: says when.
        site: of the configuration.
        trigger_n: how many fields lie before this moment, which is also the number of the first after it.
        armed_utc: since when it waited for its trigger; None where it did not.
    """
    name, config, stream = device
    now_utc = iso_utc(clock.utc_now())
    return CaptureMeta(
        id=capture_id,
        created_utc=now_utc,
        start_ns=clock.now_ns(),
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
            "trigger": {"utc": now_utc, "n": trigger_n, "armed_utc": armed_utc},
        },
    )
