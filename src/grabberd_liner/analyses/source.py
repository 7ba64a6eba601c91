"""Sources of an analysis in a capture: points, object model, a single view's images, recorded channels."""

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import chain
from pathlib import Path
from textwrap import shorten
from typing import Any

from grabberd.archive.capture.reader import CaptureReader
from grabberd.archive.capture.recorded_channels import ChannelReadings
from grabberd.archive.capture.rows import RunInfo
from grabberd.archive.measure_setups import measure_setup
from grabberd.core.chain.measure import MeasureSetup, single_view_images
from grabberd.core.channels import Dating, Quantity
from grabberd.core.field import NumberedField
from grabberd.core.geometry import Calibration, Rig
from grabberd.core.ledger import Ledger
from grabberd.core.reconstruction import ObjectModel, Points, SingleViewImages
from grabberd.documents.document import JsonObject
from grabberd.errors import InputError, NotReady
from grabberd_liner.analysis.pulsation.movement import TimedPoints
from grabberd_liner.analysis.vacuum.light_clock import FoundLight, find_light, logged_light
from grabberd_liner.analysis.vacuum.vacuum import ChannelCurve
from grabberd_liner.analysis.vacuum.vacuum_log import read_vacuum_log
from grabberd_liner.chain.analysis.inputs import BY_LIGHT, CHAMBERS, CHANNEL, FLOW, channel_of, is_channel
from grabberd_liner.chain.analysis.wall_state import FieldPoints

_LONGEST_REASON = 200
_LEAST_LIGHT = 10
"""Readings below which nothing is said of a light."""


@dataclass(frozen=True, slots=True)
class AnalysisSource:
    """Points of one capture, and what they were measured with.

    Attributes:
        fields: Points of each field, with the images of targets that one view alone sees if there are any.
        model: Object model.
        calibration: Its document; None if the run has none, or one that cannot be read.
        about: Origin of the points, as the report shows it.
        problem: Why those images are missing though they were wanted, as a sentence; None if they are not.
    """

    fields: list[FieldPoints]
    model: ObjectModel
    calibration: JsonObject | None
    about: JsonObject
    problem: str | None


def read_source(path: Path, run: int | None, single: bool, *, later: bool = False) -> AnalysisSource:
    """Reads a capture.

    Points need nothing but themselves, so a run whose calibration or settings this version cannot read only
    does without the images of a single view.

    Args:
        path: The capture.
        run: The run whose points are read; None for the latest.
        single: True if the images of targets that one view alone sees are wanted.
        later: True if `single_view` reads them, of a few fields.

    Raises:
        CaptureFileError, NotFound: The capture or the run does not exist.
        NotReady: It was measured without an object model.
        InputError: Its object model cannot be read.
    """
    with CaptureReader(path) as reader:
        info = reader.run(run)
        reader.check_unchanged(runs=(info.run,))
        model = _object_model(path, info)
        first_ns = reader.first_time_ns or 0
        timed = {n: (time_ns, points) for n, time_ns, points in reader.timed_points(info.run)}
        setup, problem = _setup(path, info) if single else (None, None)
        if setup is not None and not later:
            points_of = {n: points for n, (_, points) in timed.items()}
            for n, images in _images(reader, reader.received(), points_of, setup):
                timed[n] = timed[n][0], replace(points_of[n], single=images)
        fields = [
            FieldPoints(n, TimedPoints((time_ns - first_ns) / 1e9, points))
            for n, (time_ns, points) in timed.items()
        ]
        calibration = info.made_with.get("calibration") if setup else None
        return AnalysisSource(fields, model, calibration, _origin(reader, info), problem)


def single_view(
    path: Path, fields: Sequence[FieldPoints], run: int | None, numbers: Sequence[int]
) -> dict[int, SingleViewImages]:
    """The images of targets that one view alone sees in some fields of a capture, by the field's number."""
    with CaptureReader(path) as reader:
        setup, _ = _setup(path, reader.run(run))
        if setup is None:
            return {}
        points_of = {one.n: one.timed.points for one in fields if one.n in numbers}
        # What is known of the marks in one field counts in the next ones.
        if reader.meta.config.get("marks"):
            wanted = reader.received()
        else:
            wanted = chain.from_iterable(reader.received(n, n + 1) for n in sorted(points_of))
        return dict(_images(reader, wanted, points_of, setup))


def _images(
    reader: CaptureReader, fields: Iterable[NumberedField], points: Mapping[int, Points], setup: MeasureSetup
) -> Iterator[tuple[int, SingleViewImages]]:
    return single_view_images(fields, points, setup, lambda _: reader.marks_before())


