"""`grabberd check-config`: validates a configuration file."""

from pathlib import Path
from typing import Annotated

import typer

from grabberd.cli.options import JsonOption, print_result


def check_config(
    file: Annotated[Path, typer.Argument(help="Configuration file (YAML).")], json: JsonOption = False
) -> None:
    """Validate a configuration file without starting anything; lists all problems, exit code 78.

    Example: grabberd check-config /etc/grabberd/grabberd.yaml
    """
    from grabberd.config import load_config  # noqa: PLC0415
    from grabberd.service.jobs.analysis_inputs import check_analysis_inputs  # noqa: PLC0415
    from grabberd.service.mqtt.publisher_setup import check_mqtt  # noqa: PLC0415
    from grabberd.service.setup import set_up  # noqa: PLC0415

    config = load_config(file)
    devices = set_up(config, file)
    check_mqtt(config, file)
    check_analysis_inputs(devices, file)
    if config.http.tls is not None:
        from grabberd.api.serving import tls_context  # noqa: PLC0415

        tls_context(config.http.tls, file)
    document = {"file": str(file), "devices": sorted(devices)}
    print_result(document, f"{file}: valid; devices: {', '.join(sorted(devices))}", as_json=json)
