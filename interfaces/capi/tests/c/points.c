/* Points and groups, against closed forms and the same rays one by one. */
#include "check.h"

enum { POINTS = 3000 };

/* A cube of side 2 around the origin, as quads that face outwards. */
static const float cube[24] = {-1, -1, -1, 1, -1, -1, 1, 1, -1, -1, 1, -1, -1, -1, 1, 1, -1, 1, 1, 1, 1, -1, 1, 1};
static const uint32_t sides[24] = {0, 3, 2, 1, 4, 5, 6, 7, 0, 1, 5, 4, 2, 3, 7, 6, 1, 2, 6, 5, 0, 4, 7, 3};

static double distance_to_cube(const float *point) {
    double outside = 0.0, inside = -DBL_MAX;
    int axis;
    for (axis = 0; axis < 3; ++axis) {
        double x = fabs((double)point[axis]) - 1.0;
        outside += x > 0.0 ? x * x : 0.0;
        inside = x > inside ? x : inside;
    }
    return outside > 0.0 ? sqrt(outside) : inside;
}

int main(void) {
    antumbra_scene *scene;
    antumbra_bvh *bvh;
    uint64_t seed = 7;
    float *points = malloc(POINTS * 5 * sizeof *points), *distances = malloc(POINTS * sizeof *distances);
    float *limits = malloc(POINTS * sizeof *limits), limit = 0.5f;
    uint8_t *inside = malloc(POINTS);
    int32_t *winding = malloc(POINTS * sizeof *winding);
    antumbra_closest_point *near = malloc(POINTS * sizeof *near);
    antumbra_points query;
    antumbra_closest_lists *lists;
    const antumbra_closest_point *items;
    const size_t *splits;
    size_t index, count, flags;

    OK(antumbra_scene_new(&scene));
    OK(antumbra_scene_add_quads(scene, cube, 8, 0, sides, 6, 0, NULL));
    OK(antumbra_bvh_build(scene, NULL, &bvh));
    for (index = 0; index < POINTS; ++index) {
        int axis;
        for (axis = 0; axis < 3; ++axis) {
            points[5 * index + (size_t)axis] = random_in(&seed, -2.0f, 2.0f);
        }
        limits[index] = random_in(&seed, 0.0f, 1.5f);
    }
    points[0] = NAN;
    query = antumbra_points_of(points, POINTS);
    query.point_stride = 20;
    for (flags = 0; flags <= ANTUMBRA_THIS_THREAD; flags += ANTUMBRA_THIS_THREAD) {
        query.flags = (uint32_t)flags;
        query.max_distances = NULL;
        OK(antumbra_signed_distance(bvh, &query, distances, 0));
        OK(antumbra_contains(bvh, &query, inside, 0));
        OK(antumbra_winding_number(bvh, &query, winding, 0));
        OK(antumbra_closest(bvh, &query, near, 0));
        CHECK(isnan(distances[0]) && !inside[0] && winding[0] == 0 && near[0].geom_id == ANTUMBRA_INVALID_ID);
        for (index = 1; index < POINTS; ++index) {
            const float *point = points + 5 * index;
            double right = distance_to_cube(point), square = 0.0;
            int axis;
            CHECK(fabs(distances[index] - right) < 1e-6);
            CHECK(inside[index] == (right < 0.0) && winding[index] == (right < 0.0));
            CHECK(fabs(near[index].distance - fabs(right)) < 1e-6 && near[index].prim_id < 6);
            CHECK(near[index].inst_id == ANTUMBRA_INVALID_ID);
            for (axis = 0; axis < 3; ++axis) {
                square += pow(near[index].position[axis] - point[axis], 2.0);
            }
            CHECK(fabs(sqrt(square) - fabs(right)) < 1e-6);
        }
        query.max_distances = limits;
        OK(antumbra_closest(bvh, &query, near, 0));
        for (index = 1; index < POINTS; ++index) {
            bool is_near = fabsf(distances[index]) <= limits[index];
            CHECK((near[index].geom_id == 0) == is_near);
            CHECK(is_near || (near[index].distance == INFINITY && near[index].position[2] == INFINITY));
        }
    }
    FAILS(antumbra_within(bvh, (query.max_distances = NULL, &query), &lists), ANTUMBRA_INVALID_ARGUMENT, "max_distances");
    query.max_distances = &limit;
    query.max_distance_stride = ANTUMBRA_SAME_FOR_ALL;
    OK(antumbra_within(bvh, &query, &lists));
    OK(antumbra_closest_lists_get(lists, &splits, &items, &count));
    CHECK(splits[0] == 0 && splits[POINTS] == count);
    for (index = 0; index < POINTS; ++index) {
        size_t item;
        CHECK((splits[index + 1] > splits[index]) == (fabsf(distances[index]) <= limit));
        for (item = splits[index]; item < splits[index + 1]; ++item) {
            CHECK(items[item].distance <= limit && (item == splits[index] || items[item - 1].distance <= items[item].distance));
        }
    }
    antumbra_closest_lists_free(lists);

    /* Groups: each bit is the answer of a ray. */
    {
        float normal[3] = {0.0f, 0.0f, 1.0f}, begin = 0.01f, directions[100 * 4];
        antumbra_directions *prepared;
        antumbra_group group = antumbra_group_of(points, POINTS);
        uint64_t *bits = malloc(POINTS * 2 * sizeof *bits);
        size_t direction;
        for (index = 0; index < 400; ++index) {
            directions[index] = random_in(&seed, -1.0f, 1.0f);
        }
        directions[4] = directions[5] = directions[6] = 0.0f;
        OK(antumbra_directions_new(directions, 100, 16, &prepared));
        group.point_stride = 20;
        group.normals = normal;
        group.normal_stride = ANTUMBRA_SAME_FOR_ALL;
        group.tnear = &begin;
        group.tnear_stride = ANTUMBRA_SAME_FOR_ALL;
        group.tfar = 2.0f;
        OK(antumbra_group_open(bvh, &group, prepared, bits, 2));
        for (index = 0; index < POINTS; ++index) {
            CHECK(bits[2 * index + 1] >> 36 == 0);
            for (direction = 0; direction < 100; ++direction) {
                antumbra_ray ray = antumbra_ray_from(points + 5 * index, directions + 4 * direction);
                bool dark, open = bits[2 * index + direction / 64] >> direction % 64 & 1;
                ray.tnear = begin;
                ray.tfar = 2.0f;
                OK(antumbra_occluded1(bvh, &ray, &dark));
                CHECK(open == (index != 0 && direction != 1 && ray.dir[2] > 0.0f && !dark));
            }
        }
        FAILS(antumbra_group_open(bvh, &group, prepared, bits, 3), ANTUMBRA_INVALID_ARGUMENT, "need 2 words");
        FAILS(antumbra_group_open(bvh, &group, NULL, bits, 2), ANTUMBRA_INVALID_ARGUMENT, "`directions` is null");
        antumbra_directions_free(prepared);
        free(bits);
    }
    antumbra_bvh_free(bvh);
    antumbra_scene_free(scene);
    free(points), free(distances), free(limits), free(inside), free(winding), free(near);
    puts("points: ok");
    return 0;
}
