/*
 * antumbra.h: what do rays hit, and is anything between two points?
 *
 * C interface of Antumbra, a ray tracing kernel for the CPU that is built around the occlusion query. C99 or later, C++11 or
 * later. For C++17 see antumbra.hpp.
 *
 * FIRST STEPS
 *
 *     antumbra_scene *scene;
 *     antumbra_bvh *bvh;
 *     antumbra_scene_new(&scene);
 *     antumbra_scene_add_triangles(scene, positions, vertex_count, 0, indices, triangle_count, 0, NULL);
 *     antumbra_bvh_build(scene, NULL, &bvh);
 *     antumbra_scene_free(scene);
 *
 *     antumbra_batch batch = antumbra_batch_of(rays, ray_count);
 *     antumbra_occluded(bvh, &batch, in_shadow, 0);
 *     antumbra_bvh_free(bvh);
 *
 * CONTENTS
 *
 *      1  versions and status codes        7  batches: many rays
 *      2  structures of rays and hits      8  all hits
 *      3  threads                          9  groups: points times directions
 *      4  scenes                          10  points: closest, inside, signed distance
 *      5  recipes and builds              11  trees that change, and worlds
 *      6  queries of one ray              12  files
 *                                         13  height fields
 *
 * RULES OF ALL FUNCTIONS
 *
 * Order of parameters. First the handle, then what goes in, then what comes out.
 *
 * Status. Functions that can fail return an antumbra_status, and a text is kept for antumbra_last_error(). A call that fails
 * changes nothing, and sets the handle it would have returned to NULL. Arrays of answers may be written in part.
 *
 * Checks. Null pointers, counts, strides, sizes, names and numbers of enums are checked. Not checked: whether an array is as
 * long as its count says, and whether a handle was freed.
 *
 * Arrays. An array is an address, a count and a stride. The stride is the number of bytes from one item to the next. Stride 0
 * stands for packed items. A stride smaller than an item is an error. Where a function says so, the stride
 * ANTUMBRA_SAME_FOR_ALL gives all rays or points the first item. Any alignment is fine, unless a function says otherwise. The
 * address of an array without items may be NULL. Outputs must not overlap each other or inputs, but they may alternate with
 * inputs in memory: a ray and its hit may be fields of one structure.
 *
 * Structures with options. Their first field is `size`. Call the init function or the function that returns the structure
 * before you set fields. A structure of another size is an error.
 *
 * Ownership. A handle belongs to whoever received it and is freed once, by the function of its type whose name ends in _free.
 * NULL may be freed. The library copies what it needs: your arrays, options and scenes are free when a call returns.
 *
 * Threads. Functions may be called from any thread. Any number of threads may use a handle at the same time in functions that
 * take it as a pointer to const. A function that takes it as a pointer to non-const needs the handle for itself. Different
 * handles are independent.
 *
 * Callbacks. A callback must not throw an exception, and must not leave by longjmp. Callbacks run on the calling thread or on
 * any thread of the pool in use, several at the same time, unless a function says otherwise. A callback may call queries.
 *
 * Numbers. Rays whose origin, direction or interval has a NaN hit nothing, and no query fails because of numbers. Answers are
 * the same bits for every recipe, instruction set, batch size and number of threads.
 *
 * Processes. There is no state that needs a set-up. The one thing shared by all calls is the default pool of threads, see 3.
 */
#ifndef ANTUMBRA_H
#define ANTUMBRA_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <math.h>

#if defined(_WIN32) && defined(ANTUMBRA_SHARED)
#define ANTUMBRA_API __declspec(dllimport)
#else
#define ANTUMBRA_API
#endif

