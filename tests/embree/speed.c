/* Times rtcOccluded1, rtcIntersect1 and their packets of 16 on two libraries, interleaved in one process:
 *
 *     cc -O2 tests/embree/speed.c -o speed -ldl -lm && ./speed OURS EMBREE [TRIANGLES]
 *
 * Rays between random points of a terrain with boxes, and rays of a camera in tiles of 4 x 4. One thread. Prints
 * the median of the rounds: millions of rays per second, and the speedup of the first library over the second. */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

enum { RAYS = 1 << 17, ROUNDS = 9 };

typedef struct { _Alignas(64) float numbers[21][16]; } Packet;
typedef struct {
    void *(*device)(const char *), *(*scene)(void *), *(*geometry)(void *, int), *(*buffer)(void *, int, unsigned, int, size_t, size_t);
    void (*commit_geometry)(void *), (*commit)(void *), (*occluded1)(void *, void *, void *), (*intersect1)(void *, void *, void *);
    void (*occluded16)(const int *, void *, void *, void *), (*intersect16)(const int *, void *, void *, void *);
    unsigned (*attach)(void *, void *);
    void *built;
} Library;

static unsigned long long state = 7;
static float number(void) {
    state = state * 6364136223846793005ull + 1442695040888963407ull;
    return (float)(state >> 40) / 16777216.0f;
}

static float height(float x, float y) { return 3 * sinf(0.31f * x) * cosf(0.27f * y) + sinf(1.3f * x + 0.7f * y); }

static void open_library(Library *lib, const char *path, unsigned side) {
    void *handle = dlopen(path, RTLD_NOW | RTLD_LOCAL | RTLD_DEEPBIND);
    if (!handle) { fprintf(stderr, "%s\n", dlerror()); exit(1); }
#define GET(field, name) *(void **)&lib->field = dlsym(handle, name)
    GET(device, "rtcNewDevice"); GET(scene, "rtcNewScene"); GET(geometry, "rtcNewGeometry"); GET(buffer, "rtcSetNewGeometryBuffer");
    GET(commit_geometry, "rtcCommitGeometry"); GET(commit, "rtcCommitScene"); GET(attach, "rtcAttachGeometry");
    GET(occluded1, "rtcOccluded1"); GET(intersect1, "rtcIntersect1"); GET(occluded16, "rtcOccluded16"); GET(intersect16, "rtcIntersect16");
    unsigned boxes = side * side / 64, x, y, i, j;
    void *device = lib->device("threads=1"), *geometry = lib->geometry(device, 0);
    float *p = lib->buffer(geometry, 1, 0, 0x9003, 12, (size_t)(side + 1) * (side + 1) + 8 * boxes);
    unsigned *t = lib->buffer(geometry, 0, 0, 0x5003, 12, 2 * (size_t)side * side + 12 * boxes);
    for (y = 0; y <= side; ++y)
        for (x = 0; x <= side; ++x, p += 3) {
            p[0] = 100.0f * x / side; p[1] = 100.0f * y / side; p[2] = height(p[0], p[1]);
        }
    for (y = 0; y < side; ++y)
        for (x = 0; x < side; ++x) {
            unsigned a = y * (side + 1) + x, quad[6] = {a, a + 1, a + side + 2, a, a + side + 2, a + side + 1};
            memcpy(t, quad, sizeof quad); t += 6;
        }
    state = 7;
    for (i = 0; i < boxes; ++i) {
        static const unsigned faces[12][3] = {{0,1,3},{0,3,2},{4,6,7},{4,7,5},{0,4,5},{0,5,1},{2,3,7},{2,7,6},{0,2,6},{0,6,4},{1,5,7},{1,7,3}};
        float bx = 100 * number(), by = 100 * number(), size = 0.2f + number(), tall = 1 + 4 * number(), low = height(bx, by) - 1;
        unsigned base = (side + 1) * (side + 1) + 8 * i;
        for (j = 0; j < 8; ++j, p += 3) { p[0] = bx + (j & 1 ? size : 0); p[1] = by + (j & 2 ? size : 0); p[2] = low + (j & 4 ? tall : 0); }
        for (j = 0; j < 12; ++j, t += 3) { t[0] = base + faces[j][0]; t[1] = base + faces[j][1]; t[2] = base + faces[j][2]; }
    }
    lib->commit_geometry(geometry);
    lib->built = lib->scene(device);
    lib->attach(lib->built, geometry);
    lib->commit(lib->built);
}

