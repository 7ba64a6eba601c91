"""Faults of the daemon itself."""

from typing import Literal

from pydantic import Field

from grabberd.documents.document import Document
from grabberd.errors import Cause


class FaultDocument(Document):
    """A fault of the daemon itself, its captures' folder or its settings."""

    cause_code: Cause = Field(description="Machine-readable code.")
    level: Literal["fault", "warning"] = Field(
        description="fault: a person has to act; warning: to be known, or repaired by itself."
    )
    message: str
    hint: str
    since_utc: str
