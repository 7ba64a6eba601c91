"""The base of every document that enters or leaves the daemon, and the types that documents share.

Types that have a name in OpenAPI stand here, so that a generated client uses it instead of inventing one.
Extensions make their documents of these, so nothing here may import a document that extensions add to.
"""

from typing import Annotated, Any, Literal, NamedTuple, TypeVar

from pydantic import BaseModel, ConfigDict, Field, GetCoreSchemaHandler, StringConstraints
from pydantic.fields import FieldInfo
from pydantic_core import CoreSchema, core_schema
from typing_extensions import TypeAliasType

from grabberd.config import BitDepth, Lines, OnInterruption
from grabberd.extension import extensions, in_order, load
from grabberd.tables import LARGEST_NUMBER


class Document(BaseModel):
    """A part of a request or a response; unknown keys are refused."""

    model_config = ConfigDict(extra="forbid", frozen=True)


Number = Annotated[float, Field(ge=-LARGEST_NUMBER, le=LARGEST_NUMBER, allow_inf_nan=False)]
"""A number of a request that can be reckoned with."""
D = TypeVar("D", bound=Document)


def assembled(model: type[D], /, *sources: object, **own: object) -> D:
    """A document of what is given, and of the attributes of the same names of some objects, the first first.

    Raises:
        ValidationError: A value is missing or invalid.
    """
    for source in sources:
        own |= {
            name: getattr(source, name)
            for name in model.model_fields
            if name not in own and hasattr(source, name)
        }
    return model.model_validate(own)


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


class JobProblem(Document):
    """Message and hint of what has failed."""

    message: str
    hint: str


MOST_LABELS = 32
MOST_MARKS = 200

Label = Annotated[str, StringConstraints(max_length=200)]
Note = Annotated[str, StringConstraints(max_length=2000)]
MarkName = Annotated[str, StringConstraints(strip_whitespace=True, pattern=r"\S", max_length=200)]
MarkedField = Annotated[str, StringConstraints(pattern=r"^[0-9]{1,8}$")]
"""Number of a field as JSON has it for a key."""

Bits = TypeAliasType("Bits", BitDepth)
LinesKind = TypeAliasType("LinesKind", Lines)
LINES = "`doubled` or `field`; null for progressive pictures, which have all lines."
InterruptionPolicy = TypeAliasType("InterruptionPolicy", OnInterruption)
OverrunPolicy = TypeAliasType("OverrunPolicy", Literal["count", "stop"])
CaptureState = TypeAliasType(
    "CaptureState", Literal["armed", "recording", "sealing", "sealed", "unsealed", "damaged", "disarmed"]
)
Verdict = TypeAliasType("Verdict", Literal["complete", "incomplete"])
ListedVerdict = TypeAliasType("ListedVerdict", Literal["complete", "incomplete", "damaged"])
AcceptanceVerdict = TypeAliasType("AcceptanceVerdict", Literal["passed", "passed_with_remarks", "failed"])
Labels = TypeAliasType("Labels", Annotated[dict[Label, Label], Field(max_length=MOST_LABELS)])
LabelChanges = TypeAliasType(
    "LabelChanges", Annotated[dict[Label, Label | None], Field(max_length=MOST_LABELS)]
)
MarkChanges = TypeAliasType(
    "MarkChanges",
    Annotated[
        dict[MarkedField, MarkName | None],
        Field(max_length=MOST_MARKS, json_schema_extra={"additionalProperties": False}),
    ],
)
Weights = TypeAliasType("Weights", Literal["honest", "equal"])
CalibrationFrameTreatment = TypeAliasType("CalibrationFrameTreatment", Literal["weighted", "held"])
Handedness = TypeAliasType("Handedness", Literal[-1, 1])
Turn = TypeAliasType("Turn", Literal[0, 90, 180, 270])
ViewHandedness = TypeAliasType("ViewHandedness", dict[str, int])
CalibrationOrigin = TypeAliasType("CalibrationOrigin", Literal["capture", "import", "configuration"])
Glass = TypeAliasType("Glass", dict[str, float])
ImageSize = TypeAliasType("ImageSize", dict[str, int])
Latency = TypeAliasType("Latency", dict[str, float])
ViewCounts = TypeAliasType("ViewCounts", dict[str, int])
JsonObject = TypeAliasType("JsonObject", dict[str, Any])
"""JSON of another schema: documents from files, configuration, and results that a job kind defines."""
AllDevices = TypeAliasType("AllDevices", Literal["all"])
DeviceNames = TypeAliasType(
    "DeviceNames", Annotated[list[Annotated[str, Field(max_length=32)]], Field(min_length=1, max_length=64)]
)
