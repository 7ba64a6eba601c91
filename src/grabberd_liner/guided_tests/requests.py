"""Body of a request for a guided test."""

from typing import Self

from pydantic import Field, model_validator

from grabberd.documents.document import Document, with_examples
from grabberd.documents.named_types import JsonObject
from grabberd.documents.requests import CaptureName
from grabberd_liner.guided_tests.documents import LinerTestKind


class LinerTestRequest(Document):
    """A guided test to make of captures that were taken for it."""

    model_config = with_examples(
        {"kind": "artificial-teat", "captures": ["20260301T093000125Z-barn", "20260301T093100250Z-barn"]}
    )

    kind: LinerTestKind = Field(description="The recipe.")
    captures: list[CaptureName] = Field(
        min_length=1,
        max_length=100,
        description="Ids of the captures, in any order; their labels find the profiles that complete the "
        "inputs, and state the known pressures and the milkings.",
    )
    inputs: JsonObject = Field(
        default_factory=dict,
        description="Inputs of the analyses that win over profiles and recipe, as in `AnalysisRequest`.",
    )

    @model_validator(mode="after")
    def _distinct(self) -> Self:
        if len(set(self.captures)) < len(self.captures):
            raise ValueError("captures name one twice: each counts once")
        return self
