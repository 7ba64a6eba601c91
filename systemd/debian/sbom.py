"""What a package is made of, as CycloneDX JSON: Python packages, and the libraries that their wheels carry.

sbom.py RELEASE WHEELS

From the packages' own metadata; the digest of a package is that of the wheel it came in. The same release
gives the same document: it has no serial number, and its time is SOURCE_DATE_EPOCH.
"""

import hashlib
import json
import os
import re
import sys
from collections.abc import Iterator
from datetime import UTC, datetime
from importlib.metadata import Distribution, distributions
from pathlib import Path
from typing import Any

Component = dict[str, Any]


def document(release: Path, wheels: Path) -> Component:
    """The whole document; grabberd is its subject, all else its components."""
    digests = {_key(file): _sha256(file) for file in wheels.glob("*.whl")}
    (site,) = release.glob("lib/python3*/site-packages")
    found = sorted(distributions(path=[str(site)]), key=lambda one: _name(one.name))
    packages = [_package(one, digests) for one in found]
    subject = next(one for one in packages if one["name"] == "grabberd")
    libraries = [_library(file, site) for file in sorted(site.glob("*.libs/*.so*"))]
    references = {one["name"]: one["bom-ref"] for one in packages}
    return {
        "bomFormat": "CycloneDX",
        "specVersion": "1.5",
        "version": 1,
        "metadata": {
            "timestamp": datetime.fromtimestamp(
                int(os.environ.get("SOURCE_DATE_EPOCH", "0")), UTC
            ).isoformat(),
            "component": {**subject, "type": "application"},
        },
        "components": [one for one in packages if one is not subject] + libraries,
        "dependencies": [
            {"ref": references[_name(one.name)], "dependsOn": sorted(set(_needed(one, references)))}
            for one in found
        ],
    }


def _package(one: Distribution, digests: dict[tuple[str, str], str]) -> Component:
    name = _name(one.name)
    reference = f"pkg:pypi/{name}@{one.version}"
    component: Component = {"type": "library", "bom-ref": reference, "name": name, "version": one.version}
    component["purl"] = reference
    if digest := digests.get((name, one.version)):
        component["hashes"] = [{"alg": "SHA-256", "content": digest}]
    if licences := licences_of(one):
        component["licenses"] = licences
    return component


def licences_of(one: Distribution) -> list[Component]:
    """As an SPDX expression where a package states one; otherwise by its classifiers or its own words."""
    about = one.metadata
    if expressions := about.get_all("License-Expression"):
        return [{"expression": expressions[0]}]
    classified = [line for line in about.get_all("Classifier") or [] if line.startswith("License ::")]
    names = [line.rpartition(" :: ")[2] for line in classified]
    first_line = next(iter(about.get_all("License") or [""])).strip().partition("\n")[0]
    return [{"license": {"name": name}} for name in names or [first_line] if name]


def _library(file: Path, site: Path) -> Component:
    """A shared library that a wheel brings; its version is in its name, if anywhere."""
    return {
        "type": "file",
        "bom-ref": f"file:{file.relative_to(site)}",
        "name": str(file.relative_to(site)),
        "hashes": [{"alg": "SHA-256", "content": _sha256(file)}],
    }


def _needed(one: Distribution, references: dict[str, str]) -> Iterator[str]:
    for line in one.requires or []:
        found = re.match(r"[\w.-]+", line)
        if found and (reference := references.get(_name(found[0]))) and _name(found[0]) != _name(one.name):
            yield reference


def _key(wheel: Path) -> tuple[str, str]:
    name, version = wheel.name.split("-")[:2]
    return _name(name), version


def _name(name: str) -> str:
    """As the index of Python packages normalises it."""
    return re.sub(r"[-_.]+", "-", name).lower()


def _sha256(file: Path) -> str:
    return hashlib.sha256(file.read_bytes()).hexdigest()


if __name__ == "__main__":
    json.dump(document(*map(Path, sys.argv[1:])), sys.stdout, indent=1, sort_keys=True)
    print()
