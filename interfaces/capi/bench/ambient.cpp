// Ambient occlusion of the vertices of a mesh in C++: antumbra.hpp beside Embree 4 with packets of 16.
//
//     ambient EMBREE-LIBRARY [FILE.obj]
//
// All programs answer the same rays: 512 directions around, of which each vertex has those above its surface. Embree's program
// gives it packets of 16 neighbouring directions of one vertex, with and without the flag for coherent rays, and single rays.
// Ours are groups, and batches of the rays of 64 vertices. CPU time of the process, one thread, interleaved turns, medians; the
// time holds the build of the tree. Answers are compared first.
#include <antumbra.hpp>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <ctime>
#include <dlfcn.h>
#include <string>

namespace {

struct Vec {
    float x, y, z;
};

Vec operator+(Vec a, Vec b) { return {a.x + b.x, a.y + b.y, a.z + b.z}; }
Vec operator-(Vec a, Vec b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }
Vec operator*(float s, Vec a) { return {s * a.x, s * a.y, s * a.z}; }
float dot(Vec a, Vec b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
Vec cross(Vec a, Vec b) { return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x}; }

using Triangle = std::array<std::uint32_t, 3>;

struct Mesh {
    std::vector<Vec> positions, normals, points;
    std::vector<Triangle> triangles;
};

void read_obj(const char *path, Mesh &mesh) {
    std::FILE *file = std::fopen(path, "r");
    if (file == nullptr) {
        std::perror(path);
        std::exit(1);
    }
    char line[4096];
    while (std::fgets(line, sizeof line, file) != nullptr) {
        Vec v{};
        if (std::sscanf(line, "v %f %f %f", &v.x, &v.y, &v.z) == 3) {
            mesh.positions.push_back(v);
        } else if (line[0] == 'f' && line[1] == ' ') {
            std::vector<std::uint32_t> corners;
            for (char *word = std::strtok(line + 2, " \r\n"); word != nullptr; word = std::strtok(nullptr, " \r\n")) {
                corners.push_back(static_cast<std::uint32_t>(std::strtol(word, nullptr, 10) - 1));
            }
            for (std::size_t corner = 2; corner < corners.size(); ++corner) {
                mesh.triangles.push_back({corners[0], corners[corner - 1], corners[corner]});
            }
        }
    }
    std::fclose(file);
}

// A field of towers, as in the example ambient_occlusion.c.
void towers(std::uint32_t side, Mesh &mesh) {
    std::uint32_t seed = 1;
    std::vector<float> tops((side / 8 + 1) * (side / 8 + 1));
    for (float &top : tops) {
        seed = seed * 1664525u + 1013904223u;
        top = static_cast<float>(seed >> 24) / 16;
    }
    for (std::uint32_t y = 0; y < side; ++y) {
        for (std::uint32_t x = 0; x < side; ++x) {
            float top = x % 8 < 4 && y % 8 < 4 ? tops[y / 8 * (side / 8 + 1) + x / 8] : 0;
            mesh.positions.push_back({static_cast<float>(x), static_cast<float>(y), top});
        }
    }
    for (std::uint32_t y = 0; y + 1 < side; ++y) {
        for (std::uint32_t x = 0; x + 1 < side; ++x) {
            std::uint32_t corner = y * side + x;
            mesh.triangles.push_back({corner, corner + 1, corner + side + 1});
            mesh.triangles.push_back({corner, corner + side + 1, corner + side});
        }
    }
}

// Numbers vertices along a curve through space, so that neighbours in the list are neighbours there: for all programs.
void sort_along_curve(Mesh &mesh) {
    Vec low = mesh.positions[0], high = low;
    for (Vec p : mesh.positions) {
        low = {std::min(low.x, p.x), std::min(low.y, p.y), std::min(low.z, p.z)};
        high = {std::max(high.x, p.x), std::max(high.y, p.y), std::max(high.z, p.z)};
    }
    float side = std::max({high.x - low.x, high.y - low.y, high.z - low.z, 1e-30f});
    auto spread = [](float x) {
        std::uint64_t bits = static_cast<std::uint64_t>(x * 2097151);
        bits = (bits | bits << 32) & 0x1f00000000ffffu, bits = (bits | bits << 16) & 0x1f0000ff0000ffu;
        bits = (bits | bits << 8) & 0x100f00f00f00f00fu, bits = (bits | bits << 4) & 0x10c30c30c30c30c3u;
        return (bits | bits << 2) & 0x1249249249249249u;
    };
    std::vector<std::pair<std::uint64_t, std::uint32_t>> keys;
    for (std::uint32_t vertex = 0; vertex < mesh.positions.size(); ++vertex) {
        Vec p = 1 / side * (mesh.positions[vertex] - low);
        keys.push_back({spread(p.x) | spread(p.y) << 1 | spread(p.z) << 2, vertex});
    }
    std::sort(keys.begin(), keys.end());
    std::vector<Vec> positions;
    std::vector<std::uint32_t> place(keys.size());
    for (auto [key, vertex] : keys) {
        place[vertex] = static_cast<std::uint32_t>(positions.size());
        positions.push_back(mesh.positions[vertex]);
    }
    mesh.positions = positions;
    for (Triangle &triangle : mesh.triangles) {
        for (std::uint32_t &corner : triangle) {
            corner = place[corner];
        }
    }
}

// Normals of length 1, and points a little above the surface.
void finish(Mesh &mesh) {
    mesh.normals.assign(mesh.positions.size(), Vec{});
    float extent = 0;
    for (const Triangle &t : mesh.triangles) {
        Vec a = mesh.positions[t[0]];
        Vec normal = cross(mesh.positions[t[1]] - a, mesh.positions[t[2]] - a);
        for (std::uint32_t corner : t) {
            mesh.normals[corner] = mesh.normals[corner] + normal;
        }
    }
    for (Vec p : mesh.positions) {
        extent = std::max({extent, std::fabs(p.x), std::fabs(p.y), std::fabs(p.z)});
    }
    for (std::size_t vertex = 0; vertex < mesh.positions.size(); ++vertex) {
        Vec &normal = mesh.normals[vertex];
        float length = std::sqrt(dot(normal, normal));
        normal = length > 0 ? 1 / length * normal : Vec{};
        mesh.points.push_back(mesh.positions[vertex] + 1e-5f * extent * normal);
    }
}

// Directions around, 16 neighbours after another: squares of 4 x 4 in the height and the angle.
std::vector<Vec> directions_around() {
    std::vector<Vec> directions;
    for (int index = 0; index < 512; ++index) {
        int tile = index / 16, place = index % 16;
        float row = static_cast<float>(tile / 4 * 4 + place / 4) + 0.5f, column = static_cast<float>(tile % 4 * 4 + place % 4);
        float z = row / 16 - 1, turn = 6.2831853f * (column + 0.5f) / 16 + row, radius = std::sqrt(1 - z * z);
        directions.push_back({radius * std::cos(turn), radius * std::sin(turn), z});
    }
    return directions;
}

double seconds() {
    std::timespec time{};
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &time);
    return static_cast<double>(time.tv_sec) + 1e-9 * static_cast<double>(time.tv_nsec);
}

