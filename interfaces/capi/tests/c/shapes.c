/* Kinds of geometry, masks, opacities and double precision, against closed forms. */
#include "check.h"

static antumbra_ray down(float x, float y) {
    const float org[3] = {x, y, 10.0f}, dir[3] = {0.0f, 0.0f, -1.0f};
    return antumbra_ray_from(org, dir);
}

/* Cubes of side 2 in a row along x, 4 apart: user geometry. */
typedef struct cubes {
    int released;
    int has_moved;
} cubes;

static void cube_bounds(void *data, uint32_t prim_id, antumbra_box *bounds) {
    const cubes *own = data;
    int axis;
    for (axis = 0; axis < 3; ++axis) {
        bounds->min[axis] = -1.0f;
        bounds->max[axis] = 1.0f;
    }
    bounds->min[0] += 4.0f * (float)prim_id;
    bounds->max[0] += 4.0f * (float)prim_id;
    bounds->max[2] += (float)own->has_moved;
}

/* The upper side is all that is hit. */
static int32_t cube_intersect(void *data, uint32_t prim_id, const antumbra_ray *ray, antumbra_user_hit *hit) {
    const cubes *own = data;
    float t = (1.0f + (float)own->has_moved - ray->org[2]) / ray->dir[2];
    float x = ray->org[0] + t * ray->dir[0] - 4.0f * (float)prim_id, y = ray->org[1] + t * ray->dir[1];
    if (!(fabsf(x) <= 1.0f && fabsf(y) <= 1.0f)) {
        return 0;
    }
    hit->t = t;
    hit->u = x;
    hit->v = y;
    return 1;
}

static int32_t cube_normal(void *data, uint32_t prim_id, const antumbra_ray *ray, const antumbra_user_hit *hit, float *normal) {
    (void)data, (void)ray;
    CHECK(fabsf(hit->u) <= 1.0f);
    normal[0] = normal[1] = 0.0f;
    normal[2] = 5.0f;
    return prim_id != 2;
}

static int32_t cube_closest(void *data, uint32_t prim_id, const double *point, const double *world_from_object, double *closest) {
    int axis;
    (void)data;
    CHECK(world_from_object[0] == 1.0 && world_from_object[3] == 0.0 && world_from_object[10] == 1.0);
    for (axis = 0; axis < 3; ++axis) {
        double middle = axis == 0 ? 4.0 * prim_id : 0.0, x = point[axis] - middle;
        closest[axis] = middle + (x < -1.0 ? -1.0 : x > 1.0 ? 1.0 : x);
    }
    closest[2] = 1.0;
    return 1;
}

static void cube_release(void *data) { ((cubes *)data)->released += 1; }

