/* The first program in C: which points of a floor does a lamp light? */
#include <antumbra.h>

#include <stdio.h>

/* A floor, and a roof over one half of it. */
static const float positions[8][3] = {{0, 0, 0}, {4, 0, 0}, {4, 4, 0}, {0, 4, 0}, {0, 0, 2}, {2, 0, 2}, {2, 4, 2}, {0, 4, 2}};
static const uint32_t quads[2][4] = {{0, 1, 2, 3}, {4, 5, 6, 7}};

int main(void) {
    const float lamp[3] = {2, 2, 10};
    antumbra_scene *scene = NULL;
    antumbra_bvh *bvh = NULL;
    antumbra_ray rays[100];
    antumbra_batch batch;
    uint8_t in_shadow[100];
    int index, shadows = 0;

    if (antumbra_scene_new(&scene) != ANTUMBRA_OK ||
        antumbra_scene_add_quads(scene, positions[0], 8, 0, quads[0], 2, 0, NULL) != ANTUMBRA_OK ||
        antumbra_bvh_build(scene, NULL, &bvh) != ANTUMBRA_OK) {
        fprintf(stderr, "%s\n", antumbra_last_error());
        antumbra_scene_free(scene);
        return 1;
    }
    antumbra_scene_free(scene);

    /* The open segment from each point to the lamp: the floor at its end does not count. */
    for (index = 0; index < 100; ++index) {
        const float point[3] = {0.2f + 0.4f * (float)(index % 10), 0.2f + 0.4f * (float)(index / 10), 0.0f};
        rays[index] = antumbra_ray_between(point, lamp);
    }
    batch = antumbra_batch_of(rays, 100);
    if (antumbra_occluded(bvh, &batch, in_shadow, 0) != ANTUMBRA_OK) {
        fprintf(stderr, "%s\n", antumbra_last_error());
    }
    for (index = 0; index < 100; ++index) {
        shadows += in_shadow[index];
    }
    printf("%d of 100 points are in shadow\n", shadows);
    antumbra_bvh_free(bvh);
    return 0;
}
