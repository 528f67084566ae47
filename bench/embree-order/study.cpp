// Child orders inside Embree: its own BVH8, whose children are permuted, answered by its own rtcOccluded1 and rtcOccluded8.
//
//   embree-order FOLDER SCENE SEED ROUNDS      rows as CSV; the first line of the output names the columns
//
// FOLDER has the files that rays.py writes. For every kind of rays, orders are learned from the training
// rays and timed on the held-out rays. Answers in every order must be those of Embree's own, or the program fails.
//
// Embree visits hit children of an occlusion query from the highest slot to the lowest, and sorts nothing
// (kernels/bvh/bvh_traverser1.h, traverseAnyHit; bvh_intersector_hybrid.cpp, occluded). So the order in memory decides.
#include <algorithm>
#include <array>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <map>
#include <random>
#include <string>
#include <vector>

#include "kernels/common/scene.h"
#include "kernels/bvh/bvh.h"
#include "kernels/geometry/triangle.h"

using namespace embree;

namespace {

using Node = BVH8::AABBNode;
using Ref = BVH8::NodeRef;

// Costs in node tests. A leaf block holds up to four triangles, at 0.15 each.
constexpr double BLOCK_COST = 0.6;

struct TestRay { float org[3], tnear, dir[3], tfar; };

template<class T> std::vector<T> read(const std::string& path) {
    FILE* file = fopen(path.c_str(), "rb");
    if (!file) { fprintf(stderr, "%s: cannot be read\n", path.c_str()); exit(1); }
    fseek(file, 0, SEEK_END);
    std::vector<T> all(ftell(file) / sizeof(T));
    rewind(file);
    if (fread(all.data(), sizeof(T), all.size(), file) != all.size()) { fprintf(stderr, "%s: is too short\n", path.c_str()); exit(1); }
    fclose(file);
    return all;
}

double seconds() {
    timespec time;
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &time);
    return time.tv_sec + 1e-9 * time.tv_nsec;
}

// A child as Embree built it.
struct Child { Ref ref; BBox3fa box; };

// A node with its children as Embree has them, in the sequence of visits: the last slot first.
struct Place { Node* node; std::vector<Child> children; std::vector<int> below; };

using Order = std::vector<std::array<uint8_t, 8>>;

class Tree {
public:
    std::vector<Place> places;
    size_t triangles = 0;

    explicit Tree(Ref root) { add(root); }

    // Puts the children of all nodes into an order of visits.
    void permute(const Order& order) {
        for (size_t i = 0; i < places.size(); i++) {
            auto& [node, children, below] = places[i];
            for (size_t k = 0; k < children.size(); k++) {
                size_t slot = children.size() - 1 - k;
                node->setRef(slot, children[order[i][k]].ref);
                node->setBounds(slot, children[order[i][k]].box);
            }
        }
    }

    Order own() const {
        Order order(places.size());
        for (auto& sequence : order) for (int k = 0; k < 8; k++) sequence[k] = k;
        return order;
    }

    // By descending key.
    template<class Key> Order by(Key key) const {
        Order order = own();
        for (size_t i = 0; i < places.size(); i++) {
            std::vector<std::pair<double, int>> keys;
            for (size_t k = 0; k < places[i].children.size(); k++) keys.push_back({-key(i, k), (int)k});
            std::stable_sort(keys.begin(), keys.end(), [](auto& a, auto& b) { return a.first < b.first; });
            for (size_t k = 0; k < keys.size(); k++) order[i][k] = keys[k].second;
        }
        return order;
    }

    Order random(unsigned seed) const {
        std::mt19937 generator(seed);
        Order order = own();
        for (size_t i = 0; i < places.size(); i++)
            std::shuffle(order[i].begin(), order[i].begin() + places[i].children.size(), generator);
        return order;
    }

