/* Rays that turn with the shape [M 6.1]: the paper's twisted X column (figures 18 and 19) with and without it,
 * measured against the column's ideal edge lines; what auto finds on it and on bodies that do not turn. */
#include "check.h"
#include "pixel_shapes.h"
#include "tube_surface.h"
#include "twist.h"
#include <math.h>

enum { SLICES = 24, VOXEL = 65536, CORNERS = 12, FINE = 12 };
static const double PI = 3.141592653589793;
static const double LENGTH = 20, PITCH = 2; /* voxels: from the axis to an arm's end; from slice to slice */

/* ---- the column ---- */

static lathe_point points[SLICES][4096];
static lathe_section sections[SLICES];
static lathe_loop section_loops[SLICES];

static void set_section(int k, uint32_t count) {
    section_loops[k] = (lathe_loop){.first = 0, .count = count};
    sections[k] =
        (lathe_section){k * (int32_t)(PITCH * VOXEL),
                        {.point_count = count, .loop_count = 1, .points = points[k], .loops = &section_loops[k]}};
}
/* Corner i of the X, arms `width` wide to either side of the diagonals, turned by `degrees`. */
static void corner(double out[2], int i, double width, double degrees) {
    double axis = PI / 4 + (i / 3) * PI / 2 + degrees * PI / 180, u = i % 3 == 2 ? width : LENGTH,
           v = i % 3 == 0 ? -width : width;
    out[0] = u * cos(axis) - v * sin(axis);
    out[1] = u * sin(axis) + v * cos(axis);
}
static void make_column(double width, double degrees) {
    for (int k = 0; k < SLICES; k++) {
        for (int i = 0; i < CORNERS; i++) {
            double p[2];
            corner(p, i, width, degrees * k);
            points[k][i] = (lathe_point){(int32_t)lround(p[0] * VOXEL), (int32_t)lround(p[1] * VOXEL)};
        }
        set_section(k, CORNERS);
    }
}

/* ---- distances ---- */