def read_origin(path: Path, run: int | None) -> tuple[JsonObject, ObjectModel]:
    """Origin of a run's points, as the report shows it, and the object model that they were measured with.

    Raises:
        CaptureFileError, NotFound: The capture or the run does not exist.
        NotReady: It was measured without an object model.
        InputError: Its object model cannot be read.
    """
    with CaptureReader(path) as reader:
        info = reader.run(run)
        return _origin(reader, info), _object_model(path, info)


def capture_origin(path: Path) -> tuple[JsonObject, Mapping[str, Any]]:
    """Origin of a capture's latest points, as the report shows it, and the calibration that made them.

    The calibration is empty where there is none.

    Raises:
        CaptureFileError, NotFound: The capture does not exist, or was never measured.
    """
    with CaptureReader(path) as reader:
        info = reader.run(None)
        return _origin(reader, info), info.made_with.get("calibration") or {}


def found_light(path: Path, vacuum: Mapping[str, Any]) -> FoundLight | None:
    """The light in a capture's pictures, where the inputs' vacuum leaves the clocks to it; else None.

    Raises:
        InputError: Neither the log nor, where the vacuum was recorded, the capture has a light.
        AnalysisError: There is none in the pictures that goes by it.
        CaptureFileError: The capture cannot be read.
    """
    if vacuum.get("offset") != BY_LIGHT:
        return None
    if CHANNEL in (vacuum.get("pulsation"), vacuum.get("liner")):
        return _recorded_light(path)
    log = read_vacuum_log(vacuum["log"])
    if log.light is None:
        raise InputError(
            "the vacuum log has no column light, which vacuum.offset: light is found by",
            "record the light's voltage beside the vacuum, or give the offset in s with its σ",
        )
    with CaptureReader(path) as reader:
        logged = logged_light(log.time_s, log.light)
        return find_light(reader.received(), reader.first_time_ns or 0, logged)


def _recorded_light(path: Path) -> FoundLight:
    """The light in a capture's pictures by the channel that was recorded with them."""
    with CaptureReader(path) as reader:
        named = {one.quantity: one for one in reader.channels.all}
        channel = named.get(Quantity.LIGHT)
        if channel is None:
            known = ", ".join(one.name for one in named.values()) or "none"
            raise InputError(
                "the capture has no channel light, which vacuum.offset: light is found by",
                f"its channels are: {known}; leave out vacuum.offset, or have a light recorded",
            )
        readings = reader.channels.read(channel.name)
        source = f"the recorded channel {channel.name}"
        if len(readings.time_s) < _LEAST_LIGHT:
            hint = "the capture's channels say what is missing, and why"
            raise InputError(f"{source} has {len(readings.time_s)} readings", hint)
        logged = logged_light(readings.time_s, readings.value, source)
        found = find_light(reader.received(), reader.first_time_ns or 0, logged)
        return found._replace(logger=channel.logger, delay_sigma_s=channel.calibration.delay_sigma_ms / 1e3)


def common_rig(sources: Sequence[AnalysisSource]) -> Rig | None:
    """The rig of all captures that have images of a single view; None if there are several rigs, or none."""
    documents = [source.calibration for source in sources if source.calibration]
    if not documents or any(other != documents[0] for other in documents[1:]):
        return None
    return Rig.of(Calibration.from_document(documents[0]))


def check_same_model(sources: Sequence[AnalysisSource]) -> None:
    """Refuses bursts of another object model: they are combined target by target.

    Raises:
        InputError: A burst was measured with another one.
    """
    first = sources[0]
    for other in sources[1:]:
        same = first.model.target.tolist() == other.model.target.tolist()
        if not same or abs(first.model.xyz_mm - other.model.xyz_mm).max() > 0:
            raise InputError(
                f"burst {other.about['id']} was measured with another object model,"
                f" {other.about['object']}, than {first.about['id']}",
                "measure both with the same object file",
            )


def _object_model(path: Path, info: RunInfo) -> ObjectModel:
    document = info.made_with.get("object")
    if not document:
        raise NotReady(
            f"run {info.run} of {path} was measured without an object model",
            f"re-measure it: {_command(path)}",
        )
    try:
        return ObjectModel.from_document(document)
    except InputError as error:
        raise InputError(
            f"the object model of run {info.run} of {path} cannot be read: {_reason(error)}",
            f"re-measure the capture: {_command(path)}",
        ) from error


