#!/usr/bin/env python3
"""Prints the crates in the program as CycloneDX 1.5 JSON: sbom.py TARGET.

Equal locks give equal bytes: components are sorted, and the time is that of SOURCE_DATE_EPOCH.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
import uuid
from collections.abc import Mapping
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
ORIGIN = "registry+https://github.com/rust-lang/crates.io-index"
PROGRAM = "photoncard"


def main() -> None:
    """Prints the bill of materials."""
    if len(sys.argv) != 2:
        sys.exit(f"usage: {sys.argv[0]} TARGET")
    metadata = _metadata(sys.argv[1])
    packages = {package["id"]: package for package in metadata["packages"]}
    linked = _linked(metadata)
    checksums = _checksums()
    components = {key: _component(packages[key], checksums) for key in linked}
    program = next(component for component in components.values() if component["name"] == PROGRAM)
    others = [component for component in components.values() if component is not program]
    dependencies = [
        {"ref": _reference(packages[key]), "dependsOn": sorted(_reference(packages[of]) for of in needed)}
        for key, needed in linked.items()
    ]
    now = time.gmtime(int(os.environ.get("SOURCE_DATE_EPOCH", "0")))
    bill: dict[str, Any] = {
        "bomFormat": "CycloneDX",
        "specVersion": "1.5",
        "version": 1,
        "metadata": {
            "timestamp": time.strftime("%Y-%m-%dT%H:%M:%SZ", now),
            "component": {**program, "type": "application"},
            "properties": [{"name": "target", "value": sys.argv[1]}],
        },
        "components": sorted(others, key=lambda component: component["bom-ref"]),
        "dependencies": sorted(dependencies, key=lambda item: item["ref"]),
    }
    bill["serialNumber"] = f"urn:uuid:{uuid.uuid5(uuid.NAMESPACE_URL, json.dumps(bill, sort_keys=True))}"
    json.dump(bill, sys.stdout, indent=1, sort_keys=True)
    print()


def _metadata(target: str) -> Any:
    words = [
        "metadata",
        "--locked",
        "--format-version=1",
        "--features=photoncard/study",
        f"--filter-platform={target}",
    ]
    said = subprocess.run([os.environ.get("CARGO", "cargo"), *words], cwd=ROOT, stdout=subprocess.PIPE)
    if said.returncode != 0:
        sys.exit(f"{sys.argv[0]}: cargo states no metadata")
    return json.loads(said.stdout)


def _linked(metadata: Any) -> dict[str, list[str]]:
    """The packages that the program contains, with those that each needs."""
    nodes = {node["id"]: node for node in metadata["resolve"]["nodes"]}
    waiting = [
        package["id"]
        for package in metadata["packages"]
        if package["name"] == PROGRAM and package["id"] in metadata["workspace_members"]
    ]
    linked: dict[str, list[str]] = {}
    while waiting:
        key = waiting.pop()
        if key not in linked:
            needed = nodes[key]["deps"]
            linked[key] = [
                of["pkg"] for of in needed if any(kind["kind"] is None for kind in of["dep_kinds"])
            ]
            waiting += linked[key]
    return linked


def _checksums() -> dict[tuple[str, str], str]:
    """SHA-256 of the packages of crates.io, by name and version."""
    found = {}
    for block in (ROOT / "Cargo.lock").read_text(encoding="utf-8").split("[[package]]"):
        fields = dict(line.split(" = ", 1) for line in block.splitlines() if " = " in line)
        if "checksum" in fields:
            name, version, checksum = (json.loads(fields[key]) for key in ("name", "version", "checksum"))
            found[name, version] = checksum
    return found


def _reference(package: Mapping[str, Any]) -> str:
    return f"pkg:cargo/{package['name']}@{package['version']}"


def _component(package: Mapping[str, Any], checksums: Mapping[tuple[str, str], str]) -> dict[str, Any]:
    component: dict[str, Any] = {
        "type": "library",
        "bom-ref": _reference(package),
        "name": package["name"],
        "version": package["version"],
    }
    if package["source"] == ORIGIN:
        component["purl"] = _reference(package)
    if package["license"]:
        component["licenses"] = [{"expression": package["license"].replace("/", " OR ")}]
    checksum = checksums.get((package["name"], package["version"]))
    if checksum:
        component["hashes"] = [{"alg": "SHA-256", "content": checksum}]
    return component


if __name__ == "__main__":
    main()
