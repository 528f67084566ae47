/* Calls the library as a client of Embree does, with declarations of its own. Exits with 0 if all is right. */
#include <math.h>
#include <pthread.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/resource.h>
#include <unistd.h>

typedef struct { _Alignas(16) float org[3]; float tnear, dir[3], time, tfar; unsigned mask, id, flags; } Ray;
typedef struct { _Alignas(16) float ng[3]; float u, v; unsigned prim, geom, inst, inst_prim; } Hit;
typedef struct { Ray ray; Hit hit; } RayHit;
typedef struct { _Alignas(64) float numbers[12][16]; } Ray16;
typedef struct { unsigned inst, inst_prim; } Context;
typedef struct { int *valid; void *user; Context *context; void *ray, *hit; unsigned n; } FilterArgs;
typedef struct { int *valid; void *user; unsigned prim; Context *context; void *ray; unsigned n, geom; } UserArgs;
typedef struct { void *user; unsigned prim, step; float *bounds; } BoundsArgs;
typedef struct { _Alignas(16) float point[3]; float time, radius; } PointQuery;
typedef struct { _Alignas(16) float to[16]; float from[16]; unsigned inst, inst_prim, size; } PointContext;
typedef struct { PointQuery *query; void *user; unsigned prim, geom; PointContext *context; float similarity; } PointArgs;

void *rtcNewDevice(const char *); void rtcReleaseDevice(void *); int rtcGetDeviceError(void *);
const char *rtcGetDeviceLastErrorMessage(void *);
void rtcSetDeviceErrorFunction(void *, void (*)(void *, int, const char *), void *);
void *rtcNewScene(void *); void rtcReleaseScene(void *); void rtcCommitScene(void *);
void *rtcNewGeometry(void *, int); void rtcReleaseGeometry(void *); void rtcCommitGeometry(void *);
unsigned rtcAttachGeometry(void *, void *); void rtcAttachGeometryByID(void *, void *, unsigned); void rtcDetachGeometry(void *, unsigned);
void *rtcSetNewGeometryBuffer(void *, int, unsigned, int, size_t, size_t);
void rtcSetSharedGeometryBuffer(void *, int, unsigned, int, const void *, size_t, size_t, size_t);
void rtcSetSceneFlags(void *, int); void rtcSetGeometryMask(void *, unsigned); void rtcDisableGeometry(void *);
void rtcSetGeometryInstancedScene(void *, void *); void rtcSetGeometryTransform(void *, unsigned, int, const void *);
void rtcSetGeometryIntersectFilterFunction(void *, void (*)(const FilterArgs *)); void rtcSetGeometryUserData(void *, void *);
void rtcSetGeometryUserPrimitiveCount(void *, unsigned); void rtcSetGeometryBoundsFunction(void *, void (*)(const BoundsArgs *), void *);
void rtcSetGeometryIntersectFunction(void *, void (*)(const UserArgs *)); void rtcSetGeometryOccludedFunction(void *, void (*)(const UserArgs *));
void rtcIntersect1(void *, RayHit *, void *); void rtcOccluded1(void *, Ray *, void *);
void rtcForwardIntersect1(const UserArgs *, void *, Ray *); void rtcForwardOccluded1(const UserArgs *, void *, Ray *);
void rtcOccluded16(const int *, void *, Ray16 *, void *);
void rtcOccluded1M(void *, Context *, Ray *, unsigned, size_t); void rtcIntersect1M(void *, Context *, RayHit *, unsigned, size_t);
bool rtcPointQuery(void *, PointQuery *, PointContext *, bool (*)(PointArgs *), void *);
void rtcCollide(void *, void *, void *, void *); void rtcSetGeometryTessellationRate(void *, float);

enum { FLOAT3 = 0x9003, FLOAT4 = 0x9004, UINT = 0x5001, UINT3 = 0x5003, UINT4 = 0x5004, FLOAT3X4_COLUMN_MAJOR = 0x9234 };

#define CHECK(x) do { if (!(x)) { printf("line %d: %s\n", __LINE__, #x); exit(1); } } while (0)

