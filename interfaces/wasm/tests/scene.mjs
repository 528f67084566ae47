// A scene and rays that Rust, Node and browsers make with the same bits: tests/same_bits.rs makes them as well.

/** Numbers in [0, 1) that single precision holds. */
export function random(seed) {
    let state = BigInt(seed);
    return () => {
        state = BigInt.asUintN(64, state * 6364136223846793005n + 1442695040888963407n);
        return Number(state >> 40n) / 2 ** 24;
    };
}

export function soup(triangles, rays) {
    const next = random(7);
    const positions = new Float32Array(9 * triangles);
    for (let triangle = 0; triangle < triangles; ++triangle) {
        const centre = [next(), next(), next()];
        for (let item = 0; item < 9; ++item) {
            // Sums of two numbers of single precision, rounded once.
            positions[9 * triangle + item] = centre[item % 3] + Math.fround(next() * 0.125);
        }
    }
    const origins = Float32Array.from({ length: 3 * rays }, next);
    const directions = Float32Array.from({ length: 3 * rays }, () => next() - 0.5);
    return { positions, origins, directions };
}

/** FNV-1a over the bytes of arrays. */
export function digest(...arrays) {
    let hash = 0xcbf29ce484222325n;
    for (const array of arrays) {
        for (const byte of new Uint8Array(array.buffer, array.byteOffset, array.byteLength)) {
            hash = BigInt.asUintN(64, (hash ^ BigInt(byte)) * 0x100000001b3n);
        }
    }
    return hash.toString(16).padStart(16, "0");
}
