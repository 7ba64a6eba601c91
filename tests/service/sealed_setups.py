"""A device whose captures are analysed when they are sealed."""

from pathlib import Path
from typing import Any

import yaml
from running import configuration

from grabberd.config import AnalysisConfig, default_config_file
from grabberd.documents.named_types import JsonObject
from grabberd.service.setup import DeviceSetup, set_up

DEVICE = "simulated"
SHAPE = {"heights_mm": [0]}


def setups_of(folder: Path, inputs: JsonObject | None = None, **analysis: Any) -> dict[str, DeviceSetup]:
    """The simulated device, whose captures are analysed when sealed unless something else is said."""
    file = folder / "inputs.yaml"
    file.write_text(yaml.safe_dump(SHAPE if inputs is None else inputs))
    config = AnalysisConfig(**{"when_sealed": True, "inputs": file, **analysis})
    return set_up(configuration({}, analysis=config), default_config_file())
