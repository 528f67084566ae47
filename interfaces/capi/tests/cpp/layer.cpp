// The C++ layer: ownership, spans of structures, exceptions through callbacks, user geometry, files.
#include "antumbra.hpp"

#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <random>
#include <string>

#define CHECK(condition)                                                              \
    do {                                                                              \
        if (!(condition)) {                                                           \
            std::fprintf(stderr, "%s:%d: %s\n", __FILE__, __LINE__, #condition);      \
            std::exit(1);                                                             \
        }                                                                             \
    } while (0)

template <class F> antumbra_status failure(F &&call) {
    try {
        call();
    } catch (const antumbra::Error &error) {
        CHECK(std::string(error.what()) != "");
        return error.status();
    }
    return ANTUMBRA_OK;
}

// Structures of a user: more than the numbers.
struct Vertex {
    float x, y, z;
    float normal[3];
};
struct Triangle {
    std::uint32_t a, b, c;
    std::uint32_t material;
};

// The few lines that README.md shows.
static std::vector<std::uint8_t> shadows(const std::vector<Vertex> &vertices, const std::vector<Triangle> &triangles,
                                         const std::vector<antumbra::Ray> &rays) {
    // ANCHOR: readme
    antumbra::Scene scene;
    scene.add_triangles(vertices, triangles);
    antumbra::Bvh bvh(scene);
    std::vector<std::uint8_t> in_shadow = bvh.batch(rays).occluded();
    // ANCHOR_END: readme
    return in_shadow;
}

// Balls with radii: user geometry with all functions.
struct Balls {
    std::vector<std::array<float, 4>> balls;
    std::shared_ptr<int> alive;

    antumbra::Box bounds(std::uint32_t id) const {
        auto [x, y, z, r] = balls[id];
        return {{x - r, y - r, z - r}, {x + r, y + r, z + r}};
    }
    std::optional<antumbra::UserHit> intersect(std::uint32_t id, const antumbra::Ray &ray) const {
        const auto &ball = balls[id];
        double b = 0, c = -double(ball[3]) * ball[3], a = 0;
        for (std::size_t axis = 0; axis < 3; ++axis) {
            double from = double(ray.org[axis]) - ball[axis];
            a += double(ray.dir[axis]) * ray.dir[axis];
            b += from * ray.dir[axis];
            c += from * from;
        }
        double root = b * b - a * c;
        if (root < 0) {
            return std::nullopt;
        }
        for (double t : {(-b - std::sqrt(root)) / a, (-b + std::sqrt(root)) / a}) {
            if (t > ray.tnear && t < ray.tfar) {
                return antumbra::UserHit{float(t), 1.0f, 2.0f};
            }
        }
        return std::nullopt;
    }
    bool occluded(std::uint32_t id, const antumbra::Ray &ray) const { return intersect(id, ray).has_value(); }
    std::optional<std::array<double, 3>> closest_point(std::uint32_t id, const std::array<double, 3> &point,
                                                       const std::array<double, 12> &) const {
        const auto &ball = balls[id];
        double length = std::hypot(point[0] - ball[0], point[1] - ball[1], point[2] - ball[2]);
        std::array<double, 3> closest{};
        for (std::size_t axis = 0; axis < 3; ++axis) {
            closest[axis] = ball[axis] + (point[axis] - ball[axis]) / length * ball[3];
        }
        return closest;
    }
    std::optional<std::array<float, 3>> normal(std::uint32_t, const antumbra::Ray &, const antumbra::UserHit &hit) const {
        CHECK(hit.u == 1.0f && hit.v == 2.0f);
        return std::array<float, 3>{0, 0, -3};
    }
};

// Curves as one list, and by their segments in another order, which changes the numbers.
static void curves() {
    const std::vector<std::array<float, 4>> points{{0, -1, 1, 0.5f}, {0, 0, 1, 0.5f}, {0, 1, 1, 0}};
    const std::vector<std::uint32_t> segments{1, 0};
    antumbra::Scene scene;
    CHECK(scene.add_curves(points) == 0);
    CHECK(scene.add_curves(points, segments) == 1);
    scene.set_mask(0, 1);
    scene.set_mask(1, 2);
    antumbra::Bvh bvh(scene);
    const std::vector<antumbra::Ray> rays{antumbra::ray({0.25f, -0.5f, 10}, {0, 0, -1}), antumbra::ray({0.3f, 0.5f, 10}, {0, 0, -1})};
    for (std::uint32_t geom = 0; geom < 2; ++geom) {
        auto hits = bvh.batch(rays).mask(1 << geom).intersect();
        CHECK(hits[0].t == 9 && hits[0].geom_id == geom && hits[0].prim_id == geom && hits[0].u == 0.5f && hits[0].v == 0.25f);
        CHECK(!antumbra_is_hit(&hits[1]));
    }
    CHECK(antumbra::Scene().add_curves(std::vector<std::array<float, 4>>{}) == 0);
}

// A wall of 2 m in the east of a plain.
static void fields() {
    const std::vector<double> heights = {0, 0, 0, 2, 0, 0, 0, 2};
    antumbra::HeightField field(heights, 4, {0, 1, 0, 0, 0, -1});
    antumbra::Threads threads(2);
    CHECK(field.cells() == 8 && field.lattice(8)[2] == 90 && field.height(3.5, -0.5) == 2);
    CHECK(field.horizons(90)[2] > 63 && field.horizons(90, 0, 0, &threads)[1] == 45);
    const double suns[] = {90, 50, 90, 60};
    CHECK(field.lit(suns) == (std::vector<std::uint8_t>{1, 1, 0, 1, 1, 1, 0, 1, 1, 1, 0, 1, 1, 1, 0, 1}));
    const auto view = field.sky(ANTUMBRA_SKY_VIEW), open = field.sky(ANTUMBRA_SKY_OPEN, 32);
    CHECK(view[0] > view[2] && open[0] > open[2] && open[0] < 1);
    CHECK(field.viewshed({0.5, -0.5, 1}) == std::vector<std::uint8_t>(8, 1));
    CHECK(field.viewshed({0.5, -0.5, NAN}, 0, 1.5)[7] == 0);
    antumbra::HeightField moved = std::move(field);
    CHECK(moved.horizons(270)[0] == -90);
    CHECK(failure([&] { antumbra::HeightField(heights, 3); }) == ANTUMBRA_INVALID_ARGUMENT);
    CHECK(failure([&] { moved.sky(9); }) == ANTUMBRA_INVALID_ARGUMENT);
}

int main(int argc, char **argv) {
    curves();
    fields();
    CHECK(argc == 2);
    std::mt19937 random(5);
    std::uniform_real_distribution<float> unit(-1, 1);
    std::vector<Vertex> vertices(900);
    std::vector<Triangle> triangles(300);
    for (std::uint32_t index = 0; index < 300; ++index) {
        float x = unit(random), y = unit(random), z = unit(random);
        for (std::uint32_t corner = 0; corner < 3; ++corner) {
            vertices[3 * index + corner] = {x + 0.2f * unit(random), y + 0.2f * unit(random), z + 0.2f * unit(random), {}};
        }
        triangles[index] = {3 * index, 3 * index + 1, 3 * index + 2, index};
    }
    std::vector<antumbra::Ray> rays(5000);
    for (auto &ray : rays) {
        ray = antumbra::between({unit(random), unit(random), unit(random)}, {unit(random), unit(random), unit(random)});
    }

    antumbra::Scene scene;
    CHECK(scene.add_triangles(vertices, triangles) == 0);
    CHECK(scene.geometry_count() == 1);
    antumbra::Threads threads(2);
    CHECK(threads.count() == 2);
    float last = 0;
    std::mutex mutex;
    antumbra::Recipe recipe("fast");
    recipe.order("sort+").level("scalar").width(8);
    antumbra::Bvh bvh(scene, antumbra::Build().recipe(recipe).rays(rays).threads(threads).progress([&](float done) {
        std::lock_guard<std::mutex> guard(mutex);
        last = std::max(last, done);
    }));
    CHECK(last > 0.5f && bvh.report().width == 8);

    // The same without structures, and without indices.
    std::vector<std::array<float, 3>> corners;
    for (const Vertex &vertex : vertices) {
        corners.push_back({vertex.x, vertex.y, vertex.z});
    }
    antumbra::Scene plain;
    plain.add_triangles(corners);
    antumbra::Bvh other(plain);
    auto hits = bvh.batch(rays).intersect(), theirs = other.batch(rays).on_this_thread().intersect();
    CHECK(std::memcmp(hits.data(), theirs.data(), hits.size() * sizeof hits[0]) == 0);
    auto dark = bvh.batch(rays).occluded();
    CHECK(dark == shadows(vertices, triangles, rays));
    auto bits = bvh.batch(rays).occluded_bits();
    auto counts = bvh.batch(rays).count_hits();
    auto lists = bvh.batch(rays).all_hits();
    auto surfaces = bvh.batch(rays).surfaces();
    auto occluders = bvh.batch(rays).occluders();
    CHECK(lists.size() == rays.size());
    std::vector<antumbra::PrimId> except;
    for (std::size_t ray = 0; ray < rays.size(); ++ray) {
        bool is = antumbra::is_hit(hits[ray]);
        CHECK(dark[ray] == is && bvh.occluded(rays[ray]) == is && (bits[ray / 64] >> ray % 64 & 1) == is);
        CHECK(bvh.intersect(rays[ray]).has_value() == is && bvh.surface(rays[ray]).has_value() == is);
        CHECK(bvh.occluder(rays[ray]).has_value() == is && (occluders[ray].geom_id == 0) == is);
        CHECK(antumbra::is_hit(surfaces[ray]) == is && counts[ray] == lists[ray].size());
        except.push_back(antumbra::prim_of(hits[ray]));
    }
    auto behind = bvh.batch(rays).except(except).intersect();
    for (std::size_t ray = 0; ray < rays.size(); ++ray) {
        CHECK(antumbra::is_hit(behind[ray]) == (lists[ray].size() > 1));
        CHECK(lists[ray].size() < 2 || lists[ray][1].prim_id == behind[ray].prim_id);
    }

    // Filters and visitors are lambdas, and what they throw comes out.
    auto odd = bvh.batch(rays).filter([](std::size_t, const antumbra::Hit &hit) { return hit.prim_id % 2 == 1; }).intersect();
    for (const auto &hit : odd) {
        CHECK(!antumbra::is_hit(hit) || hit.prim_id % 2 == 1);
    }
    std::vector<std::uint32_t> visited(rays.size());
    bvh.batch(rays).threads(threads).visit_hits([&](std::size_t ray, const antumbra::Hit &) {
        ++visited[ray];
        return ANTUMBRA_REJECT;
    });
    CHECK(visited == counts);
    struct Thrown {};
    bool caught = false;
    try {
        bvh.batch(rays).filter([](std::size_t, const antumbra::Hit &) -> bool { throw Thrown(); }).occluded();
    } catch (const Thrown &) {
        caught = true;
    }
    CHECK(caught);
    caught = false;
    try {
        bvh.batch(rays).visit_hits([](std::size_t, const antumbra::Hit &) -> int { throw Thrown(); });
    } catch (const Thrown &) {
        caught = true;
    }
    CHECK(caught);
    caught = false;
    try {
        antumbra::Bvh none(scene, antumbra::Build().progress([](float) { throw Thrown(); }));
    } catch (const Thrown &) {
        caught = true;
    }
    CHECK(caught);
    CHECK(failure([&] { antumbra::Bvh(scene, antumbra::Build().cancelled([] { return true; })); }) == ANTUMBRA_CANCELLED);
    CHECK(failure([] { antumbra::Recipe("best"); }) == ANTUMBRA_INVALID_ARGUMENT);
    CHECK(failure([&] { bvh.batch(rays).except(antumbra::span<const antumbra::PrimId>()); }) == ANTUMBRA_INVALID_ARGUMENT);
    CHECK(failure([&] { antumbra::Bvh::load("/no/such/file"); }) == ANTUMBRA_IO);
    CHECK(failure([&] { plain.add_triangles(std::vector<float>(10)); }) == ANTUMBRA_INVALID_ARGUMENT);

    // Handles move.
    antumbra::Bvh moved = std::move(other);
    CHECK(other.get() == nullptr && moved.occluded(rays[0]) == (dark[0] == 1));
    CHECK(failure([&] { (void)other.occluded(rays[0]); }) == ANTUMBRA_INVALID_ARGUMENT);
    other = std::move(moved);
    CHECK(other.occluded(rays[0]) == (dark[0] == 1));
    antumbra::Scene taken = std::move(plain);
    CHECK(taken.geometry_count() == 1);

    // User geometry: an object, kept as long as a tree needs it; and two lambdas.
    std::string path = std::string(argv[1]) + "/balls.antumbra";
    auto alive = std::make_shared<int>(1);
    auto balls = std::make_shared<Balls>(Balls{{{0, 0, 5, 1}, {4, 0, 5, 2}}, alive});
    {
        antumbra::Scene own;
        own.add_user(2, balls);
        antumbra::Bvh tree(own);
        CHECK(alive.use_count() == 2);
        auto surface = tree.surface(antumbra::ray({0, 0, 0}, {0, 0, 1}));
        CHECK(surface && surface->hit.t == 4 && surface->hit.v == 2 && surface->normal[2] == -1);
        CHECK(!tree.occluded(antumbra::ray({2, 2, 0}, {0, 0, 1})));
        std::vector<std::array<float, 3>> points{{4, 0, 0}};
        CHECK(tree.points(points).closest()[0].distance == 3 && tree.points(points).within(2.5f).closest()[0].geom_id != 0);
        CHECK(tree.points(points).within(9.0f).all()[0].size() == 2);
        tree.save(path);
        CHECK(failure([&] { antumbra::Bvh::load(path); }) == ANTUMBRA_OTHER_FUNCTIONS);
        CHECK(failure([&] { antumbra::Bvh::load(path, antumbra::Functions().user(balls).user(balls)); }) ==
              ANTUMBRA_OTHER_FUNCTIONS);
        antumbra::Bvh loaded = antumbra::Bvh::load(path, antumbra::Functions().user(balls));
        CHECK(loaded.intersect(antumbra::ray({0, 0, 0}, {0, 0, 1}))->t == 4);
    }
    CHECK(balls.use_count() == 1);
    {
        antumbra::Scene own;
        own.add_user(3, antumbra::user(
                            [](std::uint32_t id) {
                                float z = static_cast<float>(id);
                                return antumbra::Box{{-1, -1, z}, {1, 1, z}};
                            },
                            [](std::uint32_t id, const antumbra::Ray &ray) -> std::optional<antumbra::UserHit> {
                                return antumbra::UserHit{(static_cast<float>(id) - ray.org[2]) / ray.dir[2], 0, 0};
                            }));
        antumbra::Bvh tree(own);
        CHECK(tree.batch(std::vector<antumbra::Ray>{antumbra::ray({0, 0, -1}, {0, 0, 1})}).count_hits()[0] == 3);
        std::vector<float> at{0, 0, 9};
        CHECK(failure([&] { (void)tree.points(at).closest(); }) == ANTUMBRA_UNSUPPORTED);
    }

    // Opacity, masks, groups, worlds.
    antumbra::Scene veil;
    veil.add_triangles(std::vector<float>{0, 0, 1, 1, 0, 1, 0, 1, 1}, std::vector<std::uint32_t>{0, 1, 2});
    veil.set_opacity(0, [](const antumbra::Candidate &at) { return at.u < 0.5f ? 1.0f : 0.0f; });
    antumbra::Bvh through(veil);
    CHECK(through.occluded(antumbra::ray({0.2f, 0.2f, 0}, {0, 0, 1})));
    CHECK(!through.occluded(antumbra::ray({0.7f, 0.2f, 0}, {0, 0, 1})));
    std::vector<std::uint32_t> masks{2};
    through.set_masks(masks);
    std::vector<antumbra::Ray> one{antumbra::ray({0.2f, 0.2f, 0}, {0, 0, 1})};
    CHECK(through.batch(one).mask(2).occluded()[0] == 1 && through.batch(one).mask(1).occluded()[0] == 0);
    CHECK(through.batch(one).masks(masks).occluded()[0] == 1);

    antumbra::Directions directions(std::vector<float>{0, 0, 1, 0, 0, -1});
    auto open = through.group(std::vector<float>{0.2f, 0.2f, 0}, directions).open();
    CHECK(open.size() == 1 && open[0] == 2);

    std::vector<antumbra::Object> objects;
    objects.emplace_back(scene);
    antumbra::World world(objects, std::vector<antumbra::Instance>{antumbra::instance(0, {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0})});
    antumbra::View tree = world.bvh();
    for (std::size_t ray = 0; ray < 100; ++ray) {
        CHECK(tree.occluded(rays[ray]) == (dark[ray] == 1) && objects[0].bvh().occluded(rays[ray]) == (dark[ray] == 1));
    }
    world.set_instances(std::vector<antumbra::Instance>{antumbra::instance(0, {1, 0, 0, 50, 0, 1, 0, 0, 0, 0, 1, 0})});
    for (std::size_t ray = 0; ray < 100; ++ray) {
        CHECK(!tree.occluded(rays[ray]));
    }
    CHECK(world.add_object(objects[0]) == 1 && world.quality(0) == 1);
    world.refit(0, scene, {});
    antumbra::World beside = world.copy();
    world.adopt(beside.relearn(rays));
    world.save(path);
    CHECK(antumbra::World::load(path).bvh().report().instances == 0);
    bvh.refit(scene, &threads);
    bvh.adopt(bvh.copy().relearn(rays, recipe));
    CHECK(std::fabs(bvh.quality() - 1) < 0.01);
    std::puts("layer: ok");
    return 0;
}