static RayHit ray(float x, float y, float z, float dx, float dy, float dz) {
    RayHit made;
    memset(&made, 0, sizeof made);
    made.ray = (Ray){{x, y, z}, 0, {dx, dy, dz}, 0, INFINITY, ~0u, 0, 0};
    made.hit.prim = made.hit.geom = made.hit.inst = made.hit.inst_prim = ~0u;
    return made;
}

static unsigned seed = 1;
static float number(void) { seed = seed * 1664525u + 1013904223u; return (float)(seed >> 8) / 16777216.0f; }

/* Random triangles in a cube. */
static void *mesh(void *device, unsigned count) {
    void *geometry = rtcNewGeometry(device, 0);
    float *positions = rtcSetNewGeometryBuffer(geometry, 1, 0, FLOAT3, 12, 3 * count);
    unsigned *indices = rtcSetNewGeometryBuffer(geometry, 0, 0, UINT3, 12, count);
    for (unsigned i = 0; i < count; ++i) {
        float center[3] = {number(), number(), number()};
        for (unsigned j = 0; j < 9; ++j) positions[9 * i + j] = center[j % 3] + 0.1f * number();
        for (unsigned j = 0; j < 3; ++j) indices[3 * i + j] = 3 * i + j;
    }
    rtcCommitGeometry(geometry);
    return geometry;
}

static void packets_and_streams(void *device) {
    enum { COUNT = 1600 };
    static Ray rays[COUNT], streamed[COUNT];
    static RayHit hits[COUNT], stream_hits[COUNT];
    void *scene = rtcNewScene(device), *geometry = mesh(device, 2000);
    unsigned found = 0;
    rtcAttachGeometry(scene, geometry);
    rtcCommitScene(scene);
    for (unsigned i = 0; i < COUNT; ++i) {
        hits[i] = ray(number(), number(), number(), number() - 0.5f, number() - 0.5f, number() - 0.5f);
        hits[i].ray.tfar = number();
        rays[i] = streamed[i] = hits[i].ray;
        stream_hits[i] = hits[i];
        rtcOccluded1(scene, &rays[i], NULL);
        rtcIntersect1(scene, &hits[i], NULL);
        found += hits[i].hit.geom == 0;
        CHECK((hits[i].hit.geom == 0) == (rays[i].tfar == -INFINITY));
    }
    CHECK(found > 100 && found < COUNT - 100);
    for (unsigned first = 0; first < COUNT; first += 16) {
        Ray16 packet;
        _Alignas(64) int valid[16];
        for (unsigned lane = 0; lane < 16; ++lane) {
            const float *numbers = streamed[first + lane].org;
            for (unsigned field = 0; field < 12; ++field) memcpy(&packet.numbers[field][lane], numbers + field, 4);
            valid[lane] = lane % 5 ? -1 : 0;
        }
        rtcOccluded16(valid, scene, &packet, NULL);
        for (unsigned lane = 0; lane < 16; ++lane)
            CHECK(packet.numbers[8][lane] == (valid[lane] ? rays : streamed)[first + lane].tfar);
    }
    rtcOccluded1M(scene, NULL, streamed, COUNT, sizeof(Ray));
    rtcIntersect1M(scene, NULL, stream_hits, COUNT, sizeof(RayHit));
    CHECK(memcmp(streamed, rays, sizeof rays) == 0);
    CHECK(memcmp(stream_hits, hits, sizeof hits) == 0);
    rtcReleaseGeometry(geometry);
    rtcReleaseScene(scene);
}