typedef struct vec {
    double x, y, z;
} vec;
static vec sub(vec a, vec b) { return (vec){a.x - b.x, a.y - b.y, a.z - b.z}; }
static double dot(vec a, vec b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
static vec cross(vec a, vec b) { return (vec){a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x}; }
static double to_segment(vec p, vec a, vec b) {
    vec ab = sub(b, a), ap = sub(p, a);
    double t = dot(ab, ab) > 0 ? dot(ap, ab) / dot(ab, ab) : 0;
    t = t < 0 ? 0 : t > 1 ? 1 : t;
    vec d = {ap.x - t * ab.x, ap.y - t * ab.y, ap.z - t * ab.z};
    return sqrt(dot(d, d));
}
static vec ideal(int line, double width, double degrees, double at) {
    double p[2];
    corner(p, line, width, degrees * at);
    return (vec){p[0], p[1], at * PITCH};
}

typedef struct edge {
    uint32_t a, b;
    vec normal;
    bool sharp, twice;
} edge;
static vec position(const lathe_mesh *m, uint32_t v) {
    return (vec){m->lattice[v][0] / (double)VOXEL, m->lattice[v][1] / (double)VOXEL, m->lattice[v][2] / (double)VOXEL};
}
/* Edges of the strips (fans left out), with whether their triangles meet at more than 40 degrees. */
static uint32_t find_edges(edge *edges, const lathe_mesh *m) {
    uint32_t count = 0;
    static uint32_t first[1 << 14];
    static uint32_t link[1 << 16];
    memset(first, 0xff, sizeof first);
    for (uint32_t t = 0; t < m->triangle_count; t++) {
        const uint32_t *c = m->triangles[t];
        vec p = position(m, c[0]), n = cross(sub(position(m, c[1]), p), sub(position(m, c[2]), p));
        double length = sqrt(dot(n, n));
        if (fabs(n.z) > 0.99 * length) continue;
        n = (vec){n.x / length, n.y / length, n.z / length};
        for (int k = 0; k < 3; k++) {
            uint32_t a = c[k] < c[(k + 1) % 3] ? c[k] : c[(k + 1) % 3], b = c[k] + c[(k + 1) % 3] - a, e = first[a];
            while (e != UINT32_MAX && edges[e].b != b) e = link[e];
            if (e == UINT32_MAX) {
                edges[count] = (edge){a, b, n, false, false};
                link[count] = first[a];
                first[a] = count++;
                continue;
            }
            edges[e].sharp = dot(edges[e].normal, n) < cos(40 * PI / 180);
            edges[e].twice = true;
        }
    }
    return count;
}
typedef struct spread {
    double mean, most;
    uint32_t samples;
} spread;
static void add_sample(spread *s, double d) {
    s->mean += d;
    if (d > s->most) s->most = d;
    s->samples++;
}
/* From the ideal lines to the mesh's edges, and from its sharp edges to the ideal lines. */
static void measure(spread out[2], const lathe_mesh *m, double width, double degrees) {
    static edge edges[1 << 16];
    uint32_t count = find_edges(edges, m);
    memset(out, 0, 2 * sizeof *out);
    for (int line = 0; line < CORNERS; line++)
        for (int i = 0; i <= 4 * (SLICES - 1); i++) {
            vec p = ideal(line, width, degrees, i / 4.0);
            double least = 1e9;
            for (uint32_t e = 0; e < count; e++)
                least = fmin(least, to_segment(p, position(m, edges[e].a), position(m, edges[e].b)));
            add_sample(&out[0], least);
        }
    for (uint32_t e = 0; e < count; e++) {
        if (!edges[e].sharp || !edges[e].twice) continue;
        vec a = position(m, edges[e].a), b = position(m, edges[e].b);
        for (int i = 0; i <= 4; i++) {
            vec p = {a.x + (b.x - a.x) * i / 4, a.y + (b.y - a.y) * i / 4, a.z + (b.z - a.z) * i / 4};
            double least = 1e9, at = p.z / PITCH;
            for (int line = 0; line < CORNERS; line++)
                for (int k = -FINE; k < FINE; k++)
                    least = fmin(least, to_segment(p, ideal(line, width, degrees, at + k / (double)FINE),
                                                   ideal(line, width, degrees, at + (k + 1) / (double)FINE)));
            add_sample(&out[1], least);
        }
    }
    for (int k = 0; k < 2; k++)
        if (out[k].samples) out[k].mean /= out[k].samples;
}
static bool tile_column(spread out[2], const uint32_t turn[SLICES], uint32_t rays, double width, double degrees) {
    lathe_tube_loop loops[SLICES];
    lathe_tube_surface *tube = NULL;
    lathe_mesh mesh = {0};
    for (int k = 0; k < SLICES; k++)
        loops[k] = (lathe_tube_loop){points[k], sections[k].outline.point_count, {0, 0}, sections[k].height, turn[k]};
    if (!CHECK(lathe__tube_open(&tube, loops, SLICES, rays) == LATHE_OK)) return false;
    bool ok = CHECK(lathe__tube_mesh(&mesh, tube) == LATHE_OK);
    if (ok) measure(out, &mesh, width, degrees);
    lathe_mesh_free(&mesh);
    lathe__tube_close(&tube);
    return ok;
}

/* ---- tests ---- */

static void test_column(double width, double degrees, bool aligned) {
    make_column(width, degrees);
    uint32_t turned[SLICES], straight[SLICES], fixed[SLICES];
    double found[SLICES];
    lathe_twist twist;
    CHECK(lathe__parse_twist(&twist, "auto", NULL) == LATHE_OK);
    CHECK(lathe__choose_turns(turned, found, sections, SLICES, &twist) == LATHE_OK);
    for (int k = 1; k < SLICES; k++) CHECK(fabs(found[k] - degrees) < 0.1);
    twist = (lathe_twist){LATHE_TWIST_FIXED, degrees};
    CHECK(lathe__choose_turns(fixed, NULL, sections, SLICES, &twist) == LATHE_OK);
    for (int k = 0; k < SLICES; k++)
        CHECK(((turned[k] - fixed[k] + 100) & 65535) < 200); /* 0.55 degrees, summed up over all slices */
    twist = (lathe_twist){LATHE_TWIST_NONE, 0};
    CHECK(lathe__choose_turns(straight, NULL, sections, SLICES, &twist) == LATHE_OK);
    for (int k = 0; k < SLICES; k++) CHECK_EQ(straight[k], 0);
    for (uint32_t rays = 16; rays <= 64; rays *= 2) {
        spread with[2], without[2];
        if (!tile_column(with, turned, rays, width, degrees) || !tile_column(without, straight, rays, width, degrees))
            return;
        printf("| %.2f | %.0f | %u | %.3f / %.3f | %.3f / %.3f | %.3f / %.3f | %.3f / %.3f |\n", width, degrees, rays,
               with[0].mean, with[0].most, without[0].mean, without[0].most, with[1].mean, with[1].most,
               without[1].mean, without[1].most);
        CHECK(with[1].samples > 0);
        /* With few rays that miss the corners, corners are cut either way. */
        if (!aligned && rays < 64) continue;
        CHECK(with[0].mean < 0.5 * without[0].mean);
        CHECK(with[1].mean < 0.5 * without[1].mean);
        if (!aligned) continue;
        /* A chord of the helix: LENGTH / cos(22.5 degrees) * (1 - cos(degrees / 2)) at the farthest corner. */
        double sagitta = LENGTH / cos(PI / 8) * (1 - cos(degrees / 2 * PI / 180));
        CHECK(with[0].most < sagitta + 0.1);
        CHECK(with[1].most < sagitta + 0.1);
        CHECK(with[0].mean < 0.25 * without[0].mean);
    }
}

/* The column as pixels, its outlines as the tracer has them. */
static void test_pixels(double width, double degrees) {
    enum { SIZE = 64 };
    static uint8_t inside[SIZE][SIZE];
    static const int dx[4] = {1, 0, -1, 0}, dy[4] = {0, 1, 0, -1};
    for (int k = 0; k < SLICES; k++) {
        double c = cos(PI / 4 + degrees * k * PI / 180), s = sin(PI / 4 + degrees * k * PI / 180);
        int x = -1, y = 0, d = 3, count = 0;
        for (int j = 0; j < SIZE; j++)
            for (int i = 0; i < SIZE; i++) {
                double px = i - 31.7, py = j - 31.4, u = fabs(px * c + py * s), v = fabs(py * c - px * s);
                inside[j][i] = (u < LENGTH && v < width) || (v < LENGTH && u < width);
                if (inside[j][i] && x < 0) x = i, y = j;
            }
        int x0 = x, y0 = y;
        do {
            points[k][count++] = (lathe_point){x * VOXEL + dx[d] * VOXEL / 2, y * VOXEL + dy[d] * VOXEL / 2};
            int along = (d + 1) & 3, ax = x + dx[along], ay = y + dy[along];
            if (!inside[ay][ax])
                d = along;
            else if (!inside[ay + dy[d]][ax + dx[d]])
                x = ax, y = ay;
            else
                x = ax + dx[d], y = ay + dy[d], d = (d + 3) & 3;
        } while (x != x0 || y != y0 || d != 3);
        set_section(k, (uint32_t)count);
    }
    uint32_t turn[SLICES];
    double found[SLICES], worst = 0, mean = 0;
    const lathe_twist twist = {LATHE_TWIST_AUTO, 0};
    CHECK(lathe__choose_turns(turn, found, sections, SLICES, &twist) == LATHE_OK);
    for (int k = 1; k < SLICES; k++) worst = fmax(worst, fabs(found[k] - degrees)), mean += found[k] / (SLICES - 1);
    printf("pixels, arms %.1f wide, %.1f degrees a slice: auto finds %.3f on average, at worst %.2f off\n", 2 * width,
           degrees, mean, worst);
    CHECK(worst < 1);
    CHECK(fabs(mean - degrees) < 0.1);
}

/* Bodies that do not turn: smooth blobs that change, drift and grow; random ones with nothing in common; round ones. */
static void test_untwisted(void) {
    uint64_t seed = 5;
    double worst = 0;
    const lathe_twist twist = {LATHE_TWIST_AUTO, 0};
    for (int round = 0; round < 60; round++) {
        double amplitude[2][6], phase[2][6], found[SLICES];
        uint32_t turn[SLICES];
        for (int e = 0; e < 2; e++)
            for (int h = 0; h < 6; h++)
                amplitude[e][h] = shape_below(&seed, 100) * 0.03 / (h + 1),
                phase[e][h] = shape_below(&seed, 628) / 100.0;
        for (int k = 0; k < SLICES; k++) {
            double t = round % 3 == 0 ? k / (double)SLICES : 0, size = 1 + 0.02 * k;
            for (int i = 0; i < 200; i++) {
                double a = 2 * PI * i / 200, r = 10;
                for (int h = 0; h < 6; h++) {
                    r += (1 - t) * amplitude[0][h] * cos((h + 1) * a + phase[0][h]) +
                         t * amplitude[1][h] * cos((h + 1) * a + phase[1][h]);
                    if (round % 3 == 1)
                        r += 0.01 * shape_below(&seed, 20) *
                             cos((h + 1) * a + shape_below(&seed, 628) / 100.0 * (i == 0));
                }
                points[k][i] = (lathe_point){(int32_t)lround((size * r * cos(a) + 0.3 * k) * VOXEL),
                                             (int32_t)lround(size * r * sin(a) * VOXEL)};
            }
            if (round % 3 == 2) {
                static shape region;
                static shape_loop loop;
                shape_make(&region, &seed, 0);
                shape_trace(&loop, &region, &seed, 1);
                memcpy(points[k], loop.points, loop.count * sizeof *loop.points);
                set_section(k, loop.count);
            } else
                set_section(k, 200);
        }
        CHECK(lathe__choose_turns(turn, found, sections, SLICES, &twist) == LATHE_OK);
        for (int k = 0; k < SLICES; k++) worst = fmax(worst, fabs(found[k]));
    }
    printf("60 stacks of blobs that do not turn: auto turns by at most %.2f degrees a slice\n", worst);
    CHECK(worst < 1);
}
static void test_parse(void) {
    lathe_twist t = {LATHE_TWIST_AUTO, 7};
    lathe_error err = {{0}};
    static const char *const wrong[] = {"", "non", "auto ", "5x", "181", "-180.5", "nan", "inf", "1e999", "--3"};
    for (size_t i = 0; i < sizeof wrong / sizeof *wrong; i++) {
        err.text[0] = 0;
        CHECK_EQ(lathe__parse_twist(&t, wrong[i], &err), LATHE_ERR_FORMAT);
        CHECK(err.text[0] != 0);
    }
    CHECK(t.method == LATHE_TWIST_AUTO && t.degrees == 7);
    CHECK(lathe__parse_twist(&t, "none", &err) == LATHE_OK && t.method == LATHE_TWIST_NONE);
    CHECK(lathe__parse_twist(&t, "-3.5", &err) == LATHE_OK && t.method == LATHE_TWIST_FIXED && t.degrees == -3.5);
    CHECK(lathe__parse_twist(&t, "180", NULL) == LATHE_OK && t.degrees == 180);
}
static void test_sections(void) {
    lathe_arena arena = {0};
    uint32_t **turns, turn[3];
    const lathe_twist twist = {LATHE_TWIST_FIXED, -90};
    make_column(5, 0);
    lathe_section empty[3] = {sections[0], {.height = 1}, sections[1]};
    if (CHECK(lathe__turn_sections(&turns, &arena, empty, 3, &twist) == LATHE_OK))
        CHECK(turns[0][0] == 0 && turns[2][0] == 32768);
    CHECK(lathe__choose_turns(turn, NULL, empty, 3, &(lathe_twist){LATHE_TWIST_AUTO, 0}) == LATHE_OK);
    CHECK(!turn[0] && !turn[1] && !turn[2]);
    CHECK(lathe__choose_turns(turn, NULL, empty, 0, &twist) == LATHE_OK);
    CHECK(lathe__choose_turns(turn, NULL, empty, 1, &(lathe_twist){LATHE_TWIST_AUTO, 0}) == LATHE_OK);
    lathe__arena_free(&arena);
}

int main(void) {
    test_parse();
    test_sections();
    printf("Voxels, mean / most. Arms %.0f long, slices %.0f apart.\n", LENGTH, PITCH);
    printf("| half width | degrees a slice | rays | lines to edges, turned | not turned | sharp edges to lines, turned "
           "| not turned |\n"
           "| --- | --- | --- | --- | --- | --- | --- |\n");
    for (int degrees = 3; degrees <= 8; degrees += degrees == 3 ? 2 : 3)
        test_column(LENGTH * tan(PI / 8), degrees, true);
    test_column(LENGTH * 0.3, 5, false);
    test_pixels(6, 3);
    test_pixels(6, -5);
    test_pixels(8.3, 8);
    test_untwisted();
    return check_end();
}
