"""From the configuration to a publisher, or to why there can be none."""

import importlib.util
from collections.abc import Callable
from pathlib import Path
from typing import Protocol
from urllib.parse import quote

from grabberd.config import Config
from grabberd.documents.state import MqttDocument, StateDocument
from grabberd.errors import ConfigError, ExtraMissing, Problem
from grabberd.service.archive.archive import Archive
from grabberd.service.clock import Clock


class Publishes(Protocol):
    """What the service has of a publisher, without what it is made of: that is an optional part."""

    def start(self) -> None:
        """Begins; returns at once."""
        ...

    def notice(self) -> None:
        """A capture has ended."""
        ...

    def stop(self) -> None:
        """Disconnects cleanly."""
        ...

    def document(self) -> MqttDocument:
        """The connection to the broker, and the captures that wait for it."""
        ...


def check_publishing(config: Config, file: Path) -> None:
    """Whether the daemon can publish as a configuration says, or need not.

    Raises:
        ConfigError: the barn has no name, aiomqtt is not installed, or a certificate cannot be used.
    """
    if config.mqtt is None:
        return
    problems = [Problem(str(file), key, words) for key, words in _problems(config) if words]
    if problems:
        raise ConfigError(problems)


def publisher_of(
    config: Config, archive: Archive, state: Callable[[], StateDocument], clock: Clock
) -> Publishes | None:
    """What publishes, as a configuration that was checked says; None where it says nothing of MQTT.

    Args:
        config: the configuration.
        archive: the captures.
        state: gives the service's state.
        clock: says when.
    """
    if config.mqtt is None:
        return None
    from grabberd.service.mqtt.broker import Broker, tls_context  # noqa: PLC0415 - an optional part
    from grabberd.service.mqtt.messages import Topics  # noqa: PLC0415
    from grabberd.service.mqtt.publisher import Publisher  # noqa: PLC0415
    from grabberd.service.mqtt.summary_queue import SummaryQueue  # noqa: PLC0415
    from grabberd.storage.state.outbox import Outbox  # noqa: PLC0415

    mqtt, barn = config.mqtt, config.site["barn"]
    context = None if mqtt.tls is None else tls_context(mqtt.tls)
    broker = Broker(mqtt, mqtt.client_id or f"grabberd-{quote(barn, safe='')}", context)
    outbox = Outbox(config.state_directory / "state.sqlite")
    outgoing = SummaryQueue(archive, outbox, mqtt.queue_captures)
    return Publisher(broker, Topics(mqtt.topic_prefix, barn), state, outgoing, clock, mqtt.every_s)


def _problems(config: Config) -> list[tuple[str, str | None]]:
    named = bool(config.site.get("barn", "").strip())
    missing = importlib.util.find_spec("aiomqtt") is None
    error = ExtraMissing("mqtt", "mqtt")
    return [
        (
            "site.barn",
            None if named else "mqtt needs it: the topics of barns without a name would be the same",
        ),
        ("mqtt", f"{error.message}; {error.hint}" if missing else None),
        ("mqtt.tls", None if missing else _tls_problem(config)),
    ]


def _tls_problem(config: Config) -> str | None:
    if config.mqtt is None or config.mqtt.tls is None:
        return None
    from grabberd.service.mqtt.broker import tls_context  # noqa: PLC0415 - an optional part

    try:
        tls_context(config.mqtt.tls)
    except OSError as error:
        return f"a certificate or key cannot be used: {getattr(error, 'reason', None) or error.strerror}"
    return None
