/* Height fields: horizons, sky, light and viewsheds, against closed forms and brute force along rows. */
#include "check.h"

enum { ROWS = 40, COLUMNS = 70, CELLS = ROWS * COLUMNS };

#define WRONG(call, words) FAILS(call, ANTUMBRA_INVALID_ARGUMENT, words)

static const double pi = 3.14159265358979323846;

/* The horizon to the east: along a row, the surface is highest at the cells. */
static double east(const double *heights, int cell, double rise) {
    double steepest = -INFINITY;
    int other;
    for (other = cell + 1; other % COLUMNS != 0; ++other) {
        steepest = fmax(steepest, (heights[other] - heights[cell] - rise) / (2.0 * (other - cell)));
    }
    return steepest == -INFINITY ? -90.0 : atan(steepest) * 180.0 / pi;
}

static void horizons_and_light(const antumbra_height_field *field, const double *heights) {
    float *angles = malloc(CELLS * sizeof *angles), *walked = malloc(CELLS * sizeof *walked);
    uint8_t *lit = malloc(3 * CELLS);
    const double lights[9] = {90.0, 20.0, 0.0, 90.0, 90.0, 0.0, 90.0 + 1e-9, 20.0, 0.0};
    antumbra_threads *threads;
    int cell;
    OK(antumbra_threads_new(2, &threads));
    OK(antumbra_height_field_horizons(field, 90.0, 0.5, 0.0, threads, angles));
    OK(antumbra_height_field_horizons(field, 90.0 + 1e-9, 0.5, 0.0, NULL, walked));
    OK(antumbra_height_field_lit(field, lights, 3, 24, 0.5, NULL, lit));
    for (cell = 0; cell < CELLS; ++cell) {
        double horizon = east(heights, cell, 0.5);
        CHECK(fabs(angles[cell] - horizon) < 1e-4 && lit[cell] == (horizon < 20.0) && lit[CELLS + cell] == 1);
        /* A little to the south of east, where the last row leaves the surface. */
        if (cell / COLUMNS < ROWS - 1) {
            CHECK(fabs(walked[cell] - horizon) < 1e-4 && lit[2 * CELLS + cell] == (horizon < 20.0));
        }
    }
    antumbra_threads_free(threads);
    free(angles), free(walked), free(lit);
}

/* The openness is the mean of the angles from the zenith to the horizons, and an even plane sees all of the sky. */
static void sky(const antumbra_height_field *field) {
    double azimuths[8], even[6] = {5, 5, 5, 5, 5, 5}, *sums = calloc(CELLS, sizeof *sums);
    float *angles = malloc(CELLS * sizeof *angles), *values = malloc(CELLS * sizeof *values);
    antumbra_height_field *plane;
    uint32_t measure;
    int cell, index;
    OK(antumbra_height_field_lattice(field, 8, azimuths));
    for (index = 0; index < 8; ++index) {
        OK(antumbra_height_field_horizons(field, azimuths[index], 0.5, 0.0, NULL, angles));
        for (cell = 0; cell < CELLS; ++cell) {
            sums[cell] += (90.0 - (angles[cell] == -90.0f ? 0.0 : angles[cell])) / 8.0;
        }
    }
    OK(antumbra_height_field_sky(field, 8, ANTUMBRA_SKY_OPENNESS, 0.5, NULL, values));
    for (cell = 0; cell < CELLS; ++cell) {
        CHECK(fabs(values[cell] - sums[cell]) < 1e-4);
    }
    OK(antumbra_height_field_new(even, 2, 3, 0, NULL, &plane));
    for (measure = 0; measure < 3; ++measure) {
        OK(antumbra_height_field_sky(plane, 16, measure, 0.0, NULL, values));
        for (cell = 0; cell < 6; ++cell) {
            CHECK(fabs(values[cell] - (measure == ANTUMBRA_SKY_OPENNESS ? 90.0 : 1.0)) < 1e-6);
        }
    }
    antumbra_height_field_free(plane);
    free(sums), free(angles), free(values);
}

