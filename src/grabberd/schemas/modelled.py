"""Schemas of files that models read: the models' own."""

from grabberd.archive.capture.meta import StoredMeta
from grabberd.config import Config
from grabberd.core.field import BIT_DEPTHS
from grabberd.schemas.forms import Schema


def configuration_schema() -> Schema:
    """The schema of the configuration."""
    schema = Config.model_json_schema()
    for name in ("devices", "loggers"):
        # The model leaves it open what other names than those of the pattern are.
        schema["properties"][name]["additionalProperties"] = False
    schema["$defs"]["LoggerConfig"]["properties"]["channels"]["additionalProperties"] = False
    return schema


def capture_meta_schema() -> Schema:
    """The schema of a capture's metadata; a later version may have further keys."""
    schema = StoredMeta.model_json_schema()
    schema["properties"]["bits"] = {"title": "Bits", "enum": list(BIT_DEPTHS)}
    return schema
