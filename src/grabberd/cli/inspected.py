"""Tell what an inspection found: in words, and as a configuration."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from grabberd.core.chain.inspection import Inspection, Interlacing, Split, Targets
from grabberd.core.field import FieldOrder, standard_rate_hz
from grabberd.errors import GrabberdError
from grabberd.instrument.acquisition import StreamInfo

FEWEST_PX = 3.0
"""Diameter of targets below which a place is uncertain whatever the method."""
LEAST_CONTRAST = 40.0
MOST_CLIPPED = 0.3
_IN_WORDS = {
    Interlacing.PROGRESSIVE: "progressive: every line is of the same moment",
    Interlacing.TOP_FIRST: "interlaced, the top field first",
    Interlacing.BOTTOM_FIRST: "interlaced, the bottom field first",
    Interlacing.UNKNOWN: "not clear from what the pictures show",
}
_PICTURES = {
    Interlacing.PROGRESSIVE: "progressive",
    Interlacing.TOP_FIRST: "frames",
    Interlacing.BOTTOM_FIRST: "frames",
}


@dataclass(frozen=True, slots=True)
class Inspected:
    """An inspection with all that its configuration needs.

    Attributes:
        found: What the pictures told.
        driver, options: The source of the pictures.
        rate_hz: Fields a second, or progressive pictures; None if nothing tells.
        of_pictures: True if the source gives whole pictures, and nobody has stated what their lines are.
        grey: Where the grey values come from; empty where they are the source's own.
        problems: What a user has to know or to do, in sentences.
    """

    found: Inspection
    driver: str
    options: dict[str, Any]
    rate_hz: float | None
    of_pictures: bool
    grey: str
    problems: tuple[str, ...]

    @classmethod
    def of(
        cls,
        found: Inspection,
        info: StreamInfo,
        driver: str,
        options: dict[str, Any],
        rate_hz: float | None,
        problem: GrabberdError | None,
    ) -> "Inspected":
        """Put together what was found and where."""
        whole = driver == "replay" and info.field_order is FieldOrder.PROGRESSIVE
        of_pictures = whole and "pictures" not in options
        is_told = rate_hz is not None or "rate_hz" in options
        if not is_told and whole and Path(options["path"]).is_dir():
            info = replace(info, rate_hz=0.0)
        marked = _marked(info) if of_pictures else None
        own = list(_of_mark(found, marked))
        if found.interlacing is Interlacing.UNKNOWN and marked:
            found = replace(found, interlacing=marked)
        rate_hz = _rate_hz(found, info.rate_hz or None, of_pictures and "rate_hz" not in options)
        own += [*_problems(found, rate_hz, of_pictures), *info.remarks]
        if found.targets and info.details.get("bits", "8") == "8":  # with fewer, grey values tell nothing
            own += _of_light(found.targets)
        if problem is not None:
            own.append(f"{problem.message}: only what comes before it was looked at ({problem.hint})")
        grey = ", ".join(info.details[key] for key in ("luma", "colours", "samples") if key in info.details)
        options = {**options, **_chosen(info)}
        return cls(found, driver, options, rate_hz, of_pictures, grey, tuple(own))


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


def _of_mark(found: Inspection, marked: Interlacing | None) -> Iterator[str]:
    if marked is None or found.interlacing is marked:
        return
    if found.interlacing is Interlacing.UNKNOWN:
        yield f"Nothing moves, so the line structure cannot be seen; the video is marked as {marked}."
    else:
        yield f"The video is marked as {marked}, but its pictures show {found.interlacing}, which was used."


def _rate_hz(found: Inspection, told_hz: float | None, per_picture: bool) -> float | None:
    interlaced = found.interlacing in (Interlacing.TOP_FIRST, Interlacing.BOTTOM_FIRST)
    if told_hz is not None:
        return 2 * told_hz if per_picture and interlaced else told_hz
    if interlaced:
        return standard_rate_hz(found.lines)
    return None


def _problems(found: Inspection, rate_hz: float | None, of_pictures: bool) -> Iterator[str]:
    if found.interlacing is Interlacing.UNKNOWN and of_pictures:
        yield (
            "Interlaced and progressive pictures differ only where something moves: use pictures of a moving "
            "object, or set the option 'pictures' (frames or progressive)."
        )
    elif found.interlacing is Interlacing.UNKNOWN:
        yield "The field order can be checked only where something moves."
    if rate_hz is None:
        yield "The rate of the pictures is unknown: give --rate-hz."
    if found.lines % 2:
        yield f"The number of lines, {found.lines}, is odd, and the rig needs an even one: cut a line off."
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


def _of_light(targets: Targets) -> Iterator[str]:
    if targets.contrast < LEAST_CONTRAST:
        yield f"Targets are only {targets.contrast:.0f} grey levels above the background: use more light."
    if targets.clipped > MOST_CLIPPED:
        yield f"{targets.clipped:.0%} of the targets' pixels are saturated: reduce the light or the exposure."


def words(seen: Inspected, out: Path | None) -> str:
    """The findings as lines of text."""
    found = seen.found
    rate = "unknown" if seen.rate_hz is None else f"{seen.rate_hz:.6g}"
    what = "pictures" if found.interlacing is Interlacing.PROGRESSIVE else "fields"
    rows = [
        f"size      {found.columns} x {found.lines} pixels",
        f"lines     {_IN_WORDS[found.interlacing]}" + (f" ({found.order.evidence})" if found.order else ""),
        f"rate      {rate} {what} a second",
        *([f"grey      {seen.grey}"] if seen.grey else []),
        *_rows_of(found.targets, found.split),
        *(f"note      {problem}" for problem in seen.problems),
    ]
    if out is not None:
        rows.append(f"written   {out}: complete it where marked, then run: grabberd check-config {out}")
    return "\n".join(rows)


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
            "      distance_mm: 240        # from the lens, along the mirrors' path, to the object",
            "      base_mm: 128            # between the two virtual cameras",
            "      convergence_deg: 30     # between their axes",
            "      focal_length_mm: 8",
            "      pixel_x_mm: 0.0086      # width of the sensor divided by the number of columns",
            "      pixel_y_mm: 0.0083      # its height divided by the number of lines",
            "      exposure_ms: 1",
            "    # calibration: rig.calibration.json    # once there is one: grabberd calibrate",
            "    # object: object.yaml                  # what to measure: docs/reference/object-files.md",
            "",
        ]
    )


def _picture_options(seen: Inspected) -> Iterator[str]:
    pictures = _PICTURES.get(seen.found.interlacing)
    if pictures is None:
        yield "pictures: progressive   # or frames, if they are interlaced: nothing that moves shows which"
    else:
        yield f"pictures: {pictures}"
    if pictures == "frames":
        yield f"field_order: {seen.found.interlacing}"


def _rate_options(seen: Inspected) -> Iterator[str]:
    if seen.rate_hz is None:
        yield "# rate_hz: 60            # required: how many pictures a second?"
    elif "rate_hz" in seen.options or (
        seen.driver == "replay"
        and (seen.of_pictures or "pictures" in seen.options)
        and Path(seen.options["path"]).is_dir()
    ):
        yield f"rate_hz: {seen.rate_hz:.6g}"