    // Equation 5 of Ogaki and Derouet-Jourdan, children shuffled while logging; keys H / (I C), bottom-up.
    Order sort_plus(const std::vector<TestRay>& rays, unsigned seed) const {
        std::vector<std::array<double, 17>> counts(places.size());
        for (auto& count : counts) count.fill(0);
        std::mt19937 generator(seed);
        if (!places.empty()) for (auto& ray : rays) log(0, ray, counts, generator);
        std::vector<double> cost(places.size());
        Order order = own();
        // Children come after their parents.
        for (size_t i = places.size(); i-- > 0;) {
            auto& [node, children, below] = places[i];
            auto& count = counts[i];
            double entered = std::max(count[16], 1.0);
            std::vector<std::pair<double, int>> keys;
            auto of = [&](int k) { return below[k] < 0 ? BLOCK_COST * blocks(children[k].ref) : cost[below[k]]; };
            for (size_t k = 0; k < children.size(); k++) {
                double I = count[k] / entered, H = count[8 + k] / entered;
                keys.push_back({count[k] > 0 ? -H / (I * of(k)) : 1.0, (int)k});
            }
            std::stable_sort(keys.begin(), keys.end(), [](auto& a, auto& b) { return a.first < b.first; });
            double left = 1, sum = 1;
            for (size_t k = 0; k < keys.size(); k++) {
                int child = keys[k].second;
                order[i][k] = child;
                sum += count[child] / entered * of(child) * left;
                left *= 1 - count[8 + child] / entered;
            }
            cost[i] = sum;
        }
        return order;
    }

    // Least measured cost on the training rays, node by node from below: dynamic programming over sets of children.
    Order joint(const std::vector<TestRay>& rays) const {
        Order order = own();
        std::vector<int> all(rays.size());
        for (size_t i = 0; i < rays.size(); i++) all[i] = i;
        std::vector<std::pair<double, bool>> found(rays.size());
        if (!places.empty()) solve(0, rays, all, found, order);
        return order;
    }

    // Node tests and leaf blocks per ray.
    std::array<double, 2> count(const std::vector<TestRay>& rays, const Order& order) const {
        std::array<double, 2> sum = {0, 0};
        if (!places.empty()) for (auto& ray : rays) walk(0, ray, order, sum);
        for (auto& value : sum) value /= rays.size();
        return sum;
    }

private:
    int add(Ref ref) {
        if (!ref.isAABBNode()) {
            size_t num;
            auto* block = (const Triangle4*)ref.leaf(num);
            for (size_t i = 0; i < num; i++) triangles += block[i].size();
            return -1;
        }
        int index = places.size();
        Node* node = ref.getAABBNode();
        places.push_back({node, {}, {}});
        size_t used = 0;
        while (used < 8 && node->child(used) != BVH8::emptyNode) used++;
        for (size_t slot = used; slot-- > 0;)
            places[index].children.push_back({node->child(slot), node->bounds(slot)});
        for (size_t k = 0; k < used; k++) {
            int child = add(places[index].children[k].ref);
            places[index].below.push_back(child);
        }
        return index;
    }

    static size_t blocks(Ref leaf) { size_t num; leaf.leaf(num); return num; }

    static bool enters(const BBox3fa& box, const TestRay& ray) {
        float near = ray.tnear, far = ray.tfar;
        for (int axis = 0; axis < 3; axis++) {
            float inverse = 1.0f / ray.dir[axis];
            float a = (box.lower[axis] - ray.org[axis]) * inverse, b = (box.upper[axis] - ray.org[axis]) * inverse;
            near = std::max(near, std::min(a, b));
            far = std::min(far, std::max(a, b));
        }
        return near <= far;
    }

    // Whether the ray hits a triangle of the leaf, and how many blocks were tested.
    static bool hits(Ref leaf, const TestRay& ray, size_t& tested) {
        size_t num;
        auto* triangles = (const Triangle4*)leaf.leaf(num);
        const Vec3f org(ray.org[0], ray.org[1], ray.org[2]), dir(ray.dir[0], ray.dir[1], ray.dir[2]);
        for (size_t block = 0; block < num; block++) {
            tested++;
            for (size_t i = 0; i < 4 && triangles[block].valid(i); i++) {
                auto at = [&](const Vec3vf4& v) { return Vec3f(v.x[i], v.y[i], v.z[i]); };
                const Vec3f v0 = at(triangles[block].v0), a = -at(triangles[block].e1), b = at(triangles[block].e2);
                const Vec3f p = cross(dir, b);
                const float det = dot(a, p);
                if (det == 0) continue;
                const Vec3f s = org - v0, q = cross(s, a);
                const float u = dot(s, p) / det, v = dot(dir, q) / det, t = dot(b, q) / det;
                if (u >= 0 && v >= 0 && u + v <= 1 && t > ray.tnear && t < ray.tfar) return true;
            }
        }
        return false;
    }

