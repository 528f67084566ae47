"""Rays per CPU second of antumbra, trimesh, embreex and Open3D, all in one process, in turns.

    pip install trimesh embreex rtree open3d-cpu
    taskset -c 0 python bench/python/compare_python.py --json bench/record/CPU-DATE-python.json

A figure is rays / (user + system seconds of the process), which stands on a machine that others use as well. In each round every
engine is asked once. Ratios are medians over rounds of rays a CPU second relative to the rival of the same round.
"""

import argparse
import importlib.metadata
import json
import os
import platform
import time

for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "TBB_NUM_THREADS"):
    os.environ.setdefault(variable, "1")

import antumbra as am
import numpy as np
import scenes

parser = argparse.ArgumentParser()
parser.add_argument("--rays", type=int, default=1_000_000)
parser.add_argument("--rounds", type=int, default=5)
parser.add_argument("--threads", type=int, default=1)
parser.add_argument("--scenes", default="city,terrain,hills")
parser.add_argument("--kinds", default="sun,ao,camera")
parser.add_argument("--json")
arguments = parser.parse_args()


def engines(vertices, faces, threads):
    """(engine, call, kind of answer, function of origins and directions)."""
    scene = am.Scene(vertices, faces)
    yield "antumbra", "occluded", "any", lambda o, d: scene.occluded(o, d, threads=threads)
    yield "antumbra", "intersect", "first", lambda o, d: scene.intersect(o, d, threads=threads).triangle
    am.set_threads(threads)
    try:
        import trimesh
        from antumbra.trimesh import RayMeshIntersector

        mesh = trimesh.Trimesh(vertices, faces, process=False)
        ours = RayMeshIntersector(mesh)
        double = lambda call: lambda o, d: call(o.astype(float), d.astype(float))
        yield "antumbra.trimesh", "intersects_any", "any", double(ours.intersects_any)
        yield "antumbra.trimesh", "intersects_first", "first", double(ours.intersects_first)
        if threads == 1 and trimesh.ray.has_embree:
            theirs = trimesh.ray.ray_pyembree.RayMeshIntersector(mesh)
            yield "trimesh", "intersects_any", "any", double(theirs.intersects_any)
            yield "trimesh", "intersects_first", "first", double(theirs.intersects_first)
    except ImportError:
        print("no trimesh")
    try:
        from embreex.mesh_construction import TriangleMesh
        from embreex.rtcore_scene import EmbreeScene

        if threads == 1:
            embree = EmbreeScene()
            TriangleMesh(embree, vertices, faces)
            yield "embreex", "OCCLUDED", "any", lambda o, d: embree.run(o, d, query="OCCLUDED") == 0
            yield "embreex", "INTERSECT", "first", lambda o, d: embree.run(o, d, query="INTERSECT")
    except ImportError:
        print("no embreex")
    try:
        import open3d

        tensor = open3d.core.Tensor.from_numpy
        caster = open3d.t.geometry.RaycastingScene(nthreads=threads)
        caster.add_triangles(tensor(vertices), tensor(faces.astype(np.uint32)))
        row = lambda o, d: tensor(np.concatenate([o, d], 1))
        yield "open3d", "test_occlusions", "any", lambda o, d: caster.test_occlusions(row(o, d), nthreads=threads).numpy()
        yield "open3d", "cast_rays", "first", lambda o, d: caster.cast_rays(row(o, d), nthreads=threads)["primitive_ids"].numpy().view(np.int32)
    except (ImportError, OSError):
        print("no Open3D")


def measure(name, rows):
    vertices, faces = getattr(scenes, name)()
    calls = list(engines(vertices, faces, arguments.threads))
    for kind, batch in scenes.rays(name, vertices, faces, arguments.rays).items():
        if kind not in arguments.kinds.split(","):
            continue
        for order in ("random", "sorted") if kind != "camera" else ("sorted",):
            o, d = scenes.in_order(*batch) if order == "sorted" and kind != "camera" else batch
            seconds, answers = {call[:2]: [] for call in calls}, {}
            for _ in range(arguments.rounds):
                for engine, call, answer, ask in calls:
                    start = time.process_time()
                    answers[engine, call] = ask(o, d)
                    seconds[engine, call].append(time.process_time() - start)
            for engine, call, answer, _ in calls:
                mine = ("antumbra", "occluded" if answer == "any" else "intersect")
                found, expected = answers[engine, call], answers[mine]
                row = dict(
                    scene=name, triangles=len(faces), kind=kind, order=order, threads=arguments.threads, engine=engine,
                    call=call, answer=answer, hit_share=float(np.mean(answers["antumbra", "occluded"])),
                    mrays_per_cpu_second=[len(o) / second / 1e6 for second in seconds[engine, call]],
                    differences=int((np.asarray(found) != np.asarray(expected)).sum()),
                )
                rows.append(row)
                rate = np.median(row["mrays_per_cpu_second"])
                print(f"{name:8} {kind:7} {order:7} {engine:17} {call:17} {rate:6.2f} Mray/s, {row['differences']} differ", flush=True)


def speedups(rows):
    """Speedup of ours over each rival: median over rounds, for each scene, kind and order."""
    pairs = [
        ("antumbra", "occluded", "embreex", "OCCLUDED"), ("antumbra", "occluded", "trimesh", "intersects_any"),
        ("antumbra", "occluded", "open3d", "test_occlusions"), ("antumbra.trimesh", "intersects_any", "trimesh", "intersects_any"),
        ("antumbra.trimesh", "intersects_first", "trimesh", "intersects_first"),
        ("antumbra", "intersect", "embreex", "INTERSECT"), ("antumbra", "intersect", "open3d", "cast_rays"),
    ]
    by = {(r["scene"], r["kind"], r["order"], r["engine"], r["call"]): r["mrays_per_cpu_second"] for r in rows}
    for ours, call, rival, other in pairs:
        ratios = {
            key[:3]: float(np.median(np.divide(rates, by[*key[:3], rival, other])))
            for key, rates in by.items() if key[3:] == (ours, call) and (*key[:3], rival, other) in by
        }
        if ratios:
            mean = lambda keep: float(np.exp(np.mean([np.log(r) for k, r in ratios.items() if keep(k)] or [np.nan])))
            yield dict(
                ours=f"{ours} {call}", rival=f"{rival} {other}",
                sun_and_ao=mean(lambda k: k[1] != "camera"), camera=mean(lambda k: k[1] == "camera"),
                each={" ".join(k): r for k, r in ratios.items()},
            )


rows = []
for scene in arguments.scenes.split(","):
    measure(scene, rows)
summary = list(speedups(rows))
for line in summary:
    print(f"{line['ours']:35} / {line['rival']:27} sun and ao {line['sun_and_ao']:.2f}, camera {line['camera']:.2f}")
if arguments.json:
    versions = {}
    for package in ("antumbra", "numpy", "trimesh", "embreex", "open3d-cpu", "open3d"):
        try:
            versions[package] = importlib.metadata.version(package)
        except importlib.metadata.PackageNotFoundError:
            pass
    cpu = next((line.split(":")[1].strip() for line in open("/proc/cpuinfo") if "model name" in line), platform.processor())
    document = dict(
        schema="antumbra.python/1", cpu=cpu, python=platform.python_version(), versions=versions, rays=arguments.rays,
        rounds=arguments.rounds, threads=arguments.threads, speedups=summary, rows=rows,
    )
    with open(arguments.json, "w") as file:
        json.dump(document, file, indent=1)
