"""The peers' process, asked from ours."""

import json
import subprocess
import sys
from pathlib import Path
from types import TracebackType
from typing import Any, Self

ENVIRONMENT = Path(".venv-bench")
ROOT = Path(__file__).parents[4]
THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS")


class Peers:
    """A process of the peers' environment that holds the same fields; it ends with the block."""

    def __init__(self, fields: Path) -> None:
        python = ROOT / ENVIRONMENT / "bin" / "python"
        if not python.exists():
            sys.exit(f"{ENVIRONMENT} is missing: run `make bench`, which sets it up")
        self._process = subprocess.Popen(
            [str(python), "-W", "ignore", "-m", "tests.proofs.bench.peers.theirs", str(fields)],
            cwd=ROOT,
            env={"PATH": "/usr/bin:/bin", "HOME": str(fields.parent), **dict.fromkeys(THREADS, "1")},
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        assert self._process.stdin
        self._process.stdin.close()
        try:
            self._process.wait(10)
        except subprocess.TimeoutExpired:
            self._process.kill()

    def about(self) -> Any:
        """`ways` that can be asked for, and `versions` of the peers."""
        return self._ask({})

    def turn_us(self, way: str) -> list[float]:
        """Processor time for every settled field."""
        taken: list[float] = self._ask({"way": way})["us"]
        return taken

    def found(self, way: str) -> list[Any]:
        """What was found in every settled field."""
        found: list[Any] = self._ask({"way": way, "found": True})["found"]
        return found

    def _ask(self, question: dict[str, Any]) -> Any:
        assert self._process.stdin
        assert self._process.stdout
        self._process.stdin.write(json.dumps(question) + "\n")
        self._process.stdin.flush()
        answer = self._process.stdout.readline()
        if not answer:
            sys.exit(f"the peers' process ended at {question}; it has said why above")
        return json.loads(answer)