    unsigned mask(int index, const TestRay& ray) const {
        unsigned mask = 0;
        auto& children = places[index].children;
        for (size_t k = 0; k < children.size(); k++) mask |= unsigned(enters(children[k].box, ray)) << k;
        return mask;
    }

    bool walk(int index, const TestRay& ray, const Order& order, std::array<double, 2>& sum) const {
        sum[0]++;
        auto& place = places[index];
        unsigned mask = this->mask(index, ray);
        for (size_t k = 0; k < place.children.size(); k++) {
            int child = order[index][k];
            if (!(mask >> child & 1)) continue;
            size_t tested = 0;
            bool hit = place.below[child] < 0 ? hits(place.children[child].ref, ray, tested) : walk(place.below[child], ray, order, sum);
            sum[1] += tested;
            if (hit) return true;
        }
        return false;
    }

    bool log(int index, const TestRay& ray, std::vector<std::array<double, 17>>& counts, std::mt19937& generator) const {
        auto& place = places[index];
        counts[index][16]++;
        unsigned mask = this->mask(index, ray);
        int order[8], count = 0;
        for (size_t k = 0; k < place.children.size(); k++) if (mask >> k & 1) { order[count++] = k; counts[index][k]++; }
        std::shuffle(order, order + count, generator);
        for (int k = 0; k < count; k++) {
            size_t tested = 0;
            int child = order[k];
            bool hit = place.below[child] < 0 ? hits(place.children[child].ref, ray, tested) : log(place.below[child], ray, counts, generator);
            if (hit) { counts[index][8 + child]++; return true; }
        }
        return false;
    }

    // Sets `found` of the rays, which all enter the node: cost in the node's best order, and whether they are occluded.
    void solve(int index, const std::vector<TestRay>& rays, const std::vector<int>& list, std::vector<std::pair<double, bool>>& found, Order& order) const {
        auto& place = places[index];
        const size_t n = place.children.size();
        std::vector<std::array<float, 8>> cost(list.size());
        std::vector<uint8_t> entered(list.size(), 0), occluded(list.size(), 0);
        for (size_t k = 0; k < n; k++) {
            std::vector<int> own, at;
            for (size_t i = 0; i < list.size(); i++)
                if (enters(place.children[k].box, rays[list[i]])) { own.push_back(list[i]); at.push_back(i); }
            if (place.below[k] >= 0 && !own.empty()) solve(place.below[k], rays, own, found, order);
            for (size_t i = 0; i < own.size(); i++) {
                if (place.below[k] < 0) {
                    size_t tested = 0;
                    bool hit = hits(place.children[k].ref, rays[own[i]], tested);
                    found[own[i]] = {BLOCK_COST * tested, hit};
                }
                cost[at[i]][k] = found[own[i]].first;
                entered[at[i]] |= 1 << k;
                occluded[at[i]] |= unsigned(found[own[i]].second) << k;
            }
        }
        // Cost of child k of all rays with these occluding children; then of all rays that a set of children leaves over.
        std::vector<std::array<double, 8>> left(1 << n);
        for (auto& row : left) row.fill(0);
        for (size_t i = 0; i < list.size(); i++)
            for (size_t k = 0; k < n; k++) if (entered[i] >> k & 1) left[occluded[i]][k] += cost[i][k];
        for (size_t bit = 0; bit < n; bit++)
            for (size_t set = 0; set < left.size(); set++)
                if (set >> bit & 1) for (size_t k = 0; k < n; k++) left[set][k] += left[set ^ (size_t(1) << bit)][k];
        std::vector<double> best(1 << n, inf);
        std::vector<uint8_t> last(1 << n, 0);
        best[0] = 0;
        for (size_t set = 0; set + 1 < best.size(); set++)
            for (size_t k = 0; k < n; k++) {
                if (set >> k & 1) continue;
                // Rays that no child of the set occludes have their occluders in the complement.
                double sum = best[set] + left[(best.size() - 1) ^ set][k];
                size_t with = set | size_t(1) << k;
                if (sum < best[with]) { best[with] = sum; last[with] = k; }
            }
        for (size_t set = best.size() - 1, k = n; k-- > 0; set ^= size_t(1) << last[set]) order[index][k] = last[set];
        for (size_t i = 0; i < list.size(); i++) {
            double sum = 1;
            for (size_t k = 0; k < n; k++) {
                int child = order[index][k];
                if (!(entered[i] >> child & 1)) continue;
                sum += cost[i][child];
                if (occluded[i] >> child & 1) break;
            }
            found[list[i]] = {sum, occluded[i] != 0};
        }
    }
};

