"""`grabberd inspect`: looks at pictures of unknown origin and writes a configuration for them."""

from dataclasses import asdict
from pathlib import Path
from typing import Annotated, Any

import typer

from grabberd.cli.options import DriverOption, JsonOption, driver_options, out_file, print_result
from grabberd.errors import InputError, StorageError


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
    from grabberd.cli.inspected import configuration, inspected, words  # noqa: PLC0415 - loads NumPy

    driver, options = _driver_of(source)
    seen = inspected(driver, options | driver_options(option), rate_hz)
    layout = seen.found.layout
    if out is not None and layout is None:
        _write(out, configuration(seen))
    document = {**asdict(seen.found), "rate_hz": seen.rate_hz, "problems": list(seen.problems)}
    print_result(document, words(seen, None if layout else out), as_json=json)
    if out is not None and layout is not None:
        why = f"{out} was not written: no configuration fits pictures whose layout is {layout.kind}"
        raise InputError(why, "convert them as the note says, and inspect the result")


def _driver_of(source: str) -> tuple[str, dict[str, Any]]:
    path = Path(source)
    driver, colon, rest = source.partition(":")
    if path.exists() or not colon:
        return "replay", {"path": str(path.resolve())}
    return driver, {"device" if driver == "v4l2" else "path": rest} if rest else {}


def _write(out: Path, text: str) -> None:
    try:
        with out.open("x", encoding="utf-8") as file:
            file.write(text)
    except FileExistsError:
        raise InputError(f"{out} exists", "name a new file") from None
    except OSError as error:
        raise StorageError(f"{out} cannot be written: {error.strerror}", "name another folder") from error
