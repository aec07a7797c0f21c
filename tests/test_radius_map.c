/* Radius maps: what is coded is what is decoded, near the truth; their surfaces are closed and cross nothing; hostile bytes end. */
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include "check.h"
#include "mesh.h"
#include "radius_map.h"
#include "radius_estimate.h"
#include "radius_trace.h"

static uint32_t seed = 7;
static uint32_t next_random(void) {
    seed = seed * 1664525u + 1013904223u;
    return seed >> 8;
}

static int32_t put(void *coder, lathe_number_model *model, int32_t number) {
    lathe__put_number(coder, model, number);
    return number;
}
static int32_t get(void *coder, lathe_number_model *model, int32_t number) {
    (void)number;
    return lathe__get_number(coder, model);
}

enum { MAX_SIZE = 96 };

/* A bumpy tube whose section turns by `twist` a slice about a wandering centre. */
static double tube_radius(double angle, int row, int slices, double size, double bumps, double twist) {
    double along = slices > 1 ? (double)row / (slices - 1) : 0.5, round = 0.35 + 0.65 * sin(3.14159 * along);
    return size * round * (1 + bumps * cos(3 * (angle - twist * row)) + 0.5 * bumps * sin(5 * angle + along));
}

static void fill_mask(lathe_mask *m, int slices, double size, double bumps, double twist) {
    int32_t n = (int32_t)(size * 2 * (1 + 2 * bumps)) + 8, dims[3] = {n, n, slices}, origin[3] = {0, 0, 0};
    if (lathe__mask_new(m, dims, origin)) abort();
    for (int w = 0; w < slices; w++)
        for (int v = 1; v < n - 1; v++)
            for (int u = 1; u < n - 1; u++) {
                double x = u - n / 2.0 - 1.5 * sin(w * 0.1), y = v - n / 2.0;
                if (hypot(x, y) > tube_radius(atan2(y, x), w, slices, size, bumps, twist) && hypot(x, y) > 1.5) continue;
                lathe__mask_slice(m, w)[(size_t)v * (size_t)m->row_words + (size_t)(u >> 6)] |= (uint64_t)1 << (u & 63);
            }
}

static lathe_arena arena, scratch;

static bool closed_ball(const lathe_mesh *mesh) {
    lathe_mesh_report r;
    if (lathe__mesh_check(&r, mesh, true)) return false;
    return !r.boundary_edges && !r.nonmanifold_edges && !r.misoriented_edges && !r.nonmanifold_vertices && !r.degenerate_triangles &&
           !r.duplicate_positions && !r.unused_vertices && !r.self_intersections && r.components == 1 && r.euler == 2;
}

/* Encodes level by level, decodes level by level; every level's surface is checked. Returns the bytes. */
static size_t round_trip(const lathe_radius_map *truth, int32_t step, double *rms) {
    lathe_radius_map coded = *truth, decoded = *truth;
    size_t total = 0;
    coded.models = decoded.models = NULL;
    if (lathe__radius_map_start(&coded, &arena) || lathe__radius_map_start(&decoded, &arena)) abort();
    coded.step = decoded.step = step;
    for (uint32_t level = 0; level < truth->level_count; level++) {
        lathe_range_encoder e;
        lathe_range_decoder d;
        lathe__encoder_start(&e);
        CHECK(!lathe__radius_walk(&coded, level, &(lathe_number_coder){put, &e, truth}));
        lathe__encoder_finish(&e);
        lathe__decoder_start(&d, e.bytes, e.size);
        CHECK(!lathe__radius_walk(&decoded, level, &(lathe_number_coder){get, &d, NULL}));
        CHECK(d.overrun <= 8);
        total += e.size;
        lathe__encoder_free(&e);
        lathe_mesh mesh;
        if (!CHECK(!lathe__radius_mesh(&mesh, &decoded, level))) continue;
        CHECK(closed_ball(&mesh));
        lathe_mesh_free(&mesh);
    }
    size_t samples = (size_t)truth->slices * truth->rays;
    double sum = 0;
    int32_t worst = 0;
    CHECK(!memcmp(coded.radius, decoded.radius, samples * sizeof *coded.radius));
    for (size_t i = 0; i < samples; i++) {
        int32_t miss = abs(decoded.radius[i] - truth->radius[i]);
        if (miss > worst) worst = miss;
        sum += (double)miss * miss;
    }
    CHECK(worst <= step * 3 / 5 + 1);   /* the dead zone bounds every sample's error */
    *rms = sqrt(sum / (double)samples) / LATHE_RADIUS_ONE;
    return total;
}

