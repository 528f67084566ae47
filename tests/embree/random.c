/* Calls the door at random, with right and wrong arguments, and must neither crash nor read what is not there:
 *
 *     cc -O1 -g tests/embree/random.c target/debug/libembree4.so -o random && valgrind ./random SECONDS SEED
 *
 * The same seed makes the same calls. The last line has the number of calls. */
#include <math.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

void *rtcNewDevice(const char *); void rtcReleaseDevice(void *); int rtcGetDeviceError(void *);
void *rtcNewScene(void *); void rtcReleaseScene(void *); void rtcCommitScene(void *); void rtcSetSceneFlags(void *, int); void rtcSetSceneBuildQuality(void *, int);
void *rtcNewGeometry(void *, int); void rtcReleaseGeometry(void *); void rtcCommitGeometry(void *); void rtcEnableGeometry(void *); void rtcDisableGeometry(void *);
unsigned rtcAttachGeometry(void *, void *); void rtcAttachGeometryByID(void *, void *, unsigned); void rtcDetachGeometry(void *, unsigned); void *rtcGetGeometry(void *, unsigned);
void *rtcSetNewGeometryBuffer(void *, int, unsigned, int, size_t, size_t); void *rtcGetGeometryBufferData(void *, int, unsigned); void rtcUpdateGeometryBuffer(void *, int, unsigned);
void rtcSetGeometryMask(void *, unsigned); void rtcSetGeometryInstancedScene(void *, void *); void rtcSetGeometryTransform(void *, unsigned, int, const void *);
void rtcSetGeometryVertexAttributeCount(void *, unsigned); void rtcSetGeometryTimeStepCount(void *, unsigned); void rtcGetSceneBounds(void *, void *);
void rtcIntersect1(void *, void *, void *); void rtcOccluded1(void *, void *, void *); void rtcIntersect8(const int *, void *, void *, void *); void rtcOccluded16(const int *, void *, void *, void *);
void rtcOccluded1M(void *, void *, void *, unsigned, size_t); bool rtcPointQuery(void *, void *, void *, void *, void *);
void rtcSetGeometryTessellationRate(void *, float); void rtcInterpolate(const void *);

static uint64_t state;
static unsigned random_below(unsigned n) { state = state * 6364136223846793005ull + 1442695040888963407ull; return (unsigned)(state >> 33) % n; }
static float number(void) {
    static const float odd[] = {0, -0.0f, INFINITY, -INFINITY, NAN, 1e38f, -1e-40f, 1e-20f};
    return random_below(12) ? (float)random_below(2000) / 1000.0f - 1 : odd[random_below(8)];
}

enum { MANY = 8 };
static void *device, *scenes[MANY], *geometries[MANY];

/* Fills a buffer as its type would have it, with some indices out of range. */
static void fill(void *memory, int type, size_t count) {
    for (size_t i = 0; memory && i < count; ++i) {
        if (type == 0) ((unsigned *)memory)[i] = random_below(40) ? random_below(12) : random_below(1 << 30);
        else ((float *)memory)[i] = number();
    }
}

static void step(void) {
    static const int kinds[] = {0, 0, 1, 50, 52, 121, 122, 24, 999, 17, 25, 33, 59};
    static const int formats[] = {0x5001, 0x5003, 0x5004, 0x9003, 0x9004, 0x9134, 0x9244, 0x9001, 77};
    void **scene = &scenes[random_below(MANY)], **geometry = &geometries[random_below(MANY)];
    float numbers[16];
    _Alignas(64) float rays[21 * 16];
    _Alignas(64) int valid[16];
    _Alignas(16) float context[36];
    struct { void *geometry; unsigned prim; float u, v; int type; unsigned slot; float *p[6]; unsigned count; } interpolate;
    float result[16];
    for (int i = 0; i < 16; ++i) { numbers[i] = number(); valid[i] = random_below(4) ? -1 : 0; }
    for (int i = 0; i < 21 * 16; ++i) rays[i] = number();
    switch (random_below(22)) {
    case 0: if (*scene) rtcReleaseScene(*scene); *scene = rtcNewScene(device); break;
    case 1: case 2: if (*geometry) rtcReleaseGeometry(*geometry); *geometry = rtcNewGeometry(device, kinds[random_below(13)]); break;
    case 3: case 4: case 5: {
        static const int types[] = {0, 1, 1, 2, 3, 23, 5};
        int type = types[random_below(7)], format = formats[random_below(9)];
        size_t stride = 4 * random_below(20) + !random_below(20), count = random_below(16);
        void *memory = rtcSetNewGeometryBuffer(*geometry, type, !random_below(9), format, stride, count);
        fill(memory, type, stride * count / 4);
        break;
    }
    case 6: rtcCommitGeometry(*geometry); break;
    case 7: rtcAttachGeometry(*scene, *geometry); break;
    case 8: rtcAttachGeometryByID(*scene, *geometry, random_below(12) ? random_below(20) : ~0u); break;
    case 9: rtcDetachGeometry(*scene, random_below(12)); break;
    case 10: rtcSetGeometryMask(*geometry, random_below(4)); break;
    case 11: rtcSetGeometryInstancedScene(*geometry, *scene); break;
    case 12: rtcSetGeometryTransform(*geometry, !random_below(9), formats[5 + random_below(4)], numbers); break;
    case 13: case 14: rtcCommitScene(*scene); break;
    case 15: rtcIntersect1(*scene, random_below(20) ? rays : NULL, NULL); break;
    case 16: rtcIntersect8(valid, *scene, rays, NULL); rtcOccluded16(valid, *scene, rays, NULL); break;
    case 17: rtcOccluded1M(*scene, NULL, rays, random_below(7), 48); rtcOccluded1(*scene, rays, NULL); break;
    case 18: rtcPointQuery(*scene, rays, context, NULL, NULL); break;
    case 19: rtcGetSceneBounds(*scene, rays); rtcUpdateGeometryBuffer(*geometry, 1, 0); rtcGetGeometryBufferData(*geometry, 1, random_below(3)); break;
    case 20:
        (random_below(2) ? rtcEnableGeometry : rtcDisableGeometry)(*geometry);
        rtcSetGeometryTimeStepCount(*geometry, random_below(3)); rtcSetGeometryTessellationRate(*geometry, 2);
        rtcSetSceneFlags(*scene, (int)random_below(16)); rtcSetSceneBuildQuality(*scene, (int)random_below(4));
        break;
    default:
        rtcSetGeometryVertexAttributeCount(*geometry, random_below(3));
        memset(&interpolate, 0, sizeof interpolate);
        interpolate.geometry = *geometry; interpolate.prim = random_below(12); interpolate.u = number(); interpolate.v = number();
        interpolate.type = 1 + (int)random_below(2); interpolate.p[0] = result; interpolate.count = 1 + random_below(16);
        rtcInterpolate(&interpolate);
    }
}

int main(int count, char **words) {
    double seconds = count > 1 ? atof(words[1]) : 10;
    unsigned long calls = 0, errors = 0;
    time_t end = time(NULL) + (time_t)seconds;
    state = count > 2 ? strtoull(words[2], NULL, 10) : 1;
    device = rtcNewDevice("threads=1");
    for (; calls % 256 || time(NULL) < end; ++calls) { step(); errors += rtcGetDeviceError(device) != 0; }
    for (int i = 0; i < MANY; ++i) {
        if (scenes[i]) rtcReleaseScene(scenes[i]);
        if (geometries[i]) rtcReleaseGeometry(geometries[i]);
    }
    rtcReleaseDevice(device);
    printf("%lu calls, %lu errors: ok\n", calls, errors);
    return 0;
}
