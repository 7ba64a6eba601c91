"""The base of every document that enters or leaves the daemon."""

from typing import Any, NamedTuple, TypeVar

from pydantic import BaseModel, ConfigDict, Field, GetCoreSchemaHandler
from pydantic.fields import FieldInfo
from pydantic_core import CoreSchema, core_schema

from grabberd.extension import extensions, in_order, load


class Document(BaseModel):
    """A part of a request or a response; unknown keys are refused."""

    model_config = ConfigDict(extra="forbid", frozen=True)


D = TypeVar("D", bound=Document)


def extended(model: type[D]) -> type[D]:
    """The document with the fields that extensions add, each at its place; a subclass would lack them."""
    added = [place for one in extensions() for place in one.fields.get(model.__name__, ())]
    if added:
        fields = in_order(model.model_fields.items(), added)
        model.__pydantic_fields__ = {name: _field(one) for name, one in fields.items()}
        model.model_rebuild(force=True)
    return model


def _field(one: FieldInfo | str) -> FieldInfo:
    return FieldInfo.from_annotation(load(one)) if isinstance(one, str) else one


def with_examples(*examples: Any) -> ConfigDict:
    """Configuration of a document whose OpenAPI description shows these examples."""
    return ConfigDict(json_schema_extra={"examples": list(examples)})


class DescribedBy(NamedTuple):
    """Annotation of JSON that passes as it is; its model describes it in OpenAPI, but checks nothing.

    A file of an earlier version may lack keys, and must neither be refused for that nor gain them.
    """

    model: Any

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        """Takes and gives the annotated type; the model stands where only JSON schemas are generated from."""
        return core_schema.json_or_python_schema(
            json_schema=handler.generate_schema(self.model),
            python_schema=handler(source),
            serialization=core_schema.simple_ser_schema("dict"),
        )


Next = Field(None, description="`cursor` of the next page; null after the last one.")
