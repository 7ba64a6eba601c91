"""`grabberd inspect`: looks at pictures of unknown origin and writes a configuration for them."""

from contextlib import closing
from dataclasses import asdict, replace
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from grabberd.cli.options import DriverOption, JsonOption, driver_options, out_file, print_result
from grabberd.errors import DeviceRefused, GrabberdError, InputError, StorageError, StreamEnded, StreamFailed

if TYPE_CHECKING:
    from collections.abc import Iterator

    from grabberd.core.chain.inspection import Inspection
    from grabberd.core.field import Field
    from grabberd.instrument.acquisition import Grabber, StreamInfo

MOST_FIELDS = 600
"""Twelve closures of a liner before a PAL grabber, and as many pictures of a folder or a video."""
MOST_PIXELS = 600 * 576 * 720
"""Larger pictures are fewer, so that it takes no longer."""
FEWEST_FIELDS = 120
MOST_MISSING = 1000
SILENCE_S = 2.0
SLOWEST_HZ = 1.0


def inspect(
    source: Annotated[
        str,
        typer.Argument(
            help="Folder of PNG pictures, video or capture; or a grabber as DRIVER:PATH, such as "
            "v4l2:/dev/video0."
        ),
    ],
    option: DriverOption = None,
    rate_hz: Annotated[
        float | None,
        typer.Option(min=0.1, max=1000, help="Pictures a second of a folder, or of a video without a rate."),
    ] = None,
    out: Annotated[Path | None, out_file("a configuration that fits the pictures")] = None,
    json: JsonOption = False,
) -> None:
    """Examine size, lines, views and targets of pictures, and write a configuration that fits them.

    Example: grabberd inspect frames/ --rate-hz 60 --out rig.yaml

    Example: grabberd inspect v4l2:/dev/video0 --option input=1
    """
    from grabberd.cli.inspected import Inspected, configuration, words  # noqa: PLC0415 - loads NumPy

    driver, options = _driver_of(source)
    options |= driver_options(option)
    found, info, problem = _inspected(driver, options, rate_hz)
    is_known = driver != "replay" or found.interlacing != "unknown"
    played = None if is_known else _played(options)
    seen = Inspected.of(found, info, driver, options, rate_hz, problem, played)
    if out is not None and found.layout is None:
        _write(out, configuration(seen))
    document = {**asdict(seen.found), "rate_hz": seen.rate_hz, "problems": list(seen.problems)}
    print_result(document, words(seen, None if found.layout else out), as_json=json)
    if out is not None and found.layout is not None:
        raise InputError(
            f"{out} was not written: no configuration fits pictures whose layout is {found.layout.kind}",
            "convert them as the note says, and inspect the result",
        )


def _played(options: dict[str, Any]) -> str | None:
    """The kind that the replay driver takes pictures for by their size; None if it asks."""
    from grabberd.instrument.acquisition import GRABBERS  # noqa: PLC0415

    try:
        with closing(GRABBERS.create("replay", {"rate_hz": 1.0, **options})) as grabber:
            return grabber.open().details.get("pictures")
    except GrabberdError:
        return None


def _driver_of(source: str) -> tuple[str, dict[str, Any]]:
    path = Path(source)
    driver, colon, rest = source.partition(":")
    if path.exists() or not colon:
        return "replay", {"path": str(path.resolve())}
    return driver, {"device" if driver == "v4l2" else "path": rest} if rest else {}


def _inspected(
    driver: str, options: dict[str, Any], rate_hz: float | None
) -> "tuple[Inspection, StreamInfo, GrabberdError | None]":
    """The inspection, the stream, and what ended its reading before its end."""
    from grabberd.core.chain.inspection import inspect as looked_at  # noqa: PLC0415
    from grabberd.core.chain.inspection import inspect_fields  # noqa: PLC0415

    pictures = driver == "replay" and _has_pictures(Path(options.get("path", "")))
    try:
        reading = _reading(driver, options, rate_hz, pictures=pictures)
    except ValueError as error:
        raise InputError(str(error), "name a folder, a video, a capture, or DRIVER:PATH") from error
    with closing(reading.grabber):
        fields = iter(reading)
        first = next((one for one in fields if one is not None), None)
        if first is None:
            raise reading.problem or InputError(f"{reading.info.card} has no pictures", "name another source")
        whole = chain([first], fields)
        if pictures and "pictures" not in options:
            found = looked_at(None if one is None else one.luma for one in whole)
        else:
            found = inspect_fields(whole)
    remarks = (*reading.info.remarks, *filter(None, [reading.repetitions]))
    return found, replace(reading.info, remarks=remarks), reading.problem


def _of_pictures(options: dict[str, Any], rate_hz: float | None) -> dict[str, Any]:
    """Options that give pictures whole: how their lines belong together is the question."""
    whole = {"pictures": "progressive", **options}
    rate_hz = rate_hz and rate_hz * (2 if whole["pictures"] == "frames" else 1)
    return {**whole, "rate_hz": rate_hz or options.get("rate_hz")}


def _reading(driver: str, options: dict[str, Any], rate_hz: float | None, *, pictures: bool) -> "_Reading":
    """The source, opened; pictures whose rate nothing tells are looked at as if they had one."""
    from grabberd.instrument.acquisition import GRABBERS  # noqa: PLC0415

    if not pictures:
        return _Reading(GRABBERS.create(driver, options))
    try:
        return _Reading(GRABBERS.create(driver, _of_pictures(options, rate_hz)))
    except DeviceRefused as error:
        if "'rate_hz'" not in error.hint:
            raise
    reading = _Reading(GRABBERS.create(driver, _of_pictures(options, SLOWEST_HZ)))
    reading.info = replace(reading.info, rate_hz=0.0)
    return reading


def _has_pictures(path: Path) -> bool:
    """True for what has pictures without a word on their lines: neither a capture nor an exported folder."""
    return not path.name.endswith((".grab", ".grab.part")) and not (path / "fields.csv").exists()


class _Reading:
    """The first fields of a grabber, each valid until the next is taken, and None for each that is missing.

    Attributes:
        grabber: Where they come from.
        info: The stream.
        problem: With the last field: the error that ended them, if one did.
    """

    def __init__(self, grabber: "Grabber") -> None:
        from grabberd.core.chain.repeats import RepeatJudge  # noqa: PLC0415 - loads NumPy
        from grabberd.core.field import FieldOrder  # noqa: PLC0415

        self.grabber = grabber
        self.info = grabber.open()
        self._rate_hz = self.info.rate_hz
        self._judge = RepeatJudge(of_any_parity=self.info.field_order is FieldOrder.PROGRESSIVE)
        self._repeats: list[bool] = []
        self.problem: GrabberdError | None = None

    def __iter__(self) -> "Iterator[Field | None]":
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

    def _is_repeated(self, field: "Field") -> bool:
        """True for a picture that a live device gives once more; a recording marks its own."""
        if not self.info.live:
            return False
        self._repeats.append(self._judge.take(replace(field, luma=field.luma.copy())))
        return self._repeats[-1]

    @property
    def repetitions(self) -> str:
        """Sentence on the pictures that a live device repeats; empty if there are none."""
        from grabberd.core.chain.repeats import repetitions  # noqa: PLC0415

        return repetitions(self._repeats, self._rate_hz)


def _write(out: Path, text: str) -> None:
    try:
        with out.open("x", encoding="utf-8") as file:
            file.write(text)
    except FileExistsError:
        raise InputError(f"{out} exists", "name a new file") from None
    except OSError as error:
        raise StorageError(f"{out} cannot be written: {error.strerror}", "name another folder") from error
