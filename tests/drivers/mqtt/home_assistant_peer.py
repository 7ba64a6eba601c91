"""Home Assistant's own judgement of discovery messages; runs in an environment that has Home Assistant.

Reads a JSON list of {"topic", "payload", "message"}: a discovery message, and a message on its state topic.
Prints a JSON list of what Home Assistant makes of them: state, attributes and availability.
"""

import asyncio
import importlib
import json
import sys
from typing import Any

from homeassistant.components.mqtt.discovery import TOPIC_MATCHER
from homeassistant.core import HomeAssistant
from homeassistant.helpers.template import Template


def judged(hass: HomeAssistant, one: dict[str, Any]) -> dict[str, Any]:
    prefix, _, rest = one["topic"].partition("/")
    found = TOPIC_MATCHER.match(rest)
    assert prefix == "homeassistant"
    assert found, rest
    module = importlib.import_module(f"homeassistant.components.mqtt.{found['component']}")
    checked = module.DISCOVERY_SCHEMA(one["payload"])
    refused = set(one["payload"]) - set(checked)
    said = json.dumps(one["message"])
    [available] = checked["availability"]
    attributes = checked.get("json_attributes_template")
    return {
        "refused": sorted(refused),
        "state": rendered(hass, checked["value_template"], said),
        "attributes": rendered(hass, attributes, said) if attributes else None,
        "available": [
            rendered(hass, available["value_template"], json.dumps({"online": on})) for on in (True, False)
        ],
        "payloads": [available["payload_available"], available["payload_not_available"]],
    }


def rendered(hass: HomeAssistant, template: Template, message: str) -> Any:
    template.hass = hass
    return template.async_render_with_possible_json_value(message, parse_result=False)


async def main() -> None:
    hass = HomeAssistant("/nonexistent")
    print(json.dumps([judged(hass, one) for one in json.load(sys.stdin)]))


asyncio.run(main())