/* The map of a mask that is one tube; EMPTY if it is more. */
static lathe_status fit_mask(lathe_radius_map *map, const lathe_mask *mask, uint32_t level_count, int32_t turn) {
    lathe_traced_tubes traced;
    lathe_status status = lathe__radius_trace(&traced, &arena, mask, 32);
    double back;
    if (status || traced.count != 1 || traced.tubes[0].rows != mask->size[2]) return status ? status : LATHE_ERR_EMPTY;
    *map = (lathe_radius_map){.slices = mask->size[2], .level_count = level_count, .turn = turn, .fall = 6, .start = {0, 0, 1024},
                              .farthest = (mask->size[0] + mask->size[1]) * LATHE_RADIUS_ONE};
    return lathe__radius_fit(map, &arena, &scratch, traced.tubes[0].loops, &back);
}

/* Radii that follow grey values end on the circle that these are the distance from, straight and turned; a circle in pixels: the outline
 * alone is up to half a pixel off. */
typedef struct circle { double x, y, radius, sign; } circle;

static double circle_depth(void *context, double u, double v, int32_t w) {
    const circle *c = context;
    return c->sign * (c->radius + 0.2 * w - hypot(u - c->x, v - c->y));
}

static void on_circle(const lathe_radius_map *map, const circle *c) {
    int worst = 0;
    for (int32_t row = 0; row < map->slices; row++)
        for (uint32_t ray = 0; ray < map->rays; ray++) {
            double angle = 6.283185307179586 * ((double)ray / map->rays + (double)map->turn * row / 65536);
            double x = map->centre[row][0] * 0.5 - c->x, y = map->centre[row][1] * 0.5 - c->y, along = x * cos(angle) + y * sin(angle);
            double radius = c->radius + 0.2 * (row + 3), length = sqrt(along * along - x * x - y * y + radius * radius) - along;
            int miss = abs((int)lround(length * LATHE_RADIUS_ONE) - map->radius[(size_t)row * map->rays + ray]);
            if (miss > worst) worst = miss;
        }
    CHECK(worst <= 1);
}

static void follows(void) {
    enum { SLICES = 7 };
    int32_t dims[3] = {48, 44, SLICES}, origin[3] = {0, 0, 0};
    lathe_mask mask;
    lathe_radius_map map;
    lathe_traced_tubes traced;
    for (int hole = 0; hole < 2; hole++) {
        circle c = {23.2, 21.7, 12.3, hole ? -1 : 1};
        const lathe_grey grey = {circle_depth, &c, 0};
        if (lathe__mask_new(&mask, dims, origin)) abort();
        for (int w = 0; w < SLICES; w++)
            for (int v = 1; v < dims[1] - 1; v++)
                for (int u = 1; u < dims[0] - 1; u++)
                    if (c.sign * circle_depth(&c, u, v, w + 3) >= 0) lathe__mask_slice(&mask, w)[v] |= (uint64_t)1 << u;
        CHECK(!fit_mask(&map, &mask, 3, 0));
        CHECK(!lathe__radius_trace(&traced, &arena, &mask, 32));
        CHECK(!lathe__radius_follow(&map, &scratch, 3, hole, &grey));
        on_circle(&map, &c);
        CHECK(!lathe__radius_turn(&map, &arena, traced.tubes[0].loops, 900));
        CHECK(!lathe__radius_follow(&map, &scratch, 3, hole, &grey));
        CHECK_EQ(map.turn, 900);
        on_circle(&map, &c);
        lathe__mask_free(&mask);
        lathe__arena_reset(&arena);
        lathe__arena_reset(&scratch);
    }
}

