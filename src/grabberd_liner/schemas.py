"""Forms of the files of liners that people write: inputs of an analysis, and profiles."""

from pydantic import TypeAdapter

from grabberd.schemas.forms import Form, Schema, or_nothing
from grabberd_liner.analyses.inputs_schema import analysis_inputs_schema, material_schema
from grabberd_liner.profiles.documents import ProfileContent


def profile_schema() -> Schema:
    """The schema of a profile of any kind; a liner's material is that of the inputs of an analysis."""
    schema = TypeAdapter(ProfileContent).json_schema()
    material = schema["$defs"]["LinerProfile"]["properties"]["material"]
    kept = {key: material[key] for key in ("default", "description") if key in material}
    schema["$defs"]["LinerProfile"]["properties"]["material"] = or_nothing(material_schema()) | kept
    return schema


ANALYSIS_INPUTS = Form("Inputs of an analysis besides the points (YAML).", analysis_inputs_schema)
PROFILE = Form("A profile of a liner, pulsator, cup or cow (YAML).", profile_schema)