/* Hits at the ends: tnear < t <= tfar on triangles, tnear <= t <= tfar in robust scenes. Packets as single rays. */
static void ends_of_intervals(void *device) {
    for (int robust = 0; robust < 2; ++robust) {
        void *scene = rtcNewScene(device), *geometry = rtcNewGeometry(device, 0);
        float *positions = rtcSetNewGeometryBuffer(geometry, 1, 0, FLOAT3, 12, 3);
        unsigned *indices = rtcSetNewGeometryBuffer(geometry, 0, 0, UINT3, 12, 1);
        static const float corners[9] = {0, 0, 1, 4, 0, 1, 0, 4, 1};
        static const float intervals[5][2] = {{0, 1}, {1, 2}, {0, 0.9999f}, {1.0001f, 2}, {-3, 2}};
        const bool expected[5] = {true, robust, false, false, true};
        memcpy(positions, corners, sizeof corners);
        for (unsigned i = 0; i < 3; ++i) indices[i] = i;
        rtcCommitGeometry(geometry);
        rtcAttachGeometry(scene, geometry);
        rtcSetSceneFlags(scene, robust ? 4 : 0);
        rtcCommitScene(scene);
        for (unsigned i = 0; i < 6; ++i) {
            /* The last one starts on the triangle. */
            RayHit hit = ray(1, 1, i == 5, 0, 0, 1);
            bool is_hit = i == 5 ? robust : expected[i];
            Ray16 packet;
            _Alignas(64) int valid[16];
            if (i < 5) hit.ray.tnear = intervals[i][0], hit.ray.tfar = intervals[i][1];
            for (unsigned lane = 0; lane < 16; ++lane, valid[lane - 1] = -1)
                for (unsigned field = 0; field < 12; ++field) memcpy(&packet.numbers[field][lane], hit.ray.org + field, 4);
            rtcOccluded16(valid, scene, &packet, NULL);
            for (unsigned lane = 0; lane < 16; ++lane) CHECK((packet.numbers[8][lane] == -INFINITY) == is_hit);
            Ray single = hit.ray;
            rtcOccluded1(scene, &single, NULL);
            CHECK((single.tfar == -INFINITY) == is_hit);
            rtcIntersect1(scene, &hit, NULL);
            CHECK((hit.hit.geom == 0) == is_hit && (!is_hit || hit.ray.tfar == (i == 5 ? 0 : 1)));
        }
        rtcReleaseGeometry(geometry);
        rtcReleaseScene(scene);
    }
}

static unsigned calls;
static void reject_first(const FilterArgs *args) { args->valid[0] = *(unsigned *)args->user == calls++ ? -1 : 0; }

static void masks_filters_instances(void *device) {
    static const float square[4][3] = {{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}};
    static const unsigned corners[4] = {0, 1, 2, 3};
    static unsigned accepted = 1;
    void *inner = rtcNewScene(device), *outer = rtcNewScene(device), *quad = rtcNewGeometry(device, 1);
    rtcSetSharedGeometryBuffer(quad, 1, 0, FLOAT3, square, 0, 12, 4);
    rtcSetSharedGeometryBuffer(quad, 0, 0, UINT4, corners, 0, 16, 1);
    rtcSetGeometryMask(quad, 2);
    rtcSetGeometryUserData(quad, &accepted);
    rtcCommitGeometry(quad);
    rtcAttachGeometryByID(inner, quad, 7);
    rtcCommitScene(inner);
    for (unsigned i = 0; i < 2; ++i) {
        void *instance = rtcNewGeometry(device, 121);
        const float columns[12] = {2, 0, 0, 0, 2, 0, 0, 0, 2, 0, 0, 3 + (float)i};
        rtcSetGeometryInstancedScene(instance, inner);
        rtcSetGeometryTransform(instance, 0, FLOAT3X4_COLUMN_MAJOR, columns);
        rtcSetGeometryMask(instance, 6);
        rtcCommitGeometry(instance);
        rtcAttachGeometryByID(outer, instance, 10 + i);
        rtcReleaseGeometry(instance);
    }
    rtcCommitScene(outer);
    RayHit hit = ray(1.5f, 1, 0, 0, 0, 1);
    rtcIntersect1(outer, &hit, NULL);
    CHECK(hit.ray.tfar == 3 && hit.hit.geom == 7 && hit.hit.inst == 10 && hit.hit.inst_prim == 0 && hit.hit.u == 0.75f);
    CHECK(hit.hit.ng[0] == 0 && hit.hit.ng[1] == 0 && hit.hit.ng[2] == 1);
    hit = ray(1.5f, 1, 0, 0, 0, 1);
    hit.ray.mask = 4;
    rtcIntersect1(outer, &hit, NULL);
    CHECK(hit.hit.geom == ~0u);
    rtcSetGeometryIntersectFilterFunction(quad, reject_first);
    rtcCommitGeometry(quad);
    rtcCommitScene(inner);
    rtcCommitScene(outer);
    hit = ray(1.5f, 1, 0, 0, 0, 1);
    rtcIntersect1(outer, &hit, NULL);
    CHECK(hit.ray.tfar == 4 && hit.hit.inst == 11 && calls == 2);
    rtcReleaseGeometry(quad);
    rtcReleaseScene(inner);
    rtcReleaseScene(outer);
}