static void tubes(void) {
    for (int i = 0; i < 60; i++) {
        int slices = 1 + (int)(next_random() % 60);
        double size = 2 + next_random() % 30, bumps = (next_random() % 20) / 100.0, twist = (next_random() % 3) * 0.03;
        lathe_mask mask;
        lathe_radius_map truth;
        fill_mask(&mask, slices, size, bumps, twist);
        lathe_status status = fit_mask(&truth, &mask, lathe__choose_levels(slices), (int32_t)lround(twist * 65536 / 6.283185307179586));
        if (!status) {
            double fine, coarse;
            size_t most = round_trip(&truth, 20, &fine), least = round_trip(&truth, 120, &coarse);
            CHECK(fine < 0.2 && least <= most);
        } else {
            CHECK_EQ(status, LATHE_ERR_EMPTY);   /* thin tubes can fall apart into diagonal neighbours */
        }
        lathe__mask_free(&mask);
        lathe__arena_reset(&arena);
    }
}

/* ---- several tubes ---- */

static void set_pixel(lathe_mask *m, int32_t u, int32_t v, int32_t w) {
    lathe__mask_slice(m, w)[(size_t)v * (size_t)m->row_words + (size_t)(u >> 6)] |= (uint64_t)1 << (u & 63);
}

enum { WIDE = 80, TALL = 50, FORKED = 44 };
static bool in_disk(double x, double y, double r) { return x * x + y * y <= r * r; }
/* A thick trunk; inside it, from slice 4 on, a round canal that parts into two at slice 20, which end at slices 35 and 39. */
static bool in_fork(int32_t u, int32_t v, int32_t w) {
    double x = u - 40, y = v - 25, apart = w < 20 ? 0 : (w - 19) * 1.1;
    if (!(x * x / (34 * 34) + y * y / (21 * 21) <= 1)) return false;
    if (w < 4) return true;
    bool left = w <= 35 && in_disk(x + apart, y, 6), right = w <= 39 && in_disk(x - apart, y, 6);
    return !left && !right;
}

static void fill_fork(lathe_mask *m) {
    int32_t dims[3] = {WIDE, TALL, FORKED}, origin[3] = {0, 0, 0};
    if (lathe__mask_new(m, dims, origin)) abort();
    for (int32_t w = 0; w < FORKED; w++)
        for (int32_t v = 1; v < TALL - 1; v++)
            for (int32_t u = 1; u < WIDE - 1; u++)
                if (in_fork(u, v, w)) set_pixel(m, u, v, w);
}

static void start_truth(lathe_radii *truth, const lathe_mask *mask, const lathe_traced_tubes *traced, int32_t step, uint32_t fine_level) {
    *truth = (lathe_radii){.slices = mask->size[2], .width = mask->size[0], .height = mask->size[1], .level_count = lathe__choose_levels(mask->size[2]),
                           .count = traced->count, .step = step, .fine_level = fine_level, .fine_step = step - 8};
    truth->tubes = LATHE_NEW(&arena, lathe_radius_tube, traced->count);
    memset(truth->tubes, 0, traced->count * sizeof *truth->tubes);
    for (uint32_t i = 0; i < traced->count; i++) {
        lathe_radius_tube *t = &truth->tubes[i];
        double back;
        t->first = traced->tubes[i].first;
        t->hole = traced->tubes[i].hole;
        t->map = (lathe_radius_map){.slices = traced->tubes[i].rows, .level_count = lathe__tube_passes(traced->tubes[i].rows, truth->level_count), .fall = 6,
                                    .farthest = (WIDE + TALL) * LATHE_RADIUS_ONE};
        CHECK(!lathe__radius_fit(&t->map, &arena, &scratch, traced->tubes[i].loops, &back));
    }
}

static void check_surface(const lathe_mesh *mesh) {
    lathe_mesh_report r;
    if (!CHECK(!lathe__mesh_check(&r, mesh, true))) return;
    CHECK(!r.boundary_edges && !r.nonmanifold_edges && !r.misoriented_edges && !r.nonmanifold_vertices && !r.degenerate_triangles &&
          !r.duplicate_positions && !r.self_intersections);
    CHECK_EQ(r.components, 2);   /* the trunk, and the forked canal as a cavity */
    CHECK_EQ(r.euler, 4);
}

