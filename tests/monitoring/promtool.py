"""Prometheus' own judge of rules and queries."""

import os
import shutil
import subprocess
from pathlib import Path
from typing import Any

import pytest
import yaml

ROOT = Path(__file__).parents[2]
MONITORING = ROOT / "configs" / "monitoring"
RULES = MONITORING / "grabberd-alerts.yaml"
DASHBOARD = MONITORING / "grabberd-dashboard.json"
PROMTOOL = os.environ.get("PROMTOOL") or shutil.which(
    "promtool", path=f"{os.environ.get('PATH', '')}:{ROOT / '.venv' / 'promtool' / 'usr' / 'bin'}"
)
needs_promtool = pytest.mark.skipif(
    PROMTOOL is None, reason="promtool is missing: make promtool, or sudo apt-get install prometheus"
)


def rules() -> list[dict[str, Any]]:
    """The alert rules."""
    [group] = yaml.safe_load(RULES.read_text())["groups"]
    return list(group["rules"])


def judged(*words: str | Path) -> None:
    """Fails with what promtool says, unless it is content."""
    assert PROMTOOL is not None
    said = subprocess.run(
        [PROMTOOL, *map(str, words)], capture_output=True, text=True, check=False, timeout=120
    )
    assert said.returncode == 0, f"{said.stdout}{said.stderr}"


def check_queries(queries: list[str], folder: Path) -> None:
    """Fails unless Prometheus can parse every query."""
    recorded = [{"record": f"query:{number}", "expr": query} for number, query in enumerate(queries)]
    file = folder / "queries.yaml"
    file.write_text(yaml.safe_dump({"groups": [{"name": "queries", "rules": recorded}]}))
    judged("check", "rules", file)
