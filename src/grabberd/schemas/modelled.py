"""Schemas of files that models read: the models' own."""

from pydantic import TypeAdapter

from grabberd.archive.capture.meta import StoredMeta
from grabberd.config import Config
from grabberd.core.field import BIT_DEPTHS
from grabberd.schemas.forms import Schema, or_nothing
from grabberd_liner.analyses.inputs_schema import material_schema
from grabberd_liner.profiles.documents import ProfileContent


def configuration_schema() -> Schema:
    """The schema of the configuration."""
    schema = Config.model_json_schema()
    for name in ("devices", "loggers"):
        # The model leaves it open what other names than those of the pattern are.
        schema["properties"][name]["additionalProperties"] = False
    schema["$defs"]["LoggerConfig"]["properties"]["channels"]["additionalProperties"] = False
    return schema


def profile_schema() -> Schema:
    """The schema of a profile of any kind; a liner's material is that of the inputs of an analysis."""
    schema = TypeAdapter(ProfileContent).json_schema()
    material = schema["$defs"]["LinerProfile"]["properties"]["material"]
    kept = {key: material[key] for key in ("default", "description") if key in material}
    schema["$defs"]["LinerProfile"]["properties"]["material"] = or_nothing(material_schema()) | kept
    return schema


def capture_meta_schema() -> Schema:
    """The schema of a capture's metadata; a later version may have further keys."""
    schema = StoredMeta.model_json_schema()
    schema["properties"]["bits"] = {"title": "Bits", "enum": list(BIT_DEPTHS)}
    return schema
