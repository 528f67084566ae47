// The package in Node: node --test node.test.mjs, with the folder of the package in ANTUMBRA_NPM.
import assert from "node:assert/strict";
import { readFile } from "node:fs/promises";
import { test } from "node:test";
import { pathToFileURL } from "node:url";
import { digest, soup } from "./scene.mjs";

const folder = pathToFileURL(`${process.env.ANTUMBRA_NPM}/`);
const { load } = await import(new URL("antumbra.js", folder));
const antumbra = await load();
const expected = (await readFile(new URL("expected.txt", import.meta.url), "utf8")).trim().split(" ");
const square = { positions: [0, 0, 1, 4, 0, 1, 4, 4, 1, 0, 4, 1], indices: [0, 1, 2, 0, 2, 3] };

/** Distance of the nearest triangle in double precision (Möller and Trumbore 1997), and how close the ray passes to an edge. */
function brute(positions, org, dir) {
    const at = (item) => [positions[item], positions[item + 1], positions[item + 2]];
    const minus = (a, b) => a.map((x, axis) => x - b[axis]);
    const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
    const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
    let [nearest, doubt] = [Infinity, Infinity];
    for (let first = 0; first < positions.length; first += 9) {
        const a = at(first);
        const [e, f, s] = [minus(at(first + 3), a), minus(at(first + 6), a), minus(org, a)];
        const p = cross(dir, f);
        const q = cross(s, e);
        const scale = 1 / dot(e, p);
        const [u, v, t] = [dot(s, p) * scale, dot(dir, q) * scale, dot(f, q) * scale];
        const inside = Math.min(u, v, 1 - u - v, t);
        doubt = Math.min(doubt, Math.abs(inside));
        if (inside > 0) nearest = Math.min(nearest, t);
    }
    return [nearest, doubt];
}

test("answers are the bits of the Rust library", () => {
    const { positions, origins, directions } = soup(2000, 5000);
    for (const options of [{}, { quality: "fast" }, { training: { origins, directions } }]) {
        const scene = antumbra.build({ positions }, options);
        const { t, uv, triangle, mesh } = scene.intersect({ origins, directions });
        assert.equal(digest(scene.occluded({ origins, directions })), expected[0]);
        assert.equal(digest(t, uv, triangle, mesh), expected[1]);
        scene.relearn({ origins, directions });
        assert.equal(digest(scene.occluded({ origins, directions })), expected[0]);
        scene.free();
    }
});

test("answers are those of a loop over all triangles", () => {
    const { positions, origins, directions } = soup(300, 400);
    const { t } = antumbra.build({ positions }).intersect({ origins, directions });
    let certain = 0;
    for (let ray = 0; ray < 400; ++ray) {
        const three = (list) => Array.from(list.subarray(3 * ray, 3 * ray + 3));
        const [nearest, doubt] = brute(positions, three(origins), three(directions));
        if (doubt < 1e-4) continue;
        ++certain;
        assert.equal(t[ray] === Infinity, nearest === Infinity);
        if (nearest < Infinity) assert.ok(Math.abs(t[ray] - nearest) < 1e-4 * nearest);
    }
    assert.ok(certain > 200, `${certain} rays pass no edge`);
});

test("many rays are answered in pieces as in one", () => {
    const { positions, origins, directions } = soup(50, 300_000);
    const scene = antumbra.build({ positions });
    const all = scene.intersect({ origins, directions });
    const occluded = scene.occluded({ origins, directions });
    for (const ray of [0, 131_071, 131_072, 262_144, 299_999]) {
        const one = [origins, directions].map((list) => list.slice(3 * ray, 3 * ray + 3));
        const { t, uv, triangle } = scene.intersect({ origins: one[0], directions: one[1] });
        assert.deepEqual([all.t[ray], all.uv[2 * ray], all.triangle[ray]], [t[0], uv[0], triangle[0]]);
        assert.equal(occluded[ray], Number(t[0] < Infinity));
    }
});

test("one origin, direction or end serves all rays", () => {
    const scene = antumbra.build(square);
    const up = { origins: [1, 1, 0, 5, 1, 0], directions: [0, 0, 1] };
    assert.deepEqual([...scene.occluded(up)], [1, 0]);
    assert.deepEqual([...scene.occluded({ origins: [1, 1, 0], directions: [0, 0, 1, 0, 0, -1] })], [1, 0]);
    assert.deepEqual([...scene.occluded({ from: [1, 1, 0], to: [1, 1, 2, 1, 1, 0.5, 1, 1, 1] })], [1, 0, 0]);
    assert.deepEqual([...scene.occluded({ ...up, near: [0, 0] })], [1, 0]);
});

test("intervals are open, and bad rays hit nothing", () => {
    const scene = antumbra.build(square);
    const ends = { origins: [1, 1, 0], directions: [0, 0, 2] };
    assert.deepEqual([...scene.occluded({ ...ends, far: 0.5 }), ...scene.occluded({ ...ends, far: 0.5000001 })], [0, 1]);
    assert.deepEqual([...scene.occluded({ ...ends, near: 0.5 }), ...scene.occluded({ ...ends, near: 0.4999999 })], [0, 1]);
    const bad = { origins: [NaN, 1, 0, 1, 1, 0], directions: [0, 0, 1, 0, 0, 0] };
    const { t, triangle, mesh, uv } = scene.intersect(bad);
    assert.deepEqual([...t, ...triangle, ...mesh, ...uv], [Infinity, Infinity, -1, -1, -1, -1, 0, 0, 0, 0]);
});

