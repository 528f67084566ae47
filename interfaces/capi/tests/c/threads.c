/* Threads: queries side by side, pools, progress, cancelling, and the last error of each thread. POSIX threads. */
#define _POSIX_C_SOURCE 200809L
#include "check.h"

#include <pthread.h>

enum { RAYS = 40000, THREADS = 4 };

static antumbra_bvh *bvh;
static antumbra_ray *rays;
static uint8_t *right;

/* Asks for everything on a thread of its own, and fails on purpose between. */
static void *ask(void *data) {
    uint8_t *dark = malloc(RAYS);
    antumbra_batch batch = antumbra_batch_of(rays, RAYS);
    uint32_t number = *(uint32_t *)data;
    char words[32];
    int round;
    CHECK(strcmp(antumbra_last_error(), "") == 0);
    snprintf(words, sizeof words, "`batch->order` is %u", (unsigned)(100 + number));
    for (round = 0; round < 5; ++round) {
        batch.order = 100 + number;
        FAILS(antumbra_occluded(bvh, &batch, dark, 0), ANTUMBRA_INVALID_ARGUMENT, words);
        batch.order = 0;
        batch.flags = round % 2 ? ANTUMBRA_THIS_THREAD : 0;
        OK(antumbra_occluded(bvh, &batch, dark, 0));
        CHECK(memcmp(dark, right, RAYS) == 0);
        /* Success keeps the text. */
        CHECK(strstr(antumbra_last_error(), words) != NULL);
    }
    free(dark);
    return NULL;
}

typedef struct watched {
    pthread_mutex_t lock;
    float last;
    int calls;
    int stop;
} watched;

static void progress(void *data, float done) {
    watched *own = data;
    pthread_mutex_lock(&own->lock);
    CHECK(done >= 0.0f && done <= 1.0f);
    own->last = done > own->last ? done : own->last;
    own->calls += 1;
    pthread_mutex_unlock(&own->lock);
}

static int32_t cancelled(void *data) { return ((watched *)data)->stop; }

/* A filter that asks the tree itself. */
static int32_t asks(void *data, size_t ray, const antumbra_hit *hit) {
    bool occluded;
    (void)data, (void)hit;
    OK(antumbra_occluded1(bvh, &rays[ray], &occluded));
    return occluded;
}

int main(void) {
    float *corners = random_triangles(5000, 1);
    antumbra_scene *scene;
    antumbra_build options = antumbra_build_init();
    antumbra_threads *pool, *none;
    antumbra_bvh *other = NULL;
    antumbra_batch batch;
    pthread_t threads[THREADS];
    uint32_t numbers[THREADS], index;
    watched own = {PTHREAD_MUTEX_INITIALIZER, 0.0f, 0, 0};
    uint8_t *dark = malloc(RAYS);
    size_t count;

    rays = random_rays(RAYS, 1.2f, 2);
    right = malloc(RAYS);
    OK(antumbra_threads_new(2, &pool));
    OK(antumbra_threads_count(pool, &count));
    CHECK(count == 2);
    FAILS(antumbra_threads_new(1u << 20, &none), ANTUMBRA_INVALID_ARGUMENT, "more than 4096");
    CHECK(none == NULL);
    OK(antumbra_scene_new(&scene));
    OK(antumbra_scene_add_triangles(scene, corners, 15000, 0, NULL, 5000, 0, NULL));
    options.threads = pool;
    options.data = &own;
    options.progress = progress;
    options.cancelled = cancelled;
    options.rays = rays;
    options.ray_count = 1000;
    OK(antumbra_bvh_build(scene, &options, &bvh));
    CHECK(own.calls > 2 && own.last > 0.5f);
    own.stop = 1;
    FAILS(antumbra_bvh_build(scene, &options, &other), ANTUMBRA_CANCELLED, "cancelled");
    CHECK(other == NULL);
    antumbra_scene_free(scene);

    batch = antumbra_batch_of(rays, RAYS);
    batch.flags = ANTUMBRA_THIS_THREAD;
    OK(antumbra_occluded(bvh, &batch, right, 0));
    batch.flags = 0;
    batch.threads = pool;
    OK(antumbra_occluded(bvh, &batch, dark, 0));
    CHECK(memcmp(dark, right, RAYS) == 0);
    batch.filter = asks;
    OK(antumbra_occluded(bvh, &batch, dark, 0));
    CHECK(memcmp(dark, right, RAYS) == 0);
    for (index = 0; index < THREADS; ++index) {
        numbers[index] = index;
        CHECK(pthread_create(&threads[index], NULL, ask, &numbers[index]) == 0);
    }
    for (index = 0; index < THREADS; ++index) {
        CHECK(pthread_join(threads[index], NULL) == 0);
    }
    antumbra_bvh_free(bvh);
    antumbra_threads_free(pool);
    free(corners), free(rays), free(right), free(dark);
    puts("threads: ok");
    return 0;
}
