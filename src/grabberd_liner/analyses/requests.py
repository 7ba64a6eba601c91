"""Body of a request for an analysis."""

from pydantic import Field

from grabberd.documents.document import Document, with_examples
from grabberd.documents.named_types import JsonObject
from grabberd.documents.requests import CaptureName


class AnalysisRequest(Document):
    """An analysis to run; missing inputs are not assumed, but reported as missing."""

    model_config = with_examples(
        {
            "inputs": {
                "reference": "nominal",
                "material": {"E_mpa": 3, "wall_mm": 2.5, "poisson": 0.5, "F0_n": 60, "radius_mm": 12.5},
                "vacuum": {
                    "pulsation": {"kpa": 0, "sigma_kpa": 0.5},
                    "liner": {"kpa": 42, "sigma_kpa": 0.5},
                },
                "plane": "symmetry",
                "sought_kpa": 1,
            },
            "bursts": ["20260301T093100250Z-barn"],
        },
        {"profiles": True},
    )

    inputs: JsonObject = Field(
        default_factory=dict,
        description="What is known in addition to the points, as in `grabberd analyse --inputs`: reference, "
        "material, vacuum, plane, heights_mm, phases, sought_kpa.",
    )
    bursts: list[CaptureName] = Field(
        default_factory=list,
        max_length=100,
        description="Ids of further captures of the same liner, to be merged with it by phase.",
    )
    run: int | None = Field(
        None, ge=1, le=2**53, description="Run whose points to analyse; default: the latest."
    )
    vacuum_log: str | None = Field(None, description="Text of a vacuum logger's CSV file.")
    profiles: bool = Field(
        False,
        description="Complete the inputs from the profiles that the capture's labels `liner`, `pulsator`, "
        "`cup` and `cow` name; what is in `inputs` wins.",
    )
    configured: bool = Field(
        False,
        description="Take the inputs that the configuration names for the device, "
        "`devices.NAME.analysis.inputs`, where `inputs` has none, as analyses do that follow a capture by "
        "themselves.",
    )
