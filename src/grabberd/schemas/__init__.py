"""The forms of files that people write and programs read, as JSON Schema, for editors and other programs.

Where a model reads a file, its schema is the model's. Calibrations, objects and calibration frames are read
key by key; theirs say what those readers take, and tests hold the two together. A schema knows the form
alone: that no two targets share an id, say, only the reader finds out.
"""

from collections.abc import Mapping
from functools import cache
from types import MappingProxyType

from grabberd.extension import extensions, in_order, load
from grabberd.schemas.files import (
    Form,
    Schema,
    calibration_frame_schema,
    calibration_schema,
    capture_meta_schema,
    configuration_schema,
    object_schema,
)

__all__ = ["DIALECT", "Form", "Schema", "known_forms", "schema_of"]

DIALECT = "https://json-schema.org/draft/2020-12/schema"
_OWN: Mapping[str, Form] = {
    "configuration": Form("The configuration (YAML).", configuration_schema),
    "object": Form("An object to measure (YAML).", object_schema),
    "calibration-frame": Form("A calibration frame (YAML).", calibration_frame_schema),
    "calibration": Form("The calibration of a rig (JSON).", calibration_schema),
    "capture-meta": Form("The table `meta` of a capture file, as one object (JSON).", capture_meta_schema),
}


@cache
def known_forms() -> Mapping[str, Form]:
    """Forms by the names of their schemas, those of extensions at their places."""
    found = in_order(_OWN.items(), (one for extension in extensions() for one in extension.schemas))
    return MappingProxyType({name: load(one) if isinstance(one, str) else one for name, one in found.items()})


def schema_of(name: str) -> Schema:
    """The JSON Schema of a form, with its dialect and title."""
    form = known_forms()[name]
    return {"$schema": DIALECT, **form.made(), "title": form.title}
