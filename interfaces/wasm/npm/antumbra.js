// Antumbra in JavaScript: scenes of triangles, and what many rays hit. The types, with all explanations, are in antumbra.d.ts.

// Rays that are in the memory of the module at a time.
const PIECE = 1 << 17;
const FAILED = 0xffffffff;
const FULL = "the memory of the module, at most 4 GiB, is full";
// Coordinates this many times as large as the scene is long are moved before they are rounded.
const FAR = 2;

/** Compiles the module. `source` says where it is, if it is not beside this file. */
export async function load(source = new URL("./antumbra.wasm", import.meta.url)) {
    const { instance } = await instantiate(await source);
    instance.exports.begin();
    return new Antumbra(instance.exports);
}

async function instantiate(source) {
    if (source instanceof WebAssembly.Module) return { instance: await WebAssembly.instantiate(source, {}) };
    if (source instanceof ArrayBuffer || ArrayBuffer.isView(source)) return WebAssembly.instantiate(source, {});
    if (typeof Response === "function" && source instanceof Response) return WebAssembly.instantiate(await bytesOf(source), {});
    if (!(source instanceof URL || typeof source === "string")) {
        throw new TypeError("source: wanted an address, a Response, bytes or a WebAssembly.Module");
    }
    const url = new URL(source, import.meta.url);
    if (url.protocol === "file:" && typeof process === "object" && process.versions?.node) {
        const { readFile } = await import("node:fs/promises");
        return WebAssembly.instantiate(await readFile(url), {});
    }
    return WebAssembly.instantiate(await bytesOf(await fetch(url)), {});
}

async function bytesOf(response) {
    if (!response.ok) throw new Error(`${response.url}: the server answered ${response.status}`);
    return response.arrayBuffer();
}

class Antumbra {
    #module;
    #freed;

    constructor(exports) {
        const module = new Calls(exports);
        this.#module = module;
        this.#freed = new FinalizationRegistry((scene) => module.free(scene));
    }

    build(meshes, options = {}) {
        const list = Array.isArray(meshes) ? meshes : [meshes];
        const { training, quality, origin } = known(options, ["training", "quality", "origin"], "options");
        if (quality !== undefined && quality !== "default" && quality !== "fast") {
            throw new RangeError(`quality: found ${show(quality)}, wanted "default" or "fast"`);
        }
        const checked = list.map(checkedMesh);
        const place = originOf(origin, checked);
        const module = this.#module;
        module.call("drop_meshes");
        for (const { positions, indices, name } of checked) {
            const floats = module.memory(Float32Array, "positions", positions.length);
            for (let item = 0; item < positions.length; ++item) floats[item] = positions[item] - place[item % 3];
            const count = indices ? indices.length : positions.length / 3;
            const triangles = module.memory(Uint32Array, "indices", count);
            for (let item = 0; item < count; ++item) {
                const index = indices ? indices[item] : item;
                if (!(Number.isInteger(index) && index >= 0 && index < FAILED)) {
                    throw new RangeError(`${name}.indices: item ${item} is ${show(index)}, wanted a vertex from 0 to ${positions.length / 3 - 1}`);
                }
                triangles[item] = index;
            }
            module.call("add_mesh");
        }
        const rays = training === undefined ? null : new Rays(training, place, "training");
        if (rays?.count > 1 << 24) throw new RangeError(`training: found ${rays.count} rays, wanted at most ${1 << 24}`);
        module.rays(rays, 0, rays ? rays.count : 0);
        const number = module.call("build", quality === "fast" ? 1 : 0);
        if (number === FAILED) throw new RangeError(module.error());
        const scene = new Scene(module, number, place, this.#freed);
        this.#freed.register(scene, number, scene);
        return scene;
    }
}

/** Calls into the module. After a failure inside, the module is of no use any more. */
class Calls {
    #exports;
    #failed = null;

    constructor(exports) {
        this.#exports = exports;
    }

