// Moving instances: 200 tori fly through a box, frame by frame.
//
//     moving_instances [FRAMES]
//
// The torus is built once. Each frame places the instances again and renders a picture of 160 x 90 pixels: camera rays, then a
// shadow ray from each surface that is hit. Prints what the last frame saw and how long frames took.
#include <antumbra.hpp>

#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <random>
#include <vector>

namespace {

struct Vertex {
    float x, y, z;
};
using Triangle = std::array<std::uint32_t, 3>;

constexpr float turn = 6.2831853f;

// A torus around the z axis.
void torus(std::vector<Vertex> &vertices, std::vector<Triangle> &triangles) {
    const std::uint32_t around = 48, across = 24;
    for (std::uint32_t i = 0; i < around; ++i) {
        for (std::uint32_t j = 0; j < across; ++j) {
            float u = turn * static_cast<float>(i) / around, v = turn * static_cast<float>(j) / across;
            float radius = 1 + 0.35f * std::cos(v);
            vertices.push_back({radius * std::cos(u), radius * std::sin(u), 0.35f * std::sin(v)});
            std::uint32_t next = (i + 1) % around, up = (j + 1) % across;
            triangles.push_back({i * across + j, next * across + j, next * across + up});
            triangles.push_back({i * across + j, next * across + up, i * across + up});
        }
    }
}

// Something that flies and turns.
struct Flight {
    std::array<float, 3> from, speed;
    float spin;
};

// Where it is at a time: in a box of side 20 that it leaves on one side and enters on the other.
antumbra::Instance place(const Flight &flight, float time) {
    std::array<float, 3> at{};
    for (std::size_t axis = 0; axis < 3; ++axis) {
        float x = flight.from[axis] + time * flight.speed[axis];
        at[axis] = x - 20 * std::floor(x / 20 + 0.5f);
    }
    float sine = std::sin(flight.spin * time), cosine = std::cos(flight.spin * time);
    return antumbra::instance(0, {cosine, 0, sine, at[0], 0, 1, 0, at[1], -sine, 0, cosine, at[2]});
}

double seconds() {
    return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

int run(int frames) {
    std::vector<Vertex> vertices;
    std::vector<Triangle> triangles;
    torus(vertices, triangles);
    antumbra::Scene scene;
    scene.add_triangles(vertices, triangles);
    std::vector<antumbra::Object> objects;
    objects.emplace_back(scene);

    std::mt19937 random(1);
    auto between = [&](float low, float high) {
        return low + (high - low) * static_cast<float>(random()) / static_cast<float>(std::mt19937::max());
    };
    std::vector<Flight> flights(200);
    for (Flight &flight : flights) {
        for (std::size_t axis = 0; axis < 3; ++axis) {
            flight.from[axis] = between(-10, 10);
            flight.speed[axis] = between(-1, 1);
        }
        flight.spin = between(-2, 2);
    }
    std::vector<antumbra::Instance> instances;
    for (const Flight &flight : flights) {
        instances.push_back(place(flight, 0));
    }
    // ANCHOR: world
    antumbra::World world(objects, instances);
    antumbra::View tree = world.bvh();
    // ANCHOR_END: world

    const std::size_t width = 160, height = 90;
    std::vector<antumbra::Ray> camera(width * height), shadow(width * height);
    for (std::size_t pixel = 0; pixel < camera.size(); ++pixel) {
        float x = (static_cast<float>(pixel % width) + 0.5f) / width - 0.5f;
        float y = (static_cast<float>(pixel / width) + 0.5f) / height - 0.5f;
        camera[pixel] = antumbra::ray({0, 0, -25}, {1.6f * x, 0.9f * y, 1});
    }
    std::vector<antumbra::Surface> surfaces(camera.size());
    std::vector<std::uint8_t> dark(camera.size());
    double moving = 0, tracing = 0;
    std::size_t seen = 0, lit = 0;
    for (int frame = 0; frame < frames; ++frame) {
        double start = seconds();
        // ANCHOR: move
        for (std::size_t index = 0; index < flights.size(); ++index) {
            instances[index] = place(flights[index], 0.04f * static_cast<float>(frame));
        }
        world.set_instances(instances);
        // ANCHOR_END: move
        double moved = seconds();

        tree.batch(camera).surfaces_into(surfaces);
        float offset = tree.origin_offset();
        for (std::size_t pixel = 0; pixel < camera.size(); ++pixel) {
            const antumbra::Surface &surface = surfaces[pixel];
            std::array<float, 3> from{};
            for (std::size_t axis = 0; axis < 3; ++axis) {
                // Off the surface, to the side of the camera.
                float side = surface.normal[0] * camera[pixel].dir[0] + surface.normal[1] * camera[pixel].dir[1] +
                             surface.normal[2] * camera[pixel].dir[2];
                from[axis] = surface.position[axis] - std::copysign(offset, side) * surface.normal[axis];
            }
            // Rays of pixels that see nothing begin at infinity and hit nothing.
            shadow[pixel] = antumbra::between(from, {10, 30, -20});
        }
        tree.batch(shadow).occluded_into(dark);
        seen = lit = 0;
        for (std::size_t pixel = 0; pixel < camera.size(); ++pixel) {
            bool is_hit = antumbra::is_hit(surfaces[pixel]);
            seen += is_hit;
            lit += is_hit && dark[pixel] == 0;
        }
        moving += moved - start;
        tracing += seconds() - moved;
    }
    std::printf("%zu instances, %d frames: %zu of %zu pixels see one, %zu are lit\n", flights.size(), frames, seen, camera.size(),
                lit);
    std::printf("per frame: moving %.2f ms, tracing %.2f ms\n", 1e3 * moving / frames, 1e3 * tracing / frames);
    return seen > 0 ? 0 : 1;
}

} // namespace

int main(int argc, char **argv) {
    try {
        int frames = argc > 1 ? std::atoi(argv[1]) : 60;
        return run(frames > 0 ? frames : 1);
    } catch (const antumbra::Error &error) {
        std::fprintf(stderr, "%s: %s\n", antumbra_status_text(error.status()), error.what());
        return 1;
    }
}