static Packet rays[RAYS / 16], work[RAYS / 16];
static float singles[RAYS][24] __attribute__((aligned(64))), single_work[RAYS][24] __attribute__((aligned(64)));

static void make(int camera) {
    for (unsigned i = 0; i < RAYS; ++i) {
        float *r = singles[i];
        memset(r, 0, sizeof singles[i]);
        if (camera) {
            unsigned tile = i / 16, lane = i % 16, x = tile % 128 * 4 + lane % 4, y = tile / 128 * 4 + lane / 4;
            r[0] = 50; r[1] = -10; r[2] = 20;
            r[4] = (x / 512.0f - 0.5f); r[5] = 1; r[6] = -0.1f - 0.6f * y / 256.0f; r[8] = INFINITY;
        } else {
            float a[2] = {100 * number(), 100 * number()}, b[2] = {a[0] + 20 * (number() - 0.5f), a[1] + 20 * (number() - 0.5f)};
            r[0] = a[0]; r[1] = a[1]; r[2] = height(a[0], a[1]) + 0.3f + number();
            r[4] = b[0] - r[0]; r[5] = b[1] - r[1]; r[6] = height(b[0], b[1]) + 0.3f + 4 * number() - r[2]; r[8] = 1;
        }
        ((unsigned *)r)[9] = ~0u;
        for (unsigned f = 12; f < 21; ++f) ((unsigned *)r)[f] = ~0u;
        for (unsigned f = 0; f < 21; ++f) rays[i / 16].numbers[f][i % 16] = r[f];
    }
}

static double now(void) { struct timespec t; clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t); return t.tv_sec + 1e-9 * t.tv_nsec; }

static double run(Library *lib, int query, unsigned *hits) {
    static const int valid[16] __attribute__((aligned(64))) = {-1,-1,-1,-1,-1,-1,-1,-1,-1,-1,-1,-1,-1,-1,-1,-1};
    memcpy(work, rays, sizeof rays);
    memcpy(single_work, singles, sizeof singles);
    double start = now();
    for (unsigned i = 0; i < RAYS; i += 16) {
        if (query == 2) lib->occluded16(valid, lib->built, &work[i / 16], NULL);
        else if (query == 3) lib->intersect16(valid, lib->built, &work[i / 16], NULL);
        else for (unsigned j = i; j < i + 16; ++j) (query ? lib->intersect1 : lib->occluded1)(lib->built, single_work[j], NULL);
    }
    double seconds = now() - start;
    *hits = 0;
    for (unsigned i = 0; i < RAYS; ++i) {
        float before = singles[i][8], after = query >= 2 ? work[i / 16].numbers[8][i % 16] : single_work[i][8];
        *hits += before != after;
    }
    return seconds;
}

static int by_size(const void *a, const void *b) { return *(const double *)a < *(const double *)b ? -1 : 1; }

int main(int count, char **names) {
    static const char *queries[] = {"rtcOccluded1", "rtcIntersect1", "rtcOccluded16", "rtcIntersect16"};
    static Library libs[2];
    if (count < 3) { fprintf(stderr, "usage: %s OURS EMBREE [TRIANGLES]\n", names[0]); return 2; }
    unsigned side = (unsigned)sqrt((count > 3 ? atof(names[3]) : 500000) / 2.2);
    for (int i = 0; i < 2; ++i) open_library(&libs[i], names[i + 1], side);
    for (int camera = 0; camera < 2; ++camera) {
        make(camera);
        for (int query = 0; query < 4; ++query) {
            double seconds[2][ROUNDS];
            unsigned hits[2];
            for (int round = -1; round < ROUNDS; ++round)
                for (int i = 0; i < 2; ++i) { double s = run(&libs[i], query, &hits[i]); if (round >= 0) seconds[i][round] = s; }
            for (int i = 0; i < 2; ++i) qsort(seconds[i], ROUNDS, sizeof(double), by_size);
            double a = seconds[0][ROUNDS / 2], b = seconds[1][ROUNDS / 2];
            printf("%-7s %-15s %7.2f %7.2f Mray/s, speedup %.2f, hits %u and %u of %d\n", camera ? "camera" : "shadow",
                   queries[query], RAYS / a / 1e6, RAYS / b / 1e6, b / a, hits[0], hits[1], RAYS);
        }
    }
    return 0;
}
