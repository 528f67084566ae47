/* Answers of all queries of rays on triangles, against a brute-force loop. */
#include "check.h"

enum { TRIANGLES = 400, RAYS = 20000 };

/* A ray among fields of a caller, and room for its answers. */
typedef struct record {
    char name[5];
    antumbra_ray ray;
    antumbra_hit hit;
    uint8_t dark;
} record;

typedef struct filtered {
    const antumbra_ray *rays;
    const float *corners;
} filtered;

static int32_t only_even(void *data, size_t ray, const antumbra_hit *hit) {
    const filtered *own = data;
    double uv[2], edge, t = brute_triangle(own->corners + 9 * hit->prim_id, &own->rays[ray], uv, &edge);
    /* The number of the ray is that of the batch: it hits this triangle there. */
    CHECK(fabs(edge) < 1e-5 || fabs(t - hit->t) < 1e-4);
    return hit->prim_id % 2 == 0;
}

static int32_t count_up(void *data, size_t ray, const antumbra_hit *hit) {
    uint32_t *counts = data;
    counts[ray] += 1;
    return hit->t < INFINITY ? ANTUMBRA_REJECT : ANTUMBRA_STOP;
}

static int32_t take_second(void *data, size_t ray, const antumbra_hit *hit) {
    antumbra_hit *hits = data;
    if (hits[ray].geom_id == ANTUMBRA_INVALID_ID) {
        hits[ray].geom_id = 0;
        return ANTUMBRA_REJECT;
    }
    hits[ray] = *hit;
    return ANTUMBRA_ACCEPT;
}

static int32_t nonsense(void *data, size_t ray, const antumbra_hit *hit) {
    (void)data, (void)ray, (void)hit;
    return 17;
}

