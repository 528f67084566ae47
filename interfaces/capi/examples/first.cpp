// The first program in C++: what does a camera see, and what through glass?
#include <antumbra.hpp>

#include <cstdio>

struct Vertex {
    float x, y, z;
    float normal[3];
};

// Which hits count for one of the queries below. A lambda may have data of its own.
static bool is_glass(std::size_t, const antumbra::Hit &hit) { return hit.geom_id == 1; }

int main() {
    // Three panes behind each other; the one in the middle is of glass.
    std::vector<Vertex> vertices;
    std::vector<std::array<std::uint32_t, 3>> triangles{{0, 1, 2}};
    antumbra::Scene scene;
    for (float z : {1.0f, 2.0f, 3.0f}) {
        vertices = {{-1, -1, z, {}}, {1, -1, z, {}}, {0, 1, z, {}}};
        scene.add_triangles(vertices, triangles);
    }
    scene.set_mask(1, 2);
    antumbra::Bvh bvh(scene);

    // ANCHOR: conditions
    std::vector<antumbra::Ray> rays{antumbra::ray({0, 0, 0}, {0, 0, 1}), antumbra::ray({0, 0, 1.5f}, {0, 0, 1})};
    auto first = bvh.batch(rays).intersect();
    auto opaque = bvh.batch(rays).mask(1).intersect();
    auto glass = bvh.batch(rays).filter(is_glass).occluded();
    auto all = bvh.batch(rays).all_hits();
    // ANCHOR_END: conditions
    for (std::size_t ray = 0; ray < rays.size(); ++ray) {
        std::printf("ray %zu hits %u first, %u without glass, %zu panes in all, glass: %s\n", ray, first[ray].geom_id,
                    opaque[ray].geom_id, all[ray].size(), glass[ray] ? "yes" : "no");
    }

    // ANCHOR: errors
    try {
        scene.add_triangles(std::vector<float>{0, 0, 0}, std::vector<std::uint32_t>{0, 1, 2});
        antumbra::Bvh wrong(scene);
    } catch (const antumbra::Error &error) {
        std::printf("%s: %s\n", antumbra_status_text(error.status()), error.what());
    }
    // ANCHOR_END: errors
    return 0;
}
