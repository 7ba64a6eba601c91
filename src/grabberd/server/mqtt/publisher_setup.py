"""Checks the MQTT configuration and creates the publisher.

The MQTT library is an optional extra, so it is imported only where a broker is configured.
"""

import importlib.util
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING
from urllib.parse import quote

from grabberd.archive.catalogue.archive import Archive
from grabberd.archive.state.state_database import StateStore
from grabberd.clock import UtcClock
from grabberd.config import Config
from grabberd.documents.state import StateDocument
from grabberd.errors import ConfigError, ExtraMissing, Problem

if TYPE_CHECKING:
    from grabberd.server.mqtt.home_assistant import Announcements
    from grabberd.server.mqtt.messages import Topics
    from grabberd.server.mqtt.publisher import Publisher


def check_mqtt(config: Config, file: Path) -> None:
    """Checks that the daemon can publish as its configuration says.

    Raises:
        ConfigError: The barn has no name, aiomqtt is not installed, or a certificate cannot be used.
    """
    if config.mqtt is None:
        return
    problems = [Problem(str(file), key, words) for key, words in _problems(config) if words]
    if problems:
        raise ConfigError(problems)


def create_publisher(
    config: Config,
    archive: Archive,
    state: Callable[[], StateDocument],
    clock: UtcClock,
    heal: Callable[[str], None] | None = None,
) -> "Publisher | None":
    """Creates the publisher of a checked configuration; None if no broker is configured.

    Args:
        config: The configuration.
        archive: The captures.
        state: Returns the state of the service.
        clock: Dates the messages.
        heal: Recovers a damaged state database; see `StateDatabase`.
    """
    if config.mqtt is None:
        return None
    from grabberd.archive.state.state_database import Outbox  # noqa: PLC0415
    from grabberd.server.mqtt.broker import Broker, tls_context  # noqa: PLC0415 - an optional extra
    from grabberd.server.mqtt.messages import Topics  # noqa: PLC0415
    from grabberd.server.mqtt.publisher import Publisher  # noqa: PLC0415
    from grabberd.server.mqtt.summary_queue import SummaryQueue  # noqa: PLC0415

    mqtt, barn = config.mqtt, config.site["barn"]
    context = None if mqtt.tls is None else tls_context(mqtt.tls)
    broker = Broker(mqtt, mqtt.client_id or f"grabberd-{quote(barn, safe='')}", context)
    outbox = Outbox(config.state_directory / "state.sqlite", heal)
    summaries = SummaryQueue(archive, outbox, mqtt.queue_captures)
    topics = Topics(mqtt.topic_prefix, barn)
    announcements = _announcements(config, topics, StateStore(outbox.path, heal))
    return Publisher(broker, topics, state, summaries, clock, mqtt.every_s, announcements)


def _announcements(config: Config, topics: "Topics", store: StateStore) -> "Announcements":
    """Prepares what Home Assistant needs to discover the devices; nothing unless it is to."""
    from grabberd.server.mqtt.home_assistant import (  # noqa: PLC0415
        Announcements,
        discovery,
    )
    from grabberd.server.mqtt.messages import LAST_CAPTURE  # noqa: PLC0415

    if config.mqtt is None or not config.mqtt.home_assistant:
        return Announcements(store, ())
    prefix, barn = config.mqtt.home_assistant_prefix, config.site["barn"]
    wanted = [
        message
        for name, device in config.devices.items()
        for message in discovery(prefix, topics, barn, name, device.driver)
    ]
    return Announcements(store, wanted, [topics.name(LAST_CAPTURE, device=name) for name in config.devices])


def _problems(config: Config) -> list[tuple[str, str | None]]:
    """Pairs each key that can be wrong with its problem, or with None."""
    named = bool(config.site.get("barn", "").strip())
    missing = importlib.util.find_spec("aiomqtt") is None
    error = ExtraMissing("mqtt", "mqtt")
    return [
        (
            "site.barn",
            None if named else "mqtt needs it: barns without a name would share their topics",
        ),
        ("mqtt", f"{error.message}; {error.hint}" if missing else None),
        ("mqtt.tls", None if missing else _tls_problem(config)),
    ]


def _tls_problem(config: Config) -> str | None:
    if config.mqtt is None or config.mqtt.tls is None:
        return None
    from grabberd.server.mqtt.broker import tls_context  # noqa: PLC0415 - an optional extra

    try:
        tls_context(config.mqtt.tls)
    except OSError as error:
        return f"a certificate or key cannot be used: {getattr(error, 'reason', None) or error.strerror}"
    return None
