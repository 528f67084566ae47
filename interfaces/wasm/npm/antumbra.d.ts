/** A list of numbers. Other numbers than those of a `Float32Array` are in double precision: see `BuildOptions.origin`. */
export type Numbers =
    | Float32Array | Float64Array
    | Int8Array | Uint8Array | Uint8ClampedArray | Int16Array | Uint16Array | Int32Array | Uint32Array
    | readonly number[];

/** Triangles. */
export interface Mesh {
    /** Coordinates x, y, z, 3 numbers per vertex. Triangles with a NaN or an infinite coordinate are dropped. */
    positions: Numbers;
    /** Vertices of each triangle, 3 numbers per triangle. Without them every 3 vertices are a triangle. */
    indices?: Numbers;
}

/**
 * Rays `origin + t * direction`. One origin, or one direction, may serve all rays.
 *
 * `t` counts multiples of the direction, which may have any length but zero. Hits count where `near < t < far`, without the
 * ends. Rays with a NaN, an infinite origin or direction, no direction or an empty interval hit nothing.
 */
export interface Rays {
    /** 3 numbers per ray, or 3 numbers. */
    origins: Numbers;
    /** 3 numbers per ray, or 3 numbers. */
    directions: Numbers;
    /** One number, or one per ray. 0 if it is absent. */
    near?: number | Numbers;
    /** One number, or one per ray. Infinity if it is absent. */
    far?: number | Numbers;
}

/** Open segments between points: `t` is 0 at `from` and 1 at `to`. One end may serve all segments. */
export interface Segments {
    /** 3 numbers per segment, or 3 numbers. */
    from: Numbers;
    /** 3 numbers per segment, or 3 numbers. */
    to: Numbers;
}

/** What the rays of a query hit, one answer per ray. At equal distances the smallest (mesh, triangle) is hit. */
export interface Hits {
    /** Distance in multiples of the direction. Infinity after a miss. */
    t: Float32Array;
    /** Barycentric weights of the second and the third corner, 2 numbers per ray. 0 after a miss. */
    uv: Float32Array;
    /** Index of the triangle in its mesh. -1 after a miss. */
    triangle: Int32Array;
    /** Index of the mesh. -1 after a miss. */
    mesh: Int32Array;
}

export interface BuildOptions {
    /**
     * A sample of the rays to come, some thousand. The tree is made for them; answers are the same. Rays between surfaces are
     * learned from in any case, unless `quality` is `"fast"`.
     */
    training?: Rays | Segments;
    /** `"default"`, or `"fast"` for the shortest build and slower queries. */
    quality?: "default" | "fast";
    /**
     * Point that is subtracted from positions and rays before they are rounded to single precision. `"auto"`, the default, is
     * the middle of positions that are far from zero for their extent, as maps are. The point is zero for other positions, and
     * for `Float32Array`s, which are rounded already.
     */
    origin?: "auto" | Numbers;
}

export interface Report {
    /** Triangles in the tree. */
    triangles: number;
    /** Triangles left out: a coordinate that is not finite, or two equal corners. */
    dropped: number;
    /** Memory of the tree. */
    bytes: number;
    /** Rays from which the child order was learned. */
    trainingRays: number;
}

/** Triangles ready for queries. Made by `Antumbra.build`. */
export interface Scene {
    /** Whether anything is in the interval of each ray: 1 or 0. */
    occluded(rays: Rays | Segments): Uint8Array;
    /** The closest hit of each ray. */
    intersect(rays: Rays | Segments): Hits;
    /** Learns the child order again, for rays like these. Answers stay the same. Takes about as long as 100 such queries. */
    relearn(rays: Rays | Segments): void;
    /** Point that is subtracted from coordinates. */
    readonly origin: [number, number, number];
    readonly report: Report;
    /** Frees the memory at once. Otherwise that happens some time after the last reference to the scene is gone. */
    free(): void;
}

/** A module of WebAssembly, with memory of its own. */
export interface Antumbra {
    /**
     * Builds a scene over meshes, which are copied.
     *
     * Throws a `TypeError` for what is no list of numbers and for unknown fields, and a `RangeError` for lengths that do not
     * fit, for a triangle that names a vertex that is not there, and if the memory is full. Any other `Error` ends the module:
     * load another one.
     */
    build(meshes: Mesh | readonly Mesh[], options?: BuildOptions): Scene;
}

/**
 * Compiles the module. Needs a browser of 2023 or later, Node 18 or Deno.
 *
 * `source` is the address of `antumbra.wasm`, a `Response`, its bytes or a `WebAssembly.Module`. Without it the file beside
 * this one is taken, which bundlers find as well.
 */
export function load(
    source?: URL | string | Response | PromiseLike<Response> | ArrayBuffer | ArrayBufferView | WebAssembly.Module,
): Promise<Antumbra>;