RTCRay ray_of(const TestRay& from) {
    RTCRay ray;
    ray.org_x = from.org[0]; ray.org_y = from.org[1]; ray.org_z = from.org[2]; ray.tnear = from.tnear;
    ray.dir_x = from.dir[0]; ray.dir_y = from.dir[1]; ray.dir_z = from.dir[2]; ray.tfar = from.tfar;
    ray.time = 0; ray.mask = -1; ray.id = 0; ray.flags = 0;
    return ray;
}

void answer1(RTCScene scene, const std::vector<TestRay>& rays, std::vector<char>& answers) {
    for (size_t i = 0; i < rays.size(); i++) {
        RTCRay ray = ray_of(rays[i]);
        rtcOccluded1(scene, &ray, nullptr);
        answers[i] = ray.tfar < 0;
    }
}

void answer8(RTCScene scene, const std::vector<TestRay>& rays, std::vector<char>& answers) {
    for (size_t first = 0; first < rays.size(); first += 8) {
        alignas(32) RTCRay8 packet;
        alignas(32) int valid[8];
        for (size_t lane = 0; lane < 8; lane++) {
            valid[lane] = first + lane < rays.size() ? -1 : 0;
            RTCRay ray = ray_of(rays[std::min(first + lane, rays.size() - 1)]);
            packet.org_x[lane] = ray.org_x; packet.org_y[lane] = ray.org_y; packet.org_z[lane] = ray.org_z;
            packet.dir_x[lane] = ray.dir_x; packet.dir_y[lane] = ray.dir_y; packet.dir_z[lane] = ray.dir_z;
            packet.tnear[lane] = ray.tnear; packet.tfar[lane] = ray.tfar; packet.time[lane] = 0;
            packet.mask[lane] = -1; packet.id[lane] = 0; packet.flags[lane] = 0;
        }
        rtcOccluded8(valid, scene, &packet, nullptr);
        for (size_t lane = 0; lane < 8 && first + lane < rays.size(); lane++) answers[first + lane] = packet.tfar[lane] < 0;
    }
}

double half_area(const BBox3fa& box) {
    Vec3fa size = box.size();
    return size.x * size.y + size.y * size.z + size.z * size.x;
}

}

