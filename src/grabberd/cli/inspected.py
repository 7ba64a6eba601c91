"""Inspection of a source of pictures: what it finds, in words and as a configuration."""

from collections.abc import Iterator
from contextlib import closing
from dataclasses import dataclass, replace
from itertools import chain
from pathlib import Path
from typing import Any

from grabberd.config import RigConfig
from grabberd.core.chain.inspection import Inspection, Interlacing, Split, Targets, inspect, inspect_fields
from grabberd.core.chain.layout import Layout, LayoutKind
from grabberd.core.chain.repeats import RepeatJudge, repetitions
from grabberd.core.field import Field, FieldOrder, standard_rate_hz
from grabberd.core.reconstruction.field_order import Order
from grabberd.errors import DeviceRefused, GrabberdError, InputError, StreamEnded, StreamFailed
from grabberd.instrument.acquisition import GRABBERS, Grabber, StreamInfo

MOST_FIELDS = 600
"""Twelve closures of a liner before a PAL grabber, and as many pictures of a folder or a video."""
MOST_PIXELS = 600 * 576 * 720
"""Larger pictures are fewer, so that it takes no longer."""
FEWEST_FIELDS = 120
MOST_MISSING = 1000
SILENCE_S = 2.0
SLOWEST_HZ = 1.0
FEWEST_PX = 3.0
"""Diameter of targets below which a place is uncertain whatever the method."""
LEAST_CONTRAST = 40.0
MOST_CLIPPED = 0.3
_IN_WORDS = {
    Interlacing.PROGRESSIVE: "progressive: every line is of the same moment",
    Interlacing.TOP_FIRST: "interlaced, the top field first",
    Interlacing.BOTTOM_FIRST: "interlaced, the bottom field first",
    Interlacing.FIELDS: "single fields, alternately top and bottom",
    Interlacing.DOUBLED: "single fields, whose missing lines are interpolated",
    Interlacing.UNKNOWN: "not clear from what the pictures show",
}
_PICTURES = {
    Interlacing.PROGRESSIVE: "progressive",
    Interlacing.TOP_FIRST: "frames",
    Interlacing.BOTTOM_FIRST: "frames",
    Interlacing.FIELDS: "fields",
    Interlacing.DOUBLED: "doubled",
}
_SINGLE = (Interlacing.FIELDS, Interlacing.DOUBLED)
_WHICH = {
    "": "which one is the top field cannot be told",
    "top": "the top one first",
    "bottom": "the bottom one first",
}
_LAYOUTS = {
    LayoutKind.STACKED: "both fields of a frame lie one above the other",
    LayoutKind.BESIDE: "both fields of a frame lie side by side",
    LayoutKind.TWICE_BELOW: "the same picture twice, one above the other",
    LayoutKind.TWICE_BESIDE: "the same picture twice, side by side",
    LayoutKind.LINES_TWICE: "each line twice: a field stretched to the height of a frame",
    LayoutKind.INTERPOLATED: "one field of each frame, whose missing lines are interpolated",
    LayoutKind.FIELD_MISSING: "the lines of one field are black",
    LayoutKind.HALF_MISSING: "half of each picture is missing",
    LayoutKind.TURNED: "the lines of interlaced frames stand upright, turned by a quarter (clock, or cclock)",
}
_FFMPEG = "convert them with ffmpeg -i INPUT -vf '{}' OUTPUT, and inspect the result"
_SIDES = "split[a][b];[a]crop=iw/2:ih:0:0[l];[b]crop=iw/2:ih:iw/2:0[r];[{}]vstack,il=l=i:c=i"
_FILTERS = {
    (LayoutKind.STACKED, "top"): "il=l=i:c=i",
    (LayoutKind.STACKED, "bottom"): "il=l=i:c=i:ls=1:cs=1",
    (LayoutKind.BESIDE, "top"): _SIDES.format("l][r"),
    (LayoutKind.BESIDE, "bottom"): _SIDES.format("r][l"),
    (LayoutKind.TWICE_BELOW, ""): "crop=iw:ih/2:0:0",
    (LayoutKind.TWICE_BESIDE, ""): "crop=iw/2:ih:0:0",
    (LayoutKind.LINES_TWICE, ""): "field=top",
    (LayoutKind.INTERPOLATED, "top"): "field=bottom",
    (LayoutKind.INTERPOLATED, "bottom"): "field=top",
    (LayoutKind.TURNED, ""): "transpose=clock",
    (LayoutKind.FIELD_MISSING, "top"): "field=bottom",
    (LayoutKind.FIELD_MISSING, "bottom"): "field=top",
}
"""Filters that make pictures of every layout that can be inspected and measured."""