int main(void) {
    float *corners = random_triangles(TRIANGLES, 1);
    antumbra_ray *rays = random_rays(RAYS, 1.2f, 2);
    antumbra_hit *brute = malloc(RAYS * sizeof *brute), *hits = malloc(RAYS * sizeof *hits);
    double *edges = malloc(RAYS * sizeof *edges);
    uint8_t *dark = malloc(RAYS);
    uint32_t *brute_counts = calloc(RAYS, sizeof *brute_counts), *counts = malloc(RAYS * sizeof *counts);
    uint64_t *bits = malloc((RAYS + 63) / 64 * sizeof *bits);
    antumbra_surface *surfaces = malloc(RAYS * sizeof *surfaces);
    antumbra_prim_id *occluders = malloc(RAYS * sizeof *occluders);
    record *records = calloc(RAYS, sizeof *records);
    antumbra_scene *scene;
    antumbra_bvh *bvh;
    antumbra_batch batch;
    size_t ray, blocked = 0, doubtful = 0, triangle;

    OK(antumbra_scene_new(&scene));
    OK(antumbra_scene_add_triangles(scene, corners, 3 * TRIANGLES, 0, NULL, TRIANGLES, 0, NULL));
    OK(antumbra_bvh_build(scene, NULL, &bvh));
    antumbra_scene_free(scene);

    for (ray = 0; ray < RAYS; ++ray) {
        double best = DBL_MAX, second = DBL_MAX;
        edges[ray] = 1.0;
        brute[ray].geom_id = ANTUMBRA_INVALID_ID;
        for (triangle = 0; triangle < TRIANGLES; ++triangle) {
            double uv[2], edge, t = brute_triangle(corners + 9 * triangle, &rays[ray], uv, &edge);
            if (fabs(edge) < 1e-5) {
                /* Too near to an edge for another formula to decide. */
                edges[ray] = 0.0;
            }
            if (t >= 0.0 && (t < 1e-5 || t > 1.0 - 1e-5)) {
                edges[ray] = 0.0;
            }
            if (t < 0.0) {
                continue;
            }
            brute_counts[ray] += 1;
            if (t < best) {
                second = best;
                best = t;
                brute[ray].t = (float)t;
                brute[ray].u = (float)uv[0];
                brute[ray].v = (float)uv[1];
                brute[ray].prim_id = (uint32_t)triangle;
                brute[ray].geom_id = 0;
            } else if (t < second) {
                second = t;
            }
        }
        if (best < DBL_MAX && second - best < 1e-5) {
            edges[ray] = 0.0;
        }
        doubtful += edges[ray] == 0.0;
        blocked += brute[ray].geom_id == 0;
    }
    printf("%zu of %zu rays are blocked, %zu are too near to an edge to say\n", blocked, (size_t)RAYS, doubtful);
    CHECK(doubtful < RAYS / 100 && blocked > RAYS / 4 && blocked < 3 * RAYS / 4);

    batch = antumbra_batch_of(rays, RAYS);
    OK(antumbra_occluded(bvh, &batch, dark, 0));
    OK(antumbra_intersect(bvh, &batch, hits, 0));
    OK(antumbra_occluded_bits(bvh, &batch, bits, (RAYS + 63) / 64));
    OK(antumbra_surface_of(bvh, &batch, surfaces, 0));
    OK(antumbra_occluder(bvh, &batch, occluders, 0));
    OK(antumbra_count_hits(bvh, &batch, counts, 0));
    for (ray = 0; ray < RAYS; ++ray) {
        bool one;
        antumbra_hit hit;
        antumbra_surface surface;
        antumbra_prim_id occluder;
        CHECK(dark[ray] <= 1);
        CHECK(dark[ray] == (bits[ray / 64] >> ray % 64 & 1));
        CHECK(dark[ray] == antumbra_is_hit(&hits[ray]));
        CHECK(dark[ray] == (occluders[ray].geom_id == 0));
        CHECK(memcmp(&hits[ray], &surfaces[ray].hit, sizeof hit) == 0);
        CHECK((counts[ray] > 0) == dark[ray]);
        OK(antumbra_occluded1(bvh, &rays[ray], &one));
        OK(antumbra_intersect1(bvh, &rays[ray], &hit));
        CHECK(one == dark[ray] && memcmp(&hit, &hits[ray], sizeof hit) == 0);
        OK(antumbra_surface1(bvh, &rays[ray], &surface));
        CHECK(memcmp(&surface, &surfaces[ray], sizeof surface) == 0);
        OK(antumbra_occluder1(bvh, &rays[ray], &occluder));
        CHECK((occluder.geom_id == 0) == one);
        if (!dark[ray]) {
            CHECK(hits[ray].t == INFINITY && hits[ray].u == 0.0f && hits[ray].inst_id == ANTUMBRA_INVALID_ID);
            CHECK(surface.position[0] == INFINITY && surface.normal[2] == 0.0f);
        }
        if (edges[ray] == 0.0) {
            continue;
        }
        CHECK(dark[ray] == (brute[ray].geom_id == 0));
        CHECK(counts[ray] == brute_counts[ray]);
        if (dark[ray]) {
            const float *at = corners + 9 * hits[ray].prim_id;
            float length = 0.0f, side = 0.0f;
            int axis;
            CHECK(hits[ray].prim_id == brute[ray].prim_id && hits[ray].inst_id == ANTUMBRA_INVALID_ID);
            CHECK(fabsf(hits[ray].t - brute[ray].t) < 1e-5f);
            CHECK(fabsf(hits[ray].u - brute[ray].u) < 1e-3f && fabsf(hits[ray].v - brute[ray].v) < 1e-3f);
            for (axis = 0; axis < 3; ++axis) {
                float place = rays[ray].org[axis] + hits[ray].t * rays[ray].dir[axis];
                CHECK(fabsf(place - surfaces[ray].position[axis]) < 1e-5f);
                length += surfaces[ray].normal[axis] * surfaces[ray].normal[axis];
                side += surfaces[ray].normal[axis] * (at[3 + axis] - at[axis]);
            }
            CHECK(fabsf(length - 1.0f) < 1e-5f && fabsf(side) < 1e-5f);
        }
    }

    /* Rays among other fields, at an odd address, with answers beside them. */
    for (ray = 0; ray < RAYS; ++ray) {
        records[ray].ray = rays[ray];
    }
    batch.rays = &records[0].ray;
    batch.ray_stride = sizeof(record);
    OK(antumbra_intersect(bvh, &batch, &records[0].hit, sizeof(record)));
    OK(antumbra_occluded(bvh, &batch, &records[0].dark, sizeof(record)));
    for (ray = 0; ray < RAYS; ++ray) {
        CHECK(memcmp(&records[ray].hit, &hits[ray], sizeof hits[ray]) == 0);
        CHECK(records[ray].dark == dark[ray]);
        CHECK(memcmp(&records[ray].ray, &rays[ray], sizeof rays[ray]) == 0);
        records[ray].dark = 9;
    }
    memset(bits, 255, (RAYS + 63) / 64 * sizeof *bits);
    OK(antumbra_occluded_bits(bvh, &batch, bits, (RAYS + 63) / 64));
    for (ray = 0; ray < (RAYS + 63) / 64 * 64; ++ray) {
        CHECK((bits[ray / 64] >> ray % 64 & 1) == (ray < RAYS && dark[ray]));
    }

    /* Misaligned memory. */
    {
        char *room = malloc(1 + 100 * sizeof(antumbra_ray) + 100 * sizeof(antumbra_hit) + 8);
        antumbra_hit hit;
        memcpy(room + 1, rays, 100 * sizeof(antumbra_ray));
        batch = antumbra_batch_of((const antumbra_ray *)(const void *)(room + 1), 100);
        OK(antumbra_intersect(bvh, &batch, (antumbra_hit *)(void *)(room + 1 + 100 * sizeof(antumbra_ray)), 0));
        for (ray = 0; ray < 100; ++ray) {
            memcpy(&hit, room + 1 + 100 * sizeof(antumbra_ray) + ray * sizeof hit, sizeof hit);
            CHECK(memcmp(&hit, &hits[ray], sizeof hit) == 0);
        }
        free(room);
    }

    /* Rays in arrays of their own. */
    {
        float up[3] = {0.0f, 0.0f, 2.0f}, far[1] = {0.5f};
        float *origins = malloc(RAYS * 4 * sizeof *origins);
        uint8_t *other = malloc(RAYS);
        antumbra_ray *same = malloc(RAYS * sizeof *same);
        for (ray = 0; ray < RAYS; ++ray) {
            memcpy(origins + 4 * ray, rays[ray].org, sizeof rays[ray].org);
            origins[4 * ray + 3] = 0.01f * (float)(ray % 20);
            same[ray] = antumbra_ray_from(rays[ray].org, up);
            same[ray].tnear = origins[4 * ray + 3];
            same[ray].tfar = 0.5f;
        }
        batch = antumbra_batch_of_arrays(origins, up, RAYS);
        batch.origin_stride = 16;
        batch.direction_stride = ANTUMBRA_SAME_FOR_ALL;
        batch.tnear = origins + 3;
        batch.tnear_stride = 16;
        batch.tfar = far;
        batch.tfar_stride = ANTUMBRA_SAME_FOR_ALL;
        OK(antumbra_occluded(bvh, &batch, other, 0));
        batch = antumbra_batch_of(same, RAYS);
        OK(antumbra_occluded(bvh, &batch, dark, 0));
        CHECK(memcmp(dark, other, RAYS) == 0);
        free(origins), free(other), free(same);
    }

    /* Filters, primitives left out, orders, closed intervals. */
    {
        antumbra_prim_id *except = malloc(RAYS * sizeof *except);
        antumbra_hit *second = malloc(RAYS * sizeof *second), *listed;
        antumbra_hit_lists *lists;
        const size_t *splits;
        const antumbra_hit *all;
        size_t total;
        uint32_t order;
        batch = antumbra_batch_of(rays, RAYS);
        for (order = ANTUMBRA_ORDER_AS_GIVEN; order <= ANTUMBRA_ORDER_BY_RULE; ++order) {
            batch.order = order;
            OK(antumbra_intersect(bvh, &batch, second, 0));
            CHECK(memcmp(second, hits, RAYS * sizeof *hits) == 0);
            batch.rays = &records[0].ray;
            batch.ray_stride = sizeof(record);
            OK(antumbra_intersect(bvh, &batch, second, 0));
            CHECK(memcmp(second, hits, RAYS * sizeof *hits) == 0);
            batch.rays = rays;
            batch.ray_stride = 0;
        }
        batch.order = ANTUMBRA_ORDER_AS_GIVEN;

        filtered own;
        own.rays = rays;
        own.corners = corners;
        batch.filter = only_even;
        batch.data = &own;
        OK(antumbra_intersect(bvh, &batch, second, 0));
        OK(antumbra_all_hits(bvh, &batch, &lists));
        OK(antumbra_hit_lists_get(lists, &splits, &all, &total));
        CHECK(splits[0] == 0 && splits[RAYS] == total);
        for (ray = 0; ray < RAYS; ++ray) {
            CHECK(antumbra_is_hit(&second[ray]) == (splits[ray + 1] > splits[ray]));
            if (splits[ray + 1] > splits[ray]) {
                CHECK(memcmp(&all[splits[ray]], &second[ray], sizeof *all) == 0);
                CHECK(second[ray].prim_id % 2 == 0);
            }
        }
        antumbra_hit_lists_free(lists);
        batch.filter = NULL;

        for (ray = 0; ray < RAYS; ++ray) {
            except[ray] = antumbra_prim_of(&hits[ray]);
        }
        batch.except = except;
        OK(antumbra_intersect(bvh, &batch, second, 0));
        batch.except = NULL;
        OK(antumbra_all_hits(bvh, &batch, &lists));
        OK(antumbra_hit_lists_get(lists, &splits, &all, NULL));
        listed = malloc(RAYS * sizeof *listed);
        for (ray = 0; ray < RAYS; ++ray) {
            size_t of_ray = splits[ray + 1] - splits[ray], hit;
            CHECK(of_ray == counts[ray]);
            for (hit = splits[ray] + 1; hit < splits[ray + 1]; ++hit) {
                CHECK(all[hit - 1].t <= all[hit].t);
            }
            CHECK(antumbra_is_hit(&second[ray]) == (of_ray > 1));
            if (of_ray > 1) {
                CHECK(memcmp(&second[ray], &all[splits[ray] + 1], sizeof *all) == 0);
            }
            listed[ray].geom_id = ANTUMBRA_INVALID_ID;
            brute_counts[ray] = 0;
        }
        OK(antumbra_visit_hits(bvh, &batch, count_up, brute_counts));
        CHECK(memcmp(brute_counts, counts, RAYS * sizeof *counts) == 0);
        OK(antumbra_visit_hits(bvh, &batch, take_second, listed));
        for (ray = 0; ray < RAYS; ++ray) {
            CHECK(counts[ray] < 2 || memcmp(&listed[ray], &second[ray], sizeof *listed) == 0);
        }
        antumbra_hit_lists_free(lists);
        FAILS(antumbra_visit_hits(bvh, &batch, nonsense, NULL), ANTUMBRA_INVALID_ARGUMENT, "17");
        FAILS(antumbra_visit_hits(bvh, &batch, NULL, NULL), ANTUMBRA_INVALID_ARGUMENT, "`visit` is null");

        /* A ray that ends at the hit hits it if intervals are closed. The distance that decides is next to the one reported. */
        for (ray = 0; ray < RAYS; ++ray) {
            if (antumbra_is_hit(&hits[ray])) {
                bool open;
                uint8_t closed;
                antumbra_ray short_ray = rays[ray], longer_ray = rays[ray];
                uint32_t ends[2];
                short_ray.tfar = hits[ray].t * 0.99f;
                longer_ray.tfar = hits[ray].t * 1.01f;
                OK(antumbra_occluded1(bvh, &short_ray, &open));
                if (open) {
                    continue;
                }
                memcpy(&ends[0], &short_ray.tfar, sizeof ends[0]);
                memcpy(&ends[1], &longer_ray.tfar, sizeof ends[1]);
                while (ends[1] - ends[0] > 1) {
                    const uint32_t middle = ends[0] + (ends[1] - ends[0]) / 2;
                    memcpy(&longer_ray.tfar, &middle, sizeof middle);
                    OK(antumbra_occluded1(bvh, &longer_ray, &open));
                    ends[open ? 1 : 0] = middle;
                }
                memcpy(&short_ray.tfar, &ends[0], sizeof ends[0]);
                batch = antumbra_batch_of(&short_ray, 1);
                batch.flags = ANTUMBRA_CLOSED | ANTUMBRA_THIS_THREAD;
                OK(antumbra_occluded(bvh, &batch, &closed, 0));
                CHECK(closed == 1);
            }
        }
        free(except), free(second), free(listed);
    }

    antumbra_bvh_free(bvh);
    free(corners), free(rays), free(brute), free(hits), free(edges), free(dark), free(brute_counts), free(counts), free(bits);
    free(surfaces), free(occluders), free(records);
    puts("queries: ok");
    return 0;
}