static void user_geometry(void) {
    cubes own = {0, 0};
    antumbra_user_geometry functions = antumbra_user_geometry_init();
    antumbra_scene *scene;
    antumbra_bvh *bvh, *loaded = NULL;
    antumbra_surface surface;
    antumbra_closest_point near;
    antumbra_points points;
    antumbra_functions given = antumbra_functions_init();
    const antumbra_user_geometry *list[2];
    uint8_t *bytes;
    size_t byte_count;
    uint32_t geom_id = 99;
    float at[3] = {4.0f, 0.5f, 4.0f};
    antumbra_ray ray;
    bool occluded;
    double quality;

    functions.data = &own;
    functions.bounds = cube_bounds;
    functions.intersect = cube_intersect;
    functions.normal = cube_normal;
    functions.release = cube_release;
    OK(antumbra_scene_new(&scene));
    OK(antumbra_scene_add_user(scene, 5, &functions, &geom_id));
    CHECK(geom_id == 0);
    OK(antumbra_bvh_build(scene, NULL, &bvh));
    ray = down(12.25f, 0.5f);
    OK(antumbra_surface1(bvh, &ray, &surface));
    CHECK(surface.hit.t == 9.0f && surface.hit.u == 0.25f && surface.hit.v == 0.5f && surface.hit.prim_id == 3);
    CHECK(surface.normal[2] == 1.0f && surface.position[2] == 1.0f);
    ray = down(8.25f, 0.5f);
    OK(antumbra_surface1(bvh, &ray, &surface));
    CHECK(surface.hit.prim_id == 2 && surface.normal[2] == 0.0f);
    ray = down(2.0f, 0.5f);
    OK(antumbra_occluded1(bvh, &ray, &occluded));
    CHECK(!occluded);

    /* Without a function for it. */
    points = antumbra_points_of(at, 1);
    FAILS(antumbra_closest(bvh, &points, &near, 0), ANTUMBRA_UNSUPPORTED, "closest_point");
    FAILS(antumbra_signed_distance(bvh, &points, &at[0], 0), ANTUMBRA_UNSUPPORTED, "closest_point");
    OK(antumbra_occluded1(bvh, &ray, &occluded));

    /* The boxes are asked for again. */
    own.has_moved = 1;
    OK(antumbra_bvh_refit(bvh, scene, NULL));
    ray = down(12.25f, 0.5f);
    OK(antumbra_surface1(bvh, &ray, &surface));
    CHECK(surface.hit.t == 8.0f);
    OK(antumbra_bvh_quality(bvh, &quality));
    CHECK(quality > 0.0);
    own.has_moved = 0;

    OK(antumbra_bvh_to_memory(bvh, &bytes, &byte_count));
    CHECK(own.released == 0);
    antumbra_scene_free(scene);
    CHECK(own.released == 0);
    antumbra_bvh_free(bvh);
    CHECK(own.released == 1);

    /* The functions again; what fails releases nothing. */
    FAILS(antumbra_bvh_from_memory(bytes, byte_count, NULL, &loaded), ANTUMBRA_OTHER_FUNCTIONS, "needs 1");
    CHECK(loaded == NULL);
    functions.closest_point = cube_closest;
    list[0] = list[1] = &functions;
    given.user_geometries = list;
    given.user_geometry_count = 2;
    FAILS(antumbra_bvh_from_memory(bytes, byte_count, &given, &loaded), ANTUMBRA_OTHER_FUNCTIONS, "2 were given");
    CHECK(own.released == 1);
    given.user_geometry_count = 1;
    OK(antumbra_bvh_from_memory(bytes, byte_count, &given, &loaded));
    OK(antumbra_closest(loaded, &points, &near, 0));
    CHECK(near.distance == 3.0f && near.prim_id == 1 && near.position[1] == 0.5f);
    antumbra_bvh_free(loaded);
    CHECK(own.released == 2);
    antumbra_memory_free(bytes, byte_count);

    /* Taken by nobody. */
    functions.intersect = NULL;
    OK(antumbra_scene_new(&scene));
    FAILS(antumbra_scene_add_user(scene, 5, &functions, NULL), ANTUMBRA_INVALID_ARGUMENT, "intersect` is null");
    antumbra_scene_free(scene);
    CHECK(own.released == 2);
}

static float half_open(void *data, const antumbra_candidate *at) {
    int *calls = data;
    *calls += 1;
    CHECK(at->id.geom_id == 0 && at->id.inst_id == ANTUMBRA_INVALID_ID);
    CHECK(at->u >= 0.0f && at->v >= 0.0f && at->u + at->v <= 1.00001f);
    return at->u < 0.5f ? 1.0f : 0.0f;
}

static void opacity(void) {
    const float corners[9] = {0.0f, 0.0f, 0.0f, 1.0f, 0.0f, 0.0f, 0.0f, 1.0f, 0.0f};
    int calls = 0;
    antumbra_opacity function = antumbra_opacity_init();
    antumbra_scene *scene;
    antumbra_bvh *bvh;
    antumbra_build options = antumbra_build_init();
    antumbra_threads *threads;
    antumbra_report report;
    bool left, right;
    antumbra_ray ray;

    /* `calls` is not for several threads. */
    OK(antumbra_threads_new(1, &threads));
    options.threads = threads;
    function.data = &calls;
    function.opacity = half_open;
    OK(antumbra_scene_new(&scene));
    OK(antumbra_scene_add_triangles(scene, corners, 3, 0, NULL, 1, 0, NULL));
    OK(antumbra_scene_set_opacity(scene, 0, &function));
    OK(antumbra_bvh_build(scene, &options, &bvh));
    ray = down(0.25f, 0.2f);
    OK(antumbra_occluded1(bvh, &ray, &left));
    ray = down(0.75f, 0.2f);
    OK(antumbra_occluded1(bvh, &ray, &right));
    CHECK(left && !right && calls >= 2);
    OK(antumbra_bvh_report(bvh, &report));
    CHECK(report.size == sizeof report && report.cutouts == 1 && report.primitives == 1);
    antumbra_bvh_free(bvh);
    antumbra_scene_free(scene);
    antumbra_threads_free(threads);
}