/* What an eye above a cell sees of its row, to both sides. */
static void viewsheds(const antumbra_height_field *field, const double *heights) {
    const int row = 17, column = 30;
    double eye[3] = {1000.0 + 2.0 * (column + 0.5), 5000.0 - 2.0 * (row + 0.5), 0.0}, ground, steepest;
    uint8_t *seen = malloc(CELLS);
    int other, side;
    OK(antumbra_height_field_height(field, eye[0], eye[1], &ground));
    CHECK(ground == heights[row * COLUMNS + column]);
    OK(antumbra_height_field_height(field, 0.0, 0.0, &eye[2]));
    CHECK(isnan(eye[2]));
    eye[2] = ground + 1.6;
    OK(antumbra_height_field_viewshed(field, eye, 0.25, INFINITY, 0.0, NULL, seen));
    CHECK(seen[row * COLUMNS + column] == 1);
    for (side = -1; side <= 1; side += 2) {
        steepest = -INFINITY;
        for (other = column + side; other >= 0 && other < COLUMNS; other += side) {
            double away = 2.0 * abs(other - column), height = heights[row * COLUMNS + other] - eye[2];
            CHECK(seen[row * COLUMNS + other] == ((height + 0.25) / away >= steepest));
            steepest = fmax(steepest, height / away);
        }
    }
    OK(antumbra_height_field_viewshed(field, eye, 99.0, 10.0, 0.0, NULL, seen));
    for (other = 0; other < CELLS; ++other) {
        double x = 2.0 * (other % COLUMNS - column), y = 2.0 * (other / COLUMNS - row);
        CHECK(seen[other] == (x * x + y * y <= 100.0));
    }
    eye[2] = ground - 1.0;
    OK(antumbra_height_field_viewshed(field, eye, 0.0, INFINITY, 0.0, NULL, seen));
    for (other = 0; other < CELLS; ++other) {
        CHECK(seen[other] == 0);
    }
    free(seen);
}

/* A wall in the east of a plain with a hole, and a round earth. */
static void walls(void) {
    double heights[2 * 4 * 2] = {0, 7, 0, 7, 0, 7, 2, 7, 0, 7, 0, 7, 0, 7, 2, 7}, azimuths[8];
    antumbra_height_field *field;
    float angles[8];
    int index;
    heights[8] = NAN;
    /* Every other number is a height. */
    OK(antumbra_height_field_new(heights, 2, 4, 16, NULL, &field));
    OK(antumbra_height_field_lattice(field, 8, azimuths));
    for (index = 0; index < 8; ++index) {
        CHECK(azimuths[index] == 45.0 * index);
    }
    OK(antumbra_height_field_horizons(field, azimuths[2], 0.0, 0.0, NULL, angles));
    CHECK(fabs(angles[0] - atan(2.0 / 3.0) * 180.0 / pi) < 1e-5 && angles[1] == 45.0f && angles[3] == -90.0f && isnan(angles[4]));
    OK(antumbra_height_field_horizons(field, azimuths[2], 0.0, 0.1, NULL, angles));
    CHECK(fabs(angles[1] - atan(1.6 / 2.0) * 180.0 / pi) < 1e-5);
    antumbra_height_field_free(field);
}

