// What the types allow and what they refuse: compiled with `tsc --noEmit --strict`, never run.
import { load, type Antumbra, type Hits, type Mesh, type Rays, type Scene } from "antumbra";

const antumbra: Antumbra = await load();
await load(new URL("https://example.org/antumbra.wasm"));
await load(fetch("/antumbra.wasm"));
const mesh: Mesh = { positions: new Float64Array(9), indices: new Uint16Array(3) };
const rays: Rays = { origins: [0, 0, 0], directions: new Float32Array(30), far: new Float32Array(10) };
const scene: Scene = antumbra.build([mesh, { positions: [0, 0, 0, 1, 0, 0, 0, 1, 0] }], { training: rays, quality: "fast" });
const bytes: Uint8Array = scene.occluded({ from: [0, 0, 0], to: [1, 1, 1] });
const hits: Hits = scene.intersect(rays);
const numbers: [Float32Array, Int32Array, number] = [hits.t, hits.mesh, scene.report.dropped + bytes.length];
scene.free();

// @ts-expect-error: there is no such quality
antumbra.build(mesh, { quality: "high" });
// @ts-expect-error: rays have directions
scene.occluded({ origins: [0, 0, 0] });
// @ts-expect-error: no field of this name
scene.occluded({ origins: [0, 0, 0], directions: [0, 0, 1], tfar: 1 });
// @ts-expect-error: numbers, not texts
antumbra.build({ positions: ["0"] });
// @ts-expect-error: the origin is not written
scene.origin = [0, 0, 0];
