"""The runs that are kept, and the page of them."""

import json
from pathlib import Path
from typing import Any

from tests.proofs.bench.peers.rendering import page

DOCS = Path(__file__).parents[4] / "docs"
PAGE = DOCS / "benchmarks.md"
RUNS = DOCS / "benchmarks"


def keep(done: dict[str, Any]) -> Path:
    """Puts a run beside the earlier ones and makes the page anew; returns the run's file."""
    RUNS.mkdir(exist_ok=True)
    name = done["at_utc"].translate(str.maketrans("", "", "-:"))
    file = RUNS / f"{name}.json"
    file.write_text(json.dumps(done, indent=1, ensure_ascii=False) + "\n")
    PAGE.write_text(page(kept(RUNS)))
    return file


def kept(runs: Path) -> list[dict[str, Any]]:
    """All runs of a folder."""
    return [json.loads(file.read_text()) for file in sorted(runs.glob("*.json"))]