// Light and the weight of all directions of a vertex.
struct Sum {
    float light = 0, weight = 0;
    void add(float cosine, bool open) {
        weight += cosine;
        light += open ? cosine : 0;
    }
    float share() const { return weight > 0 ? light / weight : 1; }
};

using Result = std::vector<float>;

antumbra::Bvh build(const Mesh &mesh, const antumbra::Threads &threads) {
    antumbra::Scene scene;
    scene.add_triangles(mesh.positions, mesh.triangles);
    return antumbra::Bvh(scene, antumbra::Build().threads(threads));
}

Result by_groups(const Mesh &mesh, const std::vector<Vec> &directions, const antumbra::Threads &threads) {
    antumbra::Bvh bvh = build(mesh, threads);
    antumbra::Directions prepared(directions);
    std::vector<std::uint64_t> open =
        bvh.group(mesh.points, prepared).above(mesh.normals).on_this_thread().open();
    Result result;
    for (std::size_t vertex = 0; vertex < mesh.points.size(); ++vertex) {
        Sum sum;
        const std::uint64_t *row = open.data() + vertex * prepared.words_per_row();
        for (std::size_t index = 0; index < directions.size(); ++index) {
            float cosine = dot(mesh.normals[vertex], directions[index]);
            if (cosine > 0) {
                sum.add(cosine, row[index / 64] >> index % 64 & 1);
            }
        }
        result.push_back(sum.share());
    }
    return result;
}