    call(name, ...values) {
        if (this.#failed !== null) throw new Error(this.#failed);
        let answer;
        try {
            answer = this.#exports[name](...values);
        } catch (failure) {
            if (!(failure instanceof WebAssembly.RuntimeError)) throw failure;
            const text = this.#text("panic_text");
            this.#failed = text ? `a mistake of antumbra, please report it: ${text}` : `${FULL}; load the module again`;
            throw new Error(this.#failed, { cause: failure });
        }
        // Addresses are unsigned.
        return Number.isInteger(answer) ? answer >>> 0 : answer;
    }

    /** Frees a scene. After a failure inside there is nothing to free. */
    free(scene) {
        if (this.#failed === null) this.call("free_scene", scene);
    }

    view(type, address, length) {
        return new type(this.#exports.memory.buffer, address, length);
    }

    memory(type, name, count) {
        if (count * type.BYTES_PER_ELEMENT >= 2 ** 31) throw new RangeError(FULL);
        const address = this.call(name, count);
        if (address === FAILED) throw new RangeError(this.error());
        return this.view(type, address, count);
    }

    /** Writes the rays from `from` to `to`. */
    rays(rays, from, to) {
        const address = this.call("rays", to - from);
        if (address === FAILED) throw new RangeError(this.error());
        if (rays) rays.write(this.view(Float32Array, address, 8 * (to - from)), from, to);
    }

    error() {
        return this.#text("error");
    }

    #text(name) {
        const bytes = this.view(Uint8Array, this.#exports[name](0) >>> 0, this.#exports[name](1));
        return new TextDecoder().decode(bytes.slice());
    }
}

class Scene {
    #module;
    #number;
    #origin;
    #freed;

    constructor(module, number, origin, freed) {
        this.#module = module;
        this.#number = number;
        this.#origin = origin;
        this.#freed = freed;
    }

    get origin() {
        return [...this.#origin];
    }

    get report() {
        const figure = (index) => this.#module.call("report", this.#alive(), index);
        return { triangles: figure(0), dropped: figure(1), bytes: figure(2), trainingRays: figure(3) };
    }

    occluded(rays) {
        const list = new Rays(rays, this.#origin, "rays");
        const answers = new Uint8Array(list.count);
        this.#pieces(list, "occluded", (address, from, count) => {
            answers.set(this.#module.view(Uint8Array, address, count), from);
        });
        return answers;
    }

    intersect(rays) {
        const list = new Rays(rays, this.#origin, "rays");
        const hits = {
            t: new Float32Array(list.count),
            uv: new Float32Array(2 * list.count),
            triangle: new Int32Array(list.count),
            mesh: new Int32Array(list.count),
        };
        this.#pieces(list, "intersect", (address, from, count) => {
            const module = this.#module;
            hits.t.set(module.view(Float32Array, address, count), from);
            hits.uv.set(module.view(Float32Array, module.call("hits", 0), 2 * count), 2 * from);
            hits.triangle.set(module.view(Int32Array, module.call("hits", 1), count), from);
            hits.mesh.set(module.view(Int32Array, module.call("hits", 2), count), from);
        });
        return hits;
    }

    relearn(rays) {
        const list = new Rays(rays, this.#origin, "rays");
        const scene = this.#alive();
        this.#module.rays(list, 0, list.count);
        this.#answered(this.#module.call("relearn", scene));
    }

    free() {
        if (this.#number === null) return;
        this.#module.free(this.#number);
        this.#freed.unregister(this);
        this.#number = null;
    }

    #alive() {
        if (this.#number === null) throw new Error("the scene has been freed");
        return this.#number;
    }

    #answered(address) {
        if (address === FAILED) throw new Error(this.#module.error());
        return address;
    }

    #pieces(rays, query, take) {
        const scene = this.#alive();
        for (let from = 0; from < rays.count; from += PIECE) {
            const to = Math.min(rays.count, from + PIECE);
            this.#module.rays(rays, from, to);
            take(this.#answered(this.#module.call(query, scene)), from, to - from);
        }
    }
}

/** Rays of the caller, checked: columns of numbers, where one item may serve all rays. */
class Rays {
    constructor(rays, place, name) {
        const between = rays && typeof rays === "object" && ("from" in rays || "to" in rays);
        const names = between ? ["from", "to"] : ["origins", "directions", "near", "far"];
        const fields = known(rays, names, name);
        this.place = place;
        this.between = between;
        this.origins = triples(fields[names[0]], `${name}.${names[0]}`);
        this.directions = triples(fields[names[1]], `${name}.${names[1]}`);
        const [a, b] = [this.origins.length / 3, this.directions.length / 3];
        if (a !== b && a !== 1 && b !== 1) {
            throw new RangeError(`${name}: found ${a} ${names[0]} and ${b} ${names[1]}, wanted as many, or one for all`);
        }
        this.count = a === 1 ? b : a;
        this.near = between ? 0 : this.#ends(fields.near ?? 0, `${name}.near`);
        this.far = between ? 1 : this.#ends(fields.far ?? Infinity, `${name}.far`);
    }

    #ends(ends, name) {
        if (typeof ends === "number") return ends;
        const list = numbers(ends, name);
        if (list.length !== this.count) {
            throw new RangeError(`${name}: found ${list.length} numbers, wanted one, or one for each of ${this.count} rays`);
        }
        return list;
    }

    write(floats, from, to) {
        const { origins, directions, near, far, between } = this;
        const [x, y, z] = this.place;
        // One item that serves all rays has the step 0.
        const [step, turn] = [origins, directions].map((list) => (list.length === 3 ? 0 : 3));
        for (let ray = from, at = 0; ray < to; ++ray, at += 8) {
            const [o, d] = [step * ray, turn * ray];
            floats[at] = origins[o] - x;
            floats[at + 1] = origins[o + 1] - y;
            floats[at + 2] = origins[o + 2] - z;
            floats[at + 3] = typeof near === "number" ? near : near[ray];
            floats[at + 4] = between ? directions[d] - origins[o] : directions[d];
            floats[at + 5] = between ? directions[d + 1] - origins[o + 1] : directions[d + 1];
            floats[at + 6] = between ? directions[d + 2] - origins[o + 2] : directions[d + 2];
            floats[at + 7] = typeof far === "number" ? far : far[ray];
        }
    }
}

function checkedMesh(mesh, index, { length }) {
    const name = length === 1 ? "mesh" : `meshes[${index}]`;
    const { positions, indices } = known(mesh, ["positions", "indices"], name);
    const points = triples(positions, `${name}.positions`);
    const triangles = indices === undefined ? undefined : triples(indices, `${name}.indices`);
    if (!triangles && points.length % 9) {
        throw new RangeError(`${name}.positions: found ${points.length} numbers and no indices, wanted 9 per triangle`);
    }
    return { positions: points, indices: triangles, name };
}

/** Point that is subtracted from coordinates before they are rounded to single precision. */
function originOf(origin, meshes) {
    if (origin !== undefined && origin !== "auto") {
        const point = numbers(origin, "origin");
        if (point.length !== 3 || ![...point].every(Number.isFinite)) {
            throw new RangeError(`origin: found ${show(origin)}, wanted "auto" or three finite numbers`);
        }
        return [...point];
    }
    if (meshes.every(({ positions }) => positions instanceof Float32Array)) return [0, 0, 0];
    const [low, high] = [[Infinity, Infinity, Infinity], [-Infinity, -Infinity, -Infinity]];
    for (const { positions } of meshes) {
        for (let at = 0; at < positions.length; at += 3) {
            const point = [positions[at], positions[at + 1], positions[at + 2]];
            if (!point.every(Number.isFinite)) continue;
            point.forEach((x, axis) => {
                low[axis] = Math.min(low[axis], x);
                high[axis] = Math.max(high[axis], x);
            });
        }
    }
    const longest = Math.max(...high.map((x, axis) => x - low[axis]));
    const farthest = Math.max(...high.map(Math.abs), ...low.map(Math.abs));
    // Nothing but points that are not finite, or points near zero: coordinates stay as they are.
    if (low[0] > high[0] || farthest <= FAR * longest) return [0, 0, 0];
    return low.map((x, axis) => 0.5 * x + 0.5 * high[axis]);
}

function known(object, names, name) {
    if (object === null || typeof object !== "object" || Array.isArray(object) || ArrayBuffer.isView(object)) {
        throw new TypeError(`${name}: found ${show(object)}, wanted an object with ${names.join(", ")}`);
    }
    const other = Object.keys(object).find((key) => !names.includes(key));
    if (other !== undefined) throw new TypeError(`${name}: there is no ${other}, only ${names.join(", ")}`);
    return object;
}

function triples(list, name) {
    const checked = numbers(list, name);
    if (checked.length % 3) throw new RangeError(`${name}: found ${checked.length} numbers, wanted 3 per item`);
    return checked;
}

function numbers(list, name) {
    const typed = ArrayBuffer.isView(list) && !(list instanceof DataView);
    if (!(typed || Array.isArray(list)) || list instanceof BigInt64Array || list instanceof BigUint64Array) {
        throw new TypeError(`${name}: found ${show(list)}, wanted a typed array or an array of numbers`);
    }
    if (!typed) {
        const wrong = list.findIndex((item) => typeof item !== "number");
        if (wrong !== -1) throw new TypeError(`${name}: item ${wrong} is ${show(list[wrong])}, wanted a number`);
    }
    return list;
}

function show(value) {
    if (typeof value === "string") return JSON.stringify(value);
    if (value === null || typeof value !== "object") return String(value);
    return Array.isArray(value) ? `[${value.slice(0, 4)}${value.length > 4 ? ", ..." : ""}]` : (value.constructor?.name ?? "an object");
}