static bool same_numbers(const int32_t *a, const int32_t *b, size_t count) { return !memcmp(a, b, count * sizeof *a); }

/* The estimate again, without its short cuts: all rows of what is shown, each ray's end by the triangle of two rays and the chord. */
static double plain_estimate(double *most, const lathe_radius_estimate *e, lathe_radii *radii, uint32_t level) {
    int32_t *slices;
    uint32_t count, stride;
    double square = 0, weight = 0;
    *most = 0;
    CHECK(!lathe__radii_slices(&slices, &count, &stride, &scratch, radii, level));
    for (uint32_t t = 0; t < radii->count; t++) {
        lathe_radius_tube *tube = &radii->tubes[t];
        const lathe_radius_map *truth = &e->truth->tubes[t].map;
        lathe_radius_map m = lathe__tube_shown(tube, lathe__passes_at(radii, tube, level));
        uint32_t q = m.rays / stride < 8 ? m.rays / 8 : stride;
        for (int32_t row = 0; row < m.slices; row++) {
            int32_t low = 0, high = m.slices - 1;
            for (uint32_t i = 0; i < count; i++) {
                int32_t at = slices[i] - tube->first;
                if (at >= 0 && at < m.slices && at <= row) low = at;
                if (at >= row && at < m.slices && at < high) high = at;
            }
            double part = high > low ? (double)(row - low) / (high - low) : 0;
            for (uint32_t ray = 0; ray < m.rays; ray++) {
                double angle = 6.283185307179586 * (ray % q) / m.rays, whole = 6.283185307179586 * q / m.rays, r[2], d = 0;
                for (uint32_t k = 0; k < 2; k++) {
                    uint32_t at = (ray / q * q + k * q) % m.rays;
                    r[k] = m.radius[(size_t)low * m.rays + at] * (1 - part) + m.radius[(size_t)high * m.rays + at] * part;
                }
                double shown = r[0] * r[1] * sin(whole) / (r[0] * sin(angle) + r[1] * sin(whole - angle));
                for (int k = 0; k < 2; k++) {
                    double along = 6.283185307179586 * ray / m.rays, centre = m.centre[low][k] * (1 - part) + m.centre[high][k] * part;
                    d += LATHE_RADIUS_ONE / 2.0 * (truth->centre[row][k] - centre) * (k ? sin(along) : cos(along));
                }
                size_t sample = (size_t)row * m.rays + ray;
                d = fabs(truth->radius[sample] - shown + d) * (double)e->tubes[t].facing[sample];
                square += (double)e->tubes[t].share[sample] * d * d;
                weight += (double)e->tubes[t].share[sample];
                if (d > *most) *most = d;
            }
        }
    }
    lathe__arena_reset(&scratch);
    *most /= LATHE_RADIUS_ONE;
    return sqrt(square / weight) / LATHE_RADIUS_ONE;
}