Result by_batches(const Mesh &mesh, const std::vector<Vec> &directions, const antumbra::Threads &threads) {
    antumbra::Bvh bvh = build(mesh, threads);
    std::vector<antumbra::Ray> rays;
    std::vector<float> cosines;
    std::vector<std::uint8_t> dark;
    std::vector<std::size_t> ends;
    Result result;
    for (std::size_t first = 0; first < mesh.points.size(); first += 64) {
        std::size_t last = std::min(first + 64, mesh.points.size());
        rays.clear(), cosines.clear(), ends.clear();
        for (std::size_t vertex = first; vertex < last; ++vertex) {
            Vec p = mesh.points[vertex];
            for (Vec d : directions) {
                float cosine = dot(mesh.normals[vertex], d);
                if (cosine > 0) {
                    rays.push_back(antumbra::ray({p.x, p.y, p.z}, {d.x, d.y, d.z}));
                    cosines.push_back(cosine);
                }
            }
            ends.push_back(rays.size());
        }
        dark.resize(rays.size());
        bvh.batch(rays).on_this_thread().occluded_into(dark);
        std::size_t ray = 0;
        for (std::size_t end : ends) {
            Sum sum;
            for (; ray < end; ++ray) {
                sum.add(cosines[ray], dark[ray] == 0);
            }
            result.push_back(sum.share());
        }
    }
    return result;
}

// What this program needs of Embree 4, declared after its documentation.
struct alignas(64) Packet {
    float org[3][16], tnear[16], dir[3][16], time[16], tfar[16];
    unsigned mask[16], id[16], flags[16];
};
struct alignas(16) Single {
    float org[3], tnear, dir[3], time, tfar;
    unsigned mask, id, flags;
};
struct Arguments {
    int flags;
    unsigned features;
    void *context, *filter, *occluded;
};

struct Embree {
    void *library;
    void *(*new_device)(const char *);
    void *(*new_scene)(void *);
    void *(*new_geometry)(void *, int);
    void *(*new_buffer)(void *, int, unsigned, int, std::size_t, std::size_t);
    void (*commit_geometry)(void *);
    unsigned (*attach)(void *, void *);
    void (*release_geometry)(void *);
    void (*commit)(void *);
    void (*release)(void *);
    void (*occluded1)(void *, Single *, const Arguments *);
    void (*occluded16)(const int *, void *, Packet *, const Arguments *);
    void *device;

    template <class F> void load(F &function, const char *name) {
        void *symbol = dlsym(library, name);
        if (symbol == nullptr) {
            std::fprintf(stderr, "%s is missing\n", name);
            std::exit(1);
        }
        std::memcpy(&function, &symbol, sizeof function);
    }
    explicit Embree(const char *path) : library(dlopen(path, RTLD_NOW)) {
        if (library == nullptr) {
            std::fprintf(stderr, "%s\n", dlerror());
            std::exit(1);
        }
        load(new_device, "rtcNewDevice"), load(new_scene, "rtcNewScene"), load(new_geometry, "rtcNewGeometry");
        load(new_buffer, "rtcSetNewGeometryBuffer"), load(commit_geometry, "rtcCommitGeometry");
        load(attach, "rtcAttachGeometry"), load(release_geometry, "rtcReleaseGeometry"), load(commit, "rtcCommitScene");
        load(release, "rtcReleaseScene"), load(occluded1, "rtcOccluded1"), load(occluded16, "rtcOccluded16");
        device = new_device("threads=1");
    }
    void *build(const Mesh &mesh) const {
        void *geometry = new_geometry(device, 0), *scene = new_scene(device);
        // RTC_BUFFER_TYPE_VERTEX and RTC_FORMAT_FLOAT3, RTC_BUFFER_TYPE_INDEX and RTC_FORMAT_UINT3.
        void *vertices = new_buffer(geometry, 1, 0, 0x9003, sizeof(Vec), mesh.positions.size());
        void *indices = new_buffer(geometry, 0, 0, 0x5003, sizeof(Triangle), mesh.triangles.size());
        std::memcpy(vertices, mesh.positions.data(), mesh.positions.size() * sizeof(Vec));
        std::memcpy(indices, mesh.triangles.data(), mesh.triangles.size() * sizeof(Triangle));
        commit_geometry(geometry);
        attach(scene, geometry);
        release_geometry(geometry);
        commit(scene);
        return scene;
    }
};

