/* Compares hits on flat curves of two libraries with Embree's interface:
 *
 *     cc -O1 tests/embree/curves.c -o curves -ldl -lm && ./curves EMBREE-LIBRARY OUR-LIBRARY [instance]
 *
 * 60 000 random rays at 400 random curves of each kind, straight and bent. With a third argument the curves are in an
 * instance. Prints a line for each kind. */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { CURVES = 400, RAYS = 60000, FLOAT4 = 0x9004, UINT = 0x5001, FLOAT3X4_COLUMN_MAJOR = 0x9234 };

typedef struct {
    float org[3], tnear, dir[3], time, tfar;
    unsigned mask, id, flags;
    float ng[3], u, v;
    unsigned prim, geom, inst, inst_prim;
} __attribute__((aligned(16))) RayHit;

typedef struct {
    void *device, *scene;
    void *(*new_device)(const char *), *(*new_scene)(void *), *(*new_geometry)(void *, int);
    void *(*new_buffer)(void *, int, unsigned, int, size_t, size_t);
    void (*commit_geometry)(void *), (*commit)(void *), (*intersect)(void *, RayHit *, void *), (*occluded)(void *, RayHit *, void *);
    void (*set_scene)(void *, void *), (*set_transform)(void *, unsigned, int, const void *);
    unsigned (*attach)(void *, void *);
} Library;

static void *symbol(void *library, const char *name) {
    void *found = dlsym(library, name);
    if (found == NULL) {
        fprintf(stderr, "%s is missing\n", name);
        exit(1);
    }
    return found;
}

static Library load(const char *path) {
    Library loaded;
    void *library = dlopen(path, RTLD_NOW | RTLD_LOCAL | RTLD_DEEPBIND);
    if (library == NULL) {
        fprintf(stderr, "%s\n", dlerror());
        exit(1);
    }
    *(void **)&loaded.new_device = symbol(library, "rtcNewDevice");
    *(void **)&loaded.new_scene = symbol(library, "rtcNewScene");
    *(void **)&loaded.new_geometry = symbol(library, "rtcNewGeometry");
    *(void **)&loaded.new_buffer = symbol(library, "rtcSetNewGeometryBuffer");
    *(void **)&loaded.commit_geometry = symbol(library, "rtcCommitGeometry");
    *(void **)&loaded.commit = symbol(library, "rtcCommitScene");
    *(void **)&loaded.intersect = symbol(library, "rtcIntersect1");
    *(void **)&loaded.occluded = symbol(library, "rtcOccluded1");
    *(void **)&loaded.attach = symbol(library, "rtcAttachGeometry");
    *(void **)&loaded.set_scene = symbol(library, "rtcSetGeometryInstancedScene");
    *(void **)&loaded.set_transform = symbol(library, "rtcSetGeometryTransform");
    loaded.device = loaded.new_device("threads=1");
    return loaded;
}

static uint64_t state = 1;
static float number(void) {
    state = state * 6364136223846793005ull + 1442695040888963407ull;
    return (float)(state >> 40) / 16777216.0f;
}

/* Four points for each curve, which turn by `bend` from one to the next. */
static void make(float points[CURVES][4][4], float bend) {
    for (int curve = 0; curve < CURVES; ++curve) {
        float at[3] = {number(), number(), number()}, way[3] = {number() - 0.5f, number() - 0.5f, number() - 0.5f};
        for (int point = 0; point < 4; ++point) {
            for (int axis = 0; axis < 3; ++axis) {
                points[curve][point][axis] = at[axis];
                at[axis] += 0.1f * way[axis];
                way[axis] += bend * (number() - 0.5f);
            }
            points[curve][point][3] = 0.005f + 0.01f * number();
        }
    }
}