/* Codes and decodes; every level closes, with the topology of the voxels; what both sides know is the same, and never worse than before. */
static size_t fork_trip(const lathe_radii *truth) {
    lathe_radii coded = {.slices = truth->slices, .width = truth->width, .height = truth->height, .level_count = truth->level_count}, decoded = coded;
    lathe_radius_estimate estimate;
    lathe_arena own = {0}, mesh_arena[2] = {{0}};
    size_t total = 0;
    double before = 1e9;
    CHECK(!lathe__estimate_start(&estimate, &own, truth, 1));
    for (uint32_t level = 0; level < truth->level_count; level++) {
        lathe_range_encoder e;
        lathe_range_decoder d;
        lathe_surface_counts counts = {0};
        lathe_mesh mesh = {0};
        uint32_t shown;
        double rms, most;
        lathe__encoder_start(&e);
        CHECK(!lathe__radii_code(&coded, truth, &own, level, put, &e));
        lathe__encoder_finish(&e);
        lathe__decoder_start(&d, e.bytes, e.size);
        CHECK(!lathe__radii_code(&decoded, NULL, &own, level, get, &d));
        CHECK(d.overrun <= 8);
        total += e.size;
        lathe__encoder_free(&e);
        if (!CHECK(!lathe__radii_mesh(&mesh, mesh_arena, &decoded, level, &counts, &shown))) continue;
        check_surface(&mesh);
        lathe_mesh_free(&mesh);
        CHECK(!lathe__estimate_error(&rms, &most, &estimate, &scratch, &decoded, level));
        CHECK(rms < before * 1.02);
        double plain_most, plain = plain_estimate(&plain_most, &estimate, &decoded, level);
        CHECK(fabs(rms - plain) < 1e-4 && fabs(most - plain_most) < 1e-3);
        before = rms;
    }
    CHECK(before < 0.5);
    CHECK_EQ(decoded.count, truth->count);
    for (uint32_t i = 0; i < truth->count; i++) {
        const lathe_radius_tube *a = &coded.tubes[i], *b = &decoded.tubes[i];
        CHECK_EQ(b->first, truth->tubes[i].first);
        CHECK_EQ(b->hole, truth->tubes[i].hole);
        CHECK(same_numbers(a->map.radius, b->map.radius, (size_t)a->map.slices * a->map.rays));
        CHECK(same_numbers(a->map.centre[0], b->map.centre[0], 2 * (size_t)a->map.slices));
    }
    lathe__arena_free(&own);
    for (int i = 0; i < 2; i++) lathe__arena_free(&mesh_arena[i]);
    return total;
}

static void forks(void) {
    lathe_mask mask;
    lathe_traced_tubes traced;
    lathe_radii truth;
    fill_fork(&mask);
    if (!CHECK(!lathe__radius_trace(&traced, &arena, &mask, 32)) || !CHECK_EQ(traced.count, 4)) return;
    /* trunk, canal up to where its halves part (they are 6 wide: first apart when 1.1 (w - 19) > 6), two branches */
    CHECK(!traced.tubes[0].hole && traced.tubes[0].first == 0 && traced.tubes[0].rows == FORKED);
    CHECK(traced.tubes[1].hole && traced.tubes[1].first == 4);
    int32_t parted = 4 + traced.tubes[1].rows, ends[2] = {0, 0};
    CHECK(parted >= 25 && parted <= 27);
    for (int i = 0; i < 2; i++) {
        CHECK(traced.tubes[2 + i].hole && traced.tubes[2 + i].first == parted);
        ends[i] = parted + traced.tubes[2 + i].rows - 1;
    }
    CHECK_EQ(ends[0] + ends[1], 35 + 39);
    start_truth(&truth, &mask, &traced, 24, 0);
    size_t fine = fork_trip(&truth);
    start_truth(&truth, &mask, &traced, 24, 2);
    size_t finer = fork_trip(&truth);
    start_truth(&truth, &mask, &traced, 30, 0);
    CHECK(fork_trip(&truth) < fine && fine < finer);
    lathe__mask_free(&mask);
    lathe__arena_reset(&arena);
}

/* Rays ahead of slices change when a radius is coded and from what it is predicted, not how near to the truth it comes; early slices hold
 * what they have been coded with to the end. */
static void ahead_and_early(void) {
    static const uint32_t AHEAD[] = {1, 3, LATHE_RADIUS_MOST_AHEAD};
    lathe_mask mask;
    lathe_traced_tubes traced;
    fill_fork(&mask);
    if (!CHECK(!lathe__radius_trace(&traced, &arena, &mask, 32))) return;
    for (int i = 0; i < 6; i++) {
        lathe_radii truth;
        bool early[FORKED];
        start_truth(&truth, &mask, &traced, 24, i & 1 ? 2 : 0);
        for (int w = 0; w < FORKED; w++) early[w] = next_random() % 3 == 0;
        for (uint32_t k = 0; k < truth.count; k++) truth.tubes[k].map.ahead = AHEAD[i / 2];
        truth.early = early;
        truth.early_level = (uint32_t)i % truth.level_count;
        fork_trip(&truth);
    }
    lathe__mask_free(&mask);
    lathe__arena_reset(&arena);
}

