// Which points of a floor does a lamp light, if a roof covers one half?
import { load } from "antumbra";

const antumbra = await load();
const floor = { positions: [0, 0, 0, 4, 0, 0, 4, 4, 0, 0, 4, 0], indices: [0, 1, 2, 0, 2, 3] };
const roof = { positions: [0, 0, 2, 2, 0, 2, 2, 4, 2, 0, 4, 2], indices: [0, 1, 2, 0, 2, 3] };
const scene = antumbra.build([floor, roof]);

const points = new Float32Array(300);
for (let point = 0; point < 100; ++point) {
    points.set([0.2 + 0.4 * (point % 10), 0.2 + 0.4 * Math.floor(point / 10), 0], 3 * point);
}
// Open segments: the floor, where they begin, does not count.
const inShadow = scene.occluded({ from: points, to: [2, 2, 10] });
console.log(`${inShadow.reduce((sum, one) => sum + one)} of 100 points are in shadow`);

const hits = scene.intersect({ origins: [1, 1, 10, 3, 1, 10], directions: [0, 0, -1] });
console.log(`meshes ${hits.mesh.join(" and ")} at the distances ${hits.t.join(" and ")}`);
scene.free();
