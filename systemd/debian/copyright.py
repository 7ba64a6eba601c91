"""Debian's copyright file of a release: grabberd's own licence, and those that its packages state.

copyright.py RELEASE
"""

import sys
from importlib.metadata import distributions
from pathlib import Path

from sbom import licences_of

HEAD = """Format: https://www.debian.org/doc/packaging-manuals/copyright-format/1.0/
Upstream-Name: grabberd

Files: *
Copyright: 2026 The grabberd authors
License: Apache-2.0

Files: usr/lib/grabberd/lib/python3*/site-packages/*
Copyright: The authors of each package, named in its METADATA and LICENSE
License: of-each-package
"""
TAIL = """
License: Apache-2.0
 On Debian systems the full text is in /usr/share/common-licenses/Apache-2.0.
"""


def main(release: Path) -> None:
    """Prints it."""
    (site,) = release.glob("lib/python3*/site-packages")
    lines = [" As each package states it; the texts are in *.dist-info:"]
    for one in sorted(distributions(path=[str(site)]), key=lambda one: one.name.lower()):
        said = [word for licence in licences_of(one) for word in _words(licence)]
        lines.append(f"  {one.name} {one.version}: {', '.join(said) or 'see its METADATA'}")
    print(HEAD + "\nLicense: of-each-package\n" + "\n".join(lines) + "\n" + TAIL, end="")


def _words(licence: dict[str, object]) -> list[str]:
    inner = licence.get("license")
    return [str(inner["name"] if isinstance(inner, dict) else licence["expression"])]


if __name__ == "__main__":
    main(Path(sys.argv[1]))