Result by_packets(const Embree &embree, const Mesh &mesh, const std::vector<Vec> &directions, bool coherent) {
    void *scene = embree.build(mesh);
    // RTC_RAY_QUERY_FLAG_COHERENT, RTC_FEATURE_FLAG_ALL.
    Arguments arguments{coherent ? 1 << 16 : 0, 0xffffffffu, nullptr, nullptr, nullptr};
    alignas(64) int valid[16];
    Packet packet{};
    float cosines[16];
    Result result;
    for (std::size_t vertex = 0; vertex < mesh.points.size(); ++vertex) {
        Vec p = mesh.points[vertex];
        Sum sum;
        int count = 0;
        auto trace = [&] {
            for (int lane = 0; lane < 16; ++lane) {
                valid[lane] = lane < count ? -1 : 0;
            }
            embree.occluded16(valid, scene, &packet, &arguments);
            for (int lane = 0; lane < count; ++lane) {
                sum.add(cosines[lane], packet.tfar[lane] >= 0);
            }
            count = 0;
        };
        for (Vec d : directions) {
            float cosine = dot(mesh.normals[vertex], d);
            if (cosine <= 0) {
                continue;
            }
            packet.org[0][count] = p.x, packet.org[1][count] = p.y, packet.org[2][count] = p.z;
            packet.dir[0][count] = d.x, packet.dir[1][count] = d.y, packet.dir[2][count] = d.z;
            packet.tnear[count] = 0, packet.tfar[count] = INFINITY, packet.mask[count] = ~0u;
            cosines[count] = cosine;
            if (++count == 16) {
                trace();
            }
        }
        if (count > 0) {
            trace();
        }
        result.push_back(sum.share());
    }
    embree.release(scene);
    return result;
}

Result by_singles(const Embree &embree, const Mesh &mesh, const std::vector<Vec> &directions) {
    void *scene = embree.build(mesh);
    Result result;
    for (std::size_t vertex = 0; vertex < mesh.points.size(); ++vertex) {
        Vec p = mesh.points[vertex];
        Sum sum;
        for (Vec d : directions) {
            float cosine = dot(mesh.normals[vertex], d);
            if (cosine > 0) {
                Single ray{{p.x, p.y, p.z}, 0, {d.x, d.y, d.z}, 0, INFINITY, ~0u, 0, 0};
                embree.occluded1(scene, &ray, nullptr);
                sum.add(cosine, ray.tfar >= 0);
            }
        }
        result.push_back(sum.share());
    }
    embree.release(scene);
    return result;
}

} // namespace

int main(int argc, char **argv) {
    if (argc < 2) {
        std::fprintf(stderr, "usage: ambient EMBREE-LIBRARY [FILE.obj]\n");
        return 2;
    }
    Embree embree(argv[1]);
    antumbra::Threads threads(1);
    Mesh mesh;
    if (argc > 2) {
        read_obj(argv[2], mesh);
    } else {
        towers(250, mesh);
    }
    sort_along_curve(mesh);
    finish(mesh);
    std::vector<Vec> directions = directions_around();

    struct Program {
        const char *name;
        std::function<Result()> run;
        Result result;
        std::vector<double> times;
    };
    std::vector<Program> programs{
        {"Antumbra, groups", [&] { return by_groups(mesh, directions, threads); }, {}, {}},
        {"Antumbra, batches", [&] { return by_batches(mesh, directions, threads); }, {}, {}},
        {"Embree, packets of 16", [&] { return by_packets(embree, mesh, directions, false); }, {}, {}},
        {"Embree, packets of 16, coherent", [&] { return by_packets(embree, mesh, directions, true); }, {}, {}},
        {"Embree, single rays", [&] { return by_singles(embree, mesh, directions); }, {}, {}},
    };
    const char *turns_text = std::getenv("TURNS");
    int turns = turns_text == nullptr ? 5 : std::atoi(turns_text);
    for (int turn = 0; turn <= turns; ++turn) {
        for (Program &program : programs) {
            double start = seconds();
            program.result = program.run();
            if (turn > 0) {
                program.times.push_back(seconds() - start);
            }
        }
    }
    std::printf("%zu triangles, %zu vertices, %zu directions\n\n", mesh.triangles.size(), mesh.points.size(), directions.size());
    std::printf("| program | CPU s | time over groups | vertices that differ | mean |\n|---|---|---|---|---|\n");
    double best = 0;
    for (Program &program : programs) {
        std::sort(program.times.begin(), program.times.end());
        double time = program.times[program.times.size() / 2], mean = 0;
        best = best == 0 ? time : best;
        std::size_t differ = 0;
        for (std::size_t vertex = 0; vertex < program.result.size(); ++vertex) {
            differ += std::fabs(program.result[vertex] - programs[0].result[vertex]) > 1e-6f;
            mean += program.result[vertex];
        }
        std::printf("| %s | %.3f | %.2f | %zu | %.5f |\n", program.name, time, time / best, differ,
                    mean / static_cast<double>(mesh.points.size()));
    }
    return 0;
}
