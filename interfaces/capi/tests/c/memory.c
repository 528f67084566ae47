/* Where there is no memory, a call says so and the program lives: with 8 GB of addresses, of which 3 are taken by inputs that
 * nothing is ever written to. */
#define _DEFAULT_SOURCE
#include "check.h"

#if defined(__linux__)
#include <sys/mman.h>
#include <sys/resource.h>

#define NEEDS(call, words) FAILS(call, ANTUMBRA_NO_MEMORY, words)

static void *zeros(size_t bytes) {
    void *memory = mmap(NULL, bytes, PROT_READ, MAP_PRIVATE | MAP_ANONYMOUS | MAP_NORESERVE, -1, 0);
    CHECK(memory != MAP_FAILED);
    return memory;
}

int main(void) {
    const size_t triangle_count = 100000000, instance_count = 20000000;
    const struct rlimit limit = {8000000000u, 8000000000u};
    const float corners[9] = {0, 0, 1, 1, 0, 1, 0, 1, 1}, org[3] = {0.25f, 0.25f, 0}, dir[3] = {0, 0, 1};
    const uint32_t *indices = zeros(triangle_count * 12);
    const antumbra_instance *instances = zeros(instance_count * sizeof *instances);
    antumbra_build options = antumbra_build_init();
    antumbra_recipe recipe;
    antumbra_scene *large, *small;
    const antumbra_scene *objects[1];
    antumbra_object *object = NULL;
    const antumbra_object *placed[1];
    antumbra_world *world = NULL;
    antumbra_bvh *bvh = NULL;
    antumbra_batch batch = antumbra_batch_of(NULL, (size_t)1 << 30);
    antumbra_hit_lists *lists = NULL;
    antumbra_ray ray = antumbra_ray_from(org, dir);
    antumbra_hit hit;

    CHECK(setrlimit(RLIMIT_AS, &limit) == 0);
    OK(antumbra_scene_new(&large));
    OK(antumbra_scene_add_triangles(large, corners, 3, 0, indices, triangle_count, 0, NULL));
    NEEDS(antumbra_bvh_build(large, NULL, &bvh), "100000000 primitives");
    NEEDS(antumbra_object_build(large, NULL, &object), "100000000 primitives");
    CHECK(bvh == NULL && object == NULL);
    antumbra_scene_free(large);

    OK(antumbra_scene_new(&small));
    OK(antumbra_scene_add_triangles(small, corners, 3, 0, NULL, 1, 0, NULL));
    objects[0] = small;
    NEEDS(antumbra_bvh_build_instances(NULL, objects, 1, instances, instance_count, NULL, &bvh), "20000000 instances");
    OK(antumbra_object_build(small, NULL, &object));
    placed[0] = object;
    NEEDS(antumbra_world_new(NULL, placed, 1, instances, instance_count, NULL, &world), "20000000 instances");
    CHECK(world == NULL);
    antumbra_object_free(object);

    OK(antumbra_recipe_init(&recipe, "default"));
    options.recipe = &recipe;
    recipe.surface_rays = (uint64_t)1 << 40;
    FAILS(antumbra_bvh_build(small, &options, &bvh), ANTUMBRA_TOO_MANY, "16777216");
    CHECK(bvh == NULL);

    /* What fits is answered as ever. */
    OK(antumbra_bvh_build(small, NULL, &bvh));
    batch.origins = org, batch.origin_stride = ANTUMBRA_SAME_FOR_ALL;
    batch.directions = dir, batch.direction_stride = ANTUMBRA_SAME_FOR_ALL;
    NEEDS(antumbra_all_hits(bvh, &batch, &lists), "1073741824 lists of hits");
    CHECK(lists == NULL);
    OK(antumbra_intersect1(bvh, &ray, &hit));
    CHECK(hit.t == 1.0f);
    antumbra_bvh_free(bvh);
    antumbra_scene_free(small);
    printf("memory: ok\n");
    return 0;
}
#else
int main(void) {
    printf("memory: ok\n");
    return 0;
}
#endif
