"""Commands of the guest's own programs."""

import subprocess
import time
from collections.abc import Callable


def run(command: str, timeout_s: float = 120.0) -> str:
    """What a shell command says.

    Raises:
        RuntimeError: it failed.
    """
    done = subprocess.run(
        ["sh", "-c", command], capture_output=True, text=True, timeout=timeout_s, check=False
    )
    if done.returncode:
        raise RuntimeError(f"{command}: exit {done.returncode}: {done.stdout[-2000:]}{done.stderr[-2000:]}")
    return done.stdout


def wait_for(condition: Callable[[], object], timeout_s: float = 30.0, every_s: float = 0.02) -> float:
    """Seconds until a condition holds.

    Raises:
        TimeoutError: it does not in time.
    """
    started = time.monotonic()
    while not condition():
        if time.monotonic() - started > timeout_s:
            raise TimeoutError(f"{condition.__qualname__} does not hold after {timeout_s} s")
        time.sleep(every_s)
    return time.monotonic() - started