/* What the map of one tube knows at a level; radii of the last level: truth, everything within 0.6 of the last step. */
static void early_rows_are_near(void) {
    enum { ROWS = 33, LEVELS = 4, EARLY = 13, RAYS = 32 };
    bool early[ROWS] = {0};
    lathe_radius_tube tube = {.map = {.slices = ROWS, .level_count = lathe__tube_passes(ROWS, LEVELS), .rays = RAYS, .fall = 6,
                                      .apex = {4, 4}, .farthest = 1 << 14}};
    lathe_radii truth = {.slices = ROWS, .width = 100, .height = 100, .level_count = LEVELS, .count = 1, .step = 24, .fine_step = 24,
                         .early_level = 2, .early = early, .tubes = &tube};
    lathe_radii coded = {.slices = ROWS, .width = 100, .height = 100, .level_count = LEVELS};
    int32_t *slices;
    uint32_t count, stride;
    if (lathe__radius_map_start(&tube.map, &arena)) abort();
    for (int32_t row = 0; row < ROWS; row++) {
        tube.map.centre[row][0] = tube.map.centre[row][1] = 99;
        for (int32_t i = 0; i < RAYS; i++) tube.map.radius[row * RAYS + i] = row == EARLY || row == EARLY + 1 ? 600 + 30 * (i & 3) : 1200;
    }
    early[EARLY - 1] = early[EARLY + 1] = true;   /* of level 1, whose slices are 4 apart: 12 is one, 14 would be new at level 2 */
    for (uint32_t level = 0; level < LEVELS; level++) {
        lathe_range_encoder e;
        lathe__encoder_start(&e);
        CHECK(!lathe__radii_code(&coded, &truth, &arena, level, put, &e));
        lathe__encoder_free(&e);
        CHECK(!lathe__radii_slices(&slices, &count, &stride, &scratch, &coded, level));
        bool shown = false;
        for (uint32_t k = 0; k < count; k++) shown |= slices[k] == EARLY + 1;
        CHECK_EQ(shown, level > 0);
        lathe_radius_map map = lathe__tube_shown(&coded.tubes[0], lathe__passes_at(&coded, &coded.tubes[0], level));
        int32_t worst = 0;
        for (int32_t i = 0; i < RAYS; i += 2) {
            int32_t miss = abs(map.radius[(EARLY + 1) * RAYS + i] - tube.map.radius[(EARLY + 1) * RAYS + i]);
            if (miss > worst) worst = miss;
        }
        /* With level 1 every second ray of the row is known, to 0.6 of a step that has fallen twice; before that it is smooth. */
        if (level) CHECK(worst <= lathe__tube_step(24) * 9 / 16 * 3 / 5 + 1);
        else CHECK(worst > 400);
        lathe__arena_reset(&scratch);
    }
    lathe__arena_reset(&arena);
}

/* Two squares, the second a hole or not: half sides a and b, the second's centre shifted. */
static bool squares_fit(int32_t a, int32_t b, int32_t shift, bool hole) {
    lathe_point points[8];
    lathe_loop loops[2] = {{.first = 0, .count = 4}, {.first = 4, .count = 4, .hole = hole}};
    lathe_outline outline = {.point_count = 8, .loop_count = 2, .points = points, .loops = loops};
    static const int32_t SIGN[4][2] = {{-1, -1}, {1, -1}, {1, 1}, {-1, 1}};
    for (int i = 0; i < 4; i++) {
        points[i] = (lathe_point){SIGN[i][0] * a, SIGN[i][1] * a};
        points[4 + i] = (lathe_point){shift + SIGN[hole ? 3 - i : i][0] * b, SIGN[hole ? 3 - i : i][1] * b};
    }
    return lathe__loops_fit(&outline);
}

