"""Documents of a liner's guided tests: a recipe's checks, its quantities, what they offer to the liner's
profile, and the request for a test.
"""

from typing import Annotated, Literal, Self

from pydantic import Field, model_validator
from typing_extensions import TypeAliasType

from grabberd.documents.document import DescribedBy, Document, JobProblem, JsonObject, Next, with_examples
from grabberd.documents.requests import CaptureName
from grabberd_liner.analyses.documents import QuantityDocument
from grabberd_liner.profiles.documents import ProfileContent, ProfileUse

LinerTestKind = TypeAliasType(
    "LinerTestKind", Literal["reference", "ramp", "milking", "artificial-teat", "overpressure", "wear"]
)
"""Recipes; the value of a capture's label `test`."""

CheckVerdict = TypeAliasType("CheckVerdict", Literal["passed", "failed", "not certain", "not checked"])


class TestCheck(Document):
    """One check of a test: what was found, against its limit."""

    __test__ = False  # no test case, whatever its name says to pytest

    name: str = Field(description="Name of the check, which never changes, such as `mounted_radius`.")
    title: str = Field(description="What is checked, in a few words.")
    verdict: CheckVerdict
    value: float | None = Field(None, description="What was found; null if the check is no number.")
    sigma: float | None = Field(None, description="Its standard deviation.")
    unit: str = Field("", description="Unit of value and σ; empty if there is no number.")
    limit: str = Field("", description="Limit in words, such as `at most 0.5 kPa`.")
    reason: str = Field("", description="Why it did not pass, with the values that it compared.")
    remedy: str = Field("", description="What to do about it.")


class ProfileOffer(Document):
    """A liner's profile with the values that a test has found, not yet stored."""

    profile: Annotated[JsonObject, DescribedBy(ProfileContent)] = Field(
        description="Content of the profile's next version."
    )
    after: int = Field(description="Version that it was made from, 0 for none.")
    changes: list[str] = Field(description="What it changes, in sentences.")


class TestedCapture(Document):
    """A capture that a test evaluated, and what it was captured and analysed with."""

    __test__ = False

    id: str
    captured_utc: str
    device: str | None
    run: int = Field(description="Run whose points were analysed.")
    bits: int
    calibration: str | None = Field(description="Id of the calibration.")
    object_model: str | None = Field(description="Name of the object model.")
    labels: dict[str, str]
    profiles: list[ProfileUse] = Field(description="Versions of the profiles that inputs came from.")


class TestQuantity(QuantityDocument):
    """A quantity that a test found."""

    __test__ = False

    title: str
    definition: str


class TestCurve(Document):
    """Values of a figure of a test, over another quantity."""

    __test__ = False

    name: str = Field(description="Name that never changes, such as `distance`.")
    title: str
    x_title: str
    x_unit: str
    y_title: str
    y_unit: str
    style: Literal["line", "points", "mark"] = Field(description="How it is drawn; a mark is a place on x.")
    x: list[float]
    y: list[float | None]
    sigma: list[float | None] = Field(description="Standard deviation of each `y`.")


class LinerTestDocument(Document):
    """A test of a liner."""

    schema_: Literal["grabberd/liner-test/1"] = Field("grabberd/liner-test/1", alias="schema")
    kind: LinerTestKind
    liner: str | None = Field(description="Name of the liner, from the captures' label; null if it has none.")
    captures: list[TestedCapture] = Field(description="Captures that were evaluated, the oldest first.")
    analyses: list[int] = Field(
        default_factory=list, description="Number of the analysis of each; empty outside a daemon."
    )
    created_utc: str
    version: str = Field(description="Version of the program.")
    verdict: CheckVerdict = Field(description="The worst of the checks that could be made.")
    checks: list[TestCheck]
    quantities: list[TestQuantity]
    curves: list[TestCurve] = Field(default_factory=list, description="What the figures show.")
    problems: list[str] = Field(
        default_factory=list, description="Problems of the analyses in spite of which the test was completed."
    )
    offer: ProfileOffer | None = Field(None, description="Null if the test has nothing to offer.")


class LinerTestResult(Document):
    """Result of a job `test`: a guided test of a liner."""

    test: str = Field(description="Id of the test.")
    kind: LinerTestKind
    verdict: CheckVerdict
    analyses: list[int] = Field(description="Number of the analysis of each capture, the oldest first.")


class LinerTestRow(Document):
    """A test in a list."""

    id: str = Field(description="Id of the test, which is that of the job that made it.")
    kind: LinerTestKind | None
    liner: str | None
    captures: list[str] = Field(description="Ids of its captures, the oldest first.")
    created_utc: str | None
    verdict: CheckVerdict | None
    quantities: list[TestQuantity]
    offers: bool = Field(description="True if it offers a version of the liner's profile.")
    problem: str | None = Field(None, description="Why it cannot be read; the others are then null or empty.")


class LinerTestList(Document):
    """A page of the tests, newest first."""

    tests: list[LinerTestRow]
    next: str | None = Next


class DeviceTest(Document):
    """The test that ended last of those of a device's captures."""

    capture: str = Field(description="Id of the newest of its captures.")
    state: Literal["done", "failed", "cancelled"]
    test: LinerTestRow | None = Field(None, description="Null if it came to nothing.")
    problem: JobProblem | None = Field(None, description="Why it came to nothing.")


class RecipeStep(Document):
    """A step that the operator takes before a capture of a test is started."""

    name: str = Field(description="Name of the step, which never changes.")
    text: str = Field(description="What to do, in a sentence.")


class RecipeDocument(Document):
    """Recipe of a guided test: its steps, and its captures."""

    kind: LinerTestKind = Field(description="Also the value of the label `test` of its captures.")
    title: str
    duration_s: float = Field(description="Length of a capture.")
    bits: int = Field(description="Bits per pixel of a capture.")
    several: bool = Field(
        description="True if it evaluates several captures, on request; a test of one capture is made by "
        "itself as soon as the capture is sealed."
    )
    pulsates: bool | None = Field(
        description="True if the pulsator runs, false if the wall stands still; null if it may do either."
    )
    teat: bool | None = Field(description="Whether there is a teat in the liner; null if there may be.")
    steps: list[RecipeStep] = Field(description="What to do, in order.")


class RecipeList(Document):
    """The guided tests that there are."""

    recipes: list[RecipeDocument]


LATEST_TEST = Annotated[
    DeviceTest | None,
    Field(None, description="Null until one has ended; those of the last month are known after a restart."),
]
"""Field `latest_test` of a device."""


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