/* Horizontal plates of a unit square at heights. */
static void plate_bounds(const BoundsArgs *args) {
    float z = ((const float *)args->user)[args->prim], lower[3] = {0, 0, z}, upper[3] = {1, 1, z};
    memcpy(args->bounds, lower, 12);
    memcpy(args->bounds + 4, upper, 12);
}
static bool plate(const UserArgs *args, Ray *r, float *t) {
    *t = (((const float *)args->user)[args->prim] - r->org[2]) / r->dir[2];
    return args->valid[0] && r->tnear <= *t && *t <= r->tfar;
}
static bool forwards;
static void plate_intersect(const UserArgs *args) {
    if (forwards) rtcForwardIntersect1(args, NULL, args->ray);
    RayHit *r = args->ray;
    float t;
    if (!plate(args, &r->ray, &t)) return;
    r->ray.tfar = t;
    r->hit = (Hit){{0, 0, 5}, 0.25f, 0.5f, args->prim, args->geom, args->context->inst, ~0u};
}
static void plate_occluded(const UserArgs *args) {
    if (forwards) rtcForwardOccluded1(args, NULL, args->ray);
    Ray *r = args->ray;
    float t;
    if (plate(args, r, &t)) r->tfar = -INFINITY;
}

static bool shrink(PointArgs *args) {
    unsigned *near = args->user;
    *near = args->prim;
    ++calls;
    args->query->radius = 0.6f;
    return true;
}

static void user_geometry_and_points(void *device) {
    static float heights[3] = {3, 1, 2};
    void *scene = rtcNewScene(device), *plates = rtcNewGeometry(device, 120);
    rtcSetGeometryUserPrimitiveCount(plates, 3);
    rtcSetGeometryUserData(plates, heights);
    rtcSetGeometryBoundsFunction(plates, plate_bounds, NULL);
    rtcSetGeometryIntersectFunction(plates, plate_intersect);
    rtcSetGeometryOccludedFunction(plates, plate_occluded);
    rtcCommitGeometry(plates);
    rtcAttachGeometry(scene, plates);
    rtcCommitScene(scene);
    RayHit hit = ray(0.5f, 0.5f, 1.5f, 0, 0, 1);
    Ray up = hit.ray, down = hit.ray;
    rtcIntersect1(scene, &hit, NULL);
    CHECK(hit.ray.tfar == 0.5f && hit.hit.prim == 2 && hit.hit.ng[2] == 5 && hit.hit.u == 0.25f);
    up.tfar = 0.25f;
    rtcOccluded1(scene, &up, NULL);
    CHECK(up.tfar == 0.25f);
    down.dir[2] = -1;
    rtcOccluded1(scene, &down, NULL);
    CHECK(down.tfar == -INFINITY);
    /* What is not there is reported to the device of the query. */
    forwards = true;
    CHECK(rtcGetDeviceError(device) == 0);
    rtcIntersect1(scene, &hit, NULL);
    CHECK(rtcGetDeviceError(device) == 3);
    CHECK(strstr(rtcGetDeviceLastErrorMessage(device), "rtcForwardIntersect1") != NULL);
    up.tfar = 10;
    rtcOccluded1(scene, &up, NULL);
    CHECK(rtcGetDeviceError(device) == 3);
    forwards = false;
    PointQuery query = {{0.5f, 0.5f, 1.4f}, 0, 10};
    PointContext context;
    unsigned near = 9;
    memset(&context, 0, sizeof context);
    calls = 0;
    CHECK(rtcPointQuery(scene, &query, &context, shrink, &near));
    CHECK(calls == 2 && near == 2);
    rtcReleaseGeometry(plates);
    rtcReleaseScene(scene);
}

