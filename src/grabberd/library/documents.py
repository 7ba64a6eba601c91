"""Documents given as a file, or as what such a file has in it."""

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from grabberd.files.documents import read_yaml

PathLike = str | os.PathLike[str]


def document_of(given: PathLike | Mapping[str, Any]) -> dict[str, Any]:
    """The document in a YAML or JSON file, or the one that is given.

    Raises:
        InputError: The file cannot be read, or has no keys.
    """
    # JSON is YAML as well.
    return dict(given) if isinstance(given, Mapping) else read_yaml(Path(given))
