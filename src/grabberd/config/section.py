"""Base class of all sections of the configuration, and the removal of secrets before they are shown."""

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any

from pydantic import AfterValidator, BaseModel, ConfigDict, ValidationInfo, field_validator

from grabberd.bounded_documents import as_written


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
    _as_written = field_validator("*", mode="wrap")(as_written)


SECRET = re.compile(r"password|passphrase|secret|token|credential|api_?key", re.IGNORECASE)
IN_URL = re.compile(r"(?P<scheme>\b[a-z][a-z0-9+.-]*://)[^/\s@]+@", re.IGNORECASE)
HIDDEN = "…"


def without_secrets(document: Any) -> Any:
    """A JSON document with "…" for secrets: values by their key's name, and credentials in addresses."""
    if isinstance(document, Mapping):
        return {key: _shown(str(key), value) for key, value in document.items()}
    if isinstance(document, list | tuple):
        return [without_secrets(inner) for inner in document]
    if isinstance(document, str):
        return IN_URL.sub(rf"\g<scheme>{HIDDEN}@", document)
    return document


def _shown(key: str, value: Any) -> Any:
    return HIDDEN if SECRET.search(key) and value is not None else without_secrets(value)