#ifdef __cplusplus
extern "C" {
#endif

/* ------------------------------------------------------------------------------------------------------------------------
 * 1  Versions and status codes
 * ------------------------------------------------------------------------------------------------------------------------ */

/* Version of this header. */
#define ANTUMBRA_VERSION_MAJOR 0
#define ANTUMBRA_VERSION_MINOR 1
#define ANTUMBRA_VERSION_PATCH 0

/* Whether a call did what it should. */
typedef int32_t antumbra_status;
enum {
    ANTUMBRA_OK = 0,
    /* An argument is null, too small, unknown or out of range. */
    ANTUMBRA_INVALID_ARGUMENT = 1,
    /* A primitive names a vertex that is not there, or an instance names an object that is not there. */
    ANTUMBRA_BAD_GEOMETRY = 2,
    /* More geometries, primitives or nodes than can be numbered. */
    ANTUMBRA_TOO_MANY = 3,
    /* A refit with other primitives than the build had, or objects of different widths. */
    ANTUMBRA_OTHER_GEOMETRY = 4,
    /* The handle is of a kind for which the call is not possible. */
    ANTUMBRA_UNSUPPORTED = 5,
    /* The callback `cancelled` stopped the build. */
    ANTUMBRA_CANCELLED = 6,
    /* A file or memory is damaged, or holds something else. */
    ANTUMBRA_UNREADABLE = 7,
    /* A file was loaded with too few or too many functions. */
    ANTUMBRA_OTHER_FUNCTIONS = 8,
    /* A file could not be opened, read or written. */
    ANTUMBRA_IO = 9,
    /* The system started no threads. */
    ANTUMBRA_NO_THREADS = 10,
    /* A mistake of the library. Please report it. */
    ANTUMBRA_INTERNAL = 11,
    /* There is no memory for what the call would make. Nothing was changed. */
    ANTUMBRA_NO_MEMORY = 12
};

/* Version of the library, such as "0.1.0". The text lives as long as the program. */
ANTUMBRA_API const char *antumbra_version(void);

/* A status in a few words, such as "invalid argument"; "unknown status" for other numbers. The text lives as long as the
 * program. */
ANTUMBRA_API const char *antumbra_status_text(int32_t status);

/* What went wrong in the last call on this thread that failed: which argument, what was found, what would be right. Empty if
 * none has failed. The text is UTF-8 and lives until the next call on this thread fails. Calls that succeed keep it. */
ANTUMBRA_API const char *antumbra_last_error(void);

/* ------------------------------------------------------------------------------------------------------------------------
 * 2  Structures of rays and hits
 * ------------------------------------------------------------------------------------------------------------------------ */

/* The id of nothing: of the instance of what is in no instance, and all ids of a miss. */
#define ANTUMBRA_INVALID_ID UINT32_MAX

/* Stride of an array whose first item serves all rays or points. */
#define ANTUMBRA_SAME_FOR_ALL SIZE_MAX

/* A ray org + t * dir over the open interval tnear < t < tfar. 32 bytes.
 *
 * `t` counts multiples of `dir`, which may have any length but zero. `tnear` may be negative, `tfar` may be INFINITY. A ray
 * with a NaN, an infinite origin or direction, no direction or an empty interval hits nothing. */
typedef struct antumbra_ray {
    float org[3];
    float tnear;
    float dir[3];
    float tfar;
} antumbra_ray;

/* Where a ray hits. 24 bytes.
 *
 * At equal distances the smallest (inst_id, geom_id, prim_id) is hit. After a miss `t` is INFINITY, `u` and `v` are 0, and the
 * ids are ANTUMBRA_INVALID_ID: see antumbra_is_hit(). */
typedef struct antumbra_hit {
    /* Distance in multiples of `dir`. */
    float t;
    /* Barycentric weights of the second and the third corner of a triangle. On a quad the place from corner 0 to corner 1 and
     * from corner 0 to corner 3. 0 on spheres and disks. The numbers of the callback on user geometry. */
    float u;
    float v;
    /* Index of the primitive in its geometry. */
    uint32_t prim_id;
    /* Index of the geometry in its scene. */
    uint32_t geom_id;
    /* Index of the instance, or ANTUMBRA_INVALID_ID outside of instances. */
    uint32_t inst_id;
} antumbra_hit;

/* Name of a primitive: the ids of a hit. 12 bytes. */
typedef struct antumbra_prim_id {
    uint32_t inst_id;
    uint32_t geom_id;
    uint32_t prim_id;
} antumbra_prim_id;

/* A closest hit with position and normal, both in the world. 48 bytes. */
typedef struct antumbra_surface {
    antumbra_hit hit;
    /* The point that is hit; INFINITY after a miss. On a triangle it is in the plane of the triangle, up to the rounding of
     * its coordinates. */
    float position[3];
    /* Geometric normal of length 1. Zero after a miss, for a triangle without area, and for user geometry without the callback
     * `normal`. The corners of a triangle turn counter-clockwise around it. It does not depend on the side that is hit. */
    float normal[3];
} antumbra_surface;

/* A box. Empty if min > max on any axis. 24 bytes. */
typedef struct antumbra_box {
    float min[3];
    float max[3];
} antumbra_box;

/* Whether a structure is of a hit, not of a miss. */
static inline bool antumbra_is_hit(const antumbra_hit *hit) {
    return hit->geom_id != ANTUMBRA_INVALID_ID;
}

/* The name of the primitive of a hit, for `except` of a batch. */
static inline antumbra_prim_id antumbra_prim_of(const antumbra_hit *hit) {
    antumbra_prim_id id;
    id.inst_id = hit->inst_id;
    id.geom_id = hit->geom_id;
    id.prim_id = hit->prim_id;
    return id;
}

/* A ray over the interval (0, INFINITY). `org` and `dir` have 3 numbers each. */
static inline antumbra_ray antumbra_ray_from(const float *org, const float *dir) {
    antumbra_ray ray;
    int axis;
    for (axis = 0; axis < 3; ++axis) {
        ray.org[axis] = org[axis];
        ray.dir[axis] = dir[axis];
    }
    ray.tnear = 0.0f;
    ray.tfar = INFINITY;
    return ray;
}

/* The open segment between two points of 3 numbers each: t is 0 at `from` and 1 at `to`. */
static inline antumbra_ray antumbra_ray_between(const float *from, const float *to) {
    antumbra_ray ray;
    int axis;
    for (axis = 0; axis < 3; ++axis) {
        ray.org[axis] = from[axis];
        ray.dir[axis] = to[axis] - from[axis];
    }
    ray.tnear = 0.0f;
    ray.tfar = 1.0f;
    return ray;
}

/* The open segment between two points in double precision, seen from the origin of a scene: see antumbra_scene_set_origin().
 * All have 3 numbers. The direction is computed before it is rounded. */
static inline antumbra_ray antumbra_ray_between_f64(const double *origin, const double *from, const double *to) {
    antumbra_ray ray;
    int axis;
    for (axis = 0; axis < 3; ++axis) {
        ray.org[axis] = (float)(from[axis] - origin[axis]);
        ray.dir[axis] = (float)(to[axis] - from[axis]);
    }
    ray.tnear = 0.0f;
    ray.tfar = 1.0f;
    return ray;
}

/* ------------------------------------------------------------------------------------------------------------------------
 * 3  Threads
 *
 * Builds, refits, worlds and large batches share their work among the threads of a pool. Where a call has no pool, that is
 * where `threads` is NULL, it uses the default pool of the process. The first call that needs the default pool starts it, with
 * one thread per core or as many as the environment variable RAYON_NUM_THREADS says. The default pool is never stopped.
 *
 * Batches of up to 16384 rays stay on the calling thread, up to 1024 rays in the functions of section 8, and up to 64 points
 * in the functions of section 10. All work stays there with the flag ANTUMBRA_THIS_THREAD. A program with threads of its own
 * calls queries from them with that flag, and makes a pool for builds.
 *
 * A pool does not survive fork(): a child process makes its own, and does not use the default pool if its parent did.
 * ------------------------------------------------------------------------------------------------------------------------ */

/* A pool of threads. */
typedef struct antumbra_threads antumbra_threads;

/* Makes a pool of `count` threads; 0 for one per core. At most 4096.
 *
 * Errors: INVALID_ARGUMENT, NO_THREADS. */
ANTUMBRA_API antumbra_status antumbra_threads_new(size_t count, antumbra_threads **threads);

/* Returns the number of threads of a pool. */
ANTUMBRA_API antumbra_status antumbra_threads_count(const antumbra_threads *threads, size_t *count);

/* Ends a pool. No call may use it any more. */
ANTUMBRA_API void antumbra_threads_free(antumbra_threads *threads);

/* ------------------------------------------------------------------------------------------------------------------------
 * 4  Scenes
 *
 * A scene is a list of geometries, from which trees and objects are built. Geometries are numbered as they are added: the
 * number is the `geom_id` of hits. All arrays are copied. Scenes are not needed after the build, unless for a refit.
 *
 * Primitives that cannot be hit are dropped at build and counted in the report: those with a NaN or an infinite coordinate,
 * triangles with two equal corners, spheres and disks without a positive radius, disks without a normal, segments of curves
 * with two equal ends, a negative radius or two radii of 0.
 * ------------------------------------------------------------------------------------------------------------------------ */

/* A list of geometries. */
typedef struct antumbra_scene antumbra_scene;

/* Makes an empty scene. */
ANTUMBRA_API antumbra_status antumbra_scene_new(antumbra_scene **scene);

/* Frees a scene. */
ANTUMBRA_API void antumbra_scene_free(antumbra_scene *scene);

/* Returns the number of geometries. */
ANTUMBRA_API antumbra_status antumbra_scene_geometry_count(const antumbra_scene *scene, size_t *count);

/* Sets the origin of points in double precision: 3 finite numbers. It is subtracted from them before they are rounded to
 * single precision. The default is 0. Hits, rays and points of queries are seen from the same origin. All scenes of one tree
 * need one origin; the middle of the coordinates is the best one.
 *
 * Errors: INVALID_ARGUMENT if the scene has a geometry already, or a number is not finite. */
ANTUMBRA_API antumbra_status antumbra_scene_set_origin(antumbra_scene *scene, const double *origin);

/* Adds a triangle mesh.
 *
 * `positions` has `position_count` points of 3 floats, `indices` has `triangle_count` times 3 indices of points. Without
 * indices (NULL) every 3 points are a triangle, and triangle_count must be position_count / 3. `geom_id` may be NULL. Indices
 * are checked at build.
 *
 * Errors: INVALID_ARGUMENT, TOO_MANY. */
ANTUMBRA_API antumbra_status antumbra_scene_add_triangles(antumbra_scene *scene, const float *positions, size_t position_count,
                                                          size_t position_stride, const uint32_t *indices, size_t triangle_count,
                                                          size_t index_stride, uint32_t *geom_id);

/* antumbra_scene_add_triangles() with points of 3 doubles, from which the origin of the scene is subtracted. */
ANTUMBRA_API antumbra_status antumbra_scene_add_triangles_f64(antumbra_scene *scene, const double *positions,
                                                              size_t position_count, size_t position_stride,
                                                              const uint32_t *indices, size_t triangle_count,
                                                              size_t index_stride, uint32_t *geom_id);

/* Adds a mesh of quads: as antumbra_scene_add_triangles() with 4 indices each.
 *
 * A quad with the corners 0, 1, 2, 3 is the two triangles (0, 1, 3) and (2, 3, 1), which have one prim_id and fit without a
 * gap. The corners need not be in one plane. If the third index equals the fourth, only the first triangle is there. */
ANTUMBRA_API antumbra_status antumbra_scene_add_quads(antumbra_scene *scene, const float *positions, size_t position_count,
                                                      size_t position_stride, const uint32_t *indices, size_t quad_count,
                                                      size_t index_stride, uint32_t *geom_id);

/* antumbra_scene_add_quads() with points of 3 doubles, from which the origin of the scene is subtracted. */
ANTUMBRA_API antumbra_status antumbra_scene_add_quads_f64(antumbra_scene *scene, const double *positions, size_t position_count,
                                                          size_t position_stride, const uint32_t *indices, size_t quad_count,
                                                          size_t index_stride, uint32_t *geom_id);

/* Adds spheres: `count` centres of 3 floats and radii of 1 float. For an array of (x, y, z, radius) give the address of the
 * first x and the address of the first radius, both with a stride of 16. One radius may serve all: ANTUMBRA_SAME_FOR_ALL.
 * Rays that start inside of a sphere hit it from within. */
ANTUMBRA_API antumbra_status antumbra_scene_add_spheres(antumbra_scene *scene, const float *centers, size_t center_stride,
                                                        const float *radii, size_t radius_stride, size_t count,
                                                        uint32_t *geom_id);

/* Adds flat disks, which are hit from both sides: `count` centres and normals of 3 floats and radii of 1 float. Normals may
 * have any length but zero. One normal and one radius may serve all: ANTUMBRA_SAME_FOR_ALL. */
ANTUMBRA_API antumbra_status antumbra_scene_add_disks(antumbra_scene *scene, const float *centers, size_t center_stride,
                                                      const float *normals, size_t normal_stride, const float *radii,
                                                      size_t radius_stride, size_t count, uint32_t *geom_id);

/* Adds thin curves: hair, fur, grass. `points` are x, y, z and radius. Segment i is straight, goes from point `segments[i]`
 * to the next one, and has the prim_id i. One that begins where the one before it in the list ends goes on there without a
 * gap. Without `segments` (NULL) all points are one curve, of one segment less. Segments are flat and face every ray, as
 * Embree's flat curves; rays hit what is within the radius of the axis. `u` of a hit goes along the segment, `v` across it,
 * with 1/2 on the axis. */
ANTUMBRA_API antumbra_status antumbra_scene_add_curves(antumbra_scene *scene, const float *points, size_t point_count,
                                                       size_t point_stride, const uint32_t *segments, size_t segment_count,
                                                       size_t segment_stride, uint32_t *geom_id);

/* A hit on user geometry: the distance in multiples of the direction, and two numbers of your choice. */
typedef struct antumbra_user_hit {
    float t;
    float u;
    float v;
} antumbra_user_hit;

/* Functions of user geometry.
 *
 * One structure serves all primitives of a geometry: the functions receive `data` and the number of the primitive. The same
 * primitive and ray must always have the same answer, on any thread. Rays and boxes are in the space of the geometry: inside
 * an instance that is the space of the object. */
typedef struct antumbra_user_geometry {
    /* sizeof(antumbra_user_geometry) */
    size_t size;
    void *data;
    /* Writes the box of a primitive. Called when a tree is built or refitted. A flat box is fine. A primitive whose box is
     * empty or not finite is dropped. Hits outside of the box are moved to its border, so boxes must be large enough. */
    void (*bounds)(void *data, uint32_t prim_id, antumbra_box *bounds);
    /* Returns whether a ray hits a primitive, and writes the closest hit. Hits count where tnear < t < tfar. The interval is
     * always the whole interval of the query. */
    int32_t (*intersect)(void *data, uint32_t prim_id, const antumbra_ray *ray, antumbra_user_hit *hit);
    /* Returns whether a primitive occludes a ray; the same as `intersect`, and perhaps faster. NULL: `intersect` is called. */
    int32_t (*occluded)(void *data, uint32_t prim_id, const antumbra_ray *ray);
    /* Writes the nearest point of a primitive to a point, both in the world; returns 0 if there is none. `point` and `closest`
     * have 3 numbers. `world_from_object` has 12: the rows of the 3x4 transform of the instance, or of the identity. NULL:
     * queries about points fail with UNSUPPORTED if they come to a primitive of this geometry. */
    int32_t (*closest_point)(void *data, uint32_t prim_id, const double *point, const double *world_from_object,
                             double *closest);
    /* Writes the normal at a hit, 3 numbers of any length, in the space of the ray; returns 0 if there is none. NULL: there
     * are none. */
    int32_t (*normal)(void *data, uint32_t prim_id, const antumbra_ray *ray, const antumbra_user_hit *hit, float *normal);
    /* Called once with `data`, when no scene, tree or object needs the functions any more, on the thread that frees the last
     * of them. NULL: nothing is called. Not called if the function that takes the structure fails. */
    void (*release)(void *data);
} antumbra_user_geometry;

/* User geometry without functions yet: set `data`, `bounds` and `intersect`, and what else you have. */
static inline antumbra_user_geometry antumbra_user_geometry_init(void) {
    antumbra_user_geometry functions = {sizeof(antumbra_user_geometry), NULL, NULL, NULL, NULL, NULL, NULL, NULL};
    return functions;
}

/* Adds user geometry of `count` primitives. The structure is copied; what `data` points to is not.
 *
 * Errors: INVALID_ARGUMENT if `bounds` or `intersect` is missing. */
ANTUMBRA_API antumbra_status antumbra_scene_add_user(antumbra_scene *scene, uint32_t count,
                                                     const antumbra_user_geometry *functions, uint32_t *geom_id);

/* A point of a triangle that may be transparent there. */
typedef struct antumbra_candidate {
    /* Barycentric weights of the second and the third corner. */
    float u;
    float v;
    antumbra_prim_id id;
    /* 1 if the query is about occlusion, 0 if it is about hits. */
    int32_t is_occlusion;
} antumbra_candidate;

/* How opaque the triangles of a mesh are, point by point: for leaves that are cut out of rectangles, or veils. */
typedef struct antumbra_opacity {
    /* sizeof(antumbra_opacity) */
    size_t size;
    void *data;
    /* Returns the opacity at a point: 1 stops every ray, 0 none, and numbers between stop their share of rays. The same point
     * must always have the same opacity, on any thread. */
    float (*opacity)(void *data, const antumbra_candidate *candidate);
    /* As `release` of antumbra_user_geometry. */
    void (*release)(void *data);
} antumbra_opacity;

/* An opacity without a function yet: set `data` and `opacity`. */
static inline antumbra_opacity antumbra_opacity_init(void) {
    antumbra_opacity function = {sizeof(antumbra_opacity), NULL, NULL, NULL};
    return function;
}

/* Makes a triangle mesh partly transparent. The structure is copied; what `data` points to is not.
 *
 * Errors: INVALID_ARGUMENT; UNSUPPORTED if the geometry has no triangles. */
ANTUMBRA_API antumbra_status antumbra_scene_set_opacity(antumbra_scene *scene, uint32_t geom_id,
                                                        const antumbra_opacity *opacity);

/* Sets the mask of a geometry. Rays with a mask hit only geometries that have a bit in common with it. All bits are set
 * unless this function is called. Rays without a mask hit everything, also a geometry with the mask 0. Trees and objects take
 * the masks of their scenes when they are built. */
ANTUMBRA_API antumbra_status antumbra_scene_set_mask(antumbra_scene *scene, uint32_t geom_id, uint32_t mask);

/* Replaces the positions of a mesh of triangles or quads by as many others, for a refit.
 *
 * Errors: INVALID_ARGUMENT if there are more or fewer; UNSUPPORTED if the geometry has no vertices. */
ANTUMBRA_API antumbra_status antumbra_scene_set_positions(antumbra_scene *scene, uint32_t geom_id, const float *positions,
                                                          size_t position_count, size_t position_stride);

/* antumbra_scene_set_positions() with points of 3 doubles, from which the origin of the scene is subtracted. */
ANTUMBRA_API antumbra_status antumbra_scene_set_positions_f64(antumbra_scene *scene, uint32_t geom_id, const double *positions,
                                                              size_t position_count, size_t position_stride);

/* ------------------------------------------------------------------------------------------------------------------------
 * 5  Recipes and builds
 * ------------------------------------------------------------------------------------------------------------------------ */

/* A choice that is left to the library. */
#define ANTUMBRA_AUTO UINT32_MAX

/* Which rays a tree learns from, `training` of a recipe. */
enum {
    /* The rays given, and surface rays: synthetic rays between surfaces. */
    ANTUMBRA_TRAINING_BOTH = 0,
    /* Only the rays given. Other kinds of rays may become slow. */
    ANTUMBRA_TRAINING_GIVEN = 1,
    /* Only surface rays. */
    ANTUMBRA_TRAINING_SURFACE = 2
};

/* Every choice that makes a tree. No choice changes an answer; they change what builds and queries cost.
 *
 * Texts are names that end with a zero. The recipe keeps their addresses, so give literals, or keep the texts as long as the
 * recipe. An unknown name is an error whose text lists the known ones. */
typedef struct antumbra_recipe {
    /* sizeof(antumbra_recipe) */
    size_t size;
    /* "default": trees that answer many rays. "fast": the shortest build, for trees that are soon built again. "paper": the
     * trees of Ogaki and Derouet-Jourdan (2016), for comparisons. NULL: "default". */
    const char *preset;
    /* How the binary tree is built: "reinsertion", "binned-sah". NULL: by the preset, and so below. */
    const char *builder;
    /* Which binary nodes become children of a wide node: "learned", "area", "sah". */
    const char *collapse;
    /* In which order occlusion rays visit children: "joint", "sort+", "sort", "sort-", "visits", "sato", "embree", "simple". */
    const char *order;
    /* Instruction set of queries: "avx512", "avx2", "neon", "scalar". NULL: the best one of this CPU. */
    const char *level;
    /* Children per node: 4, 8 or 16; 0 for what suits the instruction set. Levels with vectors have no other: 8 on `avx2`, 16 on
     * `avx512`, 4 on `neon`. `scalar` has all. */
    uint32_t width;
    /* ANTUMBRA_TRAINING_..., or ANTUMBRA_AUTO. */
    uint32_t training;
    /* Number of surface rays, 0 for none; UINT64_MAX for a number that suits the scene. */
    uint64_t surface_rays;
    /* Seed of everything random in learning. */
    uint64_t seed;
    /* Costs of a node test, of a primitive test, of entering an instance, and of a test of a partly transparent triangle or a
     * primitive of user geometry, relative to each other. NAN: by the preset. */
    float node_cost;
    float prim_cost;
    float entry_cost;
    float cutout_cost;
    /* Whether batches prefetch nodes: 1 or 0, or ANTUMBRA_AUTO: by the size of the tree. */
    uint32_t prefetch;
    /* 0 */
    uint32_t reserved;
} antumbra_recipe;

/* Makes a recipe that leaves all choices to a preset; NULL for "default". Keeps the address of the name.
 *
 * Errors: INVALID_ARGUMENT for an unknown name. */
ANTUMBRA_API antumbra_status antumbra_recipe_init(antumbra_recipe *recipe, const char *preset);

/* Options of a build. */
typedef struct antumbra_build {
    /* sizeof(antumbra_build) */
    size_t size;
    /* NULL for the default. */
    const antumbra_recipe *recipe;
    /* Rays to learn from: some thousand rays like those to come, taken at random from the whole job. They pay if they differ
     * from rays between surfaces, from which every tree learns by default. For objects they are in the space of the object. */
    const antumbra_ray *rays;
    size_t ray_count;
    size_t ray_stride;
    /* Passed to both callbacks, which are called from the threads of the build, several at a time. */
    void *data;
    /* Receives how much of the build is done, from 0 to 1. May be NULL. */
    void (*progress)(void *data, float done);
    /* Returns whether to stop the build, which then fails with CANCELLED. Called often; should be short. May be NULL. */
    int32_t (*cancelled)(void *data);
    /* NULL for the default pool. */
    const antumbra_threads *threads;
} antumbra_build;

/* Options of a build by the default recipe. */
static inline antumbra_build antumbra_build_init(void) {
    antumbra_build options = {sizeof(antumbra_build), NULL, NULL, 0, 0, NULL, NULL, NULL, NULL};
    return options;
}

/* A tree: a bounding volume hierarchy (BVH) over geometry, which answers queries. */
typedef struct antumbra_bvh antumbra_bvh;

/* Geometry with its tree, to be placed in worlds by instances: see 11. */
typedef struct antumbra_object antumbra_object;

/* Builds a tree over a scene. An empty scene is fine. `options` may be NULL.
 *
 * Errors: INVALID_ARGUMENT, BAD_GEOMETRY, TOO_MANY, NO_MEMORY, CANCELLED. */
ANTUMBRA_API antumbra_status antumbra_bvh_build(const antumbra_scene *scene, const antumbra_build *options, antumbra_bvh **bvh);

/* An object in a world. 56 bytes. */
typedef struct antumbra_instance {
    /* Index in the list of objects. */
    uint32_t object;
    /* Rays with a mask enter the instance only if they have a bit in common with it. UINT32_MAX for all bits. */
    uint32_t mask;
    /* From the object to the world: the rows of an affine 3x4 matrix, translation last in each row. Anything that can be
     * inverted. An instance whose transform cannot be is dropped. */
    float transform[12];
} antumbra_instance;

/* Builds one tree over a ground, objects and their instances, none of which will move. Learns all levels together, so it
 * answers faster than a world, and takes longer to build. `ground` may be NULL. Hits of instance i have the inst_id i.
 *
 * Errors: as antumbra_bvh_build(); BAD_GEOMETRY if an instance names an object that is not there. */
ANTUMBRA_API antumbra_status antumbra_bvh_build_instances(const antumbra_scene *ground, const antumbra_scene *const *objects,
                                                          size_t object_count, const antumbra_instance *instances,
                                                          size_t instance_count, const antumbra_build *options,
                                                          antumbra_bvh **bvh);

/* Frees a tree. Not for trees that antumbra_world_bvh() or antumbra_object_bvh() lent. */
ANTUMBRA_API void antumbra_bvh_free(antumbra_bvh *bvh);

/* Builds an object. `options` may be NULL. Errors: as antumbra_bvh_build(). */
ANTUMBRA_API antumbra_status antumbra_object_build(const antumbra_scene *scene, const antumbra_build *options,
                                                   antumbra_object **object);

/* Frees an object. Worlds that it joined keep what they have. */
ANTUMBRA_API void antumbra_object_free(antumbra_object *object);

/* Lends the tree of an object, in its own space and without masks. It lives as long as the object, and is not freed. */
ANTUMBRA_API antumbra_status antumbra_object_bvh(const antumbra_object *object, const antumbra_bvh **bvh);

/* What was built. The library writes all fields. */
typedef struct antumbra_report {
    size_t size;
    /* Primitives in the tree, of an object once; a quad counts as two triangles. */
    size_t primitives;
    /* Partly transparent triangles among them. */
    size_t cutouts;
    size_t instances;
    size_t objects;
    /* Primitives and instances that were left out because nothing can hit them. */
    size_t dropped;
    /* Triangles that were left out because they are clear. */
    size_t transparent;
    size_t nodes;
    /* Blocks of primitives. */
    size_t leaves;
    /* Levels of nodes. */
    size_t depth;
    /* Bytes of nodes, leaves and instances. */
    size_t bytes;
    /* Rays that the child order was learned from. */
    uint64_t training_rays;
    /* Expected cost of a ray by the surface area heuristic. */
    double sah;
    /* Children per node. */
    uint32_t width;
    /* Whether batches prefetch. */
    uint32_t prefetches;
    /* Name of the instruction set. */
    char level[16];
} antumbra_report;

/* Returns what was built. */
ANTUMBRA_API antumbra_status antumbra_bvh_report(const antumbra_bvh *bvh, antumbra_report *report);

/* Returns the smallest box around everything, empty for an empty tree, and the distance from a surface at which rays that
 * leave it should begin. Rays that begin nearer have exact answers too, but take longer. Both may be NULL. */
ANTUMBRA_API antumbra_status antumbra_bvh_bounds(const antumbra_bvh *bvh, antumbra_box *bounds, float *origin_offset);

/* ------------------------------------------------------------------------------------------------------------------------
 * 6  Queries of one ray
 *
 * For programs that learn of rays one by one. Batches answer a ray in about half the time. For one ray with a mask, a filter
 * or an excluded primitive give a batch of one ray.
 *
 * A query allocates nothing and takes no lock. Errors: INVALID_ARGUMENT for null pointers and misaligned structures.
 * ------------------------------------------------------------------------------------------------------------------------ */

/* Returns whether anything is in the interval of a ray. */
ANTUMBRA_API antumbra_status antumbra_occluded1(const antumbra_bvh *bvh, const antumbra_ray *ray, bool *occluded);

/* Returns the closest hit of a ray. */
ANTUMBRA_API antumbra_status antumbra_intersect1(const antumbra_bvh *bvh, const antumbra_ray *ray, antumbra_hit *hit);

/* Returns the closest hit of a ray with position and normal. */
ANTUMBRA_API antumbra_status antumbra_surface1(const antumbra_bvh *bvh, const antumbra_ray *ray, antumbra_surface *surface);

/* Returns any primitive in the interval of a ray, not the closest one; all ids are ANTUMBRA_INVALID_ID if there is none. Which
 * primitive it is depends on the tree, whether there is one does not. */
ANTUMBRA_API antumbra_status antumbra_occluder1(const antumbra_bvh *bvh, const antumbra_ray *ray, antumbra_prim_id *occluder);

/* ------------------------------------------------------------------------------------------------------------------------
 * 7  Batches: many rays
 *
 * The fast way. Give a hundred rays or more at once, neighbours one after the other. No batch is slower than a loop of single
 * queries. Packed rays at a multiple of 4 bytes are traced where they are; others are copied a few thousand at a time.
 *
 * Answer i is that of ray i. Answers have a stride, as inputs have.
 * ------------------------------------------------------------------------------------------------------------------------ */

/* Flags of batches, groups and points. */
enum {
    /* Hits at tnear and at tfar count as well. Only for batches. */
    ANTUMBRA_CLOSED = 1,
    /* No other thread takes part, and `threads` has no effect. */
    ANTUMBRA_THIS_THREAD = 2
};

/* Order in which rays are traced, `order` of a batch. No order changes an answer or its place. */
enum {
    /* As they are given. */
    ANTUMBRA_ORDER_AS_GIVEN = 0,
    /* As they are given; what occluded the rays before is tested first. For rays from one point to the points of a surface. */
    ANTUMBRA_ORDER_ALIKE = 1,
    /* Sorted by origin and direction. For scattered rays in large trees. */
    ANTUMBRA_ORDER_SORTED = 2,
    /* Sorted if a look at the rays says that it pays. */
    ANTUMBRA_ORDER_BY_RULE = 3
};

/* Rays and conditions on what they may hit. A hit counts if it meets all of them. */
typedef struct antumbra_batch {
    /* sizeof(antumbra_batch) */
    size_t size;
    /* Number of rays. */
    size_t count;
    /* Rays as structures, or NULL for rays in arrays of their own. */
    const antumbra_ray *rays;
    size_t ray_stride;
    /* Rays in arrays of their own: origins and directions of 3 floats, and the ends of intervals. ANTUMBRA_SAME_FOR_ALL is
     * possible for each. Without `tnear` intervals begin at 0, without `tfar` they have no end. */
    const float *origins;
    size_t origin_stride;
    const float *directions;
    size_t direction_stride;
    const float *tnear;
    size_t tnear_stride;
    const float *tfar;
    size_t tfar_stride;
    /* A mask for each ray, or one for all with ANTUMBRA_SAME_FOR_ALL; NULL for rays that hit everything. */
    const uint32_t *masks;
    size_t mask_stride;
    /* A primitive for each ray that it does not hit, for rays that start on surfaces; NULL for none. All ids
     * ANTUMBRA_INVALID_ID exclude nothing. A quad and a sphere are excluded as a whole. */
    const antumbra_prim_id *except;
    size_t except_stride;
    /* Passed to `filter`. */
    void *data;
    /* Returns whether a hit counts, given the number of the ray in the batch. Must decide the same about the same hit. Called
     * in no defined order, perhaps twice with a hit. NULL: all hits count. */
    int32_t (*filter)(void *data, size_t ray, const antumbra_hit *hit);
    /* ANTUMBRA_CLOSED and ANTUMBRA_THIS_THREAD, combined by |. */
    uint32_t flags;
    /* ANTUMBRA_ORDER_... */
    uint32_t order;
    /* NULL for the default pool. */
    const antumbra_threads *threads;
} antumbra_batch;

/* A batch of packed rays without conditions. */
static inline antumbra_batch antumbra_batch_of(const antumbra_ray *rays, size_t count) {
    antumbra_batch batch = {sizeof(antumbra_batch), 0, NULL, 0, NULL, 0, NULL, 0, NULL, 0, NULL, 0,
                            NULL, 0, NULL, 0, NULL, NULL, 0, 0, NULL};
    batch.rays = rays;
    batch.count = count;
    return batch;
}

/* A batch of rays in packed arrays: origins and directions of 3 floats each, intervals (0, INFINITY). */
static inline antumbra_batch antumbra_batch_of_arrays(const float *origins, const float *directions, size_t count) {
    antumbra_batch batch = antumbra_batch_of(NULL, count);
    batch.origins = origins;
    batch.directions = directions;
    return batch;
}

/* Writes for each ray whether anything that counts is in its interval: a byte, 1 or 0. A bool of C has the size of a byte. */
ANTUMBRA_API antumbra_status antumbra_occluded(const antumbra_bvh *bvh, const antumbra_batch *batch, uint8_t *occluded,
                                               size_t stride);

/* antumbra_occluded() with a bit for each ray: bit i % 64 of bits[i / 64]. Bits behind the last ray become 0. `word_count` must
 * be (count + 63) / 64, and `bits` a multiple of 8 bytes. */
ANTUMBRA_API antumbra_status antumbra_occluded_bits(const antumbra_bvh *bvh, const antumbra_batch *batch, uint64_t *bits,
                                                    size_t word_count);

/* Writes the closest hit of each ray that counts. */
ANTUMBRA_API antumbra_status antumbra_intersect(const antumbra_bvh *bvh, const antumbra_batch *batch, antumbra_hit *hits,
                                                size_t stride);

/* Writes the closest hit of each ray that counts, with position and normal. Takes about 1.25 times as long as
 * antumbra_intersect(). */
ANTUMBRA_API antumbra_status antumbra_surface_of(const antumbra_bvh *bvh, const antumbra_batch *batch,
                                                 antumbra_surface *surfaces, size_t stride);

/* Writes any primitive that occludes each ray, not the closest one: see antumbra_occluder1(). Takes about 1.25 times as long as
 * antumbra_occluded(). */
ANTUMBRA_API antumbra_status antumbra_occluder(const antumbra_bvh *bvh, const antumbra_batch *batch, antumbra_prim_id *occluders,
                                               size_t stride);

/* ------------------------------------------------------------------------------------------------------------------------
 * 8  All hits
 *
 * Hits of a ray come front to back, by (t, inst_id, geom_id, prim_id). Each primitive comes once for every instance: a sphere
 * with the nearer of its points in the interval, a quad perhaps once for each of its triangles.
 * ------------------------------------------------------------------------------------------------------------------------ */

/* Answers of `visit`. */
enum {
    /* Go on to the next hit of the ray. */
    ANTUMBRA_REJECT = 0,
    /* The ray ends here. */
    ANTUMBRA_ACCEPT = 1,
    /* The ray ends here, and has no hit. The same as ANTUMBRA_ACCEPT for the caller, who has seen the hit. */
    ANTUMBRA_STOP = 2
};

/* Calls `visit` with the hits of each ray that count, front to back, until it returns something else than ANTUMBRA_REJECT.
 * `ray` is the number of the ray in the batch. Calls for one ray come one after another; different rays may be on different
 * threads. For shadow rays through glass, and whatever accumulates along a ray.
 *
 * Errors: INVALID_ARGUMENT, also if `visit` returns an unknown number, which ends the ray. */
ANTUMBRA_API antumbra_status antumbra_visit_hits(const antumbra_bvh *bvh, const antumbra_batch *batch,
                                                 int32_t (*visit)(void *data, size_t ray, const antumbra_hit *hit), void *data);

/* Writes the number of hits of each ray that count. */
ANTUMBRA_API antumbra_status antumbra_count_hits(const antumbra_bvh *bvh, const antumbra_batch *batch, uint32_t *counts,
                                                 size_t stride);

/* Hits of many rays, one list after the other. */
typedef struct antumbra_hit_lists antumbra_hit_lists;

/* Lists all hits of each ray that count. */
ANTUMBRA_API antumbra_status antumbra_all_hits(const antumbra_bvh *bvh, const antumbra_batch *batch, antumbra_hit_lists **lists);

/* Lends the arrays: hits of ray i are hits[splits[i]] to hits[splits[i + 1] - 1]. `splits` has one number more than there are
 * rays, the last is `hit_count`. The arrays live as long as the lists. Each of the three may be NULL. */
ANTUMBRA_API antumbra_status antumbra_hit_lists_get(const antumbra_hit_lists *lists, const size_t **splits,
                                                    const antumbra_hit **hits, size_t *hit_count);

/* Frees lists of hits. */
ANTUMBRA_API void antumbra_hit_lists_free(antumbra_hit_lists *lists);

/* ------------------------------------------------------------------------------------------------------------------------
 * 9  Groups: points times directions
 *
 * Many points that look in the same directions: suns of a year, patches of a sky, ambient occlusion. Faster than the same rays
 * as a batch. Points should be near the ones before and after them, as the vertices of a mesh are. Directions may be in any
 * order.
 * ------------------------------------------------------------------------------------------------------------------------ */

/* Directions, sorted for the kernel. */
typedef struct antumbra_directions antumbra_directions;

/* Prepares directions of 3 floats, of any length. A direction that is zero, not finite or shorter than 3e-39 has the bit 0
 * for all points. */
ANTUMBRA_API antumbra_status antumbra_directions_new(const float *directions, size_t count, size_t stride,
                                                     antumbra_directions **prepared);

/* Frees directions. */
ANTUMBRA_API void antumbra_directions_free(antumbra_directions *directions);

/* Points that look around. */
typedef struct antumbra_group {
    /* sizeof(antumbra_group) */
    size_t size;
    /* Number of points. */
    size_t count;
    /* 3 floats each. A point that is not finite has no rays. */
    const float *points;
    size_t point_stride;
    /* Normals of the surfaces that the points are on, 3 floats each, of any length: directions that are not above the surface
     * have the bit 0. NULL: all directions. ANTUMBRA_SAME_FOR_ALL is possible. */
    const float *normals;
    size_t normal_stride;
    /* Where the rays of each point begin, in lengths of the direction. NULL: 0. ANTUMBRA_SAME_FOR_ALL is possible. */
    const float *tnear;
    size_t tnear_stride;
    /* Where all rays end, in lengths of the direction. */
    float tfar;
    /* ANTUMBRA_THIS_THREAD or 0. */
    uint32_t flags;
    /* NULL for the default pool. */
    const antumbra_threads *threads;
} antumbra_group;

/* A group of packed points whose rays have no end. */
static inline antumbra_group antumbra_group_of(const float *points, size_t count) {
    antumbra_group group = {sizeof(antumbra_group), 0, NULL, 0, NULL, 0, NULL, 0, INFINITY, 0, NULL};
    group.points = points;
    group.count = count;
    return group;
}

/* Writes which rays nothing is in the way of: bit j % 64 of bits[i * words_per_row + j / 64] is of point i and direction j.
 * Bits behind the last direction become 0. `words_per_row` must be (directions + 63) / 64, and `bits` a multiple of 8 bytes. Each
 * answer equals the answer of antumbra_occluded1(). */
ANTUMBRA_API antumbra_status antumbra_group_open(const antumbra_bvh *bvh, const antumbra_group *group,
                                                 const antumbra_directions *directions, uint64_t *bits, size_t words_per_row);

/* ------------------------------------------------------------------------------------------------------------------------
 * 10  Points: closest, inside, signed distance
 *
 * Distances are distances to surfaces, in the world. Points of a grid or a curve are fastest in that order. Partly transparent
 * triangles count as opaque.
 *
 * Errors: INVALID_ARGUMENT; UNSUPPORTED if a query for distances comes to user geometry without `closest_point`.
 * ------------------------------------------------------------------------------------------------------------------------ */

/* Points, and how far they look. */
typedef struct antumbra_points {
    /* sizeof(antumbra_points) */
    size_t size;
    /* Number of points. */
    size_t count;
    /* 3 floats each. */
    const float *points;
    size_t point_stride;
    /* Largest distance for each point. NULL: no limit. ANTUMBRA_SAME_FOR_ALL is possible. Only for antumbra_closest() and
     * antumbra_within(). */
    const float *max_distances;
    size_t max_distance_stride;
    /* ANTUMBRA_THIS_THREAD or 0. */
    uint32_t flags;
    /* 0 */
    uint32_t reserved;
    /* NULL for the default pool. */
    const antumbra_threads *threads;
} antumbra_points;

/* Packed points that look without limit. */
static inline antumbra_points antumbra_points_of(const float *points, size_t count) {
    antumbra_points options = {sizeof(antumbra_points), 0, NULL, 0, NULL, 0, 0, 0, NULL};
    options.points = points;
    options.count = count;
    return options;
}

/* Where a primitive is nearest to a point. 36 bytes.
 *
 * If nothing is near enough, or the point is not finite, `distance` and `position` are INFINITY and the ids are
 * ANTUMBRA_INVALID_ID. */
typedef struct antumbra_closest_point {
    float distance;
    float position[3];
    /* As in antumbra_hit. */
    float u;
    float v;
    uint32_t prim_id;
    uint32_t geom_id;
    uint32_t inst_id;
} antumbra_closest_point;

/* Writes the nearest primitive of each point within its largest distance. At equal distances the smallest (inst_id, geom_id,
 * prim_id). */
ANTUMBRA_API antumbra_status antumbra_closest(const antumbra_bvh *bvh, const antumbra_points *points,
                                              antumbra_closest_point *closest, size_t stride);

/* Writes for each point whether it is inside of a sphere or a closed mesh: a byte, 1 or 0. Exact if every edge is shared, with
 * the same coordinates, by an even number of triangles. 0 for points that are not finite. */
ANTUMBRA_API antumbra_status antumbra_contains(const antumbra_bvh *bvh, const antumbra_points *points, uint8_t *inside,
                                               size_t stride);

/* Writes the distance of the nearest surface from each point, negative inside, see antumbra_contains(). INFINITY if there is no
 * geometry, NAN for points that are not finite. */
ANTUMBRA_API antumbra_status antumbra_signed_distance(const antumbra_bvh *bvh, const antumbra_points *points, float *distances,
                                                      size_t stride);

/* Writes how often closed surfaces go around each point: 1 in a mesh whose triangles turn counter-clockwise seen from outside, 0
 * outside, the sum where bodies overlap. */
ANTUMBRA_API antumbra_status antumbra_winding_number(const antumbra_bvh *bvh, const antumbra_points *points, int32_t *numbers,
                                                     size_t stride);

/* Primitives near many points, one list after the other. */
typedef struct antumbra_closest_lists antumbra_closest_lists;

/* Lists all primitives within the largest distance of each point, the nearest first. */
ANTUMBRA_API antumbra_status antumbra_within(const antumbra_bvh *bvh, const antumbra_points *points,
                                             antumbra_closest_lists **lists);

/* Lends the arrays, as antumbra_hit_lists_get(). */
ANTUMBRA_API antumbra_status antumbra_closest_lists_get(const antumbra_closest_lists *lists, const size_t **splits,
                                                        const antumbra_closest_point **items, size_t *item_count);

/* Frees lists of near primitives. */
ANTUMBRA_API void antumbra_closest_lists_free(antumbra_closest_lists *lists);

/* ------------------------------------------------------------------------------------------------------------------------
 * 11  Trees that change, and worlds
 * ------------------------------------------------------------------------------------------------------------------------ */

/* Replaces the masks of all geometries of a tree: mask i belongs to geometry i. Geometries behind the last mask have all bits.
 * Files do not hold masks, so loaded trees need them again.
 *
 * Errors: UNSUPPORTED if the tree has instances. */
ANTUMBRA_API antumbra_status antumbra_bvh_set_masks(antumbra_bvh *bvh, const uint32_t *masks, size_t count);

/* Moves the primitives of a tree. `scene` has the geometries of the build with other vertices: see
 * antumbra_scene_set_positions(). Far cheaper than a build. Answers equal the answers of a new tree, bit for bit. A refit keeps the
 * nodes, so queries become slower the more the primitives move: see antumbra_bvh_quality(). Masks stay.
 *
 * Errors: OTHER_GEOMETRY if other primitives can be hit than at the build; UNSUPPORTED if the tree has instances. */
ANTUMBRA_API antumbra_status antumbra_bvh_refit(antumbra_bvh *bvh, const antumbra_scene *scene, const antumbra_threads *threads);

/* Returns the expected cost of a ray now over that before the first refit. Build again from about 1.5 on. */
ANTUMBRA_API antumbra_status antumbra_bvh_quality(const antumbra_bvh *bvh, double *quality);

/* The order of children that a tree or a world learned, for copies of it. */
typedef struct antumbra_child_order antumbra_child_order;

/* Learns the child order again, for the rays of today, on the calling thread. Answers stay. Takes some ten milliseconds for a
 * few thousand rays. Of the recipe, which may be NULL, the order and the seed count. `learned` may be NULL; otherwise it takes
 * the order, which belongs to the caller.
 *
 * To learn beside frames, give antumbra_bvh_copy() to a thread of its own, and adopt what it learned between two frames. */
ANTUMBRA_API antumbra_status antumbra_bvh_relearn(antumbra_bvh *bvh, const antumbra_ray *rays, size_t ray_count,
                                                  size_t ray_stride, const antumbra_recipe *recipe,
                                                  antumbra_child_order **learned);

/* Puts children in the order that a copy of this tree learned, in about a tenth of a millisecond. Answers stay. Both may have
 * been refitted since they were copied. The order of another tree changes nothing that matters. */
ANTUMBRA_API antumbra_status antumbra_bvh_adopt(antumbra_bvh *bvh, const antumbra_child_order *order);

/* Frees an order. */
ANTUMBRA_API void antumbra_child_order_free(antumbra_child_order *order);

/* Copies a tree. User geometry and opacities are shared by the copies: what `release` of them frees lives as long as the last. */
ANTUMBRA_API antumbra_status antumbra_bvh_copy(const antumbra_bvh *bvh, antumbra_bvh **copy);

/* Objects that instances place, and that may move. A world copies the trees of its objects. */
typedef struct antumbra_world antumbra_world;

/* Makes a world. `ground` is an object that is part of the world itself, or NULL. Takes the masks of objects
 * and instances. The place of an instance in the list is its inst_id. `threads` may be NULL.
 *
 * Errors: BAD_GEOMETRY if an instance names an object that is not there; OTHER_GEOMETRY if objects have different widths. */
ANTUMBRA_API antumbra_status antumbra_world_new(const antumbra_object *ground, const antumbra_object *const *objects,
                                                size_t object_count, const antumbra_instance *instances, size_t instance_count,
                                                const antumbra_threads *threads, antumbra_world **world);

/* Frees a world. */
ANTUMBRA_API void antumbra_world_free(antumbra_world *world);

/* Lends the tree over everything, for queries. It lives as long as the world, also when instances change, and is not freed. No
 * query may run while a function changes the world. */
ANTUMBRA_API antumbra_status antumbra_world_bvh(const antumbra_world *world, const antumbra_bvh **bvh);

/* Replaces the list of instances: some may have moved, some be new, some be gone. Builds the nodes above the objects again.
 * Instances that are as they were cost least. If it fails the world stays as it was.
 *
 * Errors: BAD_GEOMETRY if an instance names an object that is not there. */
ANTUMBRA_API antumbra_status antumbra_world_set_instances(antumbra_world *world, const antumbra_instance *instances,
                                                          size_t instance_count, const antumbra_threads *threads);

/* Moves the vertices of some objects, and replaces the list of instances. Object objects[i] takes the vertices of scenes[i], see
 * antumbra_bvh_refit(). ANTUMBRA_INVALID_ID stands for the ground. If it fails the world stays as it was.
 *
 * Errors: as antumbra_bvh_refit() and antumbra_world_set_instances(). */
ANTUMBRA_API antumbra_status antumbra_world_refit(antumbra_world *world, const uint32_t *objects,
                                                  const antumbra_scene *const *scenes, size_t object_count,
                                                  const antumbra_instance *instances, size_t instance_count,
                                                  const antumbra_threads *threads);

/* Adds an object, which no instance places yet, and returns its index. `index` may be NULL. */
ANTUMBRA_API antumbra_status antumbra_world_add_object(antumbra_world *world, const antumbra_object *object, uint32_t *index);

/* Replaces the masks of the geometries of an object, or of the ground with ANTUMBRA_INVALID_ID: see antumbra_bvh_set_masks(). */
ANTUMBRA_API antumbra_status antumbra_world_set_masks(antumbra_world *world, uint32_t object, const uint32_t *masks,
                                                      size_t count);

/* antumbra_bvh_relearn() for a world. Where instances change, the nodes above objects keep the order by the places of instances
 * in the list. */
ANTUMBRA_API antumbra_status antumbra_world_relearn(antumbra_world *world, const antumbra_ray *rays, size_t ray_count,
                                                    size_t ray_stride, const antumbra_recipe *recipe,
                                                    antumbra_child_order **learned);

/* antumbra_bvh_adopt() for a world. The nodes above objects take the order when instances are set next. */
ANTUMBRA_API antumbra_status antumbra_world_adopt(antumbra_world *world, const antumbra_child_order *order);

/* Copies a world, with its masks. */
ANTUMBRA_API antumbra_status antumbra_world_copy(const antumbra_world *world, antumbra_world **copy);

/* antumbra_bvh_quality() of an object of a world. */
ANTUMBRA_API antumbra_status antumbra_world_quality(const antumbra_world *world, uint32_t object, double *quality);

/* ------------------------------------------------------------------------------------------------------------------------
 * 12  Files
 *
 * Trees, objects and worlds can be saved with everything that they learned, and loaded on any machine. Loading takes about as
 * long as a copy. Masks are not saved, and neither are functions: whoever loads a file gives these again. Files are not trusted:
 * a damaged or forged one is an error.
 *
 * Paths are bytes as the system takes them; on Windows they are UTF-8. A file is written under another name and renamed, so
 * there is never half of one. An existing file is replaced;
 * a symbolic link stays and leads to the new file, and a device or a pipe is written to as it is.
 * ------------------------------------------------------------------------------------------------------------------------ */

/* Functions that files cannot hold: one for each user geometry of which there is a primitive, and one for each mesh with an
 * opacity. Both lists go by geometry: first of the tree or the ground, then of object 0, of object 1 and so on. */
typedef struct antumbra_functions {
    /* sizeof(antumbra_functions) */
    size_t size;
    const antumbra_user_geometry *const *user_geometries;
    size_t user_geometry_count;
    const antumbra_opacity *const *opacities;
    size_t opacity_count;
} antumbra_functions;

/* No functions yet. */
static inline antumbra_functions antumbra_functions_init(void) {
    antumbra_functions functions = {sizeof(antumbra_functions), NULL, 0, NULL, 0};
    return functions;
}

/* Writes a tree, an object or a world into a file. Errors: IO. */
ANTUMBRA_API antumbra_status antumbra_bvh_save(const antumbra_bvh *bvh, const char *path);
ANTUMBRA_API antumbra_status antumbra_object_save(const antumbra_object *object, const char *path);
ANTUMBRA_API antumbra_status antumbra_world_save(const antumbra_world *world, const char *path);

/* Reads a tree, an object or a world from a file. `functions` may be NULL if the file needs none.
 *
 * Errors: IO, UNREADABLE, OTHER_FUNCTIONS. */
ANTUMBRA_API antumbra_status antumbra_bvh_load(const char *path, const antumbra_functions *functions, antumbra_bvh **bvh);
ANTUMBRA_API antumbra_status antumbra_object_load(const char *path, const antumbra_functions *functions,
                                                  antumbra_object **object);
ANTUMBRA_API antumbra_status antumbra_world_load(const char *path, const antumbra_functions *functions, antumbra_world **world);

/* Writes what the save functions write into memory of the library, which antumbra_memory_free() frees. */
ANTUMBRA_API antumbra_status antumbra_bvh_to_memory(const antumbra_bvh *bvh, uint8_t **bytes, size_t *byte_count);
ANTUMBRA_API antumbra_status antumbra_object_to_memory(const antumbra_object *object, uint8_t **bytes, size_t *byte_count);
ANTUMBRA_API antumbra_status antumbra_world_to_memory(const antumbra_world *world, uint8_t **bytes, size_t *byte_count);

/* Reads what the functions above wrote, as the load functions do. No byte may be left over. */
ANTUMBRA_API antumbra_status antumbra_bvh_from_memory(const uint8_t *bytes, size_t byte_count,
                                                      const antumbra_functions *functions, antumbra_bvh **bvh);
ANTUMBRA_API antumbra_status antumbra_object_from_memory(const uint8_t *bytes, size_t byte_count,
                                                         const antumbra_functions *functions, antumbra_object **object);
ANTUMBRA_API antumbra_status antumbra_world_from_memory(const uint8_t *bytes, size_t byte_count,
                                                        const antumbra_functions *functions, antumbra_world **world);

/* Frees memory that one of the functions above returned, with the number of bytes that it returned. */
ANTUMBRA_API void antumbra_memory_free(uint8_t *bytes, size_t byte_count);

/* ------------------------------------------------------------------------------------------------------------------------
 * 13  Height fields
 *
 * What the cells of a raster of heights see, such as of a digital elevation model: exact for its surface, without a tree and
 * without rays, for all cells at once. The surface has a vertex at the centre of each cell. Each square between four centres is
 * two triangles, which share the diagonal from the first to the last of them: give rows from north to south and columns from west
 * to east for the triangles that programs of maps have. A square with three centres is one triangle, and one with fewer is a hole.
 *
 * Answers are packed arrays of all cells, row by row, with the same bits for any number of threads. `threads` may be NULL.
 *
 * Errors: INVALID_ARGUMENT, NO_MEMORY.
 * ------------------------------------------------------------------------------------------------------------------------ */

/* Heights of cells, and where these are. */
typedef struct antumbra_height_field antumbra_height_field;

/* What of the sky is measured: the part of the light of an even sky that the surface of a cell receives (its sky view factor), the
 * part of the hemisphere above that nothing hides, and the degrees from the zenith down to the horizon on average. */
enum {
    ANTUMBRA_SKY_VIEW = 0,
    ANTUMBRA_SKY_OPEN = 1,
    ANTUMBRA_SKY_OPENNESS = 2
};

/* Makes a height field of rows * columns heights, row by row, which are copied. NAN is no data. `transform` has 6 numbers in
 * the order of GDAL, and says where corners of cells are on the map: x = t[0] + column * t[1] + row * t[2], y = t[3] + column *
 * t[4] + row * t[5]. NULL stands for cells of 1 in rows from north to south.
 *
 * Errors: INVALID_ARGUMENT if there are no cells, they have no size, or a height is infinite; NO_MEMORY. */
ANTUMBRA_API antumbra_status antumbra_height_field_new(const double *heights, size_t rows, size_t columns, size_t stride,
                                                       const double *transform, antumbra_height_field **field);

/* Writes the azimuths of a lattice of so many, 8, 16, 32, 48, 80, 96, 144, 176 or 224: degrees from the north of the map (y)
 * through east. They are steps between cells, and not evenly spread. */
ANTUMBRA_API antumbra_status antumbra_height_field_lattice(const antumbra_height_field *field, size_t count, double *azimuths);

/* Writes how high the horizon of each cell is in an azimuth, in degrees: -90 where no surface is ahead, NAN without data. Eyes
 * are `rise` above their cells, and places d away lie `drop` * d * d lower; 0 for a flat earth. Azimuths of the lattices of 8
 * and 16 take the least time. */
ANTUMBRA_API antumbra_status antumbra_height_field_horizons(const antumbra_height_field *field, double azimuth, double rise,
                                                            double drop, const antumbra_threads *threads, float *angles);

/* Writes how open the sky is over each cell, summed over the horizons in the azimuths of a lattice of so many; NAN without data.
 * Eyes are `rise` above their cells. `measure` is ANTUMBRA_SKY_VIEW, ANTUMBRA_SKY_OPEN or ANTUMBRA_SKY_OPENNESS. The sky ends at the
 * horizontal, so nothing beyond the border of the field hides it. */
ANTUMBRA_API antumbra_status antumbra_height_field_sky(const antumbra_height_field *field, size_t count, uint32_t measure,
                                                       double rise, const antumbra_threads *threads, float *values);

/* Writes which cells see lights far away: bytes 1 or 0, for each light all cells. A light is 2 doubles, its azimuth and its
 * elevation above the horizon in degrees, from -90 to 90. A light exactly on the horizon of a cell is hidden, and cells without
 * data have 0. */
ANTUMBRA_API antumbra_status antumbra_height_field_lit(const antumbra_height_field *field, const double *lights, size_t count,
                                                       size_t stride, double rise, const antumbra_threads *threads,
                                                       uint8_t *lit);

/* Returns the height of the surface at x, y of the map; NAN beside it. */
ANTUMBRA_API antumbra_status antumbra_height_field_height(const antumbra_height_field *field, double x, double y,
                                                          double *height);

/* Writes which cells an eye at x, y, z sees, 3 doubles on the map: bytes 1 or 0. A cell is seen if no part of the surface is above
 * the line to its centre, raised by `target`, and it is at most `radius` away in plan, which may be INFINITY. An eye whose z is
 * NAN is on the surface, and one below it sees nothing. `drop` is as for antumbra_height_field_horizons(). */
ANTUMBRA_API antumbra_status antumbra_height_field_viewshed(const antumbra_height_field *field, const double *eye, double target,
                                                            double radius, double drop, const antumbra_threads *threads,
                                                            uint8_t *seen);

/* Frees a height field. */
ANTUMBRA_API void antumbra_height_field_free(antumbra_height_field *field);

#ifdef __cplusplus
}
#endif

#endif
