#!/usr/bin/env python3
"""The atlas of errors: maps of terrain by usual tools beside exact ones.

    ANTUMBRA=target/release/antumbra bench/atlas/atlas.py FOLDER RECORD.json [--new-zealand DSM.tif] [--only TERRAIN,...]
    bench/atlas/atlas.py --join RECORD.json PART.json...

Terrains are made in FOLDER. Tools that are not installed are left out, and the record says why.
Needs numpy and rasterio, and of the tools those that you have: gdal-bin, grass-core and saga of Debian,
and the packages that `docs/src/atlas.md` installs.
"""

import argparse
import importlib.metadata
import json
import os
import subprocess
import sys

for threads in ("OMP_NUM_THREADS", "NUMBA_NUM_THREADS", "RAYON_NUM_THREADS"):
    os.environ.setdefault(threads, "1")

import numpy as np

import exact
import terrains
import tools

AZIMUTHS, FINE = 16, 120
SUNS = ((112.5, 25.0), (247.5, 12.0))
PACKAGES = ("numpy", "numba", "xarray-spatial", "topocalc", "rvt-py", "umep", "solweig", "insolation")


def share(wrong):
    return float(np.mean(wrong))


def wrong_angles(found, right):
    """Figures of horizons: azimuths that are multiples of 45 degrees, and the others."""
    found = np.maximum(found, 0)
    figures = {"unanswered": share(~np.isfinite(found))}
    for name, planes in (("even", np.s_[0::2]), ("others", np.s_[1::2])):
        error = np.abs(found[planes] - right[planes])
        error = error[np.isfinite(error)]
        figures[name] = {"over 0.1": share(error > 0.1), "over 1": share(error > 1), "mean": float(error.mean()), "most": float(error.max())}
    return figures


class Record:
    """Rows of the record, written after each, so that an interruption loses one."""

    def __init__(self, path, terrain):
        self.path, self.terrain = path, terrain
        self.rows = []

    def add(self, question, tool, figures, seconds, command):
        self.rows.append({"question": question, "terrain": self.terrain, "tool": tool, **figures, "seconds": round(seconds, 3), "command": command})
        print(json.dumps(self.rows[-1]), flush=True)

    def ask(self, question, tool, function, *args):
        """The answer of a tool as (array, seconds, command), or None if it has none; then a row says why."""
        try:
            found, seconds, command = function(*args)
            return np.asarray(found), seconds, command
        except (ImportError, FileNotFoundError, RuntimeError, ValueError) as error:
            self.add(question, tool, {"failed": " ".join(str(error).split())[-300:]}, 0, "")


def horizons(t, record):
    found, seconds, command = tools.ours_horizons(t, AZIMUTHS)
    right = np.maximum(np.asarray(found), 0)
    random = np.random.default_rng(5)
    worst, z = 0, t.z.astype(float)
    for _ in range(400):
        row, column, k = (int(random.integers(n)) for n in (*t.z.shape, AZIMUTHS))
        worst = max(worst, abs(exact.horizon(z, t.cell, row, column, k * 360 / AZIMUTHS) - float(right[k, row, column])))
    record.add("horizon", "antumbra", {"beyond brute force": worst, "cells": int(t.z.size)}, seconds, command)
    for tool, function in tools.HORIZONS.items():
        answer = record.ask("horizon", tool, function, t, AZIMUTHS)
        if answer:
            record.add("horizon", tool, wrong_angles(answer[0], right), *answer[1:])


