/* Random calls: numbers that are none, strides, options that are wrong now and then, files with other bytes. No call may
 * crash or report an internal error, and equal questions have equal answers.
 *
 *     random FOLDER [ROUNDS [SEED]]
 */
#include "check.h"

static uint64_t state;

static uint32_t below(uint32_t limit) { return (uint32_t)((double)random_unit(&state) * limit); }

/* A number, now and then a strange one. */
static float number(void) {
    switch (below(40)) {
    case 0:
        return NAN;
    case 1:
        return INFINITY;
    case 2:
        return -FLT_MAX;
    case 3:
        return 1e-40f;
    case 4:
        return 0.0f;
    case 5:
        return 3e30f;
    default:
        return random_in(&state, -2.0f, 2.0f);
    }
}

static void fill(float *numbers, size_t count) {
    size_t index;
    for (index = 0; index < count; ++index) {
        numbers[index] = number();
    }
}

/* Any status but an internal error; whether it is success. */
static bool done(antumbra_status status) {
    if (status == ANTUMBRA_INTERNAL || status < 0 || status > ANTUMBRA_INTERNAL) {
        fprintf(stderr, "status %d: %s\n", (int)status, antumbra_last_error());
        exit(1);
    }
    return status == ANTUMBRA_OK;
}

static void bounds_of(void *data, uint32_t prim_id, antumbra_box *bounds) {
    const float *numbers = data;
    memcpy(bounds->min, numbers + 6 * (prim_id % 8), 3 * sizeof(float));
    memcpy(bounds->max, numbers + 6 * (prim_id % 8) + 3, 3 * sizeof(float));
}

static int32_t hit_of(void *data, uint32_t prim_id, const antumbra_ray *ray, antumbra_user_hit *hit) {
    const float *numbers = data;
    hit->t = numbers[prim_id % 48] + 0.1f * ray->org[0];
    hit->u = numbers[0];
    hit->v = 1.0f;
    return prim_id % 3;
}

static int32_t nearest_of(void *data, uint32_t prim_id, const double *point, const double *world_from_object, double *closest) {
    (void)world_from_object;
    closest[0] = ((const float *)data)[prim_id % 48];
    closest[1] = point[1];
    closest[2] = -point[2];
    return prim_id % 2;
}

static float opacity_of(void *data, const antumbra_candidate *at) { return at->u * ((const float *)data)[at->id.prim_id % 48]; }

static int32_t filter_of(void *data, size_t ray, const antumbra_hit *hit) {
    (void)data;
    return (hit->prim_id + ray) % 3 != 0;
}

static int32_t visit_of(void *data, size_t ray, const antumbra_hit *hit) {
    (void)data;
    return (int32_t)((ray + hit->prim_id) % 3);
}

enum { NUMBERS = 6000 };
static float numbers[NUMBERS];
static uint32_t indices[600];

static void fill_scene(antumbra_scene *scene) {
    antumbra_user_geometry functions = antumbra_user_geometry_init();
    antumbra_opacity opacity = antumbra_opacity_init();
    uint32_t parts = below(5), part;
    functions.data = opacity.data = numbers;
    functions.bounds = bounds_of;
    functions.intersect = hit_of;
    functions.closest_point = below(4) ? nearest_of : NULL;
    opacity.opacity = opacity_of;
    for (part = 0; part < parts; ++part) {
        size_t count = below(150), stride = below(4) ? 0 : 12 + below(20);
        float *first = numbers + below(100);
        uint32_t geom_id = 0;
        bool is;
        switch (below(8)) {
        case 0:
            is = done(antumbra_scene_add_triangles(scene, first, 3 * count, stride, NULL, count - (below(9) == 0), 0, &geom_id));
            break;
        case 1:
            is = done(antumbra_scene_add_quads(scene, first, 151, stride, indices, count, 0, &geom_id));
            break;
        case 2:
            is = done(antumbra_scene_add_spheres(scene, first, stride, first + 3, below(2) ? stride : ANTUMBRA_SAME_FOR_ALL, count,
                                                 &geom_id));
            break;
        case 3:
            is = done(antumbra_scene_add_disks(scene, first, stride, first + 3, below(2) ? 12 : ANTUMBRA_SAME_FOR_ALL, first + 6, 8,
                                               count, &geom_id));
            break;
        case 5:
            is = done(antumbra_scene_add_curves(scene, first, 100 + below(60), stride, below(3) ? indices : NULL, count, 0,
                                                &geom_id));
            break;
        case 4:
            is = done(antumbra_scene_add_user(scene, (uint32_t)count % 20, &functions, &geom_id));
            break;
        default:
            is = done(antumbra_scene_add_triangles(scene, first, 100 + below(60), stride, indices, count, 0, &geom_id));
            if (is && below(3) == 0) {
                done(antumbra_scene_set_opacity(scene, geom_id, &opacity));
            }
        }
        if (is && below(2)) {
            done(antumbra_scene_set_mask(scene, geom_id, below(8)));
        }
    }
    done(antumbra_scene_set_mask(scene, 7, 1));
}