static void curves(void) {
    /* Along y, the second segment to a tip; as one curve, and by its segments in another order, which cuts them apart. */
    const float points[12] = {0.0f, -1.0f, 1.0f, 0.5f, 0.0f, 0.0f, 1.0f, 0.5f, 0.0f, 1.0f, 1.0f, 0.0f};
    const uint32_t segments[2] = {1, 0};
    antumbra_scene *scene;
    antumbra_bvh *bvh;
    antumbra_hit hit;
    antumbra_ray ray;
    uint32_t ids[2];

    OK(antumbra_scene_new(&scene));
    OK(antumbra_scene_add_curves(scene, points, 3, 0, NULL, 2, 0, &ids[0]));
    OK(antumbra_bvh_build(scene, NULL, &bvh));
    ray = down(0.25f, -0.5f);
    OK(antumbra_intersect1(bvh, &ray, &hit));
    CHECK(hit.t == 9.0f && hit.geom_id == ids[0] && hit.prim_id == 0 && hit.u == 0.5f && hit.v == 0.25f);
    ray = down(0.2f, 0.5f);
    OK(antumbra_intersect1(bvh, &ray, &hit));
    CHECK(hit.prim_id == 1);
    ray = down(0.3f, 0.5f);
    OK(antumbra_intersect1(bvh, &ray, &hit));
    CHECK(hit.geom_id == ANTUMBRA_INVALID_ID);
    antumbra_bvh_free(bvh);

    OK(antumbra_scene_add_curves(scene, points, 3, 16, segments, 2, 4, &ids[1]));
    CHECK(ids[0] == 0 && ids[1] == 1);
    OK(antumbra_scene_set_mask(scene, 0, 0));
    OK(antumbra_bvh_build(scene, NULL, &bvh));
    antumbra_bvh_free(bvh);
    antumbra_scene_free(scene);
}

