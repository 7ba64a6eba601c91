"""Remarks for the operator on a granted stream."""

from collections.abc import Iterator
from pathlib import Path

from grabberd.core.field import FieldOrder
from grabberd.instrument.acquisition.device import StreamInfo
from grabberd.instrument.acquisition.discovery import Verdict
from grabberd_v4l2.abi import Arrangement
from grabberd_v4l2.formats import FORMATS
from grabberd_v4l2.layout import Layout
from grabberd_v4l2.profiles import Profile
from grabberd_v4l2.sysfs import Roots, video_nodes
from grabberd_v4l2.times import FieldTimes
from grabberd_v4l2.usb import remarks_on

_MANY_BUFFERS = 8
"""At 25 frames a second a third of a second of delay in this process."""
_ENOUGH_S = 0.1
"""Time that the buffers should last for; delays in this process of a tenth of a second are common."""
_ANALOG_SIZES = ((720, 576), (720, 480))


def stream_info(
    layout: Layout,
    profile: Profile,
    times: FieldTimes,
    tells_signal: bool,
    path: Path,
    remarks: tuple[str, ...],
) -> StreamInfo:
    """Description of the stream; `remarks` on its surroundings come before its own."""
    granted = layout.granted
    two_a_buffer = layout.order in (FieldOrder.TOP_FIRST, FieldOrder.BOTTOM_FIRST)
    return StreamInfo(
        driver="v4l2",
        card=granted.card,
        standard=granted.standard,
        columns=granted.columns,
        field_rows=layout.field_rows,
        rate_hz=layout.rate_hz,
        field_order=layout.order,
        pixel_format=granted.fourcc,
        buffers=granted.buffers * (2 if two_a_buffer else 1),
        live=True,
        counts_losses=profile.trusts_sequence,
        tells_signal=tells_signal,
        time_sigma_ns=times.sigma_ns,
        details={
            "node": str(path),
            "kernel driver": granted.kernel_driver,
            "bus": granted.bus_info,
            "field order of the driver": Arrangement(granted.field).name,
            "buffers of the driver": str(granted.buffers),
        },
        remarks=(*remarks, *layout.remarks, *_doubts(profile), *_of_pictures(layout), *_few(layout)),
    )


def remarks_on_place(path: Path, roots: Roots) -> tuple[str, ...]:
    """Warnings about the USB port."""
    nodes = video_nodes(roots)
    return tuple(remark for node in nodes if node.path == path for remark in remarks_on(node, nodes))


def usb_id(path: Path, roots: Roots) -> str:
    """The node's "VENDOR:PRODUCT", or "" if it is not on USB."""
    return next(
        (node.usb.vendor_product for node in video_nodes(roots) if node.path == path and node.usb), ""
    )


def _doubts(profile: Profile) -> Iterator[str]:
    if profile.verdict is Verdict.DOUBTFUL:
        yield f"{profile.driver}: {'; '.join((*profile.remarks, profile.advice))}"


def _of_pictures(layout: Layout) -> Iterator[str]:
    granted = layout.granted
    if not granted.scan.is_progressive:
        return
    if (granted.columns, granted.lines) in _ANALOG_SIZES:
        yield (
            f"whole pictures of {granted.columns}×{granted.lines} may come from an analog camera behind a "
            "stick that throws one field of every frame away and invents its lines: use another grabber"
        )
    if FORMATS[granted.fourcc].is_compressed:
        yield (
            "the camera compresses its pictures (JPEG): places of targets are less exact, decoding costs "
            "processor time; a smaller size or rate may come uncompressed"
        )


def _few(layout: Layout) -> Iterator[str]:
    buffers, scan = layout.granted.buffers, layout.granted.scan
    if buffers < _MANY_BUFFERS:
        yield f"the driver has only {buffers} buffers: fields will be lost while the computer is busy"
    elif scan.is_progressive and buffers / scan.rate_hz < _ENOUGH_S:
        yield (
            f"{buffers} buffers last for {buffers / scan.rate_hz * 1e3:.0f} ms: set the option 'buffers' to "
            "a larger number, 32 at most"
        )
