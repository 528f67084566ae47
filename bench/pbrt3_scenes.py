"""Renders scenes by pbrt-v3 and by Antumbra with the same samples: what the scripts pbrt3-* share."""

import pathlib
import re
import resource
import subprocess

import numpy
import OpenEXR

HERE = pathlib.Path(__file__).resolve().parent
VALUES = r'(?:\s+|#[^\n]*\n|"[^"]*"|\[[^\]]*\]|[-+.\d][-+.\deE]*)*'


def programs(parser):
    """Arguments of both programs, and of scenes that are not ours."""
    parser.add_argument("--antumbra", default="target/release/antumbra", type=pathlib.Path, help="the program")
    parser.add_argument("--pbrt", default=HERE / "pbrt3/build/pbrt", type=pathlib.Path, help="pbrt-v3 of bench/get-pbrt3")
    parser.add_argument("--collection", type=pathlib.Path, help="a copy of pbrt-v3-scenes, for files that are not ours")


def rewrite(text, width, spp, seed, sampler="random"):
    """The scene with our sampler, filter, film and integrator. The shape of the picture is kept."""
    film = re.search(rf"(?m)^[ \t]*Film\b{VALUES}", text)
    size = {"x": 640, "y": 480}
    for axis in size:
        found = film and re.search(rf'"integer {axis}resolution"\s*\[?\s*(\d+)', film[0])
        size[axis] = int(found[1]) if found else size[axis]
    before, world = re.split(r"(?m)^[ \t]*WorldBegin\b", text, maxsplit=1)
    before = re.sub(rf"(?m)^[ \t]*(?:Sampler|PixelFilter|Film)\b{VALUES}", "\n", before)
    before = re.sub(rf'(?m)^[ \t]*Integrator\s+"(?:bdpt|mlt)"({VALUES})', r'\nIntegrator "volpath"\1', before)
    height = round(width * size["y"] / size["x"])
    film = f'Film "image" "integer xresolution" {width} "integer yresolution" {height}\nPixelFilter "box"\n'
    seeds = f' "integer seed" {seed}' if seed is not None else ""
    return f'{film}Sampler "{sampler}" "integer pixelsamples" {spp}{seeds}\n{before}\nWorldBegin{world}'


def linked(scene, args, folder, replace=()):
    """A folder with all that is beside the scene, where a rewritten scene finds its files.

    Every pair of `replace` is a text of the scene or of what it includes, and the text in its place.
    """
    collection = args.collection.resolve().iterdir() if args.collection else []
    for beside in [*scene.resolve().parent.iterdir(), *collection]:
        link = folder / beside.name
        if link.exists():
            continue
        text = beside.read_text() if beside.suffix == ".pbrt" and replace else ""
        if any(old in text for old, _ in replace):
            for pair in replace:
                text = text.replace(*pair)
            link.write_text(text)
        else:
            link.symlink_to(beside)
    return folder


def timed(command):
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    done = subprocess.run([str(part) for part in command], capture_output=True, text=True)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    if done.returncode:
        raise RuntimeError(f"{command[0]}: {done.stderr.strip() or done.stdout.strip()}")
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def read_pfm(path):
    with open(path, "rb") as file:
        kind, size, scale = file.readline(), file.readline().split(), float(file.readline())
        if kind.strip() != b"PF" or scale >= 0:
            raise RuntimeError(f"{path}: no PFM of three channels in little endian")
        width, height = map(int, size)
        return numpy.fromfile(file, "<f4").reshape(height, width, 3)[::-1].astype(float)


def read_exr(path):
    channels = OpenEXR.File(str(path)).channels()
    return next(channels[name].pixels for name in ("RGB", "RGBA") if name in channels)[..., :3].astype(float)


def by_pbrt(args, scene, folder, seed, sampler="random"):
    rewritten, picture = folder / "pbrt.rewritten.pbrt", folder / "pbrt.pfm"
    rewritten.write_text(rewrite((folder / scene.name).read_text(), args.width, args.spp, seed, sampler))
    cpu = timed([args.pbrt, "--quiet", "--nthreads=1", f"--outfile={picture}", rewritten])
    return read_pfm(picture), cpu


def by_antumbra(args, scene, folder, seed, sampler="random", flags=()):
    rewritten, picture = folder / "antumbra.rewritten.pbrt", folder / "antumbra.exr"
    rewritten.write_text(rewrite((folder / scene.name).read_text(), args.width, args.spp, None, sampler))
    command = [args.antumbra, "render", rewritten, "-o", picture, "-q", "--threads", "1", "--seed", str(seed)]
    cpu = timed([*command, *flags])
    return read_exr(picture), cpu