int main(int count, char** arguments) {
    if (count != 5) { fprintf(stderr, "usage: embree-order FOLDER SCENE SEED ROUNDS\n"); return 2; }
    const std::string base = std::string(arguments[1]) + "/" + arguments[2];
    const unsigned seed = atoi(arguments[3]), rounds = atoi(arguments[4]);
    auto corners = read<float>(base + ".triangles");
    RTCDevice device = rtcNewDevice("threads=1");
    RTCScene scene = rtcNewScene(device);
    RTCGeometry mesh = rtcNewGeometry(device, RTC_GEOMETRY_TYPE_TRIANGLE);
    const size_t vertices = corners.size() / 3;
    corners.resize(corners.size() + 4);
    rtcSetSharedGeometryBuffer(mesh, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, corners.data(), 0, 12, vertices);
    auto* indices = (unsigned*)rtcSetNewGeometryBuffer(mesh, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3, 12, vertices / 3);
    for (size_t i = 0; i < vertices; i++) indices[i] = i;
    rtcCommitGeometry(mesh);
    rtcAttachGeometry(scene, mesh);
    rtcCommitScene(scene);
    BVH8* bvh = nullptr;
    for (auto* accel : ((Scene*)scene)->accels)
        if (accel->intersectors.ptr && accel->intersectors.ptr->type == AccelData::TY_BVH8) bvh = (BVH8*)accel->intersectors.ptr;
    if (!bvh) { fprintf(stderr, "Embree built no BVH8\n"); return 1; }
    Tree tree(bvh->root);
    // The layout is that of the headers, not of the library: a tree of another size is another layout.
    if (tree.triangles > vertices / 3 || 100 * tree.triangles < 99 * (vertices / 3)) {
        fprintf(stderr, "%s: the tree holds %zu of %zu triangles\n", base.c_str(), tree.triangles, vertices / 3);
        return 1;
    }
    printf("scene,triangles,rays,held_out,seed,call,order,ns_per_ray,speed,speed_least,speed_most,node_tests,leaf_blocks,occluded,differences\n");
    bool failed = false;
    for (std::string kind : {"shadow", "ao", "sun"}) {
        auto training = read<TestRay>(base + "." + kind + ".training.rays");
        auto rays = read<TestRay>(base + "." + kind + ".held-out.rays");
        if (rays.empty()) continue;
        auto area = [&](size_t i, size_t k) { return half_area(tree.places[i].children[k].box); };
        std::vector<std::pair<std::string, Order>> orders = {
            {"own", tree.own()}, {"random", tree.random(seed)}, {"sato", tree.by(area)},
            {"sort+", tree.sort_plus(training, seed)}, {"joint", tree.joint(training)},
        };
        for (int lanes : {1, 8}) {
            std::vector<std::vector<double>> times(orders.size());
            std::vector<char> reference(rays.size()), answers(rays.size());
            std::vector<size_t> differences(orders.size(), 0);
            auto answer = lanes == 1 ? answer1 : answer8;
            tree.permute(orders[0].second);
            answer(scene, rays, reference);
            std::vector<TestRay> warm(rays.begin(), rays.begin() + std::min<size_t>(rays.size(), 4096));
            for (unsigned round = 0; round < rounds; round++) {
                for (size_t turn = 0; turn < orders.size(); turn++) {
                    size_t which = round % 2 ? orders.size() - 1 - turn : turn;
                    tree.permute(orders[which].second);
                    answer(scene, warm, answers);
                    double start = seconds();
                    answer(scene, rays, answers);
                    times[which].push_back(seconds() - start);
                    for (size_t i = 0; i < rays.size(); i++) differences[which] += answers[i] != reference[i];
                }
            }
            size_t occluded = std::count(reference.begin(), reference.end(), 1);
            for (size_t which = 0; which < orders.size(); which++) {
                auto& [name, order] = orders[which];
                std::vector<double> ratios, own = times[which];
                for (unsigned round = 0; round < rounds; round++) ratios.push_back(times[0][round] / times[which][round]);
                std::sort(ratios.begin(), ratios.end());
                std::sort(own.begin(), own.end());
                auto tests = tree.count(rays, order);
                printf("%s,%zu,%s,%zu,%u,rtcOccluded%d,%s,%.2f,%.4f,%.4f,%.4f,%.3f,%.3f,%.4f,%zu\n", arguments[2], vertices / 3,
                    kind.c_str(), rays.size(), seed, lanes, name.c_str(), 1e9 * own[rounds / 2] / rays.size(), ratios[rounds / 2],
                    ratios.front(), ratios.back(), tests[0], tests[1], double(occluded) / rays.size(), differences[which]);
                failed |= differences[which] > 0;
            }
            fflush(stdout);
        }
        tree.permute(orders[0].second);
    }
    rtcReleaseGeometry(mesh);
    rtcReleaseScene(scene);
    rtcReleaseDevice(device);
    return failed;
}
