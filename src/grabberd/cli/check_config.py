"""`grabberd check-config`: validates a configuration file."""

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from grabberd.cli.options import JsonOption, print_result
from grabberd.errors import ConfigError, Problem

if TYPE_CHECKING:
    from grabberd.config import Config


def check_config(
    file: Annotated[Path, typer.Argument(help="Configuration file (YAML).")], json: JsonOption = False
) -> None:
    """Validate a configuration file without starting anything; lists all problems, exit code 78.

    Example: grabberd check-config /etc/grabberd/grabberd.yaml
    """
    from grabberd.config import load_sound_part  # noqa: PLC0415
    from grabberd.extension import extensions, load  # noqa: PLC0415
    from grabberd.instrument.channels.logger_setup import create_logger, set_up_loggers  # noqa: PLC0415
    from grabberd.instrument.setup import set_up  # noqa: PLC0415

    config, problems, loose = load_sound_part(file)
    for name, driver in loose.items():
        create_logger(name, driver, file, problems)
    of_extensions = [load(one.config_check) for one in extensions() if one.config_check]
    checks: list[Callable[[Config, Path], object]] = [set_up, *of_extensions, set_up_loggers, _check_tls]
    if config is not None:
        problems += [problem for check in checks for problem in _problems(check, config, file)]
    if config is None or problems:
        raise ConfigError(problems)
    devices, loggers = sorted(config.devices), sorted(config.loggers)
    words = f"{file}: valid; devices: {', '.join(devices)}"
    words += f"; loggers: {', '.join(loggers)}" if loggers else ""
    print_result({"file": str(file), "devices": devices, "loggers": loggers}, words, as_json=json)


def _problems(
    check: "Callable[[Config, Path], object]", config: "Config", file: Path
) -> "tuple[Problem, ...]":
    """Run a check and return what it finds, so that those after it run all the same."""
    try:
        check(config, file)
    except ConfigError as error:
        return error.problems
    return ()


def _check_tls(config: "Config", file: Path) -> None:
    if config.http.tls is not None:
        from grabberd.server.api.serving import tls_context  # noqa: PLC0415

        tls_context(config.http.tls, file)
