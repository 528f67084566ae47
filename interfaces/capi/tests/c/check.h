/* What the test programs share: checks that name their line, random numbers, brute force. */
#ifndef CHECK_H
#define CHECK_H

#include "antumbra.h"

#include <float.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* Fails with the line and, if a call did it, the text of the last error. */
#define CHECK(condition)                                                                            \
    do {                                                                                            \
        if (!(condition)) {                                                                         \
            fprintf(stderr, "%s:%d: %s (%s)\n", __FILE__, __LINE__, #condition, antumbra_last_error()); \
            exit(1);                                                                                \
        }                                                                                           \
    } while (0)

#define OK(call) CHECK((call) == ANTUMBRA_OK)

/* The call fails with this status, and a text that has these words. */
#define FAILS(call, expected, words)                                                                   \
    do {                                                                                               \
        antumbra_status found_ = (call);                                                               \
        if (found_ != (expected) || strstr(antumbra_last_error(), (words)) == NULL) {                  \
            fprintf(stderr, "%s:%d: %s\n  returned %d (%s), \"%s\"\n", __FILE__, __LINE__, #call, (int)found_, \
                    antumbra_status_text(found_), antumbra_last_error());                              \
            exit(1);                                                                                   \
        }                                                                                              \
    } while (0)

/* Numbers in 0..1 from a linear congruence. */
static inline float random_unit(uint64_t *state) {
    *state = *state * 6364136223846793005u + 1442695040888963407u;
    return (float)(*state >> 40) / 16777216.0f;
}

static inline float random_in(uint64_t *state, float low, float high) { return low + (high - low) * random_unit(state); }

/* Rays between random points of a box around the origin. */
static inline antumbra_ray *random_rays(size_t count, float side, uint64_t seed) {
    antumbra_ray *rays = malloc((count + 1) * sizeof *rays);
    size_t index;
    for (index = 0; index < count; ++index) {
        float from[3], to[3];
        int axis;
        for (axis = 0; axis < 3; ++axis) {
            from[axis] = random_in(&seed, -side, side);
            to[axis] = random_in(&seed, -side, side);
        }
        rays[index] = antumbra_ray_between(from, to);
    }
    return rays;
}

/* Triangles of random corners near each other: 9 floats each. */
static inline float *random_triangles(size_t count, uint64_t seed) {
    float *corners = malloc((count + 1) * 9 * sizeof *corners);
    size_t index;
    for (index = 0; index < count; ++index) {
        float middle[3];
        int axis, corner;
        for (axis = 0; axis < 3; ++axis) {
            middle[axis] = random_in(&seed, -1.0f, 1.0f);
        }
        for (corner = 0; corner < 3; ++corner) {
            for (axis = 0; axis < 3; ++axis) {
                corners[9 * index + 3 * (size_t)corner + (size_t)axis] = middle[axis] + random_in(&seed, -0.2f, 0.2f);
            }
        }
    }
    return corners;
}

/* Where a ray hits a triangle, in double precision after Moeller and Trumbore; negative if it does not. `edge` receives how far
 * from an edge that is. */
static inline double brute_triangle(const float *corners, const antumbra_ray *ray, double uv[2], double *edge) {
    double e1[3], e2[3], s[3], p[3], q[3], det, u, v, t;
    int axis;
    for (axis = 0; axis < 3; ++axis) {
        e1[axis] = (double)corners[3 + axis] - corners[axis];
        e2[axis] = (double)corners[6 + axis] - corners[axis];
        s[axis] = (double)ray->org[axis] - corners[axis];
    }
    p[0] = (double)ray->dir[1] * e2[2] - (double)ray->dir[2] * e2[1];
    p[1] = (double)ray->dir[2] * e2[0] - (double)ray->dir[0] * e2[2];
    p[2] = (double)ray->dir[0] * e2[1] - (double)ray->dir[1] * e2[0];
    det = e1[0] * p[0] + e1[1] * p[1] + e1[2] * p[2];
    u = (s[0] * p[0] + s[1] * p[1] + s[2] * p[2]) / det;
    q[0] = s[1] * e1[2] - s[2] * e1[1];
    q[1] = s[2] * e1[0] - s[0] * e1[2];
    q[2] = s[0] * e1[1] - s[1] * e1[0];
    v = (ray->dir[0] * q[0] + ray->dir[1] * q[1] + ray->dir[2] * q[2]) / det;
    t = (e2[0] * q[0] + e2[1] * q[1] + e2[2] * q[2]) / det;
    uv[0] = u;
    uv[1] = v;
    *edge = u < v ? u : v;
    if (1.0 - u - v < *edge) {
        *edge = 1.0 - u - v;
    }
    if (*edge >= 0.0 && t > ray->tnear && t < ray->tfar) {
        return t;
    }
    return -1.0;
}

#endif
