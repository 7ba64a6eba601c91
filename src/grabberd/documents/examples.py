"""Example documents for the OpenAPI description, read from `examples.json`."""

import json
from pkgutil import get_data

from grabberd.documents.document import JsonObject

_KNOWN = json.loads(get_data(__package__, "examples.json") or b"")

CAPTURE: JsonObject = _KNOWN["capture"]
POINTS: JsonObject = _KNOWN["points"]
JOB: JsonObject = _KNOWN["job"]
PROBLEM: JsonObject = _KNOWN["problem"]
_GROUP: JsonObject = _KNOWN["group"]
_IN_A_GROUP: JsonObject = {"group": _GROUP, "first_field_s": 0.0134}
GROUP: JsonObject = {
    **_GROUP,
    "captures": [
        {**CAPTURE, "id": f"{_GROUP['id']}-{device}", "device": device, **_IN_A_GROUP}
        for device in _GROUP["devices"]
    ],
}