static void solids(void) {
    /* Two spheres with their radii between them, a disk, a quad. */
    const float spheres[8] = {0.0f, 0.0f, 0.0f, 2.0f, 10.0f, 0.0f, 0.0f, 1.0f};
    const float center[3] = {20.0f, 0.0f, 3.0f}, normal[3] = {0.0f, 0.0f, 7.0f}, radius = 1.0f;
    const float quad[12] = {29.0f, -1.0f, 1.0f, 31.0f, -1.0f, 1.0f, 31.0f, 1.0f, 1.0f, 29.0f, 1.0f, 1.0f};
    const uint32_t corners[4] = {0, 1, 2, 3};
    antumbra_scene *scene;
    antumbra_bvh *bvh;
    antumbra_hit hit;
    antumbra_ray ray;
    antumbra_batch batch;
    antumbra_box box;
    float offset;
    size_t count;
    uint32_t ids[3], mask, masks[3] = {1, 2, 4};
    uint8_t dark;

    OK(antumbra_scene_new(&scene));
    OK(antumbra_scene_add_spheres(scene, spheres, 16, spheres + 3, 16, 2, &ids[0]));
    OK(antumbra_scene_add_disks(scene, center, 0, normal, ANTUMBRA_SAME_FOR_ALL, &radius, ANTUMBRA_SAME_FOR_ALL, 1, &ids[1]));
    OK(antumbra_scene_add_quads(scene, quad, 4, 0, corners, 1, 0, &ids[2]));
    CHECK(ids[0] == 0 && ids[1] == 1 && ids[2] == 2);
    OK(antumbra_scene_geometry_count(scene, &count));
    CHECK(count == 3);
    for (mask = 0; mask < 3; ++mask) {
        OK(antumbra_scene_set_mask(scene, mask, masks[mask]));
    }
    OK(antumbra_bvh_build(scene, NULL, &bvh));
    antumbra_scene_free(scene);

    ray = down(0.0f, 0.0f);
    OK(antumbra_intersect1(bvh, &ray, &hit));
    CHECK(hit.t == 8.0f && hit.geom_id == 0 && hit.prim_id == 0);
    ray = down(10.0f, 0.0f);
    OK(antumbra_intersect1(bvh, &ray, &hit));
    CHECK(hit.t == 9.0f && hit.prim_id == 1);
    ray = down(20.5f, 0.0f);
    OK(antumbra_intersect1(bvh, &ray, &hit));
    CHECK(hit.t == 7.0f && hit.geom_id == 1);
    ray = down(30.5f, -0.5f);
    OK(antumbra_intersect1(bvh, &ray, &hit));
    CHECK(hit.t == 9.0f && hit.geom_id == 2 && hit.u == 0.75f && hit.v == 0.25f);

    /* Masks: without one rays see everything, with one what has a bit in common. */
    for (mask = 0; mask < 8; ++mask) {
        const float xs[3] = {0.0f, 20.0f, 30.0f};
        antumbra_ray rays[3];
        uint32_t each[3], geometry;
        uint8_t answers[3];
        for (geometry = 0; geometry < 3; ++geometry) {
            rays[geometry] = down(xs[geometry], 0.0f);
            each[geometry] = mask;
        }
        batch = antumbra_batch_of(rays, 3);
        batch.masks = &mask;
        batch.mask_stride = ANTUMBRA_SAME_FOR_ALL;
        OK(antumbra_occluded(bvh, &batch, answers, 0));
        for (geometry = 0; geometry < 3; ++geometry) {
            CHECK(answers[geometry] == ((mask & masks[geometry]) != 0));
        }
        each[1] = 0;
        batch.masks = each;
        batch.mask_stride = 0;
        OK(antumbra_occluded(bvh, &batch, answers, 0));
        for (geometry = 0; geometry < 3; ++geometry) {
            CHECK(answers[geometry] == ((each[geometry] & masks[geometry]) != 0));
        }
        batch.masks = NULL;
        OK(antumbra_occluded(bvh, &batch, answers, 0));
        CHECK(answers[0] && answers[1] && answers[2]);
    }
    masks[0] = 0;
    OK(antumbra_bvh_set_masks(bvh, masks, 1));
    ray = down(0.0f, 0.0f);
    mask = UINT32_MAX;
    batch = antumbra_batch_of(&ray, 1);
    batch.masks = &mask;
    OK(antumbra_occluded(bvh, &batch, &dark, 0));
    CHECK(!dark);

    OK(antumbra_bvh_bounds(bvh, &box, &offset));
    CHECK(box.min[0] <= -2.0f && box.min[0] > -2.001f && box.max[0] == 31.0f && offset > 0.0f && offset < 0.01f);
    OK(antumbra_bvh_bounds(bvh, NULL, NULL));
    antumbra_bvh_free(bvh);
}

