#!/usr/bin/env python3
"""Lists the dependencies that artefacts contain: their licences with texts, and a bill of materials.

    .ci/licences.py [--text FILE] [--sbom FILE]

The list comes from `cargo metadata --locked`, without development dependencies. A dependency without a licence is an
error. The bill of materials is CycloneDX 1.5.
"""
import argparse
import json
import pathlib
import subprocess
import sys

NAMES = ("LICENSE", "LICENCE", "COPYING", "UNLICENSE", "NOTICE", "COPYRIGHT")


def dependencies():
    command = ["cargo", "metadata", "--locked", "--format-version", "1"]
    found = json.loads(subprocess.run(command, check=True, capture_output=True).stdout)
    packages = {package["id"]: package for package in found["packages"]}
    nodes = {node["id"]: node for node in found["resolve"]["nodes"]}
    tools = {"antumbra-testkit", "antumbra-digest"}
    own = [id for id in found["workspace_members"] if packages[id]["name"] not in tools]
    reached, edges, open_ids = set(), {}, list(own)
    while open_ids:
        id = open_ids.pop()
        if id in reached:
            continue
        reached.add(id)
        # Development and build dependencies are in no artefact.
        edges[id] = [dep["pkg"] for dep in nodes[id]["deps"] if any(kind["kind"] is None for kind in dep["dep_kinds"])]
        open_ids += edges[id]
    return packages, own, sorted(reached, key=lambda id: (packages[id]["name"], packages[id]["version"])), edges


def texts(package):
    folder = pathlib.Path(package["manifest_path"]).parent
    files = sorted(path for path in folder.iterdir() if path.is_file() and path.name.upper().startswith(NAMES))
    return [(path.name, path.read_text(errors="replace").strip()) for path in files]


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--text", type=pathlib.Path)
    parser.add_argument("--sbom", type=pathlib.Path)
    given = parser.parse_args()
    packages, own, ids, edges = dependencies()
    foreign = [packages[id] for id in ids if id not in own]
    without = [package["name"] for package in foreign if not package["license"] and not package["license_file"]]
    if without:
        sys.exit(f"no licence: {', '.join(without)}")

    if given.text:
        shared = {}
        lines = ["Licences of the software that is contained in antumbra.", ""]
        for package in foreign:
            lines.append(f"{package['name']} {package['version']}: {package['license'] or package['license_file']}")
            for name, text in texts(package):
                shared.setdefault(text, []).append(f"{package['name']} {package['version']} ({name})")
        for text, users in shared.items():
            lines += ["", "=" * 100, *users, "-" * 100, text]
        given.text.write_text("\n".join(lines) + "\n")
    if given.sbom:
        def component(id):
            package = packages[id]
            kind = "application" if package["name"] == "antumbra-cli" else "library"
            purl = f"pkg:cargo/{package['name']}@{package['version']}"
            entry = {"type": kind, "bom-ref": purl, "name": package["name"], "version": package["version"], "purl": purl}
            if package["license"]:
                # Older manifests write "/" for OR.
                entry["licenses"] = [{"expression": package["license"].replace("/", " OR ").replace("  ", " ")}]
            return entry

        components = [component(id) for id in ids]
        graph = [
            {"ref": component(id)["bom-ref"], "dependsOn": sorted({component(dep)["bom-ref"] for dep in edges[id]})}
            for id in ids
        ]
        version = packages[own[0]]["version"]
        bom = {
            "bomFormat": "CycloneDX",
            "specVersion": "1.5",
            "version": 1,
            "metadata": {"component": {"type": "application", "name": "antumbra", "version": version}},
            "components": components,
            "dependencies": graph,
        }
        given.sbom.write_text(json.dumps(bom, indent=1) + "\n")
    print(f"{len(foreign)} dependencies of {len(own)} crates")


if __name__ == "__main__":
    main()
