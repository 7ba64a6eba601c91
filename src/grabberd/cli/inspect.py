"""`grabberd inspect`: looks at pictures of unknown origin and writes a configuration for them."""

from contextlib import closing
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from grabberd.cli.options import DriverOption, JsonOption, driver_options, out_file, print_result
from grabberd.errors import GrabberdError, InputError, StorageError, StreamEnded, StreamFailed

if TYPE_CHECKING:
    from grabberd.core.chain.inspection import Inspection
    from grabberd.core.field import Field
    from grabberd.instrument.acquisition import Grabber, StreamInfo

MOST_FIELDS = 200
SILENCE_S = 2.0


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
    seen = Inspected.of(found, info, driver, options, rate_hz, problem)
    if out is not None:
        _write(out, configuration(seen))
    document = {**asdict(seen.found), "rate_hz": seen.rate_hz, "problems": list(seen.problems)}
    print_result(document, words(seen, out), as_json=json)


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
    from grabberd.core.chain.field_order import check  # noqa: PLC0415
    from grabberd.core.chain.inspection import inspect as looked_at  # noqa: PLC0415
    from grabberd.core.chain.inspection import inspect_fields  # noqa: PLC0415
    from grabberd.core.field import FieldOrder  # noqa: PLC0415
    from grabberd.instrument.acquisition import GRABBERS  # noqa: PLC0415

    pictures = driver == "replay" and _has_pictures(Path(options.get("path", "")))
    try:
        grabber = GRABBERS.create(driver, _of_pictures(options, rate_hz) if pictures else options)
    except ValueError as error:
        raise InputError(str(error), "name a folder, a video, a capture, or DRIVER:PATH") from error
    with closing(grabber):
        info = grabber.open()
        fields, problem = _fields(grabber)
    if not fields:
        raise problem or InputError(f"{info.card} has no pictures", "name another source")
    if pictures and "pictures" not in options:
        return looked_at([one.luma for one in fields]), info, problem
    order = None if info.field_order is FieldOrder.PROGRESSIVE else check(fields)
    return inspect_fields(fields, order), info, problem


def _of_pictures(options: dict[str, Any], rate_hz: float | None) -> dict[str, Any]:
    """Options that give pictures whole: how their lines belong together is the question."""
    whole = {"pictures": "progressive", **options}
    rate_hz = rate_hz and rate_hz * (2 if whole["pictures"] == "frames" else 1)
    rate_hz = rate_hz or options.get("rate_hz") or (1.0 if Path(options["path"]).is_dir() else None)
    return {**whole, "rate_hz": rate_hz}


def _has_pictures(path: Path) -> bool:
    """True for what has pictures without a word on their lines: neither a capture nor an exported folder."""
    return not path.name.endswith((".grab", ".grab.part")) and not (path / "fields.csv").exists()


def _fields(grabber: "Grabber") -> "tuple[list[Field], GrabberdError | None]":
    """Copies of the first fields, and the error that ended them, if one did."""
    from dataclasses import replace  # noqa: PLC0415

    fields: list[Field] = []
    while len(fields) < MOST_FIELDS:
        try:
            with grabber.dequeue(SILENCE_S) as grabbed:
                if not grabbed:
                    hint = "check the camera and its cable"
                    return fields, StreamFailed(f"no picture came for {SILENCE_S:g} s", hint)
                fields += [replace(one.field, luma=one.field.luma.copy()) for one in grabbed]
        except StreamEnded:
            break
        except GrabberdError as error:
            return fields, error
    return fields, None


def _write(out: Path, text: str) -> None:
    try:
        with out.open("x", encoding="utf-8") as file:
            file.write(text)
    except FileExistsError:
        raise InputError(f"{out} exists", "name a new file") from None
    except OSError as error:
        raise StorageError(f"{out} cannot be written: {error.strerror}", "name another folder") from error
