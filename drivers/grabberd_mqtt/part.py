"""The part of a daemon that publishes to an MQTT broker, and the check of its configuration.

The MQTT library is an optional extra, so it is imported only where a broker is configured.
"""

import importlib.util
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING
from urllib.parse import quote

from grabberd.archive.state.state_database import StateStore
from grabberd.config import Config
from grabberd.config.daemon import MqttConfig
from grabberd.errors import ConfigError, ExtraMissing, Problem
from grabberd.server.daemon.service import Service, ServicePart

if TYPE_CHECKING:
    from grabberd_mqtt.home_assistant import Announcements
    from grabberd_mqtt.messages import Topics
    from grabberd_mqtt.publisher import Publisher


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


class MqttPart(ServicePart):
    """The publisher of a daemon whose configuration names a broker.

    Args:
        service: The daemon.

    Attributes:
        publisher: Publishes states and captures; None if no broker is configured.

    Raises:
        ConfigError: See `check_mqtt`.
    """

    def __init__(self, service: Service) -> None:
        self.publisher: Publisher | None = None
        if service.config is not None and service.config[0].mqtt is not None:
            check_mqtt(*service.config)
            self.publisher = _publisher(service, service.config[0], service.config[0].mqtt)

    def start(self) -> None:
        """See `ServicePart`."""
        if self.publisher is not None:
            self.publisher.start()

    def stop(self) -> None:
        """See `ServicePart`."""
        if self.publisher is not None:
            self.publisher.stop()

    def state_fields(self) -> Mapping[str, object]:
        """See `ServicePart`."""
        return {"mqtt": self.publisher.document() if self.publisher else None}

    def sealed(self, capture_id: str, device: str) -> None:
        """See `ServicePart`."""
        if self.publisher is not None:
            self.publisher.capture_ended()


def _publisher(service: Service, config: Config, mqtt: MqttConfig) -> "Publisher":
    from grabberd.archive.state.state_database import Outbox  # noqa: PLC0415
    from grabberd_mqtt.broker import Broker, tls_context  # noqa: PLC0415 - an optional extra
    from grabberd_mqtt.messages import Topics  # noqa: PLC0415
    from grabberd_mqtt.publisher import Publisher, SummaryQueue  # noqa: PLC0415

    barn, heal = config.site["barn"], service.state_keeper.heal
    context = None if mqtt.tls is None else tls_context(mqtt.tls)
    broker = Broker(mqtt, mqtt.client_id or f"grabberd-{quote(barn, safe='')}", context)
    outbox = Outbox(service.directory / "state.sqlite", heal)
    summaries = SummaryQueue(service.archive, outbox, mqtt.queue_captures)
    topics = Topics(mqtt.topic_prefix, barn)
    announcements = _announcements(config, topics, StateStore(outbox.path, heal))
    return Publisher(broker, topics, service.state, summaries, service.clock, mqtt.every_s, announcements)


def _announcements(config: Config, topics: "Topics", store: StateStore) -> "Announcements":
    """Prepares what Home Assistant needs to discover the devices; nothing unless it is to."""
    from grabberd_mqtt.home_assistant import Announcements, discovery  # noqa: PLC0415
    from grabberd_mqtt.messages import LAST_CAPTURE  # noqa: PLC0415

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
        ("site.barn", None if named else "mqtt needs it: barns without a name would share their topics"),
        ("mqtt", f"{error.message}; {error.hint}" if missing else None),
        ("mqtt.tls", None if missing else _tls_problem(config)),
    ]


def _tls_problem(config: Config) -> str | None:
    if config.mqtt is None or config.mqtt.tls is None:
        return None
    from grabberd_mqtt.broker import tls_context  # noqa: PLC0415 - an optional extra

    try:
        tls_context(config.mqtt.tls)
    except OSError as error:
        return f"a certificate or key cannot be used: {getattr(error, 'reason', None) or error.strerror}"
    return None
