/* Ambient occlusion: how much of the sky each vertex of a mesh sees.
 *
 *     ambient_occlusion [FILE.obj [DIRECTIONS]]
 *
 * Without a file the mesh is a field of towers. Every vertex looks in the same directions; those that are not above the surface
 * do not count, and the others count by the cosine of their angle to the normal. Prints the mean over all vertices: 1 is an open
 * plane, 0 a closed box. */
#include "antumbra.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* A mesh that grows while it is read. */
typedef struct mesh {
    float *positions;
    size_t vertices, vertex_room;
    uint32_t *indices;
    size_t triangles, triangle_room;
} mesh;

static void *enough(void *memory, size_t needed, size_t *room, size_t item) {
    if (needed <= *room) {
        return memory;
    }
    *room = 2 * needed;
    memory = realloc(memory, *room * item);
    if (memory == NULL) {
        fputs("out of memory\n", stderr);
        exit(1);
    }
    return memory;
}

static void add_vertex(mesh *own, float x, float y, float z) {
    own->positions = enough(own->positions, own->vertices + 1, &own->vertex_room, 3 * sizeof(float));
    own->positions[3 * own->vertices] = x;
    own->positions[3 * own->vertices + 1] = y;
    own->positions[3 * own->vertices + 2] = z;
    own->vertices += 1;
}

static void add_triangle(mesh *own, uint32_t a, uint32_t b, uint32_t c) {
    own->indices = enough(own->indices, own->triangles + 1, &own->triangle_room, 3 * sizeof(uint32_t));
    own->indices[3 * own->triangles] = a;
    own->indices[3 * own->triangles + 1] = b;
    own->indices[3 * own->triangles + 2] = c;
    own->triangles += 1;
}

/* Reads vertices and faces of an OBJ file, and divides faces into triangles. */
static bool read_obj(const char *path, mesh *own) {
    char line[4096];
    size_t number = 0;
    FILE *file = fopen(path, "r");
    if (file == NULL) {
        perror(path);
        return false;
    }
    while (fgets(line, sizeof line, file) != NULL) {
        number += 1;
        if (strncmp(line, "v ", 2) == 0) {
            float x, y, z;
            if (sscanf(line + 2, "%f %f %f", &x, &y, &z) != 3) {
                fprintf(stderr, "%s:%zu: a vertex needs three numbers\n", path, number);
                fclose(file);
                return false;
            }
            add_vertex(own, x, y, z);
        } else if (strncmp(line, "f ", 2) == 0) {
            uint32_t corners[3] = {0, 0, 0};
            size_t count = 0;
            const char *word = strtok(line + 2, " \t\r\n");
            for (; word != NULL; word = strtok(NULL, " \t\r\n")) {
                /* From 1 on, or from the end if negative. The first number of "7/2/9" is the vertex. */
                long index = strtol(word, NULL, 10);
                index = index < 0 ? (long)own->vertices + index : index - 1;
                if (index < 0 || (size_t)index >= own->vertices) {
                    fprintf(stderr, "%s:%zu: there is no vertex %s\n", path, number, word);
                    fclose(file);
                    return false;
                }
                corners[count < 2 ? count : 2] = (uint32_t)index;
                count += 1;
                if (count >= 3) {
                    add_triangle(own, corners[0], corners[1], corners[2]);
                    corners[1] = corners[2];
                }
            }
        }
    }
    fclose(file);
    return true;
}

/* A height field of `side` times `side` points: towers on a plain. */
static void towers(mesh *own, uint32_t side) {
    uint32_t x, y, seed = 1;
    float height = 0.0f, row[64];
    for (y = 0; y < side; ++y) {
        for (x = 0; x < side; ++x) {
            if (y % 8 == 0 && x % 8 == 0) {
                seed = seed * 1664525u + 1013904223u;
                row[x / 8 % 64] = (float)(seed >> 24) / 16.0f;
            }
            height = x % 8 < 4 && y % 8 < 4 ? row[x / 8 % 64] : 0.0f;
            add_vertex(own, (float)x, (float)y, height);
        }
    }
    for (y = 0; y + 1 < side; ++y) {
        for (x = 0; x + 1 < side; ++x) {
            uint32_t corner = y * side + x;
            add_triangle(own, corner, corner + 1, corner + side + 1);
            add_triangle(own, corner, corner + side + 1, corner + side);
        }
    }
}

