"""Documents whose every word is an attack on the page."""

from typing import Any

EVIL = "\"><script>alert(1)</script>'&"


def hostile(value: Any, keep: set[str], key: str = "") -> Any:
    """A document with the same structure and numbers, but with markup at the end of every string.

    Keys that name a view or a free entry get it as well; keys in `keep` leave their strings alone.
    """
    if isinstance(value, str):
        return value if key in keep else value + EVIL
    if isinstance(value, list):
        return [hostile(one, keep, key) for one in value]
    if isinstance(value, dict):
        return {_key(name): hostile(one, keep, name) for name, one in value.items()}
    return value


def _key(name: str) -> str:
    return name + EVIL if name in {"left", "right", "laboratory", "device", "material", "E_mpa"} else name