static bool count_call(PointArgs *args) {
    *(unsigned *)args->user |= 1u << args->prim;
    ++calls;
    return false;
}

/* A scene with flat curves, each of which begins at every fourth point. */
static void *strands(void *device, int kind, const float *points, unsigned count) {
    void *scene = rtcNewScene(device), *geometry = rtcNewGeometry(device, kind);
    CHECK(geometry != NULL);
    memcpy(rtcSetNewGeometryBuffer(geometry, 1, 0, FLOAT4, 16, 4 * count), points, 64 * count);
    unsigned *first = rtcSetNewGeometryBuffer(geometry, 0, 0, UINT, 4, count + 1);
    for (unsigned i = 0; i < count; ++i) first[i] = 4 * i;
    first[count] = 4 * count - 1; /* Its last point is out of range. */
    rtcCommitGeometry(geometry);
    rtcAttachGeometry(scene, geometry);
    rtcReleaseGeometry(geometry);
    rtcCommitScene(scene);
    return scene;
}

static RayHit down_at(void *scene, float x, float y, float z, float length) {
    RayHit hit = ray(x, y, z, 0, 0, -length);
    Ray shadow = hit.ray;
    Ray16 all;
    int valid[16];
    for (int lane = 0; lane < 16; ++lane) {
        valid[lane] = -1;
        for (int field = 0; field < 12; ++field) memcpy(&all.numbers[field][lane], (float *)&hit.ray + field, 4);
    }
    rtcIntersect1(scene, &hit, NULL);
    rtcOccluded1(scene, &shadow, NULL);
    rtcOccluded16(valid, scene, &all, NULL);
    for (int lane = 0; lane < 16; ++lane) CHECK((all.numbers[8][lane] < 0) == (hit.hit.prim != ~0u));
    CHECK((shadow.tfar < 0) == (hit.hit.prim != ~0u));
    return hit;
}

