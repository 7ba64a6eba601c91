"""The base of every document that enters or leaves the daemon."""

from typing import Any

from pydantic import BaseModel, ConfigDict, Field


class Document(BaseModel):
    """A part of a request or a response; unknown keys are refused."""

    model_config = ConfigDict(extra="forbid", frozen=True)


def with_examples(*examples: Any) -> ConfigDict:
    """Configuration of a document whose OpenAPI description shows these examples."""
    return ConfigDict(json_schema_extra={"examples": list(examples)})


Next = Field(None, description="`cursor` of the next page; null after the last one.")