static void build(Library *library, int kind, float points[CURVES][4][4], int is_instanced) {
    void *geometry = library->new_geometry(library->device, kind), *scene = library->new_scene(library->device);
    memcpy(library->new_buffer(geometry, 1, 0, FLOAT4, 16, 4 * CURVES), points, CURVES * 64);
    unsigned *first = library->new_buffer(geometry, 0, 0, UINT, 4, CURVES);
    for (unsigned curve = 0; curve < CURVES; ++curve) first[curve] = 4 * curve;
    library->commit_geometry(geometry);
    library->attach(scene, geometry);
    library->commit(scene);
    library->scene = scene;
    if (is_instanced) {
        static const float transform[12] = {2, 0, 0, 0.5f, 1, 0, 0, 0, 1.5f, 0.1f, 0.2f, 0.3f};
        void *instance = library->new_geometry(library->device, 121), *world = library->new_scene(library->device);
        library->set_scene(instance, scene);
        library->set_transform(instance, 0, FLOAT3X4_COLUMN_MAJOR, transform);
        library->commit_geometry(instance);
        library->attach(world, instance);
        library->commit(world);
        library->scene = world;
    }
}

int main(int argc, char **argv) {
    static const struct { const char *name; int kind; } kinds[] = {{"linear", 17}, {"Bezier", 25}, {"B-spline", 33}, {"Catmull-Rom", 59}};
    static float points[CURVES][4][4];
    if (argc < 3) {
        fprintf(stderr, "usage: curves EMBREE-LIBRARY OUR-LIBRARY [instance]\n");
        return 2;
    }
    Library libraries[2] = {load(argv[1]), load(argv[2])};
    for (int which = 0; which < 8; ++which) {
        float bend = which % 2 ? 0.6f : 0.1f;
        long hits = 0, alone[2] = {0, 0}, other = 0, far = 0, shadows = 0;
        double most = 0;
        make(points, bend);
        for (int library = 0; library < 2; ++library) build(&libraries[library], kinds[which / 2].kind, points, argc > 3);
        for (long ray = 0; ray < RAYS; ++ray) {
            RayHit made, found[2], shadow[2];
            float scale = 0.2f + 3 * number();
            memset(&made, 0, sizeof made);
            for (int axis = 0; axis < 3; ++axis) made.org[axis] = (argc > 3 ? 2 : 1) * number();
            for (int axis = 0; axis < 3; ++axis) made.dir[axis] = scale * (number() - 0.5f);
            made.tfar = INFINITY;
            made.mask = made.prim = made.geom = made.inst = made.inst_prim = ~0u;
            for (int library = 0; library < 2; ++library) {
                found[library] = shadow[library] = made;
                libraries[library].intersect(libraries[library].scene, &found[library], NULL);
                libraries[library].occluded(libraries[library].scene, &shadow[library], NULL);
                shadows += (shadow[library].tfar < 0) != (found[library].geom != ~0u);
            }
            int is_hit[2] = {found[0].geom != ~0u, found[1].geom != ~0u};
            hits += is_hit[0];
            if (is_hit[0] != is_hit[1]) {
                ++alone[is_hit[1]];
            } else if (is_hit[0] && (found[0].prim != found[1].prim || found[0].inst != found[1].inst)) {
                ++other;
            } else if (is_hit[0]) {
                double off = fmax(fabs(found[0].u - found[1].u), fabs(found[0].v - found[1].v));
                off = fmax(off, scale * fabs(found[0].tfar - found[1].tfar));
                for (int axis = 0; axis < 3; ++axis) off = fmax(off, fabs(found[0].ng[axis] - found[1].ng[axis]));
                far += off > 1e-3;
                most = fmax(most, off > 1e-3 ? 0 : off);
            }
        }
        printf("%-11s bend %.1f: %ld rays hit, %ld only the first, %ld only the second, %ld another primitive, %ld another place, others within %.0e; %ld shadows differ from hits\n",
               kinds[which / 2].name, bend, hits, alone[0], alone[1], other, far, most, shadows);
    }
    return 0;
}