@dataclass(frozen=True, slots=True)
class Inspected:
    """An inspection with all that its configuration needs.

    Attributes:
        found: What the pictures told.
        driver, options: The source of the pictures.
        rate_hz: Fields a second, or progressive pictures; None if nothing tells.
        of_pictures: True if the source gives whole pictures, and nobody has stated what their lines are.
        grey: Where the grey values come from; empty where they are the source's own.
        played: Kind that the replay driver takes pictures of an unknown one for; None if it does not.
        problems: What a user has to know or to do, in sentences.
    """

    found: Inspection
    driver: str
    options: dict[str, Any]
    rate_hz: float | None
    of_pictures: bool
    grey: str
    played: str | None
    problems: tuple[str, ...]


def inspected(driver: str, options: dict[str, Any], rate_hz: float | None) -> Inspected:
    """Inspect the first pictures of a source.

    Args:
        driver: Its driver.
        options: Those of the driver.
        rate_hz: Pictures a second, where nothing else tells.

    Raises:
        InputError: The options are invalid, or there are no pictures.
        DeviceError: The source cannot be opened, or ends with an error before the first picture.
    """
    has_pictures = driver == "replay" and _has_pictures(Path(options.get("path", "")))
    try:
        reading = _opened(driver, options, rate_hz) if has_pictures else _Reading(driver, options)
    except ValueError as error:
        raise InputError(str(error), "name a folder, a video, a capture, or DRIVER:PATH") from error
    with closing(reading.grabber):
        fields = iter(reading)
        first = next((one for one in fields if one is not None), None)
        if first is None:
            raise reading.problem or InputError(f"{reading.info.card} has no pictures", "name another source")
        fields = chain([first], fields)
        if has_pictures and "pictures" not in options:
            found = inspect(None if one is None else one.luma for one in fields)
        else:
            found = inspect_fields(fields)
    return _judged(found, reading, driver, options)


def _judged(found: Inspection, reading: "_Reading", driver: str, options: dict[str, Any]) -> Inspected:
    """The findings beside what the source says of itself."""
    info = reading.info
    whole = driver == "replay" and info.field_order is FieldOrder.PROGRESSIVE
    of_pictures = whole and "pictures" not in options
    played = _played(options) if driver == "replay" and found.interlacing is Interlacing.UNKNOWN else None
    marked = _marked(info) if of_pictures else None
    # Recorders forget to mark frames, and the replay driver knows it.
    is_forgotten = marked is Interlacing.PROGRESSIVE and played == "frames"
    if found.layout or found.interlacing in _SINGLE:
        marked = None
    problems = list(_of_mark(found, marked, is_forgotten=is_forgotten))
    if found.interlacing is Interlacing.UNKNOWN and marked and not is_forgotten:
        found = replace(found, interlacing=marked)
    rate_hz = _rate_hz(found, info.rate_hz or None, of_pictures and "rate_hz" not in options)
    problems += [*_problems(found, rate_hz, of_pictures), *reading.remarks]
    if found.targets and info.details.get("bits", "8") == "8":  # with fewer, grey values tell nothing
        problems += _of_light(found.targets)
    if (end := reading.problem) is not None:
        problems.append(f"{end.message}: only what comes before it was looked at ({end.hint})")
    grey = ", ".join(info.details[key] for key in ("luma", "colours", "samples") if key in info.details)
    options = {**options, **_chosen(info)}
    return Inspected(found, driver, options, rate_hz, of_pictures, grey, played, tuple(problems))


def _played(options: dict[str, Any]) -> str | None:
    """The kind that the replay driver takes pictures for by their size; None if it asks."""
    try:
        with closing(GRABBERS.create("replay", {"rate_hz": 1.0, **options})) as grabber:
            return grabber.open().details.get("pictures")
    except GrabberdError:
        return None


def _has_pictures(path: Path) -> bool:
    """True for what has pictures without a word on their lines: neither a capture nor an exported folder."""
    return not path.name.endswith((".grab", ".grab.part")) and not (path / "fields.csv").exists()