/* Normals of vertices: the sum of those of their triangles, by area. */
static float *normals_of(const mesh *own) {
    float *normals = calloc(own->vertices + 1, 3 * sizeof(float));
    size_t triangle;
    int corner, axis;
    if (normals == NULL) {
        fputs("out of memory\n", stderr);
        exit(1);
    }
    for (triangle = 0; triangle < own->triangles; ++triangle) {
        const uint32_t *index = own->indices + 3 * triangle;
        const float *a = own->positions + 3 * (size_t)index[0];
        const float *b = own->positions + 3 * (size_t)index[1];
        const float *c = own->positions + 3 * (size_t)index[2];
        float ab[3], ac[3], normal[3];
        for (axis = 0; axis < 3; ++axis) {
            ab[axis] = b[axis] - a[axis];
            ac[axis] = c[axis] - a[axis];
        }
        normal[0] = ab[1] * ac[2] - ab[2] * ac[1];
        normal[1] = ab[2] * ac[0] - ab[0] * ac[2];
        normal[2] = ab[0] * ac[1] - ab[1] * ac[0];
        for (corner = 0; corner < 3; ++corner) {
            for (axis = 0; axis < 3; ++axis) {
                normals[3 * (size_t)index[corner] + (size_t)axis] += normal[axis];
            }
        }
    }
    return normals;
}

/* Directions all around, evenly spread along a spiral. */
static void directions_around(float *directions, size_t count) {
    size_t index;
    for (index = 0; index < count; ++index) {
        double z = 1.0 - (2.0 * (double)index + 1.0) / (double)count, turn = 2.399963229728653 * (double)index;
        double radius = sqrt(1.0 - z * z);
        directions[3 * index] = (float)(radius * cos(turn));
        directions[3 * index + 1] = (float)(radius * sin(turn));
        directions[3 * index + 2] = (float)z;
    }
}

/* Ends the program if a call failed. */
static void check(antumbra_status status) {
    if (status != ANTUMBRA_OK) {
        fprintf(stderr, "%s: %s\n", antumbra_status_text(status), antumbra_last_error());
        exit(1);
    }
}

int main(int argc, char **argv) {
    mesh own = {NULL, 0, 0, NULL, 0, 0};
    size_t count = argc > 2 ? strtoul(argv[2], NULL, 10) : 256, words = (count + 63) / 64, vertex, direction;
    float *normals, *points, *directions, offset;
    uint64_t *open;
    double sum = 0.0;
    size_t seen = 0;
    antumbra_scene *scene;
    antumbra_bvh *bvh;
    antumbra_directions *prepared;
    antumbra_group group;
    antumbra_report report;

    if (argc > 1) {
        if (!read_obj(argv[1], &own)) {
            return 1;
        }
    } else {
        towers(&own, 200);
    }
    check(antumbra_scene_new(&scene));
    check(antumbra_scene_add_triangles(scene, own.positions, own.vertices, 0, own.indices, own.triangles, 0, NULL));
    check(antumbra_bvh_build(scene, NULL, &bvh));
    antumbra_scene_free(scene);
    check(antumbra_bvh_report(bvh, &report));
    printf("%zu vertices, %zu triangles, %zu of them cannot be hit\n", own.vertices, own.triangles, report.dropped);

    /* Points a little above the surface. */
    normals = normals_of(&own);
    points = malloc((own.vertices + 1) * 3 * sizeof *points);
    directions = malloc((count + 1) * 3 * sizeof *directions);
    open = malloc((own.vertices * words + 1) * sizeof *open);
    if (points == NULL || directions == NULL || open == NULL) {
        fputs("out of memory\n", stderr);
        return 1;
    }
    check(antumbra_bvh_bounds(bvh, NULL, &offset));
    for (vertex = 0; vertex < own.vertices; ++vertex) {
        float *normal = normals + 3 * vertex;
        float length = sqrtf(normal[0] * normal[0] + normal[1] * normal[1] + normal[2] * normal[2]);
        int axis;
        for (axis = 0; axis < 3; ++axis) {
            normal[axis] = length > 0.0f ? normal[axis] / length : 0.0f;
            points[3 * vertex + (size_t)axis] = own.positions[3 * vertex + (size_t)axis] + offset * normal[axis];
        }
    }

    directions_around(directions, count);
    // ANCHOR: group
    check(antumbra_directions_new(directions, count, 0, &prepared));
    group = antumbra_group_of(points, own.vertices);
    group.normals = normals;
    check(antumbra_group_open(bvh, &group, prepared, open, words));
    // ANCHOR_END: group

    for (vertex = 0; vertex < own.vertices; ++vertex) {
        const float *normal = normals + 3 * vertex;
        double weight = 0.0, light = 0.0;
        for (direction = 0; direction < count; ++direction) {
            const float *to = directions + 3 * direction;
            double cosine = (double)normal[0] * to[0] + (double)normal[1] * to[1] + (double)normal[2] * to[2];
            if (cosine > 0.0) {
                weight += cosine;
                if (open[vertex * words + direction / 64] >> direction % 64 & 1) {
                    light += cosine;
                }
            }
        }
        if (weight > 0.0) {
            sum += light / weight;
            seen += 1;
        }
    }
    printf("mean ambient occlusion of %zu vertices, %zu directions: %.4f\n", seen, count, seen > 0 ? sum / (double)seen : 1.0);

    antumbra_directions_free(prepared);
    antumbra_bvh_free(bvh);
    free(own.positions);
    free(own.indices);
    free(normals);
    free(points);
    free(directions);
    free(open);
    return 0;
}