/* Asks everything about a tree, in two forms that must agree. */
static void ask(const antumbra_bvh *bvh) {
    enum { MOST = 700 };
    static struct {
        antumbra_ray ray;
        antumbra_hit hit;
        uint8_t dark;
    } records[MOST];
    static antumbra_ray rays[MOST];
    static antumbra_hit hits[MOST];
    static antumbra_surface surfaces[MOST];
    static antumbra_closest_point near[MOST];
    static antumbra_prim_id except[MOST];
    static uint32_t masks[MOST], counts[MOST];
    static uint8_t dark[MOST];
    static float distances[MOST];
    static uint64_t bits[MOST];
    size_t count = below(MOST), index;
    antumbra_batch batch, other;
    antumbra_group group;
    antumbra_points points;
    antumbra_directions *directions;
    antumbra_hit_lists *lists;
    antumbra_closest_lists *near_lists;
    const size_t *splits;
    for (index = 0; index < count; ++index) {
        fill((float *)&rays[index], 8);
        if (below(3)) {
            rays[index].tnear = 0.0f;
            rays[index].tfar = INFINITY;
        }
        records[index].ray = rays[index];
        masks[index] = below(8);
        except[index].inst_id = below(2) ? ANTUMBRA_INVALID_ID : below(4);
        except[index].geom_id = below(4);
        except[index].prim_id = below(150);
    }
    batch = antumbra_batch_of(rays, count);
    batch.masks = below(2) ? masks : NULL;
    batch.mask_stride = below(2) ? 0 : ANTUMBRA_SAME_FOR_ALL;
    batch.except = below(2) ? except : NULL;
    batch.filter = below(2) ? filter_of : NULL;
    batch.flags = below(4);
    batch.order = below(4);
    if (below(20) == 0) {
        batch.flags = below(8);
        batch.order = below(6);
        batch.ray_stride = below(40);
        batch.mask_stride = below(6);
        done(antumbra_occluded(bvh, &batch, dark, below(3)));
        done(antumbra_visit_hits(bvh, &batch, visit_of, NULL));
        return;
    }
    other = batch;
    other.rays = &records[0].ray;
    other.ray_stride = sizeof records[0];
    OK(antumbra_occluded(bvh, &batch, dark, 0));
    OK(antumbra_intersect(bvh, &batch, hits, 0));
    OK(antumbra_surface_of(bvh, &batch, surfaces, 0));
    OK(antumbra_count_hits(bvh, &batch, counts, 0));
    OK(antumbra_occluded_bits(bvh, &other, bits, (count + 63) / 64));
    OK(antumbra_intersect(bvh, &other, &records[0].hit, sizeof records[0]));
    OK(antumbra_occluded(bvh, &other, &records[0].dark, sizeof records[0]));
    OK(antumbra_visit_hits(bvh, &batch, visit_of, NULL));
    OK(antumbra_all_hits(bvh, &other, &lists));
    OK(antumbra_hit_lists_get(lists, &splits, NULL, NULL));
    for (index = 0; index < count; ++index) {
        CHECK(memcmp(&records[index].hit, &hits[index], sizeof hits[0]) == 0);
        CHECK(memcmp(&surfaces[index].hit, &hits[index], sizeof hits[0]) == 0);
        CHECK(records[index].dark == dark[index] && (bits[index / 64] >> index % 64 & 1) == dark[index]);
        CHECK(splits[index + 1] - splits[index] == counts[index]);
        /* An opacity may differ by the kind of query, these do not. */
        CHECK(antumbra_is_hit(&hits[index]) == dark[index] && (counts[index] > 0) == dark[index]);
    }
    antumbra_hit_lists_free(lists);

    points = antumbra_points_of(rays[0].org, count);
    points.point_stride = sizeof rays[0];
    points.max_distances = below(2) ? &rays[0].tfar : NULL;
    points.max_distance_stride = sizeof rays[0];
    points.flags = below(2) ? ANTUMBRA_THIS_THREAD : 0;
    done(antumbra_closest(bvh, &points, near, 0));
    done(antumbra_signed_distance(bvh, &points, distances, 0));
    OK(antumbra_contains(bvh, &points, dark, 0));
    if (done(antumbra_within(bvh, &points, &near_lists))) {
        antumbra_closest_lists_free(near_lists);
    }
    OK(antumbra_directions_new(rays[0].dir, count < 64 ? count : 64, sizeof rays[0], &directions));
    group = antumbra_group_of(rays[0].org, count);
    group.point_stride = sizeof rays[0];
    group.tfar = number();
    OK(antumbra_group_open(bvh, &group, directions, bits, count > 0));
    antumbra_directions_free(directions);
}

