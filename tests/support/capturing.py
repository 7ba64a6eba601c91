"""Captures made for tests: on the simulated grabber, and on a replay of what was recorded."""

from pathlib import Path

from running import configuration, sealed

from grabberd.archive.capture.reader import CaptureReader
from grabberd.config import ThresholdConfig, default_config_file
from grabberd.instrument.capture.capture_request import CaptureRequest
from grabberd.instrument.setup import set_up
from grabberd.server.daemon.service import Service

Points = dict[tuple[int, int], tuple[float, ...]]


def fixed_threshold() -> dict[str, object]:
    return {"threshold": ThresholdConfig(kind="fixed", value=60)}


def capture(service: Service, **request: object) -> Path:
    capture_id = service.capture_control.start(None, CaptureRequest(**request)).id  # type: ignore[arg-type]
    sealed(service)
    return service.archive.path(capture_id)


def points_of(path: Path, run: int = 1) -> Points:
    with CaptureReader(path) as reader:
        return {
            (n, int(target)): tuple(xyz)
            for n, points in reader.points(run)
            for target, xyz in zip(points.target, points.xyz_mm.tolist(), strict=True)
        }


def replaying(tmp_path: Path, recording: Path, **changes: object):  # type: ignore[no-untyped-def]
    from contextlib import contextmanager  # noqa: PLC0415

    from running import wait_until_it_accepts  # noqa: PLC0415

    @contextmanager
    def service():  # type: ignore[no-untyped-def]
        config = configuration({}, driver="replay", **{**fixed_threshold(), **changes})
        device = config.devices["simulated"].model_copy(update={"options": {"path": str(recording)}})
        config = config.model_copy(update={"devices": {"simulated": device}})
        one = Service(set_up(config, default_config_file()), tmp_path / "replayed")
        one.start()
        try:
            wait_until_it_accepts(one)
            yield one
        finally:
            one.stop()

    return service()


def thresholds_of(path: Path) -> list[int]:
    with CaptureReader(path) as reader:
        return [field.packed.threshold for field in reader.received()]