static void curves(void *device) {
    /* Two along x; every third number is a height of 0. */
    static const float points[2][4][4] = {
        {{0, 0, 0, 0.125f}, {1, 0, 0, 0.25f}, {2, 0, 0, 0.25f}, {3, 0, 0, 0.25f}},
        {{0, 4, 0, 0.25f}, {1, 4, 0, 0.25f}, {2, 4, 0, 0.25f}, {3, 4, 0, 0.25f}}};
    void *linear = strands(device, 17, points[0][0], 2);
    RayHit hit = down_at(linear, 0.5f, 0.125f, 5, 1);
    CHECK(hit.ray.tfar == 5 && hit.hit.prim == 0 && hit.hit.u == 0.5f && hit.hit.v == 0 && hit.hit.ng[0] == 1 && hit.hit.ng[1] == 0);
    CHECK(down_at(linear, 0.5f, 4.125f, 5, 1).hit.prim == 1);
    /* The radius is 3/16 in the middle. Both ends are round. */
    CHECK(down_at(linear, 0.5f, 0.25f, 5, 1).hit.prim == ~0u && down_at(linear, 2, 0, 5, 1).hit.prim == ~0u);
    CHECK(down_at(linear, -0.1f, 0, 5, 1).hit.u == 0 && down_at(linear, 1.2f, 0, 5, 1).hit.u == 1);
    CHECK(down_at(linear, -0.1f, 0.1f, 5, 1).hit.prim == ~0u && down_at(linear, -0.2f, 0, 5, 1).hit.prim == ~0u);
    /* Nothing is hit within two radii, whatever the length of the direction. */
    CHECK(down_at(linear, 0.5f, 0, 0.37f, 1).hit.prim == ~0u && down_at(linear, 0.5f, 0, 0.38f, 1).hit.prim == 0);
    CHECK(down_at(linear, 0.5f, 0, 0.37f, 0.25f).hit.prim == ~0u && down_at(linear, 0.5f, 0, 0.38f, 4).hit.prim == 0);

    void *bezier = strands(device, 25, points[0][0], 2);
    hit = down_at(bezier, 0.75f, 4.125f, 5, 1);
    CHECK(hit.ray.tfar == 5 && hit.hit.prim == 1 && fabsf(hit.hit.u - 0.25f) < 1e-6f && fabsf(fabsf(hit.hit.v) - 0.5f) < 1e-6f && hit.hit.ng[0] == 3);
    CHECK(hit.hit.v * down_at(bezier, 0.75f, 3.875f, 5, 1).hit.v < 0);
    /* The ends are flat. */
    CHECK(down_at(bezier, -0.1f, 4, 5, 1).hit.prim == ~0u && down_at(bezier, 2.9f, 4, 5, 1).hit.prim == 1);
    CHECK(down_at(bezier, 0.5f, 4, 0.45f, 1).hit.prim == ~0u && down_at(bezier, 0.5f, 4, 0.55f, 1).hit.prim == 1);
    void *spline = strands(device, 33, points[0][0], 2), *catmull_rom = strands(device, 59, points[0][0], 2);
    hit = down_at(spline, 1.5f, 4, 5, 1);
    CHECK(hit.hit.prim == 1 && fabsf(hit.hit.u - 0.5f) < 1e-6f);
    hit = down_at(catmull_rom, 1.75f, 4, 5, 1);
    CHECK(hit.hit.prim == 1 && fabsf(hit.hit.u - 0.75f) < 1e-6f);

    PointQuery query = {{1.5f, 2, 0}, 0, 10};
    PointContext context;
    unsigned seen = 0;
    memset(&context, 0, sizeof context);
    calls = 0;
    rtcPointQuery(bezier, &query, &context, count_call, &seen);
    CHECK(calls == 2 && seen == 3);
    void *triangles = rtcNewGeometry(device, 0);
    CHECK(rtcGetDeviceError(device) == 0);
    rtcSetGeometryTessellationRate(triangles, 2);
    CHECK(rtcGetDeviceError(device) == 3);
    rtcReleaseGeometry(triangles);
    rtcReleaseScene(linear);
    rtcReleaseScene(bezier);
    rtcReleaseScene(spline);
    rtcReleaseScene(catmull_rom);
}

static int last_code;
static void note(void *user, int code, const char *text) { (void)user; last_code = text[0] ? code : -1; }

static void errors(void *device) {
    void *scene = rtcNewScene(device);
    RayHit hit = ray(0, 0, 0, 0, 0, 1);
    rtcSetDeviceErrorFunction(device, note, NULL);
    CHECK(rtcNewGeometry(device, 24) == NULL && last_code == 3);
    CHECK(strstr(rtcGetDeviceLastErrorMessage(device), "curves") != NULL);
    CHECK(rtcGetDeviceError(device) == 3 && rtcGetDeviceError(device) == 0);
    rtcIntersect1(scene, &hit, NULL);
    CHECK(rtcGetDeviceError(device) == 3 && hit.hit.geom == ~0u);
    rtcDetachGeometry(scene, 5);
    CHECK(rtcGetDeviceError(device) == 3);
    void *geometry = rtcNewGeometry(device, 0);
    rtcSetSharedGeometryBuffer(geometry, 1, 0, FLOAT3, (const char *)&hit + 1, 0, 12, 1);
    CHECK(rtcGetDeviceError(device) == 3);
    CHECK(rtcSetNewGeometryBuffer(geometry, 1, 1, FLOAT3, 12, 1) == NULL && rtcGetDeviceError(device) == 2);
    rtcReleaseGeometry(geometry);
    rtcReleaseScene(scene);
    rtcReleaseScene(NULL);
    CHECK(rtcGetDeviceError(NULL) == 2);
    rtcCollide(NULL, NULL, NULL, NULL);
    CHECK(rtcGetDeviceError(NULL) == 3 && strstr(rtcGetDeviceLastErrorMessage(NULL), "rtcCollide") != NULL);
    CHECK(rtcNewDevice("no_such_setting=1") == NULL && rtcGetDeviceError(NULL) == 2);
}

