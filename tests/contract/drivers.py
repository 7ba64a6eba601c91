"""One grabber of every kind, in a state in which it delivers at least forty fields without a fault."""

from pathlib import Path
from typing import Any

from archive.captures import slots, write
from drivers.replay.pictures import frames
from drivers.replay.videos import avi
from drivers.v4l2.bench import Bench, camera, card_with, pci_card
from drivers.v4l2.fake_kernel.card import NTSC
from grabberd.core.field import NTSC_HZ
from grabberd.instrument.acquisition.device import Grabber
from grabberd.testing import FIELDS, GrabberBench, ManualClock
from grabberd_fake import FakeGrabber
from grabberd_replay import ReplayGrabber


def fake(_: Path) -> Grabber:
    return FakeGrabber(clock=ManualClock(), scene="calibration_frame")


def fake_free(_: Path) -> Grabber:
    return FakeGrabber(clock=ManualClock(), pace="free")


def capture(directory: Path) -> Grabber:
    return ReplayGrabber(write(directory, slots(FIELDS)))


def capture_in_real_time(directory: Path) -> Grabber:
    path = write(directory, slots(FIELDS, bits=8, doubled=True), bits=8, lines="doubled")
    return ReplayGrabber(path, pace="real", clock=ManualClock())


def woven_frames(directory: Path) -> Grabber:
    return ReplayGrabber(frames(directory, FIELDS // 2, 48, 64), pictures="frames")


def single_fields(directory: Path) -> Grabber:
    folder = frames(directory, FIELDS, 48, 64)
    return ReplayGrabber(folder, pictures="fields", pace="real", clock=ManualClock())


def video(directory: Path) -> Grabber:
    return ReplayGrabber(avi(directory / "clip.avi", FIELDS // 2, 48, 64), pictures="frames")


def v4l2_alternate_grey(directory: Path) -> Grabber:
    return Bench(directory).grabber


def v4l2_alternate_counting_fields(directory: Path) -> Grabber:
    return Bench(directory, card_with(numbering="fields", first_sequence=2**32 - 9)).grabber


def v4l2_woven_yuyv(directory: Path) -> Grabber:
    return Bench(directory, pci_card("tw686x"), format="YUYV").grabber


def v4l2_woven_bottom_first(directory: Path) -> Grabber:
    return Bench(directory, pci_card("tw686x", older=1), older_field="bottom").grabber


def v4l2_stacked_uyvy(directory: Path) -> Grabber:
    return Bench(directory, field_order="seq_tb", format="UYVY").grabber


def v4l2_nv12(directory: Path) -> Grabber:
    return Bench(directory, card_with(padding=48), field_order="interlaced", format="NV12").grabber


def v4l2_one_parity(directory: Path) -> Grabber:
    return Bench(directory, field_order="bottom").grabber


def v4l2_ntsc_alternate(directory: Path) -> Grabber:
    return Bench(directory, card_with(camera=NTSC), standard="NTSC").grabber


def v4l2_ntsc_woven(directory: Path) -> Grabber:
    return Bench(directory, pci_card("tw686x", camera=NTSC), standard="NTSC", size="640x480").grabber


def _camera(directory: Path, fourcc: str, size: tuple[int, int], rate_hz: int, **traits: Any) -> Grabber:
    made = camera(modes={fourcc: {size: (rate_hz,)}}, bus_info="PCI:0000:04:00.0", **traits)
    return Bench(directory, made, size=f"{size[0]}x{size[1]}", rate_hz=rate_hz).grabber


def v4l2_camera_yuyv(directory: Path) -> Grabber:
    return _camera(directory, "YUYV", (640, 480), 30)


def v4l2_camera_grey_fast(directory: Path) -> Grabber:
    return _camera(directory, "GREY", (640, 480), 120, soe=False)


def v4l2_camera_nv12_large(directory: Path) -> Grabber:
    return _camera(directory, "NV12", (1280, 720), 60, padding=64)


def v4l2_camera_jpeg(directory: Path) -> Grabber:
    return _camera(directory, "MJPG", (640, 480), 60)


RATES_HZ = {
    "v4l2_one_parity": 25.0,
    "v4l2_ntsc_alternate": NTSC_HZ,
    "v4l2_ntsc_woven": NTSC_HZ,
    "v4l2_camera_yuyv": 30.0,
    "v4l2_camera_grey_fast": 120.0,
    "v4l2_camera_nv12_large": 60.0,
    "v4l2_camera_jpeg": 60.0,
}
"""Fields or pictures a second, where they are not 50."""

V4L2 = (
    v4l2_ntsc_alternate,
    v4l2_ntsc_woven,
    v4l2_camera_yuyv,
    v4l2_camera_grey_fast,
    v4l2_camera_nv12_large,
    v4l2_camera_jpeg,
    v4l2_alternate_grey,
    v4l2_alternate_counting_fields,
    v4l2_woven_yuyv,
    v4l2_woven_bottom_first,
    v4l2_stacked_uyvy,
    v4l2_nv12,
    v4l2_one_parity,
)

RECORDINGS = (capture, capture_in_real_time, woven_frames, single_fields, video)
SIMULATED = (fake, fake_free)
ALL = {made.__name__: made for made in (*SIMULATED, *RECORDINGS, *V4L2)}
UNPACED = ("fake_free", "capture", "woven_frames", "video")
"""Those whose fields come as fast as they are read."""


def bench_of(name: str, directory: Path) -> GrabberBench:
    """A grabber of this kind, as the contract's suite takes it."""
    made = ALL[name]
    return GrabberBench(
        made(directory),
        rate_hz=RATES_HZ.get(name, 50.0),
        ends=made in RECORDINGS,
        resets=made in SIMULATED,
        waits=name not in UNPACED,
    )