static void loops_fit(void) {
    CHECK(squares_fit(1000, 400, 0, true));      /* a hole in a square */
    CHECK(!squares_fit(1000, 400, 0, false));    /* a square in a square */
    CHECK(!squares_fit(1000, 400, 2000, true));  /* a hole in nothing */
    CHECK(squares_fit(1000, 400, 2000, false));  /* side by side */
    CHECK(!squares_fit(1000, 400, 700, true));   /* across its rim */
    CHECK(!squares_fit(1000, 400, 1300, false));
    CHECK(!squares_fit(1000, 400, 600, true));   /* touching it */
    CHECK(!squares_fit(400, 1000, 0, true));     /* inside out */
}

/* The same of random polygons, their boxes left aside: is there a pair of edges of different loops that have a point in common? */
static bool edges_cross(lathe_point a, lathe_point b, lathe_point c, lathe_point d) {
    lathe_point at[4] = {a, b, c, d};
    int64_t side[4] = {lathe__orient(c, d, a), lathe__orient(c, d, b), lathe__orient(a, b, c), lathe__orient(a, b, d)};
    if (!side[0] && !side[1]) {   /* on one line: their extents overlap along both axes */
        int32_t low[2][2], high[2][2];
        for (int i = 0; i < 2; i++) {
            lathe_point p = at[2 * i], q = at[2 * i + 1];
            low[i][0] = p.x < q.x ? p.x : q.x, high[i][0] = p.x < q.x ? q.x : p.x;
            low[i][1] = p.y < q.y ? p.y : q.y, high[i][1] = p.y < q.y ? q.y : p.y;
        }
        for (int k = 0; k < 2; k++)
            if (high[0][k] < low[1][k] || high[1][k] < low[0][k]) return false;
        return true;
    }
    return (side[0] <= 0 || side[1] <= 0) && (side[0] >= 0 || side[1] >= 0) && (side[2] <= 0 || side[3] <= 0) && (side[2] >= 0 || side[3] >= 0);
}

static void random_loops_fit(void) {
    enum { CORNERS = 9 };
    uint32_t fitting = 0;
    for (int round = 0; round < 20000; round++) {
        lathe_point points[2 * CORNERS];
        lathe_loop loops[2] = {{.first = 0, .count = CORNERS}, {.first = CORNERS, .count = CORNERS}};
        lathe_outline outline = {.point_count = 2 * CORNERS, .loop_count = 2, .points = points, .loops = loops};
        for (int l = 0; l < 2; l++) {   /* stars; corners on a coarse lattice, so that touching is not rare */
            double x = (double)(next_random() % 60), y = (double)(next_random() % 60), most = 4 + (double)(next_random() % 30);
            for (int i = 0; i < CORNERS; i++) {
                double angle = 6.283185307179586 * i / CORNERS, r = most * (0.5 + (next_random() % 64) / 128.0);
                points[l * CORNERS + i] = (lathe_point){(int32_t)lround(x + r * cos(angle)), (int32_t)lround(y + r * sin(angle))};
            }
        }
        bool cross = false;
        for (int i = 0; i < CORNERS; i++)
            for (int k = 0; k < CORNERS; k++)
                cross |= edges_cross(points[i], points[(i + 1) % CORNERS], points[CORNERS + k], points[CORNERS + (k + 1) % CORNERS]);
        bool fit = lathe__loops_fit(&outline);
        if (cross && !CHECK(!fit)) return;
        fitting += fit;
    }
    CHECK(fitting > 2000 && fitting < 18000);
}

/* What is too many tubes is told without fitting any. */
static void too_many(void) {
    int32_t dims[3] = {64, 8, 3}, origin[3] = {0, 0, 0};
    lathe_mask mask;
    lathe_traced_tubes traced;
    for (int loops = LATHE_TUBES_MOST; loops <= LATHE_TUBES_MOST + 1; loops++) {
        if (lathe__mask_new(&mask, dims, origin)) abort();
        for (int32_t w = 0; w < 3; w++)
            for (int32_t i = 0; i < loops; i++)
                for (int32_t k = 0; k < 9; k++) set_pixel(&mask, 2 + 6 * i + k % 3, 2 + k / 3, w);
        CHECK_EQ(lathe__radius_trace(&traced, &arena, &mask, 32), loops > LATHE_TUBES_MOST ? LATHE_ERR_EMPTY : LATHE_OK);
        lathe__mask_free(&mask);
    }
    lathe__arena_reset(&arena);
}

