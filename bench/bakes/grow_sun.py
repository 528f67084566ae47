"""How the cost of `antumbra sun` grows: CPU seconds for more and more sensors on facades, and more and more suns of a year.

    python bench/bakes/grow_sun.py --program target/release/antumbra --record bench/record/NAME.csv SCENE[=LENGTH]...
    python bench/bakes/grow_sun.py --table bench/record/NAME.csv

Each scene is a file or builtin:NAME, perhaps with the length of its unit in metres. Sensors are on the facades, in squares of a side
that gives about as many as wanted. Suns are those of steps of equal length through a year, above the horizon; 145 patches of the sky
are seen beside them. A run is one process on one thread, from the file to a .csv with a line for each sensor. `fixed` is the CPU time
of the same command with a single sensor and a single sun: reading and building.

--table prints the table of the book from a record.
"""

import argparse
import csv
import json
import os
import resource
import subprocess
import tempfile
from pathlib import Path

SENSORS = (1_000, 10_000, 100_000, 1_000_000)
SUNS = (100, 1_000, 4_446, 35_000)
# Pairs of both beyond which nothing is measured.
MOST = 4_500_000_000
PLACE = ["--lat", "48.2", "--lon", "16.4", "--timezone", "1"]


def cpu():
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def run(program, scene, sensors, times, folder):
    out, figures = folder / "sun.csv", folder / "sun.json"
    before = cpu()
    command = [program, "sun", scene, *sensors, *PLACE, *times, "--threads", "1", "-q", "-o", out, "--json", figures]
    subprocess.run([str(word) for word in command], check=True)
    return cpu() - before, json.loads(figures.read_text())


def facades(side):
    return ["--surfaces", f"{side:.6g}", "--on", "facade", "--offset", "0.01"]


def measure(program, scene, counts, writer, file, folder):
    name = Path(scene).stem.removeprefix("builtin:")
    single = folder / "single.csv"
    # A side that gives some sensors is the measure of all others.
    _, figures = run(program, scene, facades(4), ["--at", "2025-06-21T12:00"], folder)
    area = 16 * figures["sensors"]
    point = (folder / "sun.csv").read_text().split("\n")[1].split(",")[1:7]
    single.write_text("x,y,z,nx,ny,nz\n" + ",".join(point) + "\n")
    fixed, _ = run(program, scene, ["--sensors", single], ["--at", "2025-06-21T12:00"], folder)
    for suns in counts[1]:
        # Half of a year is night.
        step = 60 * 4_446 / suns
        for sensors in counts[0]:
            if suns * sensors > MOST:
                continue
            side = (area / sensors) ** 0.5
            seconds, figures = run(program, scene, facades(side), ["--year", "2025", "--step", f"{step:.6g}"], folder)
            # Less than a few tenths of a second are lost in the noise.
            own = seconds - fixed
            rate = round(figures["rays"] / own / 1e6, 2) if own > 0.3 else "-"
            row = [name, figures["triangles"], figures["sensors"], figures["suns"], figures["rays"]]
            writer.writerow([*row, round(fixed, 2), round(seconds, 2), rate])
            file.flush()
            print(*row, f"{seconds:.1f} s, {rate} Mray/s", flush=True)


def numbers(text):
    return [int(number) for number in text.split(",")]


def table(record):
    rows = [row for row in csv.DictReader(line for line in open(record) if not line.startswith("#"))]
    print("| scene | sensors | suns | million rays | CPU s | Mray/s |\n|---|---|---|---|---|---|")
    for row in rows:
        sensors, suns = (f"{int(row[key]):,}".replace(",", " ") for key in ("sensors", "suns"))
        rays = float(row["rays"]) / 1e6
        rays = f"{rays:.2f}" if rays < 10 else f"{rays:.0f}"
        print(f"| {row['scene']} | {sensors} | {suns} | {rays} | {row['cpu_seconds']} | {row['mrays_per_s']} |")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--program")
    parser.add_argument("--record")
    parser.add_argument("--table")
    parser.add_argument("--sensors", type=numbers, default=SENSORS)
    parser.add_argument("--suns", type=numbers, default=SUNS)
    parser.add_argument("scenes", nargs="*")
    args = parser.parse_args()
    if args.table:
        return table(args.table)
    text = subprocess.run([args.program, "--version"], check=True, capture_output=True, text=True).stdout
    version = ", ".join(text.split("\n")[:2])
    with open(args.record, "w") as file, tempfile.TemporaryDirectory() as folder:
        file.write(f"# bench/bakes/grow_sun.py; {version}; one thread; {os.uname().machine}\n")
        file.write("# rays: those above the plane of each sensor; mrays_per_s: without the fixed seconds of reading and building\n")
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow("scene triangles sensors suns rays fixed_seconds cpu_seconds mrays_per_s".split())
        for scene in args.scenes:
            measure(args.program, scene, (args.sensors, args.suns), writer, file, Path(folder))


if __name__ == "__main__":
    main()
