/* Objects, instances, worlds, refits, learning and files. */
#define _POSIX_C_SOURCE 200809L

#include <sys/stat.h>
#include <unistd.h>

#include "check.h"

enum { RAYS = 4000, INSTANCES = 60 };

static antumbra_instance place(uint32_t object, float x, float y, float z) {
    antumbra_instance placed = {0, UINT32_MAX, {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0}};
    placed.object = object;
    placed.transform[3] = x;
    placed.transform[7] = y;
    placed.transform[11] = z;
    return placed;
}

static void same_hits(const antumbra_bvh *a, const antumbra_bvh *b, const antumbra_ray *rays) {
    static antumbra_hit ours[RAYS], theirs[RAYS];
    antumbra_batch batch = antumbra_batch_of(rays, RAYS);
    size_t ray, hits = 0;
    OK(antumbra_intersect(a, &batch, ours, 0));
    OK(antumbra_intersect(b, &batch, theirs, 0));
    CHECK(memcmp(ours, theirs, sizeof ours) == 0);
    for (ray = 0; ray < RAYS; ++ray) {
        hits += antumbra_is_hit(&ours[ray]);
    }
    printf("%zu of %zu rays hit\n", hits, (size_t)RAYS);
    CHECK(hits > RAYS / 50 && hits < RAYS);
}

/* A triangle by a transform with twelve different numbers: where its corners and its middle are is known. */
static void transforms(void) {
    const float corners[9] = {0, 0, 0, 1, 0, 0, 0, 1, 0};
    const float rows[12] = {2, 0.5f, 0.25f, 3, -0.5f, 1.5f, 0.125f, 5, 0.75f, -0.25f, 4, 7};
    antumbra_instance one;
    antumbra_scene *scene;
    antumbra_object *object;
    antumbra_world *world;
    antumbra_bvh *fixed;
    const antumbra_bvh *tree;
    antumbra_surface surface;
    antumbra_ray ray;
    float middle[3], dir[3] = {0, 0, 1};
    int axis;
    one.object = 0;
    one.mask = UINT32_MAX;
    memcpy(one.transform, rows, sizeof rows);
    for (axis = 0; axis < 3; ++axis) {
        /* Of the point (0.25, 0.5, 0). */
        middle[axis] = 0.25f * rows[4 * axis] + 0.5f * rows[4 * axis + 1] + rows[4 * axis + 3];
    }
    ray = antumbra_ray_from(middle, dir);
    ray.org[2] -= 2.0f;
    OK(antumbra_scene_new(&scene));
    OK(antumbra_scene_add_triangles(scene, corners, 3, 0, NULL, 1, 0, NULL));
    OK(antumbra_object_build(scene, NULL, &object));
    OK(antumbra_world_new(NULL, (const antumbra_object *const *)&object, 1, &one, 1, NULL, &world));
    OK(antumbra_world_bvh(world, &tree));
    OK(antumbra_surface1(tree, &ray, &surface));
    CHECK(fabsf(surface.hit.t - 2.0f) < 1e-5f && surface.hit.inst_id == 0);
    CHECK(fabsf(surface.hit.u - 0.25f) < 1e-5f && fabsf(surface.hit.v - 0.5f) < 1e-5f);
    CHECK(fabsf(surface.position[2] - middle[2]) < 1e-5f);
    OK(antumbra_bvh_build_instances(NULL, (const antumbra_scene *const *)&scene, 1, &one, 1, NULL, &fixed));
    OK(antumbra_surface1(fixed, &ray, &surface));
    CHECK(fabsf(surface.hit.t - 2.0f) < 1e-5f && fabsf(surface.hit.v - 0.5f) < 1e-5f);
    antumbra_bvh_free(fixed);
    antumbra_world_free(world);
    antumbra_object_free(object);
    antumbra_scene_free(scene);
}

