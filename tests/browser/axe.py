"""What axe-core finds in a page: it is vendored beside this file, for tests alone."""

from pathlib import Path
from typing import Any

SOURCE = (Path(__file__).parent / "vendor" / "axe.min.js").read_text(encoding="utf-8")
SERIOUS = ("serious", "critical")
RUN = "async () => (await axe.run(document, { resultTypes: ['violations'] })).violations"


def serious(page: Any) -> list[str]:
    """One line for each serious finding; a page that is as it should be has none."""
    if page.evaluate("typeof axe === 'undefined'"):
        page.evaluate(SOURCE)
    found = [one for one in page.evaluate(RUN) if one["impact"] in SERIOUS]
    return [
        f"{one['id']}: {node['target']} {node['failureSummary']}" for one in found for node in one["nodes"]
    ]