def _opened(driver: str, options: dict[str, Any], rate_hz: float | None) -> "_Reading":
    """Whole pictures, since how their lines belong together is the question; nothing may tell their rate."""
    whole = {"pictures": "progressive", **options}
    fields = 2 if whole["pictures"] == "frames" else 1
    try:
        stated_hz = fields * rate_hz if rate_hz else options.get("rate_hz")
        return _Reading(driver, {**whole, "rate_hz": stated_hz})
    except DeviceRefused as error:
        if "'rate_hz'" not in error.hint:
            raise
    reading = _Reading(driver, {**whole, "rate_hz": fields * SLOWEST_HZ})
    reading.info = replace(reading.info, rate_hz=0.0)
    return reading


class _Reading:
    """The first fields of a grabber, each valid until the next is taken, and None for each that is missing.

    Attributes:
        grabber: Where they come from.
        info: The stream.
        problem: With the last field: the error that ended them, if one did.
    """

    def __init__(self, driver: str, options: dict[str, Any]) -> None:
        self.grabber: Grabber = GRABBERS.create(driver, options)
        self.info = self.grabber.open()
        self._rate_hz = self.info.rate_hz
        self._judge = RepeatJudge(of_any_parity=self.info.field_order is FieldOrder.PROGRESSIVE)
        self._repeats: list[bool] = []
        self.problem: GrabberdError | None = None

    def __iter__(self) -> Iterator[Field | None]:
        size = self.info.columns * self.info.field_rows
        left = max(FEWEST_FIELDS, min(MOST_FIELDS, MOST_PIXELS // size))
        due_ns: int | None = None
        while left > 0:
            try:
                with self.grabber.dequeue(SILENCE_S) as grabbed:
                    if not grabbed:
                        hint = "check the camera and its cable"
                        self.problem = StreamFailed(f"no picture came for {SILENCE_S:g} s", hint)
                        return
                    for one in grabbed:
                        missing = 0 if due_ns is None else round((one.time_ns - due_ns) * self._rate_hz / 1e9)
                        yield from [None] * min(missing, MOST_MISSING)
                        yield None if one.damage or self._is_repeated(one.field) else one.field
                        due_ns = one.time_ns + round(1e9 / self._rate_hz)
                        left -= 1
            except StreamEnded:
                return
            except GrabberdError as error:
                self.problem = error
                return

    def _is_repeated(self, field: Field) -> bool:
        """True for a picture that a live device gives once more; a recording marks its own."""
        if not self.info.live:
            return False
        self._repeats.append(self._judge.take(replace(field, luma=field.luma.copy())))
        return self._repeats[-1]

    @property
    def remarks(self) -> Iterator[str]:
        """Remarks of the stream on itself, and which pictures of a live device repeat another."""
        yield from self.info.remarks
        if repeated := repetitions(self._repeats, self._rate_hz):
            yield repeated


def _chosen(info: StreamInfo) -> dict[str, Any]:
    """Options for the size, rate and format that a digital camera was looked at in."""
    if info.driver != "v4l2" or info.field_order is not FieldOrder.PROGRESSIVE:
        return {}
    size = f"{info.columns}x{info.field_rows}"
    return {"size": size, "rate_hz": float(f"{info.rate_hz:.6g}"), "format": info.pixel_format}


def _marked(info: StreamInfo) -> Interlacing | None:
    """The interlacing that a video is marked with; None if it says nothing of it."""
    marked = info.details.get("marked", "")
    return Interlacing(marked) if marked in set(Interlacing) else None


def _of_mark(found: Inspection, marked: Interlacing | None, *, is_forgotten: bool) -> Iterator[str]:
    if marked is None or found.interlacing is marked:
        return
    if found.interlacing is not Interlacing.UNKNOWN:
        yield f"The video is marked as {marked}, but its pictures show {found.interlacing}, which was used."
    elif is_forgotten:
        yield (
            "The video is marked as progressive, but has the size of interlaced frames and is played as "
            "such: recorders often forget the mark."
        )
    else:
        still = found.order is None or found.order.order is Order.NO_MOVEMENT
        unseen, unclear = (
            "Nothing moves, so the line structure cannot be seen",
            "The line structure is not clear",
        )
        yield f"{unseen if still else unclear}; the video is marked as {marked}."


def _rate_hz(found: Inspection, told_hz: float | None, per_picture: bool) -> float | None:
    interlaced = found.interlacing in (Interlacing.TOP_FIRST, Interlacing.BOTTOM_FIRST)
    if told_hz is not None:
        return 2 * told_hz if per_picture and interlaced else told_hz
    if interlaced or found.interlacing in _SINGLE:
        return standard_rate_hz(found.lines)
    return None


def _problems(found: Inspection, rate_hz: float | None, of_pictures: bool) -> Iterator[str]:
    if found.layout is not None:
        yield _of_layout(found.layout)
        return
    yield from _of_lines(found, of_pictures)
    if rate_hz is None:
        yield "The rate of the pictures is unknown: give --rate-hz."
    if found.targets is None:
        yield "No targets are visible: they must be bright discs on a dark background."
    elif found.targets.diameter_px < FEWEST_PX:
        size = found.targets.diameter_px
        yield f"Targets of {size:.1f} px are small: from {FEWEST_PX:g} px on they are located reliably."
    if found.split is not None and not found.split.sure:
        yield (
            "The targets do not show where the views meet, so the middle was assumed: look at a picture and "
            "correct rig.views."
        )


def _of_lines(found: Inspection, of_pictures: bool) -> Iterator[str]:
    if found.interlacing in _SINGLE:
        yield from _of_singles(found)
    elif found.interlacing is Interlacing.UNKNOWN:
        yield _why_unknown(found, of_pictures)
    if found.lines % 2:
        yield f"The number of lines, {found.lines}, is odd, and the rig needs an even one: cut a line off."
    if found.is_flat:
        yield (
            "Targets are far wider than high, as if half of the lines were missing: use the original "
            "pictures if there are any, else correct pixel_y_mm, which is for the lines that there are."
        )


def _of_light(targets: Targets) -> Iterator[str]:
    if targets.contrast < LEAST_CONTRAST:
        yield f"Targets are only {targets.contrast:.0f} grey levels above the background: use more light."
    if targets.clipped > MOST_CLIPPED:
        yield f"{targets.clipped:.0%} of the targets' pixels are saturated: reduce the light or the exposure."


def _why_unknown(found: Inspection, of_pictures: bool) -> str:
    """Reason why the line structure, or the order of the fields, cannot be told."""
    order = found.order
    if order is not None and order.order is Order.UNCLEAR:
        other = ", or set the option 'pictures' (frames or progressive)" if of_pictures else ""
        return f"What moves does not show how the lines belong together: {order.evidence}{other}."
    if of_pictures:
        return (
            "Interlaced and progressive pictures differ only where something moves: use pictures of a moving "
            "object, or set the option 'pictures' (frames or progressive)."
        )
    return "The field order can be checked only where something moves."


def _of_layout(layout: Layout) -> str:
    words = _LAYOUTS[layout.kind]
    if layout.kind is LayoutKind.HALF_MISSING:
        return (
            f"The {layout.part} half of the pictures is missing: check the recorder, and record them again."
        )
    if layout.kind in (LayoutKind.STACKED, LayoutKind.BESIDE):
        half = "upper" if layout.kind is LayoutKind.STACKED else "left"
        is_known = f"with the {layout.part} field in the {half} half"
        words = f"{words}, {is_known if layout.part else _WHICH['']}"
    filters = _FILTERS.get((layout.kind, layout.part or "top"), _FILTERS.get((layout.kind, "")))
    return f"In each picture {words}, so it cannot be measured as it is: {_FFMPEG.format(filters)}."


def _of_singles(found: Inspection) -> Iterator[str]:
    order = found.order.order if found.order else Order.UNCLEAR
    if found.first_parity is None:
        yield (
            "Whether the first field is the top one cannot be told without targets that show by how much the "
            "fields lie apart: look up how they were separated, and set first_parity."
        )
    if order is Order.REVERSED:
        right = "tff" if found.first_parity == "bottom" else "bff"
        yield (
            "The two fields of each frame change places in time: they were separated in the wrong order. "
            f"Separate them again with ffmpeg -i INPUT -vf 'setfield={right},separatefields' OUTPUT, since "
            "ffmpeg takes frames without a mark for bottom field first."
        )
    if found.interlacing is Interlacing.FIELDS and order is Order.SAME_INSTANT:
        yield "Both fields of each frame show the same instant: they are halves of a progressive picture."


def words(seen: Inspected, out: Path | None) -> str:
    """The findings as lines of text."""
    found = seen.found
    rate = "unknown" if seen.rate_hz is None else f"{seen.rate_hz:.6g}"
    what = "pictures" if found.interlacing is Interlacing.PROGRESSIVE else "fields"
    rows = [
        f"size      {found.columns} x {found.lines} pixels",
        f"lines     {_lines_in_words(found)}",
        f"rate      {rate} {what} a second",
        *([f"grey      {seen.grey}"] if seen.grey else []),
        *_rows_of(found.targets, found.split),
        *(f"note      {problem}" for problem in seen.problems),
    ]
    if out is not None:
        rows.append(f"written   {out}: complete it where marked, then run: grabberd check-config {out}")
    return "\n".join(rows)


def _lines_in_words(found: Inspection) -> str:
    if found.layout is not None:
        return _LAYOUTS[found.layout.kind]
    words = _IN_WORDS[found.interlacing]
    if found.interlacing in _SINGLE:
        words += f", {_WHICH[found.first_parity or '']}"
    return words + (f" ({found.order.evidence})" if found.order else "")


def _rows_of(targets: Targets | None, split: Split | None) -> Iterator[str]:
    if targets is not None:
        yield (
            f"targets   {targets.count:.0f} in a picture, {targets.diameter_px:.1f} px wide, "
            f"{targets.contrast:.0f} grey levels above a background of {targets.background:.0f}"
        )
    if split is not None:
        how = "the views meet" if split.sure else "the middle; unclear where the views meet"
        yield f"split     column {split.column}: {how} ({split.left:.0%} of the targets left of it)"


def configuration(seen: Inspected) -> str:
    """A configuration that fits the pictures, with a comment at each line that a person has to look at."""
    found, split = seen.found, seen.found.split
    column = split.column if split else found.columns // 2
    sure = "" if split and split.sure else "   # the middle: look at a picture and correct it"
    lines = found.lines + found.lines % 2
    options = [f"      {key}: {value}" for key, value in seen.options.items() if key != "rate_hz"]
    options += [f"      {line}" for line in _picture_options(seen)] if seen.of_pictures else []
    options += [f"      {line}" for line in _rate_options(seen)]
    size = f"{found.targets.diameter_px:.1f} px" if found.targets else "of unknown size"
    nominal = ((key, one) for key, one in RigConfig.model_fields.items() if isinstance(one.default, float))
    return "\n".join(
        [
            f"# By grabberd inspect, for pictures of {found.columns} x {found.lines} pixels; targets {size}.",
            "devices:",
            "  camera:",
            f"    driver: {seen.driver}",
            "    options:",
            *(options or ["      {}"]),
            "    rig:",
            f"      columns: {found.columns}",
            f"      lines: {lines}",
            "      views:",
            f"        left: {{first_column: 0, end_column: {column}}}{sure}",
            f"        right: {{first_column: {column}, end_column: {found.columns}}}",
            "      # Measure these on your rig, to ten per cent; a calibration determines them exactly.",
            "      # These are the values of the reference rig.",
            *(f"      {key}: {one.default:g}".ljust(30) + f"# {one.description}" for key, one in nominal),
            "    # calibration: rig.calibration.json    # once there is one: grabberd calibrate",
            "    # object: object.yaml                  # what to measure: docs/reference/object-files.md",
            "",
        ]
    )


def _picture_options(seen: Inspected) -> Iterator[str]:
    found = seen.found
    pictures = _PICTURES.get(found.interlacing)
    if pictures is not None:
        yield f"pictures: {pictures}"
    elif seen.played == "frames":
        yield "pictures: frames   # as their size suggests; or progressive: nothing that moves shows which"
    else:
        yield "pictures: progressive   # or frames, if they are interlaced: nothing that moves shows which"
    if pictures == "frames":
        yield f"field_order: {found.interlacing}"
    if found.interlacing in _SINGLE:
        unknown = "top   # or bottom: the pictures do not show which"
        yield f"first_parity: {found.first_parity or unknown}"
        if found.order is not None and found.order.order is Order.REVERSED:
            yield "# The fields change places in time: separate them again in the other order."


def _rate_options(seen: Inspected) -> Iterator[str]:
    if seen.rate_hz is None:
        yield "# rate_hz: 60            # required: how many pictures a second?"
        return
    of_folder = seen.driver == "replay" and Path(seen.options["path"]).is_dir()
    is_folder_of_pictures = of_folder and (seen.of_pictures or "pictures" in seen.options)
    if "rate_hz" in seen.options or seen.found.interlacing in _SINGLE or is_folder_of_pictures:
        yield f"rate_hz: {seen.rate_hz:.6g}"
