"""Profiles of liners, pulsators, cups and cows: named, versioned, found by the labels of captures."""

from typing import Annotated, Literal

from pydantic import BeforeValidator, Field, StringConstraints
from typing_extensions import TypeAliasType

from grabberd.documents.document import DescribedBy, Document, JsonObject, Next, Note, with_examples

NAME_PATTERN = r"^\w(?:[\w .-]{0,62}[\w.-])?$"
"""Letters and digits of any language: a cow may be called Blåros, and a label is what a tablet sends."""
MOST_TEATS = 8


def _quoted(value: object) -> object:
    if isinstance(value, int | float):
        # YAML takes 0112 for 112, so that the number is not always what was written.
        raise ValueError(f'it is the number {value}: write the name in quotes, such as "112"')
    return value


ProfileKind = TypeAliasType("ProfileKind", Literal["liner", "pulsator", "cup", "cow"])
ProfileName = Annotated[str, StringConstraints(pattern=NAME_PATTERN), BeforeValidator(_quoted)]
Word = Annotated[str, StringConstraints(min_length=1, max_length=200)]
Flowing = TypeAliasType("Flowing", Literal["high", "low"])
TeatShape = TypeAliasType("TeatShape", Literal["round", "blunt", "pointed", "funnel", "pocket", "plate"])

_NAME = (
    "Value of the capture's label of this kind, such as `liner: A`; letters, digits, spaces, `.`, `_`, `-`."
)
_NOTE = "Free text, such as where it is kept, or that it is an example."


class _Profile(Document):
    """Keys of every profile."""

    name: ProfileName = Field(description=_NAME)
    note: Note = Field("", description=_NOTE)


class LagDocument(Document):
    """Delay from half the vacuum to half the wall's stroke; negative: the wall leads."""

    opening_s: float = Field(ge=-0.5, le=0.5, allow_inf_nan=False, description="While opening.")
    closing_s: float = Field(ge=-0.5, le=0.5, allow_inf_nan=False, description="While closing.")
    sigma_s: float = Field(gt=0, le=0.5, allow_inf_nan=False, description="σ of each.")


class LinerProfile(_Profile):
    """A liner as it is mounted: its maker, its age, and the wall that pressure and tension need."""

    kind: Literal["liner"] = Field(description="`liner`.")
    maker: Word | None = None
    type: Word | None = Field(None, description="The maker's name of this type of liner.")
    lot: Word | None = Field(None, description="The maker's lot.")
    age_milkings: int | None = Field(
        None, ge=0, le=1_000_000, description="Number of milkings it has been used for."
    )
    material: JsonObject | None = Field(
        None,
        description="The `material` of an analysis' inputs, whole or by `zones`; here σ of E, thickness and "
        "force are required.",
    )
    obtained: dict[str, Word] = Field(
        default_factory=dict,
        description="How each value of the material was obtained, by its key; required for `E_mpa`, "
        "`wall_mm`, `F0_n`, and `radius_mm` if it is given.",
    )
    lag: LagDocument | None = Field(
        None,
        description="The wall's lag, which relates a pulsator's settings to the capture; without `near_s`.",
    )
    analysis: JsonObject | None = Field(
        None,
        description="Defaults for the analysis of this liner's captures: `reference`, "
        "`plane`, `heights_mm`, `phases`, `sought_kpa`, `unseen`.",
    )


class PulsatorProfile(_Profile):
    """A pulsator by its settings, and the vacuum of the milking system."""

    kind: Literal["pulsator"] = Field(description="`pulsator`.")
    maker: Word | None = None
    type: Word | None = Field(None, description="The maker's name of this type of pulsator.")
    tested: Word | None = Field(None, description="Date and tester of the test report.")
    pulsation: JsonObject | None = Field(
        None,
        description="The `vacuum.pulsation` of an analysis' inputs: `rate_per_min`, `ratio`, `a_s`, `c_s`, "
        "`system_kpa`, `sigma_kpa`.",
    )
    liner: JsonObject | None = Field(
        None, description="The `vacuum.liner` of an analysis' inputs: `kpa`, `sigma_kpa`."
    )


class CupProfile(_Profile):
    """A cup with its targets: its device and object model, and the σ of its vacuum gauge."""

    kind: Literal["cup"] = Field(description="`cup`.")
    device: Word | None = Field(None, description="Device whose camera views it.")
    object_model: Word | None = Field(None, description="Name of the object model of its targets.")
    gauge: Word | None = Field(None, description="Its gauge, and when that was calibrated.")
    gauge_sigma_kpa: float | None = Field(
        None, gt=0, le=10, allow_inf_nan=False, description="σ of the gauge's zero: `vacuum.gauge_sigma_kpa`."
    )
    milk_flow: Flowing | None = Field(
        None, description="What its sensor in the short milk tube reads while milk flows: `milk_flow`."
    )