int main(int argc, char **argv) {
    float *corners = random_triangles(30, 3), *other = random_triangles(50, 4), *ground_corners = random_triangles(40, 5);
    antumbra_ray *rays = random_rays(RAYS, 12.0f, 6);
    antumbra_scene *scenes[2], *ground_scene;
    antumbra_object *objects[2], *ground, *narrow, *loaded_object;
    antumbra_instance instances[INSTANCES];
    antumbra_world *world, *loaded_world, *beside;
    antumbra_child_order *order = NULL;
    antumbra_bvh *fixed, *alone, *loaded, *copy;
    const antumbra_bvh *tree, *tree_beside, *lent;
    antumbra_recipe recipe;
    antumbra_build options = antumbra_build_init();
    antumbra_threads *threads;
    antumbra_report report;
    uint64_t seed = 8;
    uint32_t index, moved[1] = {1}, masks[1] = {4}, mask;
    double quality;
    uint8_t *bytes, seen;
    size_t byte_count;
    antumbra_batch batch;
    char path[1024];
    FILE *file;
    struct stat status;

    CHECK(argc == 2);
    transforms();
    OK(antumbra_threads_new(2, &threads));
    options.threads = threads;
    OK(antumbra_scene_new(&scenes[0]));
    OK(antumbra_scene_new(&scenes[1]));
    OK(antumbra_scene_new(&ground_scene));
    OK(antumbra_scene_add_triangles(scenes[0], corners, 90, 0, NULL, 30, 0, NULL));
    OK(antumbra_scene_add_triangles(scenes[1], other, 150, 0, NULL, 50, 0, NULL));
    OK(antumbra_scene_add_triangles(ground_scene, ground_corners, 120, 0, NULL, 40, 0, NULL));
    for (index = 0; index < 2; ++index) {
        OK(antumbra_object_build(scenes[index], &options, &objects[index]));
    }
    OK(antumbra_object_build(ground_scene, NULL, &ground));
    for (index = 0; index < INSTANCES; ++index) {
        float at[3] = {random_in(&seed, -10, 10), random_in(&seed, -10, 10), random_in(&seed, -10, 10)};
        instances[index] = place(index % 2, at[0], at[1], at[2]);
    }
    OK(antumbra_bvh_build_instances(ground_scene, (const antumbra_scene *const *)scenes, 2, instances, INSTANCES, &options,
                                    &fixed));
    OK(antumbra_world_new(ground, (const antumbra_object *const *)objects, 2, instances, INSTANCES, threads, &world));
    OK(antumbra_world_bvh(world, &tree));
    same_hits(fixed, tree, rays);
    OK(antumbra_bvh_report(tree, &report));
    CHECK(report.instances == INSTANCES && report.primitives == 120);

    /* Objects have trees of their own. */
    OK(antumbra_object_bvh(objects[0], &lent));
    OK(antumbra_bvh_build(scenes[0], NULL, &alone));
    {
        antumbra_hit a, b;
        antumbra_ray ray = antumbra_ray_between(corners, corners + 45);
        ray.tnear = -1.0f;
        ray.tfar = 2.0f;
        OK(antumbra_intersect1(lent, &ray, &a));
        OK(antumbra_intersect1(alone, &ray, &b));
        CHECK(antumbra_is_hit(&a) && memcmp(&a, &b, sizeof a) == 0);
    }
    antumbra_bvh_free(fixed);

    /* Everything moves, and an object changes its shape. */
    for (index = 0; index < 150; ++index) {
        other[3 * index] *= 1.5f;
    }
    OK(antumbra_scene_set_positions(scenes[1], 0, other, 150, 0));
    for (index = 0; index < INSTANCES; ++index) {
        instances[index].transform[3] += 1.0f;
        instances[index].transform[1] = 0.25f;
    }
    OK(antumbra_world_refit(world, moved, (const antumbra_scene *const *)&scenes[1], 1, instances, INSTANCES, NULL));
    OK(antumbra_bvh_build_instances(ground_scene, (const antumbra_scene *const *)scenes, 2, instances, INSTANCES, NULL, &fixed));
    same_hits(fixed, tree, rays);
    OK(antumbra_world_quality(world, 1, &quality));
    CHECK(quality > 0.5 && quality != 1.0);
    OK(antumbra_world_quality(world, 0, &quality));
    CHECK(quality == 1.0);
    FAILS(antumbra_world_quality(world, 2, &quality), ANTUMBRA_INVALID_ARGUMENT, "no object 2 among 2");

    OK(antumbra_recipe_init(&recipe, NULL));
    OK(antumbra_world_copy(world, &beside));
    OK(antumbra_world_relearn(beside, rays, RAYS, 0, &recipe, &order));
    CHECK(order != NULL);
    OK(antumbra_world_bvh(beside, &tree_beside));
    same_hits(fixed, tree_beside, rays);
    OK(antumbra_world_adopt(world, order));
    same_hits(fixed, tree, rays);
    OK(antumbra_world_set_instances(world, instances, INSTANCES, NULL));
    same_hits(fixed, tree, rays);
    FAILS(antumbra_world_adopt(world, NULL), ANTUMBRA_INVALID_ARGUMENT, "`order` is null");
    antumbra_child_order_free(order);
    antumbra_world_free(beside);
    OK(antumbra_world_relearn(world, rays, RAYS, 0, &recipe, NULL));
    same_hits(fixed, tree, rays);

    /* An instance of nothing is an error, and leaves the world as it was. */
    instances[3].object = 2;
    FAILS(antumbra_world_set_instances(world, instances, INSTANCES, NULL), ANTUMBRA_BAD_GEOMETRY, "instance 3");
    same_hits(fixed, tree, rays);
    OK(antumbra_world_add_object(world, ground, &index));
    CHECK(index == 2);
    OK(antumbra_world_set_instances(world, instances, INSTANCES, threads));
    instances[3].object = 1;
    OK(antumbra_world_set_instances(world, instances, INSTANCES, NULL));
    same_hits(fixed, tree, rays);
    /* The only level with several widths. */
    recipe.level = "scalar";
    recipe.width = 4;
    options.recipe = &recipe;
    OK(antumbra_object_build(scenes[0], &options, &narrow));
    recipe.width = 8;
    OK(antumbra_object_build(scenes[0], &options, &loaded_object));
    {
        const antumbra_object *two[2];
        antumbra_world *none;
        two[0] = narrow;
        two[1] = loaded_object;
        FAILS(antumbra_world_new(NULL, two, 2, NULL, 0, NULL, &none), ANTUMBRA_OTHER_GEOMETRY, "children per node");
        CHECK(none == NULL);
    }
    antumbra_object_free(narrow);
    antumbra_object_free(loaded_object);
    options.recipe = NULL;

    /* Masks of instances, of objects, of the ground. */
    {
        antumbra_instance one = place(0, 0, 0, 0);
        antumbra_object *masked;
        antumbra_world *small;
        antumbra_ray ray = antumbra_ray_between(corners, corners + 45);
        const antumbra_bvh *small_tree;
        ray.tnear = -1.0f;
        ray.tfar = 2.0f;
        OK(antumbra_scene_set_mask(scenes[0], 0, 3));
        OK(antumbra_object_build(scenes[0], NULL, &masked));
        one.mask = 6;
        OK(antumbra_world_new(NULL, (const antumbra_object *const *)&masked, 1, &one, 1, NULL, &small));
        OK(antumbra_world_bvh(small, &small_tree));
        batch = antumbra_batch_of(&ray, 1);
        batch.masks = &mask;
        for (mask = 0; mask < 8; ++mask) {
            OK(antumbra_occluded(small_tree, &batch, &seen, 0));
            CHECK(seen == ((mask & 3) != 0 && (mask & 6) != 0));
        }
        OK(antumbra_world_set_masks(small, 0, masks, 1));
        one.mask = 1;
        OK(antumbra_world_set_instances(small, &one, 1, NULL));
        for (mask = 0; mask < 8; ++mask) {
            OK(antumbra_occluded(small_tree, &batch, &seen, 0));
            CHECK(seen == ((mask & 4) != 0 && (mask & 1) != 0));
        }
        one.mask = UINT32_MAX;
        OK(antumbra_world_set_instances(small, &one, 1, NULL));
        for (mask = 0; mask < 8; ++mask) {
            OK(antumbra_occluded(small_tree, &batch, &seen, 0));
            CHECK(seen == ((mask & 4) != 0));
        }
        FAILS(antumbra_world_set_masks(small, 1, masks, 1), ANTUMBRA_INVALID_ARGUMENT, "no object 1");
        antumbra_world_free(small);
        OK(antumbra_world_new(masked, NULL, 0, NULL, 0, NULL, &small));
        OK(antumbra_world_bvh(small, &small_tree));
        mask = 4;
        OK(antumbra_occluded(small_tree, &batch, &seen, 0));
        CHECK(!seen);
        OK(antumbra_world_set_masks(small, ANTUMBRA_INVALID_ID, masks, 1));
        OK(antumbra_occluded(small_tree, &batch, &seen, 0));
        CHECK(seen);
        antumbra_world_free(small);
        antumbra_object_free(masked);
    }

    /* Files. */
    snprintf(path, sizeof path, "%s/world.antumbra", argv[1]);
    OK(antumbra_world_save(world, path));
    OK(antumbra_world_save(world, path));
    OK(antumbra_world_load(path, NULL, &loaded_world));
    OK(antumbra_world_set_instances(loaded_world, instances, INSTANCES, NULL));
    OK(antumbra_world_bvh(loaded_world, &lent));
    same_hits(lent, tree, rays);
    OK(antumbra_world_to_memory(world, &bytes, &byte_count));
    antumbra_world_free(loaded_world);
    OK(antumbra_world_from_memory(bytes, byte_count, NULL, &loaded_world));
    OK(antumbra_world_bvh(loaded_world, &lent));
    same_hits(lent, tree, rays);
    FAILS(antumbra_bvh_from_memory(bytes, byte_count, NULL, &loaded), ANTUMBRA_UNREADABLE, "");
    CHECK(loaded == NULL);
    bytes[byte_count / 2] ^= 1;
    antumbra_world_free(loaded_world);
    FAILS(antumbra_world_from_memory(bytes, byte_count, NULL, &loaded_world), ANTUMBRA_UNREADABLE, "world");
    FAILS(antumbra_world_from_memory(bytes, byte_count / 2, NULL, &loaded_world), ANTUMBRA_UNREADABLE, "");
    antumbra_memory_free(bytes, byte_count);
    FAILS(antumbra_object_load(path, NULL, &loaded_object), ANTUMBRA_UNREADABLE, path);

    snprintf(path, sizeof path, "%s/object.antumbra", argv[1]);
    OK(antumbra_object_save(objects[1], path));
    OK(antumbra_object_load(path, NULL, &loaded_object));
    OK(antumbra_object_to_memory(loaded_object, &bytes, &byte_count));
    antumbra_object_free(loaded_object);
    OK(antumbra_object_from_memory(bytes, byte_count, NULL, &loaded_object));
    antumbra_memory_free(bytes, byte_count);
    antumbra_object_free(loaded_object);

    snprintf(path, sizeof path, "%s/tree.antumbra", argv[1]);
    OK(antumbra_bvh_save(fixed, path));
    OK(antumbra_bvh_load(path, NULL, &loaded));
    same_hits(fixed, loaded, rays);
    FAILS(antumbra_bvh_refit(loaded, ground_scene, NULL), ANTUMBRA_UNSUPPORTED, "instances");
    FAILS(antumbra_bvh_set_masks(loaded, masks, 1), ANTUMBRA_UNSUPPORTED, "instances");
    antumbra_bvh_free(loaded);
    file = fopen(path, "wb");
    CHECK(file != NULL && fputs("no tree", file) >= 0 && fclose(file) == 0);
    FAILS(antumbra_bvh_load(path, NULL, &loaded), ANTUMBRA_UNREADABLE, path);
    snprintf(path, sizeof path, "%s/there/is/no/such/folder", argv[1]);
    FAILS(antumbra_bvh_load(path, NULL, &loaded), ANTUMBRA_IO, path);
    FAILS(antumbra_bvh_save(fixed, path), ANTUMBRA_IO, path);
    FAILS(antumbra_bvh_load(argv[1], NULL, &loaded), ANTUMBRA_IO, "no regular file");
    /* A link stays, and a pipe would be waited for. */
    snprintf(path, sizeof path, "%s/link.antumbra", argv[1]);
    CHECK(symlink("tree.antumbra", path) == 0);
    OK(antumbra_bvh_save(fixed, path));
    CHECK(lstat(path, &status) == 0 && S_ISLNK(status.st_mode));
    OK(antumbra_bvh_load(path, NULL, &loaded));
    antumbra_bvh_free(loaded);
    snprintf(path, sizeof path, "%s/pipe", argv[1]);
    CHECK(mkfifo(path, 0600) == 0);
    FAILS(antumbra_bvh_load(path, NULL, &loaded), ANTUMBRA_IO, "no regular file");
    FAILS(antumbra_bvh_save(fixed, argv[1]), ANTUMBRA_IO, argv[1]);

    /* A tree alone: learned, refitted, and one that does not fit. */
    OK(antumbra_bvh_copy(alone, &copy));
    OK(antumbra_bvh_relearn(copy, rays, RAYS, sizeof *rays, NULL, &order));
    OK(antumbra_bvh_adopt(alone, order));
    for (index = 0; index < RAYS; ++index) {
        bool here = false, there = true;
        OK(antumbra_occluded1(alone, &rays[index], &here));
        OK(antumbra_occluded1(copy, &rays[index], &there));
        CHECK(here == there);
    }
    antumbra_bvh_free(copy);
    antumbra_child_order_free(order);
    OK(antumbra_bvh_relearn(alone, rays, RAYS, sizeof *rays, NULL, NULL));
    FAILS(antumbra_bvh_refit(alone, scenes[1], NULL), ANTUMBRA_OTHER_GEOMETRY, "30");
    OK(antumbra_bvh_refit(alone, scenes[0], threads));
    OK(antumbra_bvh_quality(alone, &quality));
    CHECK(fabs(quality - 1.0) < 0.01);

    antumbra_bvh_free(alone);
    antumbra_bvh_free(fixed);
    antumbra_world_free(world);
    for (index = 0; index < 2; ++index) {
        antumbra_object_free(objects[index]);
        antumbra_scene_free(scenes[index]);
    }
    antumbra_object_free(ground);
    antumbra_scene_free(ground_scene);
    antumbra_threads_free(threads);
    free(corners), free(other), free(ground_corners), free(rays);
    puts("worlds: ok");
    return 0;
}
