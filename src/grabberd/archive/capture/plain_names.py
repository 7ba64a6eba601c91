"""Names of files that can be shown, logged and sent: a USB stick may bring any bytes as a name."""

import logging
import os
from pathlib import Path
from urllib.parse import quote_from_bytes

log = logging.getLogger(__name__)
_PLAIN = " !#$&'()+,-.=@[]^_`{}~"
LONGEST_BYTES = 200
"""Longer names leave no room for the endings that are added to them; file systems end at 255."""


def is_plain(name: str) -> bool:
    """True if a name is UTF-8, printable and not too long."""
    try:
        return name.isprintable() and len(name.encode()) <= LONGEST_BYTES
    except UnicodeEncodeError:
        return False


def plainly_named(path: Path) -> Path | None:
    """The file under a name that can be shown; it is renamed if its own cannot.

    Bytes that cannot be shown are written as in URLs, %FF. None if it cannot be renamed: it is left alone.
    """
    if is_plain(path.name):
        return path
    stem, *endings = os.fsencode(path.name).split(b".")
    ending = quote_from_bytes(b"".join(b"." + one for one in endings), safe=_PLAIN)[-20:]
    name = quote_from_bytes(stem, safe=_PLAIN)[: LONGEST_BYTES - 20]
    for number in range(1, 1000):
        plain = path.with_name(f"{name}{'' if number == 1 else f'-{number}'}{ending}")
        if not plain.exists():
            break
    try:
        os.rename(path, plain)
    except OSError as error:
        log.error("%r stays unlisted, since it cannot be renamed: %s", os.fsencode(path), error)
        return None
    log.warning("%r has a name that cannot be shown, and is now %s", os.fsencode(path), plain.name)
    return plain
