"""Options shared by several commands."""

import json
from collections.abc import Iterable
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.console import Console

from grabberd.config import Config, DeviceConfig, default_config_file, load_config
from grabberd.errors import ConfigError, Problem

ConfigOption = Annotated[
    Path | None,
    typer.Option(
        "--config", "-c", help="Configuration file; default: the simulated grabber.", show_default=False
    ),
]
JsonOption = Annotated[bool, typer.Option("--json", help="Print JSON for scripts instead of text.")]
UrlOption = Annotated[str, typer.Option("--url", help="Address of the daemon.", envvar="GRABBERD_URL")]
TokenFileOption = Annotated[
    Path | None,
    typer.Option(
        "--token-file",
        help="File with the token for the daemon; default: the environment variable GRABBERD_TOKEN.",
        envvar="GRABBERD_TOKEN_FILE",
        show_default=False,
    ),
]
DEFAULT_URL = "http://127.0.0.1:8050"

console = Console()
"""Standard output, for results."""
progress_console = Console(stderr=True)
"""Standard error, for progress, so that results can be piped."""


def load(config: Path | None) -> Config:
    """Load the configuration named on the command line, or the simulated grabber's."""
    return load_config(config or default_config_file())


def only_device(config: Config, name: str | None, file: Path | None) -> str:
    """Name of the chosen device: the one named, or the only one."""
    if name is None and len(config.devices) == 1:
        return next(iter(config.devices))
    if name in config.devices:
        assert name is not None
        return name
    known = ", ".join(config.devices)
    problem = f"no device {name!r}; known: {known}" if name else f"several devices; choose one of: {known}"
    raise ConfigError([Problem(str(file or default_config_file()), "devices", problem)])


def with_device(config: Config, file: Path | None, device: str | None) -> Config:
    """Reduce the configuration to the chosen device; replay:PATH replaces the configured driver."""
    driver, colon, path = (device or "").partition(":")
    name = only_device(config, None if colon else device, file)
    chosen: DeviceConfig = config.devices[name]
    if colon:
        chosen = chosen.model_copy(update={"driver": driver, "options": {"path": str(Path(path).resolve())}})
    return config.model_copy(update={"devices": {name: chosen}})


def warn(warnings: Iterable[str]) -> None:
    """Print remarks beside the results, on standard error."""
    for warning in warnings:
        typer.echo(f"note: {warning}", err=True)


def print_json(document: Any) -> None:
    """Print a document as JSON on standard output."""
    typer.echo(json.dumps(document, indent=2, ensure_ascii=False))
