"""The environment in which LSL's programs find each other, on this computer alone."""

import os
from pathlib import Path

import pytest

LOOPBACK = """
[multicast]
ResolveScope = machine
[lab]
KnownPeers = {127.0.0.1}
[ports]
IPv6 = disable
[log]
level = -3
"""


@pytest.fixture(scope="session")
def lsl(tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    """Environment for a program that uses pylsl; the test is skipped where there is none."""
    try:
        import pylsl  # noqa: F401, PLC0415
    except (ImportError, RuntimeError) as error:  # RuntimeError: it comes without liblsl for this computer
        pytest.skip(f"pylsl is missing ({error}): pip install 'grabberd[lsl]'")
    file: Path = tmp_path_factory.mktemp("lsl") / "lsl.cfg"
    file.write_text(LOOPBACK)
    return {**os.environ, "LSLAPICFG": str(file)}
