"""Default locations of configuration and state."""

import os
import sys
from pathlib import Path


def default_state_directory() -> Path:
    """The state directory given by systemd, else one in the user's home."""
    if systemd := os.environ.get("STATE_DIRECTORY"):
        return Path(systemd.split(":")[0])
    base = os.environ.get("XDG_STATE_HOME") or Path.home() / ".local" / "state"
    return Path(base) / "grabberd"


def shipped_configs() -> Path:
    """Folder of the configurations shipped with the program, in a checkout or as installed."""
    checkout = Path(__file__).resolve().parents[3] / "configs"
    return checkout if checkout.is_dir() else Path(sys.prefix) / "share" / "grabberd" / "configs"


def default_config_file() -> Path:
    """The configuration of the simulated grabber, used when none is given."""
    return shipped_configs() / "fake.yaml"