static void mistakes(void) {
    double heights[4] = {0, 0, 0, 0}, flat[6] = {0, 0, 0, 0, 0, -1}, lights[2] = {0, NAN};
    antumbra_height_field *field = (antumbra_height_field *)8;
    float angles[4];
    uint8_t bytes[4];
    WRONG(antumbra_height_field_new(NULL, 2, 2, 0, NULL, &field), "`heights` is null");
    CHECK(field == NULL);
    WRONG(antumbra_height_field_new(heights, 2, 2, 0, NULL, NULL), "`field` is null");
    WRONG(antumbra_height_field_new(heights, 0, 2, 0, NULL, &field), "number of cells: found 0");
    WRONG(antumbra_height_field_new(heights, 2, 2, 4, NULL, &field), "stride of `heights` is 4 bytes");
    WRONG(antumbra_height_field_new(heights, SIZE_MAX / 2, 3, 0, NULL, &field), "more than any memory");
    WRONG(antumbra_height_field_new(heights, 2, 2, 0, flat, &field), "area of a cell: found 0");
    heights[3] = INFINITY;
    WRONG(antumbra_height_field_new(heights, 2, 2, 0, NULL, &field), "height: found inf");
    heights[3] = 0.0;
    OK(antumbra_height_field_new(heights, 2, 2, 0, NULL, &field));
    WRONG(antumbra_height_field_lattice(field, 12, heights), "azimuths of a lattice: found 12");
    WRONG(antumbra_height_field_lattice(field, 8, NULL), "`azimuths` is null");
    WRONG(antumbra_height_field_horizons(NULL, 0.0, 0.0, 0.0, NULL, angles), "`field` is null");
    WRONG(antumbra_height_field_horizons(field, NAN, 0.0, 0.0, NULL, angles), "azimuth: found NaN");
    WRONG(antumbra_height_field_horizons(field, 0.0, 0.0, 0.0, NULL, NULL), "`angles` is null");
    WRONG(antumbra_height_field_sky(field, 12, ANTUMBRA_SKY_VIEW, 0.0, NULL, angles), "azimuths of a lattice: found 12");
    WRONG(antumbra_height_field_sky(field, 8, 3, 0.0, NULL, angles), "`measure` is 3");
    WRONG(antumbra_height_field_sky(field, 8, ANTUMBRA_SKY_OPEN, 0.0, NULL, NULL), "`values` is null");
    WRONG(antumbra_height_field_lit(field, lights, 1, 0, 0.0, NULL, bytes), "slope: found NaN");
    WRONG(antumbra_height_field_lit(field, NULL, 1, 0, 0.0, NULL, bytes), "`lights` is null");
    WRONG(antumbra_height_field_lit(field, lights, SIZE_MAX / 8, 0, 0.0, NULL, bytes), "more than any memory");
    lights[1] = 90.5;
    WRONG(antumbra_height_field_lit(field, lights, 1, 0, 0.0, NULL, bytes), "slope: found NaN");
    OK(antumbra_height_field_lit(field, NULL, 0, 0, 0.0, NULL, NULL));
    WRONG(antumbra_height_field_viewshed(field, NULL, 0.0, INFINITY, 0.0, NULL, bytes), "`eye` is null");
    WRONG(antumbra_height_field_viewshed(field, heights, 0.0, INFINITY, 0.0, NULL, NULL), "`seen` is null");
    heights[2] = NAN;
    WRONG(antumbra_height_field_viewshed(field, heights, 0.0, INFINITY, 0.0, NULL, bytes), "`eye` is beside the surface");
    WRONG(antumbra_height_field_height(field, 0.0, 0.0, NULL), "`height` is null");
    antumbra_height_field_free(field);
    antumbra_height_field_free(NULL);
}

int main(void) {
    const double transform[6] = {1000.0, 2.0, 0.0, 5000.0, 0.0, -2.0};
    double *heights = malloc(CELLS * sizeof *heights);
    antumbra_height_field *field;
    uint64_t seed = 7;
    int cell;
    for (cell = 0; cell < CELLS; ++cell) {
        heights[cell] = random_in(&seed, 0.0f, 3.0f);
    }
    OK(antumbra_height_field_new(heights, ROWS, COLUMNS, 0, transform, &field));
    horizons_and_light(field, heights);
    sky(field);
    viewsheds(field, heights);
    antumbra_height_field_free(field);
    walls();
    mistakes();
    free(heights);
    puts("fields: ok");
    return 0;
}
