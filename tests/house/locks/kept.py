"""The folder `kept`: canonical JSON, a line for each part, so that a difference of files can be read."""

import hashlib
import json
from pathlib import Path
from typing import Any

KEPT = Path(__file__).parent / "kept"
LINE = 110
"""Length up to which a value stands on one line."""


def canonical(value: Any) -> str:
    """A value as JSON with sorted keys and without blanks."""
    return json.dumps(value, sort_keys=True, ensure_ascii=False, separators=(",", ":"))


def plain(value: Any) -> Any:
    """A value as it comes back from JSON."""
    return json.loads(canonical(value))


def digest(content: bytes | str) -> str:
    """Sixteen hexadecimal characters of the SHA-256 of a content."""
    raw = content.encode() if isinstance(content, str) else content
    return hashlib.sha256(raw).hexdigest()[:16]


def read(name: str) -> Any:
    """The kept document of a lock."""
    return json.loads((KEPT / f"{name}.json").read_text(encoding="utf-8"))


def write(name: str, document: Any, depth: int = 3) -> None:
    """Keeps a document.

    Args:
        name: Name of the lock.
        document: Its document.
        depth: Levels of mappings and lists whose parts stand on lines of their own, if they are long.
    """
    text = "\n".join(_lines(document, depth, "")) + "\n"
    (KEPT / f"{name}.json").write_text(text, encoding="utf-8")


def _lines(value: Any, depth: int, indent: str) -> list[str]:
    whole = canonical(value)
    if not depth or len(whole) <= LINE or not isinstance(value, dict | list):
        return [whole]
    opening, closing = "{}" if isinstance(value, dict) else "[]"
    parts = _parts(value, depth - 1, f"{indent} ")
    return [opening, *_joined(parts, f"{indent} "), f"{indent}{closing}"]


def _parts(value: dict[str, Any] | list[Any], depth: int, indent: str) -> list[list[str]]:
    if isinstance(value, list):
        return [_lines(one, depth, indent) for one in value]
    inner = ((canonical(key), _lines(one, depth, indent)) for key, one in sorted(value.items()))
    return [[f"{key}:{lines[0]}", *lines[1:]] for key, lines in inner]


def _joined(parts: list[list[str]], indent: str) -> list[str]:
    ended = [[*lines[:-1], f"{lines[-1]},"] for lines in parts[:-1]] + parts[-1:]
    return [line if k else f"{indent}{line}" for lines in ended for k, line in enumerate(lines)]
