"""Renders a glTF model by `antumbra render` and by three.js in a browser, and prints how the pictures differ:
three.py CHROMIUM ANTUMBRA THREE FOLDER MODEL.glb

THREE is the folder of the npm package three. Both get the camera and the light of the file, linear colours, one bounce.
Pictures of both, side by side, are left in FOLDER. MODEL has a grid of 6 x 4 balls, see antumbra-testkit.
"""

import base64
import http.server
import pathlib
import subprocess
import sys
import threading

import numpy as np
import OpenEXR
from PIL import Image
from playwright.sync_api import sync_playwright

BROWSER, PROGRAM, THREE, FOLDER, MODEL = sys.argv[1], sys.argv[2], *map(pathlib.Path, sys.argv[3:6])
WIDTH, HEIGHT = 480, 320
# Samples of three.js per pixel and side: its pictures are made so much larger, and then averaged.
FINE = 8
NAMES = ["metal 0", "metal 1/2", "metal 1", "textures"]

PAGE = """<!doctype html><script type="importmap">
{"imports": {"three": "/three/build/three.module.js", "three/addons/": "/three/examples/jsm/"}}</script>
<script type="module">
import * as THREE from "three";
import { GLTFLoader } from "three/addons/loaders/GLTFLoader.js";
window.picture = async (width, height, single) => {
  // Without the light that facets reflect several times, as the specification writes the model.
  const chunk = "lights_physical_pars_fragment", code = THREE.ShaderChunk[chunk];
  if (single) THREE.ShaderChunk[chunk] = code.replaceAll("* material.multiScatteringCompensation", "");
  if (single && THREE.ShaderChunk[chunk] === code) throw new Error("nothing to leave out in this version");
  const renderer = new THREE.WebGLRenderer({ antialias: false });
  const { scene, cameras } = await new GLTFLoader().loadAsync("/model.glb");
  scene.updateMatrixWorld(true);
  const target = new THREE.WebGLRenderTarget(width, height, { type: THREE.FloatType });
  renderer.setRenderTarget(target);
  renderer.render(scene, cameras[0]);
  const values = new Float32Array(4 * width * height);
  renderer.readRenderTargetPixels(target, 0, 0, width, height, values);
  const bytes = new Uint8Array(values.buffer);
  let text = "";
  for (let at = 0; at < bytes.length; at += 32768) text += String.fromCharCode(...bytes.subarray(at, at + 32768));
  return [THREE.REVISION, btoa(text)];
};
window.ready = true;
</script>"""


class Handler(http.server.BaseHTTPRequestHandler):
    def do_GET(self):
        kind, body = "text/html", PAGE.encode()
        if self.path == "/model.glb":
            kind, body = "model/gltf-binary", MODEL.read_bytes()
        elif self.path.startswith("/three/"):
            kind, body = "text/javascript", (THREE / self.path[len("/three/"):]).read_bytes()
        self.send_response(200)
        self.send_header("Content-Type", kind)
        self.end_headers()
        self.wfile.write(body)

    def log_message(self, *_):
        pass


def by_three(single):
    server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), Handler)
    threading.Thread(target=server.serve_forever, daemon=True).start()
    arguments = ["--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"]
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=BROWSER, args=arguments)
        page = browser.new_page()
        page.on("pageerror", lambda error: sys.exit(f"three.js: {error}"))
        page.goto(f"http://127.0.0.1:{server.server_port}/")
        page.wait_for_function("window.ready", timeout=60_000)
        revision, text = page.evaluate(f"window.picture({FINE * WIDTH}, {FINE * HEIGHT}, {str(single).lower()})")
        browser.close()
    server.shutdown()
    values = np.frombuffer(base64.b64decode(text), np.float32).reshape(FINE * HEIGHT, FINE * WIDTH, 4)
    fine = values[::-1, :, :3].astype(np.float64)
    return revision, fine.reshape(HEIGHT, FINE, WIDTH, FINE, 3).mean((1, 3))


def by_antumbra():
    picture = FOLDER / "antumbra.exr"
    command = [PROGRAM, "render", MODEL, "-o", picture, "--resolution", f"{WIDTH}x{HEIGHT}", "--spp", "256"]
    command += ["--max-depth", "1", "--environment", "none", "--filter", "box", "-q", "--restart"]
    subprocess.run(command, check=True)
    return np.asarray(OpenEXR.File(str(picture)).channels()["RGB"].pixels, np.float64)


def encoded(picture):
    x = np.clip(picture, 0, 1)
    return (255 * np.where(x <= 0.0031308, 12.92 * x, 1.055 * x ** (1 / 2.4) - 0.055) + 0.5).astype(np.uint8)


def main():
    FOLDER.mkdir(parents=True, exist_ok=True)
    ours = by_antumbra()
    revision, theirs = by_three(False)
    _, single = by_three(True)
    print(f"three.js r{revision}, {WIDTH} x {HEIGHT}; differences of antumbra to three.js: of the means, and mean absolute ones")
    print("| | antumbra | three.js | without light between facets | difference | absolute | to the one without | absolute |")
    print("|---|---|---|---|---|---|---|---|")
    rows = [(name, k, slice(None)) for k, name in enumerate(NAMES)]
    column = lambda c: slice(WIDTH * c // 6, WIDTH * (c + 1) // 6)
    rows += [(f"{NAMES[k]}, ball {c + 1}", k, column(c)) for k in range(4) for c in range(6)]
    for name, row, x in rows:
        y = slice(HEIGHT * row // 4, HEIGHT * (row + 1) // 4)
        a, b, c = ours[y, x], theirs[y, x], single[y, x]
        percent = lambda other: (
            f"{100 * (a.mean() / other.mean() - 1):+.1f} % | {100 * np.abs(a - other).mean() / other.mean():.1f} %"
        )
        print(f"| {name} | {a.mean():.4f} | {b.mean():.4f} | {c.mean():.4f} | {percent(b)} | {percent(c)} |")
    Image.fromarray(encoded(np.vstack([theirs, ours]))).save(FOLDER / "three-above-antumbra.png")


main()
