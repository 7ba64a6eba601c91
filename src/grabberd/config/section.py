"""What all sections of the configuration have in common."""

from pathlib import Path
from typing import Annotated

from pydantic import AfterValidator, BaseModel, ConfigDict, ValidationInfo


def _existing_file(path: Path, info: ValidationInfo) -> Path:
    directory: Path = (info.context or {}).get("directory", Path())
    resolved = (directory / path.expanduser()).resolve()
    if not resolved.is_file():
        raise ValueError(f"no file {resolved}")
    return resolved


ExistingFile = Annotated[Path, AfterValidator(_existing_file)]


class Section(BaseModel):
    """A part of the configuration: unknown keys are refused, nothing changes after loading."""

    model_config = ConfigDict(extra="forbid", frozen=True)