def eyes(t):
    rows, columns = t.z.shape
    return [(rows * a // 4, columns * b // 4) for a in (1, 3) for b in (1, 3)]


def sights(t, record):
    right = [tools.ours_seen(t, *eye) for eye in eyes(t)]
    random, differ, z = np.random.default_rng(6), 0, t.z.astype(float)
    for eye, (seen, *_) in zip(eyes(t), right):
        for _ in range(250):
            row, column = (int(random.integers(n)) for n in t.z.shape)
            margin = exact.sight(z, *eye, tools.EYE, row, column) if (row, column) != eye else 1
            differ += bool(seen[row, column]) != (margin >= 0) and abs(margin) > 1e-9
    figures = {"differ from brute force, of 1000": differ, "seen": share([seen for seen, *_ in right])}
    record.add("viewshed", "antumbra", figures, sum(row[1] for row in right), right[0][2])
    for tool, function in tools.SEEN.items():
        answers = [record.ask("viewshed", tool, function, t, *eye) for eye in eyes(t)]
        if all(answers):
            found, truth = np.array([row[0] for row in answers]), np.array([row[0] for row in right])
            figures = {"wrong": share(found != truth), "missed": share(~found & truth), "invented": share(found & ~truth)}
            record.add("viewshed", tool, figures, sum(row[1] for row in answers), answers[0][2])


def shadows(t, record):
    right = [tools.ours_lit(t, *sun) for sun in SUNS]
    record.add("shadow", "antumbra", {"lit": [share(row[0]) for row in right]}, sum(row[1] for row in right), right[0][2])
    for tool, function in tools.LIT.items():
        answers = [record.ask("shadow", tool, function, t, *sun) for sun in SUNS]
        if all(answers):
            wrong = [share(row[0] != truth[0]) for row, truth in zip(answers, right)]
            of_shadow = [float((row[0] != truth[0]).sum() / (~truth[0]).sum()) for row, truth in zip(answers, right)]
            record.add("shadow", tool, {"wrong": wrong, "wrong per shadow": of_shadow}, sum(row[1] for row in answers), answers[0][2])


def hours(t, record):
    right, _, _ = tools.hours_by(tools.ours_lit)(t)
    _, seconds, command = tools.ours_hours(t)
    record.add("hours", "antumbra", {"hours": float(right.mean())}, seconds, command)
    for tool, function in tools.HOURS.items():
        answer = record.ask("hours", tool, function, t)
        if answer:
            error = np.abs(answer[0] - right)
            record.add("hours", tool, {"wrong": share(error > 0.25), "mean": float(error.mean()), "most": float(error.max())}, *answer[1:])


def skies(t, record):
    """Parts of the sky by three weights from many azimuths, and what half of these azimuths would change."""
    planes, seconds, command = tools.ours_horizons(t, FINE)
    sums = {kind: np.zeros((2, *t.z.shape)) for kind in ("angle", "cosine", "arc")}
    for k, plane in enumerate(planes):
        horizon = np.radians(np.maximum(plane, 0).astype(float))
        sine = np.sin(horizon)
        sums["arc"][k % 2] += 1 - horizon / (np.pi / 2)
        sums["angle"][k % 2] += 1 - sine
        sums["cosine"][k % 2] += 1 - sine**2
    right = {kind: total.sum(0) / FINE for kind, total in sums.items()}
    half = {kind: np.abs(total[0] * 2 / FINE - right[kind]) for kind, total in sums.items()}
    figures = {"half of the azimuths, mean": float(half["cosine"].mean()), "half of the azimuths, most": float(half["cosine"].max())}
    record.add("sky", "antumbra", figures | {"sky": float(right["cosine"].mean())}, seconds, command)
    for tool, (function, kind) in tools.SKY.items():
        answer = record.ask("sky", tool, function, t)
        if answer:
            error = np.abs(answer[0] - right[kind])
            record.add("sky", tool, {"kind": kind, "mean": float(np.nanmean(error)), "most": float(np.nanmax(error))}, *answer[1:])


def versions():
    """What made the record: the CPU, the program and the tools."""
    found = {"antumbra": first_lines(tools.ANTUMBRA, "--version")}
    with open("/proc/cpuinfo") as file:
        cpu = {key.strip(): value.strip() for key, _, value in (line.partition(":") for line in file)}
    found["cpu"] = f"{cpu.get('model name')}, family {cpu.get('cpu family')}, model {cpu.get('model')}"
    for name, command in {"GDAL": ("gdalinfo", "--version"), "GRASS": ("grass", "--version"), "SAGA": ("saga_cmd", "--version")}.items():
        found[name] = first_lines(*command)
    for package in PACKAGES:
        try:
            found[package] = importlib.metadata.version(package)
        except importlib.metadata.PackageNotFoundError:
            found[package] = None
    return found


def first_lines(*command):
    try:
        said = subprocess.run(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True).stdout
    except FileNotFoundError:
        return None
    return "; ".join(line.strip() for line in said.split("\n")[:2] if line.strip())


def save(path, made_by, rows):
    with open(path, "w") as file:
        file.write(json.dumps(made_by)[:-1] + ', "rows": [\n' + ",\n".join(json.dumps(row) for row in rows) + "\n]}\n")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", nargs="?", help="for terrains and the files of tools")
    parser.add_argument("record", nargs="*", help="the record; with --join its parts")
    parser.add_argument("--new-zealand", help="GeoTIFF of the 1 m surface model, tiles CC11 of 2021")
    parser.add_argument("--only", help="terrains separated by commas")
    parser.add_argument("--tools", default="", help="only tools whose name has this, and the program")
    parser.add_argument("--join", metavar="RECORD", help="joins parts of a record")
    args = parser.parse_args()
    if args.join:
        parts = [json.load(open(part)) for part in [args.folder, *args.record]]
        rows = {(row["question"], row["terrain"], row["tool"]): row for part in reversed(parts) for row in reversed(part.pop("rows"))}
        return save(args.join, parts[0], list(reversed(rows.values())))
    for chosen in (tools.HORIZONS, tools.SEEN, tools.LIT, tools.HOURS, tools.SKY):
        for tool in [tool for tool in chosen if args.tools not in tool]:
            del chosen[tool]
    paths = terrains.make(args.folder, args.new_zealand)
    warm = tools.Terrain("warm", paths["tower"])
    warm.z = warm.z[:64, :64]
    for question, tool, *known in ((tools.LIT, "insolation", *SUNS[0]), (tools.SEEN, "xarray-spatial", 10, 10)):
        if tool in question:
            Record("", "warm").ask("compile", tool, question[tool], warm, *known)
    rows, made_by = [], versions()
    for name in args.only.split(",") if args.only else paths:
        record = Record(args.record[0], name)
        for question in (horizons, sights, shadows, hours, skies):
            question(tools.Terrain(name, paths[name]), record)
            save(args.record[0], made_by, rows + record.rows)
        rows += record.rows
    return None


if __name__ == "__main__":
    sys.exit(main())