static void *commit_often(void *scene) {
    for (int i = 0; i < 300; ++i) { rtcSetSceneFlags(scene, i % 2 ? 4 : 0); rtcCommitScene(scene); }
    return NULL;
}

/* Two scenes that are instances of each other, committed from two threads: each commit ends, with or without an error. */
static void each_other(void *device) {
    void *scenes[2], *made[2];
    pthread_t thread;
    for (int i = 0; i < 2; ++i) {
        void *geometry = mesh(device, 10);
        scenes[i] = rtcNewScene(device);
        rtcAttachGeometry(scenes[i], geometry);
        rtcReleaseGeometry(geometry);
        rtcCommitScene(scenes[i]);
    }
    for (int i = 0; i < 2; ++i) {
        made[i] = rtcNewGeometry(device, 121);
        rtcSetGeometryInstancedScene(made[i], scenes[1 - i]);
        rtcCommitGeometry(made[i]);
        rtcAttachGeometry(scenes[i], made[i]);
    }
    CHECK(rtcGetDeviceError(device) == 0);
    alarm(120);
    CHECK(pthread_create(&thread, NULL, commit_often, scenes[0]) == 0);
    commit_often(scenes[1]);
    pthread_join(thread, NULL);
    alarm(0);
    rtcGetDeviceError(device);
    for (int i = 0; i < 2; ++i) {
        rtcDetachGeometry(scenes[i], 1);
        rtcReleaseGeometry(made[i]);
    }
    for (int i = 0; i < 2; ++i) rtcReleaseScene(scenes[i]);
}

/* A scene for which there is no memory is error 4, and the device lives. Nothing is ever written to the indices. */
static void memory(void *device) {
    const struct rlimit limit = {8000000000u, 8000000000u};
    const size_t count = 100000000;
    static const float corners[9] = {0, 0, 1, 1, 0, 1, 0, 1, 1};
    void *indices = mmap(NULL, count * 12, PROT_READ, MAP_PRIVATE | MAP_ANONYMOUS | MAP_NORESERVE, -1, 0);
    void *scene = rtcNewScene(device), *geometry = rtcNewGeometry(device, 0);
    CHECK(indices != MAP_FAILED && setrlimit(RLIMIT_AS, &limit) == 0);
    rtcSetSharedGeometryBuffer(geometry, 1, 0, FLOAT3, corners, 0, 12, 3);
    rtcSetSharedGeometryBuffer(geometry, 0, 0, UINT3, indices, 0, 12, count);
    rtcCommitGeometry(geometry);
    rtcAttachGeometry(scene, geometry);
    CHECK(rtcGetDeviceError(device) == 0);
    rtcCommitScene(scene);
    CHECK(rtcGetDeviceError(device) == 4);
    CHECK(strstr(rtcGetDeviceLastErrorMessage(device), "not enough memory") != NULL);
    CHECK(rtcSetNewGeometryBuffer(geometry, 1, 1, FLOAT3, 12, (size_t)1 << 31) == NULL && rtcGetDeviceError(device) == 4);
    rtcReleaseGeometry(geometry);
    rtcReleaseScene(scene);
}

int main(void) {
    void *device = rtcNewDevice("threads=2,isa=avx2");
    CHECK(device != NULL);
    packets_and_streams(device);
    ends_of_intervals(device);
    masks_filters_instances(device);
    user_geometry_and_points(device);
    curves(device);
    CHECK(rtcGetDeviceError(device) == 0);
    each_other(device);
    errors(device);
    memory(device);
    rtcReleaseDevice(device);
    puts("door: ok");
    return 0;
}
