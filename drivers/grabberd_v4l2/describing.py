"""Remarks for the operator on a granted stream."""

from collections.abc import Iterator
from pathlib import Path

from grabberd.acquisition.device import FieldOrder, StreamInfo
from grabberd.acquisition.discovery import Verdict
from grabberd_v4l2.abi import Arrangement
from grabberd_v4l2.layout import Layout
from grabberd_v4l2.profiles import Profile
from grabberd_v4l2.sysfs import Roots, video_nodes
from grabberd_v4l2.times import FieldTimes
from grabberd_v4l2.usb import remarks_on

# At 25 frames a second eight buffers are a third of a second of delay in this process.
_MANY_BUFFERS = 8


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
    one_a_buffer = layout.order in (FieldOrder.ALTERNATE, FieldOrder.ONE_PARITY)
    return StreamInfo(
        driver="v4l2",
        card=granted.card,
        standard=granted.standard,
        columns=granted.columns,
        field_rows=layout.field_rows,
        rate_hz=layout.rate_hz,
        field_order=layout.order,
        pixel_format=granted.fourcc,
        buffers=granted.buffers * (1 if one_a_buffer else 2),
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
        remarks=(*remarks, *layout.remarks, *_doubts(profile), *_few(granted.buffers)),
    )


def remarks_on_place(path: Path, roots: Roots) -> tuple[str, ...]:
    """Warnings about the USB port."""
    nodes = video_nodes(roots)
    return tuple(remark for node in nodes if node.path == path for remark in remarks_on(node, nodes))


def _doubts(profile: Profile) -> Iterator[str]:
    if profile.verdict is Verdict.DOUBTFUL:
        yield f"{profile.driver}: {'; '.join((*profile.remarks, profile.advice))}"


def _few(buffers: int) -> Iterator[str]:
    if buffers < _MANY_BUFFERS:
        yield f"the driver has only {buffers} buffers: fields will be lost while the computer is busy"
