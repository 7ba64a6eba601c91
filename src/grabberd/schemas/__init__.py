"""The forms of files that people write and programs read, as JSON Schema, for editors and other programs.

Where a model reads a file, its schema is the model's. Calibrations, objects, calibration frames and inputs of
an analysis are read key by key; theirs say what those readers take, and tests hold the two together. A schema
knows the form alone: that no two targets share an id, say, only the reader finds out.
"""

from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import NamedTuple

from grabberd.schemas.calibration import calibration_schema
from grabberd.schemas.forms import Schema
from grabberd.schemas.modelled import capture_meta_schema, configuration_schema, profile_schema
from grabberd.schemas.object_files import calibration_frame_schema, object_schema
from grabberd_liner.analyses.inputs_schema import analysis_inputs_schema

__all__ = ["DIALECT", "SCHEMAS", "Form", "Schema", "schema_of"]

DIALECT = "https://json-schema.org/draft/2020-12/schema"


class Form(NamedTuple):
    """The form of a file.

    Attributes:
        title: What the file is.
        made: Makes its schema.
    """

    title: str
    made: Callable[[], Schema]


SCHEMAS: Mapping[str, Form] = MappingProxyType(
    {
        "configuration": Form("The configuration (YAML).", configuration_schema),
        "object": Form("An object to measure (YAML).", object_schema),
        "calibration-frame": Form("A calibration frame (YAML).", calibration_frame_schema),
        "calibration": Form("The calibration of a rig (JSON).", calibration_schema),
        "analysis-inputs": Form("Inputs of an analysis besides the points (YAML).", analysis_inputs_schema),
        "profile": Form("A profile of a liner, pulsator, cup or cow (YAML).", profile_schema),
        "capture-meta": Form(
            "The table `meta` of a capture file, as one object (JSON).", capture_meta_schema
        ),
    }
)
"""Forms by the names of their schemas."""


def schema_of(name: str) -> Schema:
    """The JSON Schema of a form, with its dialect and title."""
    form = SCHEMAS[name]
    return {"$schema": DIALECT, **form.made(), "title": form.title}