class FlowStopDocument(Document):
    """Contact pressure at the teat's end, above the gas in the liner, at which milk just stops flowing."""

    kpa: float = Field(gt=0, le=60, allow_inf_nan=False, description="The pressure.")
    sigma_kpa: float = Field(gt=0, le=60, allow_inf_nan=False, description="Its σ.")


class TeatDocument(Document):
    """Size and shape of a teat."""

    length_mm: float | None = Field(None, gt=0, le=150, allow_inf_nan=False, description="Its length.")
    diameter_mm: float | None = Field(
        None, gt=0, le=60, allow_inf_nan=False, description="Its diameter in the middle."
    )
    shape: TeatShape | None = Field(None, description="Shape of its end.")


class CowProfile(_Profile):
    """A cow: her teats, and the pressure at which her milk just stops flowing."""

    kind: Literal["cow"] = Field(description="`cow`.")
    breed: Word | None = None
    lactation: int | None = Field(None, ge=0, le=30, description="Number of her lactation.")
    teats: dict[Word, TeatDocument] = Field(
        default_factory=dict,
        max_length=MOST_TEATS,
        description="Teats by the value of the label `teat`: size and shape of the end, for information.",
    )
    flow_stop: FlowStopDocument | None = Field(None, description="The `flow_stop` of an analysis' inputs.")


ProfileContent = TypeAliasType(
    "ProfileContent",
    Annotated[LinerProfile | PulsatorProfile | CupProfile | CowProfile, Field(discriminator="kind")],
)

EXAMPLE: JsonObject = {
    "kind": "liner",
    "name": "A",
    "note": "first cluster, since March",
    "maker": "Example",
    "type": "R24",
    "age_milkings": 1200,
    "material": {
        "law": "neo_hookean",
        "E_mpa": 3.0,
        "E_sigma_mpa": 0.1,
        "wall_mm": 2.5,
        "wall_sigma_mm": 0.05,
        "poisson": 0.5,
        "F0_n": 60.0,
        "F0_sigma_n": 3.0,
        "radius_mm": 12.5,
        "target_mm": 0.0,
        "first_end_mm": -65.0,
        "last_end_mm": 65.0,
    },
    "obtained": {
        "E_mpa": "ramp of 2026-03-01",
        "wall_mm": "calliper, six points at three heights",
        "radius_mm": "drawing",
        "F0_n": "spring balance",
    },
}
"""A liner's profile, as OpenAPI shows it."""


class ProfileRequest(Document):
    """A profile to store: its document, or the same as YAML text."""

    model_config = with_examples({"profile": EXAMPLE}, {"yaml": "kind: cow\nname: '112'\n", "after": 0})

    profile: Annotated[JsonObject, DescribedBy(ProfileContent)] | None = Field(
        None, description="The profile's document."
    )
    yaml: str | None = Field(
        None, max_length=200_000, description="The same as YAML text, in place of `profile`."
    )
    after: int | None = Field(
        None,
        ge=0,
        le=2**31 - 1,
        description="Version that the change was made on, 0 for none: 409 if there is a newer one. Without "
        "it the profile follows whatever version there is.",
    )


class ProfileUse(Document):
    """A version of a profile that inputs of an analysis came from."""

    kind: str
    name: str
    version: int
    sha256: str = Field(description="SHA-256 of its content: tells it from another of the same number.")


class ProfileRow(Document):
    """A version of a profile in a list."""

    kind: ProfileKind
    name: str
    version: int = Field(description="Number of the version, from 1; a version never changes.")
    newest: int = Field(description="Number of the profile's newest version.")
    created_utc: str
    retired_utc: str | None = Field(
        description="Time when the profile was retired: no label finds it any longer, its versions stay."
    )
    sha256: str = Field(description="SHA-256 of its content.")
    note: str = Field(description="Its note.")
    problem: str | None = Field(description="Why it cannot be used: it is no longer what was stored.")


class ProfileList(Document):
    """A page of the profiles, each by its newest version, the newest first."""

    profiles: list[ProfileRow]
    next: str | None = Next


class ProfileVersions(Document):
    """A page of the versions of a profile, newest first."""

    versions: list[ProfileRow]
    next: str | None = Next


class ProfileDocument(ProfileRow):
    """A version of a profile with its content."""

    profile: Annotated[JsonObject, DescribedBy(ProfileContent)] = Field(description="The content.")
    yaml: str = Field(description="The content as YAML text, as it is exported.")