/* Numbers that no encoder would send: the head's are small, so that many get through; then any. */
static int32_t wild(void *coder, lathe_number_model *model, int32_t number) {
    int *count = coder;
    (void)model, (void)number;
    if (!(*count)++) return 5 + (int32_t)(next_random() % 3);   /* tubes; tubes with more in the head; plain ones */
    if (*count < 40) return next_random() % 4 ? 0 : (int32_t)(next_random() % 6) - 1;
    return next_random() % 3 ? 0 : next_random() % 20 ? (int32_t)(next_random() % 41) - 20 : (int32_t)(next_random() % (1 << 20)) - (1 << 19);
}

/* They end, and their surfaces, however their polygons lie, have no open edge. */
static void hostile_tubes(void) {
    lathe_arena own = {0}, mesh_arena[2] = {{0}};
    int made = 0;
    for (int i = 0; i < 60; i++) {
        lathe_radii radii = {.slices = 1 + (int32_t)(next_random() % 30), .width = 3 + (int32_t)(next_random() % 60), .height = 3 + (int32_t)(next_random() % 60),
                             .level_count = 2 + next_random() % 4};
        lathe_status status = LATHE_OK;
        int count = 0;
        for (uint32_t level = 0; !status && level < radii.level_count; level++) {
            lathe_surface_counts counts = {0};
            lathe_mesh mesh = {0};
            lathe_mesh_report r;
            uint32_t shown;
            status = lathe__radii_code(&radii, NULL, &own, level, wild, &count);
            if (status) break;
            made++;
            if (!CHECK(!lathe__radii_mesh(&mesh, mesh_arena, &radii, level, &counts, &shown))) continue;
            if (mesh.triangle_count) CHECK(!lathe__mesh_check(&r, &mesh, false) && !r.boundary_edges && !r.bad_indices);
            lathe_mesh_free(&mesh);
        }
        CHECK(!status || status == LATHE_ERR_FORMAT);
        lathe__arena_reset(&own);
    }
    CHECK(made > 20);
    lathe__arena_free(&own);
    for (int i = 0; i < 2; i++) lathe__arena_free(&mesh_arena[i]);
}

static void hostile(void) {
    for (int i = 0; i < 3000; i++) {
        uint8_t bytes[200];
        size_t size = next_random() % sizeof bytes;
        for (size_t k = 0; k < size; k++) bytes[k] = (uint8_t)(next_random() % 3 ? next_random() : 255);
        lathe_radius_map map = {.slices = 1 + (int32_t)(next_random() % 40), .level_count = 2 + next_random() % 4,
                                .rays = 8u << next_random() % 8, .step = 1 + (int32_t)(next_random() % 100000), .fall = 6, .apex = {1, 7},
                                .farthest = 1 << 19};
        if (lathe__radius_map_start(&map, &arena)) abort();
        lathe_range_decoder d;
        lathe__decoder_start(&d, bytes, size);
        lathe_status status = LATHE_OK;
        for (uint32_t level = 0; !status && level < map.level_count; level++) {
            status = lathe__radius_walk(&map, level, &(lathe_number_coder){get, &d, NULL});
            lathe_mesh mesh;
            if (!status && CHECK(!lathe__radius_mesh(&mesh, &map, level))) lathe_mesh_free(&mesh);
        }
        CHECK(!status || status == LATHE_ERR_FORMAT);
        lathe__arena_reset(&arena);
    }
    lathe_radius_map large = {.slices = 4098, .level_count = 6, .rays = 8192};
    CHECK_EQ(lathe__radius_map_start(&large, &arena), LATHE_ERR_LIMIT);
}

int main(void) {
    follows();
    tubes();
    forks();
    ahead_and_early();
    early_rows_are_near();
    too_many();
    loops_fit();
    random_loops_fit();
    hostile_tubes();
    hostile();
    lathe__arena_free(&arena);
    lathe__arena_free(&scratch);
    return check_end();
}
