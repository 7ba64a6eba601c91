"""Base class of all sections of the configuration."""

from pathlib import Path
from typing import Annotated

from pydantic import AfterValidator, BaseModel, ConfigDict, ValidationInfo


def _existing_file(path: Path, info: ValidationInfo) -> Path:
    directory: Path = (info.context or {}).get("directory", Path())
    try:
        resolved = (directory / path.expanduser()).resolve()
        if resolved.is_file():
            return resolved
    except (OSError, RuntimeError) as error:  # a name too long, a loop of links, an unknown user's home
        raise ValueError(f"there is no file {str(path)[:200]}: {error}"[:500]) from None
    raise ValueError(f"there is no file {resolved}")


ExistingFile = Annotated[Path, AfterValidator(_existing_file)]


class Section(BaseModel):
    """A section of the configuration: refuses unknown keys, immutable once loaded."""

    model_config = ConfigDict(extra="forbid", frozen=True)