def _setup(path: Path, info: RunInfo) -> tuple[MeasureSetup | None, str | None]:
    """Setup of the measurement that made the points, or why there is none that can be read."""
    if not info.made_with.get("calibration"):
        return None, None
    try:
        return measure_setup(info.made_with, info.made_with.get("settings") or {}), None
    except InputError as error:
        return None, (
            f"targets that one view alone sees are left out: the calibration or the settings of run"
            f" {info.run} of {path} cannot be read ({_reason(error)});"
            f" re-measure the capture: {_command(path)}"
        )


def _command(path: Path) -> str:
    return f"grabberd measure {path} --calibration … --object …"


def _reason(error: InputError) -> str:
    return shorten(error.message, _LONGEST_REASON, placeholder=" …")


def _origin(reader: CaptureReader, info: RunInfo) -> JsonObject:
    meta = reader.meta
    return {
        "id": meta.id,
        "captured_utc": meta.created_utc,
        "device": meta.device.get("name"),
        "run": info.run,
        "run_created_utc": info.created_utc,
        "run_version": info.version,
        "calibration": (info.made_with.get("calibration") or {}).get("id"),
        "object": (info.made_with.get("object") or {}).get("name"),
        "bits": meta.bits,
        "site": meta.site,
        "labels": meta.labels,
        "note": meta.note,
        "ledger": _ledger(reader.ledger),
    }


def _ledger(ledger: Ledger) -> JsonObject:
    lacking = [{**entry._asdict(), "outcome": str(entry.outcome)} for entry in ledger.entries]
    return {"total": ledger.total, "received": ledger.received, "lacking": lacking}


def recorded_channels(path: Path) -> dict[str, tuple[str, ...]]:
    """Names of a capture's channels that have readings, for every field or not, by the quantity they measure.

    Raises:
        CaptureFileError: The capture does not exist, or a channel is damaged.
    """
    found: dict[str, tuple[str, ...]] = {}
    with CaptureReader(path) as reader:
        for one in reader.channels.all:
            if reader.channels.count(one):
                found[str(one.quantity)] = (*found.get(str(one.quantity), ()), one.name)
    return found


def channel_curves(path: Path, inputs: Mapping[str, Any]) -> dict[str, ChannelCurve]:
    """The channels that the inputs refer to, by chamber; that of milk flow only if the capture has it.

    Raises:
        CaptureFileError: The capture does not exist, or a channel is damaged.
        InputError: It has no such channel, or several that could be meant.
    """
    vacuum = inputs.get("vacuum")
    given = vacuum if isinstance(vacuum, Mapping) else {}
    wanted = [name for name in CHAMBERS if is_channel(given.get(name))]
    flow = [FLOW] if "milk_flow" in inputs else []
    if not wanted + flow:
        return {}
    recorded = recorded_channels(path)
    names = {name: channel_of(name, given[name], recorded.get(name, ())) for name in wanted}
    names |= {name: _flow_channel(recorded[name]) for name in flow if name in recorded}
    with CaptureReader(path) as reader:
        return {chamber: _curve(chamber, reader.channels.read(name)) for chamber, name in names.items()}


def _flow_channel(names: Sequence[str]) -> str:
    if len(names) > 1:
        raise InputError(
            f"milk_flow: the channels {' and '.join(names)} of this capture could each be the flow",
            "leave milk_flow out; next time, configure one channel of the quantity flow for this teatcup",
        )
    return names[0]


def _curve(quantity: str, readings: ChannelReadings) -> ChannelCurve:
    channel, calibration = readings.channel, readings.channel.calibration
    delay_sigma_s = calibration.delay_sigma_ms / 1e3
    calibrated = f"calibrated {calibration.calibrated}" if calibration.calibrated else "never calibrated"
    return ChannelCurve(
        name=quantity,
        time_s=readings.time_s,
        kpa=readings.kpa if channel.quantity.is_vacuum else readings.value,
        sigma_kpa=calibration.sigma_kpa,
        time_sigma_s=math.hypot(float(readings.time_sigma_ns.max(initial=0)) / 1e9, delay_sigma_s),
        origin=f"channel {channel.name} of this capture (logger {channel.logger}, {calibrated})",
        remark=_remark(readings),
        delay_sigma_s=delay_sigma_s,
        logger=channel.logger,
    )


def _remark(readings: ChannelReadings) -> str | None:
    if Dating.ARRIVAL not in readings.datings:
        return None
    calibration = readings.channel.calibration
    return (
        f"the readings of channel {readings.channel.name} are dated by their arrival; their way to the "
        f"computer is taken as {calibration.delay_ms:g} ms (σ {calibration.delay_sigma_ms:g}), as it is "
        "configured: 10 ms are 3 kPa on a flank; vacuum.offset corrects it"
    )
