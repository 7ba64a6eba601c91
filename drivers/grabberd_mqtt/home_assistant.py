"""Retained messages by which Home Assistant discovers the devices, and shows them without being configured.

One for each entity, on PREFIX/COMPONENT/NODE/OBJECT/config. It names the topics that the daemon publishes
anyway; its templates, which Home Assistant evaluates, pick a value from their messages. What was announced
is kept, so that it can be removed when it is no longer wanted.
"""

import re
from collections.abc import Collection, Iterator, Sequence
from typing import NamedTuple

from grabberd import __version__
from grabberd.archive.state.state_database import StateStore
from grabberd.documents.document import JsonObject
from grabberd.documents.mqtt import Topic
from grabberd_mqtt.messages import LAST_CAPTURE, ONLINE, STATE, Message, Topics

_NO_NAME = re.compile(r"[^A-Za-z0-9-]")
"""Home Assistant's topics have letters, digits, hyphens and underscores; the latter escape the rest here."""


class Entity(NamedTuple):
    """One thing that Home Assistant shows of a device.

    Attributes:
        component: Kind of entity.
        object: Its name in topics and ids.
        name: Its name for people, after the device's.
        topic: Topic that its value comes from.
        value: Jinja expression of it.
        more: Other keys of the message.
        attributes: Keys of the topic's message that are shown beside the value.
    """

    component: str
    object: str
    name: str
    topic: Topic
    value: str
    more: JsonObject
    attributes: tuple[str, ...] = ()


def _count(outcome: str, words: str) -> Entity:
    key = f"fields_{outcome}"
    more = {
        "state_class": "total_increasing",
        "icon": "mdi:image-off-outline",
        "unit_of_measurement": "fields",
    }
    return Entity("sensor", key, words, STATE, f"value_json.{key}", {**more, "entity_category": "diagnostic"})


_WHY = ("health_part", "health_word", "hint", "cause", "signal")
_LEDGER = ("capture_id", "ended_because", "coverage_verdict", "coverage_in_words", "fields", "labels")
ENTITIES = (
    Entity("sensor", "health", "Health", STATE, "value_json.health", {"icon": "mdi:heart-pulse"}, _WHY),
    Entity(
        *("binary_sensor", "problem", "Problem", STATE, "'ON' if value_json.health == 'bad' else 'OFF'"),
        {"device_class": "problem"},
    ),
    Entity(
        *("binary_sensor", "capturing", "Capturing", STATE, "'ON' if value_json.capture_id else 'OFF'"),
        {"device_class": "running"},
    ),
    Entity(
        *("sensor", "rate", "Rate", STATE, "value_json.rate_hz"),
        {"device_class": "frequency", "unit_of_measurement": "Hz", "state_class": "measurement"},
    ),
    _count("lost", "Fields lost"),
    _count("damaged", "Fields damaged"),
    _count("no_signal", "Fields without signal"),
    _count("overrun", "Fields overrun"),
    Entity(
        *("sensor", "disk", "Recording time left", STATE, "value_json.disk_minutes_left"),
        {"device_class": "duration", "unit_of_measurement": "min", "state_class": "measurement"},
    ),
    Entity(
        *("sensor", "last_capture", "Last capture", LAST_CAPTURE, "value_json.started_utc"),
        {"device_class": "timestamp"},
    ),
    Entity(
        *("sensor", "last_verdict", "Last verdict", LAST_CAPTURE, "value_json.verdict or value_json.state"),
        {"icon": "mdi:clipboard-check-outline"},
        _LEDGER,
    ),
)


def discovery(prefix: str, topics: Topics, barn: str, device: str, driver: str) -> Iterator[Message]:
    """The messages by which a device is discovered.

    Args:
        prefix: Home Assistant's prefix of discovery topics.
        topics: Topics of the barn.
        barn: Its name.
        device: Name of the device.
        driver: Its driver.
    """
    node = f"grabberd_{_plain(barn)}_{_plain(device)}"
    about = {
        "identifiers": [node],
        "name": f"{barn} {device}",
        "manufacturer": "grabberd",
        "model": driver,
        "sw_version": __version__,
        "suggested_area": barn,
    }
    available = {
        "topic": topics.name(ONLINE),
        "value_template": "{{ 'online' if value_json.online else 'offline' }}",
    }
    for entity in ENTITIES:
        topic = topics.name(entity.topic, device=device)
        content: JsonObject = {
            "name": entity.name,
            "unique_id": f"{node}_{entity.object}",
            "state_topic": topic,
            "value_template": f"{{{{ {entity.value} }}}}",
            **entity.more,
            "availability": [available],
            "device": about,
            "origin": {"name": "grabberd", "sw_version": __version__},
        }
        if entity.attributes:
            content["json_attributes_topic"] = topic
            content["json_attributes_template"] = _attributes(entity.attributes)
        yield Message(f"{prefix}/{entity.component}/{node}/{entity.object}/config", content, retained=True)


def _attributes(keys: tuple[str, ...]) -> str:
    pairs = ", ".join(f"'{key}': value_json.{key}" for key in keys)
    return f"{{{{ {{{pairs}}} | tojson }}}}"


def _plain(name: str) -> str:
    """A name of letters, digits, hyphens and underscores; different names stay different."""
    return _NO_NAME.sub(lambda match: "".join(f"_{byte:02x}" for byte in match[0].encode()), name)


ANNOUNCED = "mqtt_announced_topics"
"""Key of the settings: topics on which the broker retains something only as long as it is wanted."""


class Announcements:
    """Compares what is to be announced with what was.

    A retained message stays with the broker when nobody publishes it any longer. So the topics are kept, and
    what is no longer wanted is removed by an empty message: the feature was turned off, or a device renamed.

    Args:
        store: Keeps the topics.
        wanted: What is to be announced; nothing where that is turned off.
        also: Topics that others publish on, for those alone who are told by the announcements.
    """

    def __init__(self, store: StateStore, wanted: Sequence[Message], also: Collection[str] = ()) -> None:
        self._store = store
        self._wanted = wanted
        self._topics = [*(message.topic for message in wanted), *also]

    @property
    def any(self) -> bool:
        """True if something is to be announced."""
        return bool(self._wanted)

    def due(self) -> Iterator[Message]:
        """Yields everything to be announced, then an empty message for each topic to be removed.

        Each is taken to have been published when the next one is asked for.

        Raises:
            StorageError: The state database cannot be used.
        """
        known: list[str] = self._store.get(ANNOUNCED) or []
        if new := [topic for topic in self._topics if topic not in known]:
            known += new  # kept before: what is published must be removable whatever happens next
            self._keep(known)
        yield from self._wanted
        # In their sequence: what names a topic is removed before that topic's own message.
        for topic in [topic for topic in known if topic not in self._topics]:
            yield Message(topic, None, retained=True)
            known.remove(topic)
            self._keep(known)

    def _keep(self, topics: Sequence[str]) -> None:
        if topics:
            self._store.put({ANNOUNCED: topics})
        else:
            self._store.remove(ANNOUNCED)