/* A tree with other bytes: refused, or a tree that answers. */
static void damage(const antumbra_bvh *bvh) {
    uint8_t *bytes;
    size_t byte_count, index;
    antumbra_bvh *loaded;
    uint32_t round;
    if (!done(antumbra_bvh_to_memory(bvh, &bytes, &byte_count))) {
        return;
    }
    for (round = 0; round < 20; ++round) {
        uint8_t *copy = malloc(byte_count + 1);
        memcpy(copy, bytes, byte_count);
        for (index = 0; index < below(4); ++index) {
            copy[below((uint32_t)byte_count)] ^= (uint8_t)(1u << below(8));
        }
        if (done(antumbra_bvh_from_memory(copy, below(3) ? byte_count : below((uint32_t)byte_count), NULL, &loaded))) {
            antumbra_bvh_free(loaded);
        }
        free(copy);
    }
    antumbra_memory_free(bytes, byte_count);
}

int main(int argc, char **argv) {
    uint64_t rounds = argc > 2 ? strtoul(argv[2], NULL, 10) : 20, seed = argc > 3 ? strtoul(argv[3], NULL, 10) : 1, round;
    antumbra_threads *threads;
    static const char *const presets[4] = {NULL, "default", "fast", "paper"};
    OK(antumbra_threads_new(2, &threads));
    for (round = 0; round < rounds; ++round) {
        antumbra_scene *scenes[2];
        antumbra_bvh *bvh;
        antumbra_object *objects[2] = {NULL, NULL};
        antumbra_world *world;
        antumbra_recipe recipe;
        antumbra_build options = antumbra_build_init();
        antumbra_instance placed[6];
        const antumbra_bvh *tree;
        size_t index;
        state = seed + round;
        fill(numbers, NUMBERS);
        for (index = 0; index < 600; ++index) {
            indices[index] = below(below(30) ? 100 : 170);
        }
        for (index = 0; index < 6; ++index) {
            placed[index].object = below(below(20) ? 2 : 4);
            placed[index].mask = below(2) ? UINT32_MAX : below(8);
            fill(placed[index].transform, 12);
        }
        OK(antumbra_recipe_init(&recipe, presets[below(4)]));
        recipe.width = below(20) ? 0 : below(20);
        recipe.level = below(4) ? NULL : "scalar";
        recipe.training = below(4) - 1;
        recipe.surface_rays = below(200);
        options.recipe = &recipe;
        options.threads = below(2) ? threads : NULL;
        options.rays = (const antumbra_ray *)(const void *)numbers;
        options.ray_count = below(100);
        for (index = 0; index < 2; ++index) {
            OK(antumbra_scene_new(&scenes[index]));
            fill_scene(scenes[index]);
            done(antumbra_object_build(scenes[index], &options, &objects[index]));
        }
        if (done(antumbra_bvh_build(scenes[0], &options, &bvh))) {
            ask(bvh);
            done(antumbra_bvh_refit(bvh, scenes[below(2)], NULL));
            done(antumbra_scene_set_positions(scenes[0], 0, numbers + 1, 150, 0));
            done(antumbra_bvh_refit(bvh, scenes[0], threads));
            done(antumbra_bvh_relearn(bvh, options.rays, options.ray_count, 0, NULL, NULL));
            ask(bvh);
            damage(bvh);
            antumbra_bvh_free(bvh);
        }
        if (done(antumbra_bvh_build_instances(below(2) ? scenes[0] : NULL, (const antumbra_scene *const *)scenes, 2, placed,
                                              below(7), &options, &bvh))) {
            ask(bvh);
            antumbra_bvh_free(bvh);
        }
        if (done(antumbra_world_new(below(2) ? objects[0] : NULL, (const antumbra_object *const *)objects, 2, placed, below(7),
                                    NULL, &world))) {
            OK(antumbra_world_bvh(world, &tree));
            ask(tree);
            fill(placed[0].transform, 12);
            done(antumbra_world_set_instances(world, placed, below(7), threads));
            index = below(3);
            done(antumbra_world_refit(world, &placed[1].object, (const antumbra_scene *const *)scenes, 1, placed, below(7), NULL));
            ask(tree);
            antumbra_world_free(world);
        }
        for (index = 0; index < 2; ++index) {
            antumbra_object_free(objects[index]);
            antumbra_scene_free(scenes[index]);
        }
    }
    antumbra_threads_free(threads);
    printf("seed %lu: random: ok\n", (unsigned long)seed);
    return 0;
}
