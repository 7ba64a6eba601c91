"""Removal of secrets from configuration documents before they are shown. Nothing else."""

import re
from collections.abc import Mapping
from typing import Any

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
