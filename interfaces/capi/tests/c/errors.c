/* Every way to call a function wrongly: a status, a text, and no handle. */
#include "check.h"

#define WRONG(call, words) FAILS(call, ANTUMBRA_INVALID_ARGUMENT, words)

int main(void) {
    const float corners[18] = {0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1, 1, 0, 1, 0, 1, 1};
    const uint32_t indices[4] = {0, 1, 2, 3}, bad[3] = {0, 1, 6};
    const double origin[3] = {0.0, NAN, 0.0};
    const float org[3] = {0.1f, 0.1f, -1.0f}, dir[3] = {0, 0, 1};
    antumbra_ray ray = antumbra_ray_from(org, dir);
    antumbra_scene *scene = NULL, *spheres;
    antumbra_bvh *bvh = NULL, *none = (antumbra_bvh *)8;
    antumbra_object *object = (antumbra_object *)8;
    antumbra_world *world = (antumbra_world *)8;
    antumbra_directions *directions = (antumbra_directions *)8;
    antumbra_recipe recipe;
    antumbra_build options = antumbra_build_init();
    antumbra_batch batch;
    antumbra_group group;
    antumbra_points points;
    antumbra_hit hit;
    antumbra_hit_lists *lists;
    antumbra_opacity opacity = antumbra_opacity_init();
    antumbra_user_geometry functions = antumbra_user_geometry_init();
    const antumbra_scene *scenes[1] = {NULL};
    antumbra_instance placed = {1, 0, {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0}};
    uint8_t dark = 7;
    uint64_t bits[2];
    bool occluded;
    float radius = 1.0f;
    size_t status;

    CHECK(strcmp(antumbra_last_error(), "") == 0);
    CHECK(strncmp(antumbra_version(), "0.1.", 4) == 0);
    for (status = 0; status <= 12; ++status) {
        CHECK(strcmp(antumbra_status_text((int32_t)status), "unknown status") != 0);
    }
    CHECK(strcmp(antumbra_status_text(13), "unknown status") == 0);
    CHECK(strcmp(antumbra_status_text(-1), "unknown status") == 0);

    /* Scenes. */
    WRONG(antumbra_scene_new(NULL), "`scene` is null");
    OK(antumbra_scene_new(&scene));
    WRONG(antumbra_scene_add_triangles(NULL, corners, 3, 0, NULL, 1, 0, NULL), "`scene` is null");
    WRONG(antumbra_scene_add_triangles(scene, NULL, 3, 0, NULL, 1, 0, NULL), "`positions` is null");
    WRONG(antumbra_scene_add_triangles(scene, corners, 3, 8, NULL, 1, 0, NULL), "stride of `positions` is 8 bytes");
    WRONG(antumbra_scene_add_triangles(scene, corners, 3, ANTUMBRA_SAME_FOR_ALL, NULL, 1, 0, NULL), "cannot be the same");
    WRONG(antumbra_scene_add_triangles(scene, corners, 3, SIZE_MAX / 2, NULL, 1, 0, NULL), "more than any memory");
    WRONG(antumbra_scene_add_triangles(scene, corners, SIZE_MAX / 12, 0, indices, 1, 0, NULL), "more than any memory");
    WRONG(antumbra_scene_add_triangles(scene, corners, 3, 0, indices, 1, 4, NULL), "stride of `indices` is 4 bytes");
    WRONG(antumbra_scene_add_triangles(scene, corners, 3, 0, indices, SIZE_MAX / 2, 0, NULL), "more than any memory");
    WRONG(antumbra_scene_add_triangles(scene, corners, 3, 0, NULL, 2, 0, NULL), "3 times as many vertices");
    WRONG(antumbra_scene_add_triangles(scene, corners, 3, 0, NULL, SIZE_MAX / 2, 0, NULL), "3 times as many vertices");
    WRONG(antumbra_scene_add_quads(scene, corners, 6, 0, NULL, 1, 0, NULL), "4 times as many vertices");
    WRONG(antumbra_scene_add_spheres(scene, corners, 0, NULL, 0, 1, NULL), "`radii` is null");
    WRONG(antumbra_scene_add_spheres(scene, corners, 4, &radius, 0, 1, NULL), "stride of `centers`");
    WRONG(antumbra_scene_add_curves(scene, corners, 2, 0, NULL, 2, 0, NULL), "one curve of 1 segments, not 2");
    WRONG(antumbra_scene_add_disks(scene, corners, 0, NULL, 0, &radius, 0, 1, NULL), "`normals` is null");
    WRONG(antumbra_scene_add_user(scene, 1, NULL, NULL), "`functions` is null");
    WRONG(antumbra_scene_add_user(scene, 1, &functions, NULL), "bounds` is null");
    functions.size -= 8;
    WRONG(antumbra_scene_add_user(scene, 1, &functions, NULL), "sizeof(antumbra_user_geometry)");
    WRONG(antumbra_scene_set_origin(scene, NULL), "`origin` is null");
    WRONG(antumbra_scene_set_origin(scene, origin), "not finite");
    WRONG(antumbra_scene_set_mask(scene, 0, 1), "no geometry 0 among 0");
    WRONG(antumbra_scene_set_positions(scene, 0, corners, 3, 0), "no geometry 0 among 0");
    {
        size_t count;
        OK(antumbra_scene_geometry_count(scene, &count));
        CHECK(count == 0);
        WRONG(antumbra_scene_geometry_count(scene, NULL), "`count` is null");
    }
    OK(antumbra_scene_add_triangles(scene, corners, 6, 0, bad, 1, 0, NULL));
    FAILS(antumbra_bvh_build(scene, NULL, &none), ANTUMBRA_BAD_GEOMETRY, "vertex 6");
    CHECK(none == NULL);
    FAILS(antumbra_object_build(scene, NULL, &object), ANTUMBRA_BAD_GEOMETRY, "vertex 6");
    CHECK(object == NULL);
    antumbra_scene_free(scene);
    OK(antumbra_scene_new(&scene));
    OK(antumbra_scene_add_triangles(scene, corners, 6, 0, indices, 1, 0, NULL));
    WRONG(antumbra_scene_set_positions(scene, 0, corners, 5, 0), "has 6 vertices, and 5 were given");
    WRONG(antumbra_scene_set_opacity(scene, 0, &opacity), "`opacity->opacity` is null");
    WRONG(antumbra_scene_set_opacity(scene, 0, NULL), "`opacity` is null");
    OK(antumbra_scene_new(&spheres));
    OK(antumbra_scene_add_spheres(spheres, corners, 0, &radius, 0, 1, NULL));
    FAILS(antumbra_scene_set_positions(spheres, 0, corners, 1, 0), ANTUMBRA_UNSUPPORTED, "no vertices");
    FAILS(antumbra_scene_set_opacity(spheres, 0, &opacity), ANTUMBRA_UNSUPPORTED, "no triangles");

    /* Recipes and builds. */
    WRONG(antumbra_recipe_init(NULL, NULL), "`recipe` is null");
    WRONG(antumbra_recipe_init(&recipe, "best"), "unknown preset `best`; known are default, fast, paper");
    WRONG(antumbra_bvh_build(scene, NULL, NULL), "`bvh` is null");
    WRONG(antumbra_bvh_build(NULL, NULL, &none), "`scene` is null");
    OK(antumbra_recipe_init(&recipe, "fast"));
    options.recipe = &recipe;
#define RECIPE(field, value, words)                                  \
    do {                                                             \
        antumbra_recipe before = recipe;                             \
        recipe.field = (value);                                      \
        WRONG(antumbra_bvh_build(scene, &options, &none), (words));  \
        CHECK(none == NULL);                                         \
        recipe = before;                                             \
    } while (0)
    RECIPE(size, 8, "`recipe->size` is 8");
    RECIPE(preset, "x", "unknown preset `x`");
    RECIPE(builder, "x", "unknown builder `x`");
    RECIPE(collapse, "x", "unknown collapse `x`");
    RECIPE(order, "x", "unknown order `x`");
    RECIPE(level, "x", "unknown");
    RECIPE(width, 5, "`recipe->width` is 5");
    RECIPE(training, 3, "`recipe->training` is 3");
    RECIPE(node_cost, -1.0f, "`recipe->node_cost` is -1");
    RECIPE(cutout_cost, INFINITY, "`recipe->cutout_cost` is inf");
    RECIPE(prefetch, 2, "`recipe->prefetch` is 2");
    RECIPE(reserved, 1, "`recipe->reserved` is 1");
    options.ray_count = 1;
    WRONG(antumbra_bvh_build(scene, &options, &none), "`rays` is null");
    options.ray_count = 0;
    options.size = 0;
    WRONG(antumbra_bvh_build(scene, &options, &none), "`options->size` is 0, and sizeof(antumbra_build)");
    options.size = sizeof options;
    /* What is right is taken: every name has an effect or an error. */
    recipe.builder = "reinsertion";
    recipe.collapse = "sah";
    recipe.order = "sort+";
    recipe.level = "scalar";
    recipe.width = 8;
    recipe.training = ANTUMBRA_TRAINING_SURFACE;
    recipe.surface_rays = 500;
    recipe.seed = 3;
    recipe.prefetch = 0;
    OK(antumbra_bvh_build(scene, &options, &bvh));
    {
        antumbra_report report;
        OK(antumbra_bvh_report(bvh, &report));
        CHECK(report.width == 8 && report.prefetches == 0 && strcmp(report.level, "scalar") == 0);
        CHECK(report.training_rays <= 500);
    }
    WRONG(antumbra_bvh_build_instances(NULL, scenes, 1, NULL, 0, NULL, &none), "`objects[0]` is null");
    WRONG(antumbra_bvh_build_instances(NULL, NULL, 1, NULL, 0, NULL, &none), "`objects` is null");
    scenes[0] = scene;
    WRONG(antumbra_bvh_build_instances(NULL, scenes, 1, NULL, 1, NULL, &none), "`instances` is null");
    FAILS(antumbra_bvh_build_instances(NULL, scenes, 1, &placed, 1, NULL, &none), ANTUMBRA_BAD_GEOMETRY, "object 1");
    CHECK(none == NULL);

    /* One ray. */
    WRONG(antumbra_occluded1(NULL, &ray, &occluded), "`bvh` is null");
    WRONG(antumbra_occluded1(bvh, NULL, &occluded), "`ray` is null");
    WRONG(antumbra_occluded1(bvh, &ray, NULL), "`occluded` is null");
    WRONG(antumbra_intersect1(bvh, &ray, NULL), "`hit` is null");
    WRONG(antumbra_intersect1(bvh, (const antumbra_ray *)(const void *)((const char *)&ray + 1), &hit), "multiple of 4 bytes");

    /* Batches. */
    batch = antumbra_batch_of(&ray, 1);
    WRONG(antumbra_occluded(NULL, &batch, &dark, 0), "`bvh` is null");
    WRONG(antumbra_occluded(bvh, NULL, &dark, 0), "`batch` is null");
    WRONG(antumbra_occluded(bvh, &batch, NULL, 0), "`occluded` is null");
    WRONG(antumbra_intersect(bvh, &batch, NULL, 0), "`hits` is null");
    WRONG(antumbra_surface_of(bvh, &batch, NULL, 0), "`surfaces` is null");
    WRONG(antumbra_intersect(bvh, &batch, &hit, 8), "stride of `hits` is 8 bytes, less than the 24 bytes");
    WRONG(antumbra_occluded_bits(bvh, &batch, bits, 2), "need 1 words");
    WRONG(antumbra_occluded_bits(bvh, &batch, (uint64_t *)(void *)((char *)bits + 4), 1), "multiple of 8 bytes");
    WRONG(antumbra_all_hits(bvh, &batch, NULL), "`lists` is null");
    WRONG(antumbra_hit_lists_get(NULL, NULL, NULL, NULL), "`lists` is null");
#define BATCH(field, value, words)                                 \
    do {                                                           \
        antumbra_batch before = batch;                             \
        batch.field = (value);                                     \
        WRONG(antumbra_occluded(bvh, &batch, &dark, 0), (words));  \
        WRONG(antumbra_intersect(bvh, &batch, &hit, 0), (words));  \
        WRONG(antumbra_all_hits(bvh, &batch, &lists), (words));    \
        CHECK(lists == NULL && dark == 7);                         \
        batch = before;                                            \
    } while (0)
    BATCH(size, 31, "sizeof(antumbra_batch)");
    BATCH(rays, NULL, "`rays` is null");
    BATCH(ray_stride, 31, "stride of `rays` is 31 bytes, less than the 32 bytes");
    BATCH(ray_stride, ANTUMBRA_SAME_FOR_ALL, "`rays` cannot be the same");
    BATCH(count, SIZE_MAX, "more than any memory");
    BATCH(origins, org, "either `rays` or `origins`");
    BATCH(tnear, org, "belong to");
    BATCH(flags, 4, "`batch->flags` is 4");
    BATCH(order, 4, "`batch->order` is 4");
    batch.masks = indices;
    BATCH(mask_stride, 2, "stride of `masks`");
    batch.masks = NULL;
    batch = antumbra_batch_of_arrays(org, dir, 1);
    BATCH(origins, NULL, "`origins` is null");
    BATCH(directions, NULL, "`directions` is null");
    BATCH(origin_stride, 8, "stride of `origins`");
    batch = antumbra_batch_of(&ray, 1);

    /* Groups and points. */
    WRONG(antumbra_directions_new(NULL, 1, 0, &directions), "`directions` is null");
    CHECK(directions == NULL);
    OK(antumbra_directions_new(dir, 1, 0, &directions));
    group = antumbra_group_of(org, 1);
    group.flags = ANTUMBRA_CLOSED;
    WRONG(antumbra_group_open(bvh, &group, directions, bits, 1), "`group->flags` is 1");
    group.flags = 0;
    group.size = 1;
    WRONG(antumbra_group_open(bvh, &group, directions, bits, 1), "sizeof(antumbra_group)");
    WRONG(antumbra_group_open(bvh, NULL, directions, bits, 1), "`group` is null");
    group = antumbra_group_of(org, 1);
    WRONG(antumbra_group_open(bvh, &group, directions, NULL, 1), "`bits` is null");
    OK(antumbra_group_open(bvh, &group, directions, bits, 1));
    CHECK(bits[0] == 0);
    antumbra_directions_free(directions);
    points = antumbra_points_of(org, 1);
    points.reserved = 1;
    WRONG(antumbra_contains(bvh, &points, &dark, 0), "reserved");
    points = antumbra_points_of(NULL, 1);
    WRONG(antumbra_contains(bvh, &points, &dark, 0), "`points->points` is null");
    points = antumbra_points_of(org, 1);
    points.max_distances = org;
    points.max_distance_stride = 3;
    WRONG(antumbra_contains(bvh, &points, &dark, 0), "stride of `max_distances`");
    WRONG(antumbra_closest_lists_get(NULL, NULL, NULL, NULL), "`lists` is null");

    /* Worlds, changes, files. */
    OK(antumbra_object_build(scene, NULL, &object));
    FAILS(antumbra_world_new(object, NULL, 0, &placed, 1, NULL, &world), ANTUMBRA_BAD_GEOMETRY, "object 1");
    CHECK(world == NULL);
    WRONG(antumbra_world_new(NULL, NULL, 1, NULL, 0, NULL, &world), "`objects` is null");
    WRONG(antumbra_world_set_instances(NULL, NULL, 0, NULL), "`world` is null");
    WRONG(antumbra_world_bvh(NULL, NULL), "`world` is null");
    WRONG(antumbra_bvh_refit(NULL, scene, NULL), "`bvh` is null");
    WRONG(antumbra_bvh_refit(bvh, NULL, NULL), "`scene` is null");
    FAILS(antumbra_bvh_refit(bvh, spheres, NULL), ANTUMBRA_OTHER_GEOMETRY, "build again");
    WRONG(antumbra_bvh_relearn(bvh, NULL, 1, 0, NULL, NULL), "`rays` is null");
    WRONG(antumbra_bvh_set_masks(bvh, NULL, 1), "`masks` is null");
    WRONG(antumbra_bvh_quality(bvh, NULL), "`quality` is null");
    WRONG(antumbra_bvh_report(bvh, NULL), "`report` is null");
    WRONG(antumbra_bvh_save(bvh, NULL), "`path` is null");
    WRONG(antumbra_world_save(NULL, "x"), "`world` is null");
    WRONG(antumbra_bvh_load(NULL, NULL, &none), "`path` is null");
    WRONG(antumbra_bvh_from_memory(NULL, 9, NULL, &none), "`bytes` is null");
    FAILS(antumbra_bvh_from_memory(NULL, 0, NULL, &none), ANTUMBRA_UNREADABLE, "");
    {
        antumbra_functions given = antumbra_functions_init();
        uint8_t *bytes;
        size_t byte_count;
        OK(antumbra_bvh_to_memory(bvh, &bytes, &byte_count));
        given.user_geometry_count = 1;
        WRONG(antumbra_bvh_from_memory(bytes, byte_count, &given, &none), "`user_geometries` is null");
        given.size = 3;
        WRONG(antumbra_bvh_from_memory(bytes, byte_count, &given, &none), "sizeof(antumbra_functions)");
        WRONG(antumbra_bvh_to_memory(bvh, NULL, &byte_count), "`bytes` is null");
        antumbra_memory_free(bytes, byte_count);
    }

    /* After all this it answers. */
    OK(antumbra_occluded1(bvh, &ray, &occluded));
    CHECK(occluded);
    antumbra_object_free(object);
    antumbra_bvh_free(bvh);
    antumbra_scene_free(scene);
    antumbra_scene_free(spheres);
    puts("errors: ok");
    return 0;
}
