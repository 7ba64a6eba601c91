"""Nodes that are no grabber, or somebody else's: what our driver says of them."""

import json
import subprocess
import sys
from collections.abc import Callable
from typing import Any

from grabberd.errors import GrabberdError
from grabberd_v4l2 import V4l2Grabber
from proofs.vm.guest import vivid
from proofs.vm.guest.shell import run, wait_for


def of(**options: Any) -> dict[str, str] | None:
    """Why a grabber is not opened, or None if it is."""
    grabber = V4l2Grabber(**{"device": vivid.CAPTURE, **options})
    try:
        grabber.open()
    except GrabberdError as error:
        return {"kind": type(error).__name__, "message": error.message, "hint": error.hint}
    finally:
        grabber.close()
    return None


def of_other_nodes() -> dict[str, dict[str, str] | None]:
    """The same of every node beside the capture node that a device with everything has, by its name."""
    vivid.load_everything()
    names = run("cat /sys/class/video4linux/*/name").splitlines()
    nodes = run("ls /sys/class/video4linux").split()
    return {name: of(device=f"/dev/{node}") for name, node in zip(names, nodes, strict=True)}


def while_another_streams() -> dict[str, str] | None:
    """The same while another program has the device."""
    return _while("v4l2-ctl --stream-mmap", of)


def without_rights() -> dict[str, str] | None:
    """The same for a user who may not open the node."""
    asked = "import json; from proofs.vm.guest import refusals; print(json.dumps(refusals.of()))"
    said = run(f"setpriv --reuid=65534 --regid=65534 --clear-groups {sys.executable} -c '{asked}'")
    refusal: dict[str, str] | None = json.loads(said)
    return refusal


def _while(command: str, ask: Callable[[], dict[str, str] | None]) -> dict[str, str] | None:
    other = subprocess.Popen(["sh", "-c", f"exec {command} -d {vivid.CAPTURE}"], stderr=subprocess.PIPE)
    try:
        assert other.stderr is not None
        wait_for(lambda: other.stderr.read(1), 30.0)  # type: ignore[union-attr]
        return ask()
    finally:
        other.kill()
        other.wait()
