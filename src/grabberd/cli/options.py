"""Options shared by several commands."""

import json
import signal
from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from grabberd.errors import StorageError

if TYPE_CHECKING:  # pydantic takes longer to import than the help does to show
    from grabberd.config import Config, DeviceConfig

ConfigOption = Annotated[
    Path | None,
    typer.Option(
        "--config", "-c", help="Configuration file; default: the simulated grabber.", show_default=False
    ),
]
JsonOption = Annotated[bool, typer.Option("--json", help="Print JSON for scripts instead of text.")]
UrlOption = Annotated[str, typer.Option("--url", help="Address of the daemon.", envvar="GRABBERD_URL")]
ConfiguredUrlOption = Annotated[
    str | None,
    typer.Option(
        "--url",
        help="Address of the daemon; default: that in the configuration.",
        envvar="GRABBERD_URL",
        show_default=False,
    ),
]
TokenFileOption = Annotated[
    Path | None,
    typer.Option(
        "--token-file",
        help="File with the token for the daemon; default: the environment variable GRABBERD_TOKEN.",
        envvar="GRABBERD_TOKEN_FILE",
        show_default=False,
    ),
]
DriverOption = Annotated[
    list[str] | None,
    typer.Option(
        "--option",
        help="Option of the device's driver, KEY=VALUE, e.g. pictures=progressive; may be repeated.",
        metavar="KEY=VALUE",
    ),
]


def out_file(what: str) -> Any:
    """The option of every command that writes a file; nothing is overwritten."""
    return typer.Option("--out", "-o", help=f"New file to write: {what}.", show_default=False)


def out_folder(what: str) -> Any:
    """The option of every command that writes a folder."""
    return typer.Option("--out", "-o", help=f"New or empty folder to write: {what}.", show_default=False)


LineJitterOption = Annotated[
    float | None,
    typer.Option("--line-jitter-px", min=0, max=2, help="Line jitter assumed; default: the capture's."),
]
IncludeDamagedOption = Annotated[
    bool,
    typer.Option(
        "--include-damaged", help="Measure damaged fields too; their points may be wrong in place or time."
    ),
]
DEFAULT_URL = "http://127.0.0.1:8050"
VERDICTS = {
    "measured_well": "measured well",
    "measured_with_gaps": "measured with gaps",
    "not_measured": "not measured",
}
"""Verdicts on how well a run was measured, in words."""


def follow_link(path: Path | None) -> Path | None:
    """The file that a link named by the user leads to; links in folders of captures are not followed."""
    return path.resolve() if path is not None and path.is_symlink() else path


def follow_links(paths: list[Path]) -> list[Path]:
    """The files that links named by the user lead to."""
    return [follow_link(path) or path for path in paths]


def load(config: Path | None) -> "Config":
    """Load the configuration named on the command line, or the simulated grabber's."""
    from grabberd.config import default_config_file, load_config  # noqa: PLC0415

    return load_config(config or default_config_file())


def daemon_url(url: str | None, config: Path | None) -> str:
    """Address of the daemon: the one given, or that in the configuration."""
    if url is not None or config is None:
        return url or DEFAULT_URL
    return load(config).http.url


def with_device(
    config: "Config", file: Path | None, device: str | None, options: dict[str, Any] | None = None
) -> "Config":
    """Reduce the configuration to the chosen device; replay:PATH replaces the configured driver.

    Args:
        config: The configuration.
        file: Where it was read from.
        device: Name of a device in it, or DRIVER:PATH; None for the only one.
        options: Options of its driver, which replace those of the same name.
    """
    from grabberd.config import default_config_file, only_device  # noqa: PLC0415

    driver, colon, path = (device or "").partition(":")
    name = only_device(config, None if colon else device, file or default_config_file())
    chosen: DeviceConfig = config.devices[name]
    if colon:
        # A path in a configuration file is relative to that file; one typed here, to the working directory.
        chosen = chosen.model_copy(update={"driver": driver, "options": {"path": str(Path(path).resolve())}})
    if options:
        chosen = chosen.model_copy(update={"options": {**chosen.options, **options}})
    return config.model_copy(update={"devices": {name: chosen}})


def warn(warnings: Iterable[str]) -> None:
    """Print remarks beside the results, on standard error."""
    for warning in warnings:
        typer.echo(f"note: {warning}", err=True)


def print_result(document: Any, words: str, *, as_json: bool) -> None:
    """Print a result on standard output: in words, or as JSON for scripts."""
    if as_json:
        print_json(document)
    else:
        typer.echo(words)


def print_json(document: Any) -> None:
    """Print a document as JSON on standard output."""
    typer.echo(json.dumps(document, indent=2, ensure_ascii=False))


def labels_of(words: list[str]) -> dict[str, str]:
    """Labels from words such as cow=112."""
    return _pairs(words, "--label")


def driver_options(words: list[str] | None) -> dict[str, Any]:
    """Options of a driver from words such as rate_hz=60; values are of the types that YAML gives them."""
    from grabberd.bounded_documents import parse_yaml  # noqa: PLC0415 - takes longer to import than the help

    options: dict[str, Any] = {}
    for key, value in _pairs(words or [], "--option").items():
        try:
            options[key] = parse_yaml(value)
        except ValueError:
            raise typer.BadParameter(f"{value!r} is no value", param_hint="--option") from None
    return options


def _pairs(words: list[str], hint: str) -> dict[str, str]:
    pairs = [word.partition("=") for word in words]
    if wrong := [word for word, (key, equals, _) in zip(words, pairs, strict=True) if not (key and equals)]:
        raise typer.BadParameter(f"{wrong[0]!r} is not KEY=VALUE", param_hint=hint)
    return {key: value for key, _, value in pairs}


def given(**options: Any) -> dict[str, Any]:
    """The options that were given on the command line."""
    return {name: value for name, value in options.items() if value is not None}


def check_absent(*paths: Path) -> None:
    """Check that none of the files to be written exists.

    Raises:
        StorageError: some do; it names them.
    """
    if there := [str(path) for path in paths if path.exists()]:
        raise StorageError(f"{', '.join(there)} exists already", "name another file; nothing is overwritten")


def check_folder(path: Path) -> None:
    """Check that the folder of a file to be written exists.

    Raises:
        StorageError: it does not.
    """
    if not path.parent.is_dir():
        raise StorageError(f"there is no folder {path.parent}", "create it, or name another file")


def group_file(out: Path, device: str) -> Path:
    """File of one capture of a group: NAME-DEVICE.grab for NAME.grab."""
    return out.with_name(f"{out.stem}-{device}{out.suffix}")


def end_as_ctrl_c_does() -> None:
    """Let SIGTERM, too, raise KeyboardInterrupt, so that a file is sealed and progress is kept."""
    signal.signal(signal.SIGTERM, signal.default_int_handler)