test("meshes have numbers, and empty scenes are fine", () => {
    const low = { positions: square.positions.map((x, at) => (at % 3 === 2 ? 0.5 : x)), indices: Uint16Array.from(square.indices) };
    const { mesh, t } = antumbra.build([square, low]).intersect({ origins: [1, 2, 0], directions: [0, 0, 1] });
    assert.deepEqual([...mesh, ...t], [1, 0.5]);
    for (const nothing of [[], { positions: [] }]) {
        const scene = antumbra.build(nothing);
        assert.deepEqual([...scene.occluded({ origins: [0, 0, 0], directions: [1, 0, 0] })], [0]);
        assert.equal(scene.occluded({ origins: [], directions: [] }).length, 0);
    }
});

test("coordinates of maps lose nothing", () => {
    const far = [5_000_000, 3_000_000, 400];
    const moved = (list) => list.map((x, at) => x + far[at % 3]);
    const small = { positions: square.positions.map((x) => x / 100), indices: square.indices };
    const scene = antumbra.build({ ...small, positions: Float64Array.from(moved(small.positions)) });
    const rays = { origins: moved([0.039, 0.01, 0, 0.041, 0.01, 0]), directions: [0, 0, 1] };
    assert.deepEqual([...scene.occluded(rays)], [1, 0]);
    assert.ok(scene.origin[0] > 4_999_999);
    assert.deepEqual(antumbra.build(small).origin, [0, 0, 0]);
    assert.deepEqual(antumbra.build(small, { origin: [1, 2, 3] }).origin, [1, 2, 3]);
});

test("mistakes say what was found and what is wanted", () => {
    const scene = antumbra.build(square);
    const ray = { origins: [0, 0, 0], directions: [0, 0, 1] };
    const cases = [
        [() => antumbra.build({ positions: [0, 0] }), RangeError, /mesh.positions: found 2 numbers, wanted 3/],
        [() => antumbra.build({ positions: [0, 0, 0, 1, 1, 1] }), RangeError, /no indices, wanted 9/],
        [() => antumbra.build({ ...square, indices: [0, 1, 4] }), RangeError, /vertex 4/],
        [() => antumbra.build({ ...square, indices: [0, 1, -1] }), RangeError, /item 2 is -1/],
        [() => antumbra.build({ ...square, indices: [0, 1, 0.5] }), RangeError, /item 2 is 0.5/],
        [() => antumbra.build([square, { ...square, indices: [9, 0, 0] }]), RangeError, /geometry 1|geometry.*1/],
        [() => antumbra.build({ ...square, colour: 1 }), TypeError, /there is no colour/],
        [() => antumbra.build(square, { quality: "high" }), RangeError, /"high".*"default" or "fast"/],
        [() => antumbra.build(square, { origin: [0, NaN, 0] }), RangeError, /three finite numbers/],
        [() => antumbra.build("square"), TypeError, /wanted an object/],
        [() => scene.occluded({ ...ray, origins: ["0", 0, 0] }), TypeError, /item 0 is "0"/],
        [() => scene.occluded({ ...ray, origins: [0, 0] }), RangeError, /rays.origins: found 2/],
        [() => scene.occluded({ origins: new Float32Array(6), directions: new Float32Array(9) }), RangeError, /found 2 origins and 3/],
        [() => scene.occluded({ ...ray, far: [1, 2] }), RangeError, /rays.far: found 2 numbers/],
        [() => scene.occluded({ ...ray, tfar: 1 }), TypeError, /there is no tfar/],
        [() => scene.occluded({ from: [0, 0, 0] }), TypeError, /rays.to: found undefined/],
        [() => scene.occluded(), TypeError, /wanted an object/],
    ];
    for (const [call, kind, text] of cases) {
        assert.throws(call, (error) => error instanceof kind && text.test(error.message) || assert.fail(`${call}: ${error}`));
    }
    scene.free();
    scene.free();
    assert.throws(() => scene.occluded(ray), /freed/);
    // A mistake leaves nothing behind for the next scene.
    assert.equal(antumbra.build(square).report.triangles, 2);
});

test("a module that has failed says so, and its scenes are freed without errors", async () => {
    const module = await WebAssembly.compile(await readFile(new URL("antumbra.wasm", folder)));
    const { instantiate } = WebAssembly;
    const fail = () => { throw new WebAssembly.RuntimeError("unreachable"); };
    WebAssembly.instantiate = async (...source) => {
        const { exports } = await instantiate(...source);
        return { exports: { ...exports, occluded: fail, free_scene: fail } };
    };
    const failing = await load(module).finally(() => { WebAssembly.instantiate = instantiate; });
    const scene = failing.build(square);
    const ray = { origins: [1, 1, 0], directions: [0, 0, 1] };
    assert.throws(() => scene.occluded(ray), /full; load the module again/);
    assert.throws(() => scene.intersect(ray), /full; load the module again/);
    assert.throws(() => failing.build(square), /full; load the module again/);
    scene.free();
});

test("triangles that cannot be hit are counted", () => {
    const { report } = antumbra.build({ positions: [...square.positions, NaN, 0, 0], indices: [0, 1, 2, 0, 0, 2, 0, 1, 4] });
    assert.deepEqual([report.triangles, report.dropped], [1, 2]);
    assert.ok(report.bytes > 0);
});

test("the module is found by bytes, response and module", async () => {
    const bytes = await readFile(new URL("antumbra.wasm", folder));
    for (const source of [bytes, bytes.buffer.slice(bytes.byteOffset, bytes.byteOffset + bytes.length),
        new Response(bytes), WebAssembly.compile(bytes), new URL("antumbra.wasm", folder)]) {
        const other = await load(source);
        assert.equal(other.build(square).report.triangles, 2);
    }
    await assert.rejects(load(7), /source: wanted an address/);
    await assert.rejects(load(new Response("", { status: 404 })), /answered 404/);
});
