"""Messages by which Home Assistant discovers the devices, so that it shows them without being configured.

One retained message for each entity, on PREFIX/COMPONENT/NODE/OBJECT/config. It names the topics that the
daemon publishes anyway; its templates, which Home Assistant evaluates, pick a value from their messages.
"""

import re
from collections.abc import Iterator
from typing import NamedTuple

from grabberd import __version__
from grabberd.documents.named_types import JsonObject
from grabberd.server.mqtt.messages import LAST_CAPTURE, ONLINE, STATE, Message, Topic, Topics

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
