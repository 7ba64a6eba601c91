"""How large each package of this environment is, and whether a daemon that serves has loaded any of it.

usage: sizes.py        in the Python of an environment that has grabberd; prints a table in Markdown
"""

import os
import socket
import sys
import tempfile
import threading
import time
import urllib.request
from collections.abc import Callable
from importlib.metadata import Distribution, distributions
from pathlib import Path

LEAST_MB = 1.0
PATIENCE_S = 60.0


def serve(then: Callable[[set[str]], None]) -> None:
    """Runs the daemon; once fields arrive, `then` is told its modules, and all ends."""
    from grabberd.cli import main  # noqa: PLC0415

    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]

    def end() -> None:
        until = time.monotonic() + PATIENCE_S
        while not is_ready(port) and time.monotonic() < until:
            time.sleep(0.2)
        then({name.partition(".")[0] for name in sys.modules})
        sys.stdout.flush()
        os._exit(0)

    threading.Thread(target=end, daemon=True).start()
    sys.argv = ["grabberd", "serve", "--port", str(port)]
    main()


def is_ready(port: int) -> bool:
    """Whether fields are arriving, by the daemon's own word."""
    try:
        with urllib.request.urlopen(f"http://127.0.0.1:{port}/readyz", timeout=5):
            return True
    except OSError:
        return False


def size_mb(one: Distribution) -> float:
    """Of its files as they lie on the disk, bytecode apart."""
    paths = [Path(str(one.locate_file(file))) for file in one.files or [] if file.suffix != ".pyc"]
    return sum(path.stat().st_size for path in paths if path.exists()) / 1e6


def names(one: Distribution) -> set[str]:
    """The modules that it brings, by their first names."""
    return {file.parts[0].removesuffix(".py") for file in one.files or [] if file.suffix in (".py", ".so")}


def print_table(loaded: set[str]) -> None:
    """The largest first; the small ones together."""
    rows = sorted(
        ((size_mb(one), one.name, bool(names(one) & loaded)) for one in distributions()), reverse=True
    )
    print("| package | MB | loaded by a daemon |\n|---|---|---|")
    for size, name, is_loaded in rows:
        if size >= LEAST_MB:
            print(f"| {name} | {size:.0f} | {'yes' if is_loaded else 'no'} |")
    small = [size for size, _, _ in rows if size < LEAST_MB]
    print(f"| {len(small)} others | {sum(small):.0f} | |")
    print(f"| all | {sum(size for size, _, _ in rows):.0f} | |")


if __name__ == "__main__":
    os.environ["STATE_DIRECTORY"] = tempfile.mkdtemp(prefix="grabberd-sizes-")
    serve(print_table)