static void double_precision(void) {
    const double far = 6371000.0, origin[3] = {6371000.0, 0.0, 0.0};
    double corners[4 * 4], from[3], to[3];
    const uint32_t indices[3] = {0, 1, 2};
    antumbra_scene *scene;
    antumbra_bvh *bvh;
    antumbra_ray ray;
    bool hit, miss;

    /* Points with a number behind each. */
    memset(corners, 0, sizeof corners);
    corners[0] = corners[8] = far;
    corners[4] = far + 0.01;
    corners[9] = 0.01;
    OK(antumbra_scene_new(&scene));
    OK(antumbra_scene_set_origin(scene, origin));
    OK(antumbra_scene_add_triangles_f64(scene, corners, 3, 32, indices, 1, 0, NULL));
    FAILS(antumbra_scene_set_origin(scene, origin), ANTUMBRA_INVALID_ARGUMENT, "before the first");
    OK(antumbra_bvh_build(scene, NULL, &bvh));
    from[0] = to[0] = far + 0.002;
    from[1] = to[1] = 0.002;
    from[2] = -1.0;
    to[2] = 1.0;
    ray = antumbra_ray_between_f64(origin, from, to);
    OK(antumbra_occluded1(bvh, &ray, &hit));
    from[0] = to[0] = far + 0.008;
    from[1] = to[1] = 0.008;
    ray = antumbra_ray_between_f64(origin, from, to);
    OK(antumbra_occluded1(bvh, &ray, &miss));
    CHECK(hit && !miss);

    /* A refit in double precision. */
    corners[2] = corners[6] = corners[10] = 5.0;
    OK(antumbra_scene_set_positions_f64(scene, 0, corners, 3, 32));
    OK(antumbra_bvh_refit(bvh, scene, NULL));
    from[0] = to[0] = far + 0.002;
    from[1] = to[1] = 0.002;
    ray = antumbra_ray_between_f64(origin, from, to);
    OK(antumbra_occluded1(bvh, &ray, &hit));
    CHECK(!hit);
    antumbra_bvh_free(bvh);
    antumbra_scene_free(scene);
}

/* What is empty, flat or not a number is no error. */
static void nothing(void) {
    const float corners[9] = {0.0f, 0.0f, 0.0f, 1.0f, 0.0f, 0.0f, NAN, 1.0f, 0.0f};
    antumbra_scene *scene;
    antumbra_bvh *bvh;
    antumbra_batch batch = antumbra_batch_of(NULL, 0);
    antumbra_ray rays[3];
    antumbra_hit hits[3];
    antumbra_report report;
    antumbra_box box;
    antumbra_hit_lists *lists;
    const size_t *splits;
    int index;

    OK(antumbra_scene_new(&scene));
    OK(antumbra_bvh_build(scene, NULL, &bvh));
    OK(antumbra_occluded(bvh, &batch, NULL, 0));
    OK(antumbra_occluded_bits(bvh, &batch, NULL, 0));
    OK(antumbra_intersect(bvh, &batch, NULL, 0));
    OK(antumbra_all_hits(bvh, &batch, &lists));
    OK(antumbra_hit_lists_get(lists, &splits, NULL, NULL));
    CHECK(splits[0] == 0);
    antumbra_hit_lists_free(lists);
    OK(antumbra_bvh_bounds(bvh, &box, NULL));
    CHECK(box.min[0] > box.max[0]);
    antumbra_bvh_free(bvh);

    OK(antumbra_scene_add_triangles(scene, corners, 3, 0, NULL, 1, 0, NULL));
    OK(antumbra_scene_add_triangles(scene, NULL, 0, 0, NULL, 0, 0, NULL));
    OK(antumbra_bvh_build(scene, NULL, &bvh));
    OK(antumbra_bvh_report(bvh, &report));
    CHECK(report.dropped == 1 && report.primitives == 0 && strlen(report.level) > 0);
    memset(rays, 0, sizeof rays);
    rays[1] = down(NAN, 0.0f);
    rays[2] = down(0.1f, 0.1f);
    batch = antumbra_batch_of(rays, 3);
    OK(antumbra_intersect(bvh, &batch, hits, 0));
    for (index = 0; index < 3; ++index) {
        CHECK(!antumbra_is_hit(&hits[index]));
    }
    antumbra_bvh_free(bvh);
    antumbra_scene_free(scene);
    antumbra_bvh_free(NULL);
    antumbra_scene_free(NULL);
    antumbra_object_free(NULL);
    antumbra_world_free(NULL);
    antumbra_threads_free(NULL);
    antumbra_directions_free(NULL);
    antumbra_hit_lists_free(NULL);
    antumbra_closest_lists_free(NULL);
    antumbra_memory_free(NULL, 0);
}

int main(void) {
    curves();
    solids();
    user_geometry();
    opacity();
    double_precision();
    nothing();
    puts("shapes: ok");
    return 0;
}
