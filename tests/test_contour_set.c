/* Contour sets: nesting, direction, repairs, complaints that name section and polygon, the lattice's fineness, hostile JSON. */
#include "contour_set.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include "check.h"
#include "contour_json.h"

static lathe_contour_set set;
static lathe_set_repairs repairs;
static lathe_error err;

static lathe_status parse(const char *json) {
    lathe__contour_set_free(&set);
    memset(&repairs, 0, sizeof repairs);
    err.text[0] = 0;
    return lathe__contour_json_parse(&set, &repairs, json, strlen(json), &err);
}

static int fails(const char *json, lathe_status want, const char *says) {
    lathe_status status = parse(json);
    int ok = CHECK_EQ(status, want) & CHECK(strstr(err.text, says) != NULL);
    if (!ok) fprintf(stderr, "  %s: \"%s\"\n", json, err.text);
    return ok;
}

static double mm(uint32_t s, uint32_t i, int axis) {
    const lathe_point *p = &set.sections[s].outline.points[i];
    double at[3] = {p->x, p->y, set.sections[s].height};
    return set.transform.m[axis][axis] * at[axis] + set.transform.m[axis][3];
}

static void nesting(void) {
    /* An island in a hole in a square, each in some direction; sections out of order; the second by points of three coordinates. */
    if (!CHECK(parse("{\"unit\": \"cm\", \"sections\": ["
                     "{\"polygons\": [[[0,0,3],[1,0,3],[0,1,3]]]},"
                     "{\"z\": -2, \"polygons\": ["
                     "[[2,2],[8,2],[8,8],[2,8]], [[0,0],[0,10],[10,10],[10,0]], [[4,4],[4,6],[6,6],[6,4]]]}]}") == LATHE_OK)) {
        fprintf(stderr, "  %s\n", err.text);
        return;
    }
    CHECK_EQ(set.count, 2);
    const lathe_outline *o = &set.sections[0].outline;
    CHECK_EQ(o->loop_count, 3);
    CHECK(o->loops[0].hole && !o->loops[1].hole && !o->loops[2].hole);
    CHECK(lathe__loop_area2(o, 0) < 0 && lathe__loop_area2(o, 1) > 0 && lathe__loop_area2(o, 2) > 0);
    CHECK_EQ(repairs.turned_polygons, 3);
    CHECK_EQ(repairs.repeated_points + repairs.spikes, 0);
    CHECK(fabs(mm(0, 0, 2) + 20) < 1e-3 && fabs(mm(1, 0, 2) - 30) < 1e-3);
    /* Longest side 100 mm: quanta of 100 / 2^20 mm. Every position is a multiple, and within half of one. */
    for (uint32_t i = 0; i < o->point_count; i++) CHECK_EQ(o->points[i].x % LATHE_SET_QUANTUM, 0);
    double quantum = set.transform.m[0][0] * LATHE_SET_QUANTUM;
    CHECK(fabs(quantum - 100.0 / (1 << 20)) < 1e-12);
    CHECK(fabs(mm(0, 8, 0) - 40) <= quantum / 2 + 1e-9 || fabs(mm(0, 8, 0) - 60) <= quantum / 2 + 1e-9);
    CHECK(lathe__loop_holds(o, 1, o->points[o->loops[0].first]) && !lathe__loop_holds(o, 2, o->points[o->loops[0].first]));
}

static void repaired(void) {
    CHECK(parse("{\"sections\": [{\"z\": 0, \"polygons\": [[[0,0],[0,0],[5,0],[10,0],[10,10],[10,14],[10,10],[0,10],[0,0]]]}]}") == LATHE_OK);
    CHECK_EQ(set.sections[0].outline.point_count, 5);   /* [5, 0] lies on a straight edge: it may stay */
    CHECK_EQ(repairs.spikes, 1);
    CHECK_EQ(repairs.repeated_points, 3);
    /* A spike whose root is the first point. */
    CHECK(parse("{\"sections\": [{\"z\": 0, \"polygons\": [[[0,0],[9,0],[9,9],[0,9],[0,-4]]]}]}") == LATHE_OK);
    CHECK_EQ(repairs.spikes, 1);
    CHECK(parse("{\"sections\": [{\"z\": 0, \"polygons\": [[[0,-4],[0,0],[9,0],[9,9],[0,9]]]}]}") == LATHE_OK);
    CHECK_EQ(repairs.spikes, 1);
    /* A section without polygons is air. */
    CHECK(parse("{\"sections\": [{\"z\": 0, \"polygons\": [[[0,0],[1,0],[0,1]]]}, {\"z\": 1, \"polygons\": []}]}") == LATHE_OK);
    CHECK_EQ(set.sections[1].outline.loop_count, 0);
}

static void complaints(void) {
    fails("", LATHE_ERR_FORMAT, "line");
    fails("[1, 2]", LATHE_ERR_FORMAT, "sections");
    fails("{\"sections\": 3}", LATHE_ERR_FORMAT, "sections");
    fails("{\"sections\": []}", LATHE_ERR_FORMAT, "no section");
    fails("{\"sections\": [{\"z\": 0, \"polygons\": []}]}", LATHE_ERR_FORMAT, "no polygon");
    fails("{\"sections\": [{\"z\": \"0\", \"polygons\": []}]}", LATHE_ERR_FORMAT, "section 0: \"z\"");
    fails("{\"sections\": [{\"z\": 0}]}", LATHE_ERR_FORMAT, "polygons");
    fails("{\"sections\": [7]}", LATHE_ERR_FORMAT, "polygons");
    fails("{\"unit\": \"inch\", \"sections\": []}", LATHE_ERR_UNSUPPORTED, "unit");
    fails("{\"unit\": 3, \"sections\": []}", LATHE_ERR_UNSUPPORTED, "unit");
    fails("{\"sections\": [{\"polygons\": [[[0,0],[1,0],[0,1]]]}]}", LATHE_ERR_FORMAT, "no \"z\"");
    fails("{\"sections\": [{\"z\": 1, \"polygons\": [[[0,0,1],[1,0,1],[0,1,2]]]}]}", LATHE_ERR_FORMAT, "section 0, polygon 0, point 2");
    fails("{\"sections\": [{\"z\": 1, \"polygons\": [[[0,0],[1,0]]]}]}", LATHE_ERR_FORMAT, "fewer than 3");
    fails("{\"sections\": [{\"z\": 1, \"polygons\": [[[0,0],[1,0],[2]]]}]}", LATHE_ERR_FORMAT, "point 2");
    fails("{\"sections\": [{\"z\": 1, \"polygons\": [[[0,0],[1,0],[2,\"x\"]]]}]}", LATHE_ERR_FORMAT, "not a number");
    fails("{\"sections\": [{\"z\": 1, \"polygons\": [5]}]}", LATHE_ERR_FORMAT, "polygon 0");
    fails("{\"sections\": [{\"z\": 1, \"polygons\": [[[0,0],[1,0],[1e300,1]]]}]}", LATHE_ERR_RANGE, "point 2");
    fails("{\"sections\": [{\"z\": 1e12, \"polygons\": [[[0,0],[1,0],[0,1]]]}]}", LATHE_ERR_RANGE, "section 0");
    fails("{\"sections\": [{\"z\": 1, \"polygons\": [[[0,0],[1,0],[2,0],[3,0]]]}]}", LATHE_ERR_FORMAT, "no area");
    fails("{\"sections\": [{\"z\": 1, \"polygons\": [[[5,5],[5,5],[5,5]]]}]}", LATHE_ERR_FORMAT, "all points are one");
    fails("{\"sections\": [{\"z\": 1, \"polygons\": [[[0,0],[9,9],[9,0],[0,9]]]}]}", LATHE_ERR_FORMAT, "polygon 0: it touches or crosses itself");
    const char *square = "[[0,0],[9,0],[9,9],[0,9]]";
    char json[1000];
    static const char *const bad[] = {"[[4,4],[14,4],[14,5]]", "[[9,3],[12,2],[12,5]]", "[[0,0],[9,0],[9,9],[0,9]]", "[[0,0],[-3,0],[-3,-3]]",
                                      "[[2,9],[4,9],[3,12]]"};
    for (size_t i = 0; i < sizeof bad / sizeof *bad; i++) {   /* crossing, a corner on an edge, equal, a common corner, an edge on an edge */
        snprintf(json, sizeof json, "{\"sections\": [{\"z\": 0, \"polygons\": [[[20,20],[21,20],[20,21]], %s, %s]}]}", square, bad[i]);
        fails(json, LATHE_ERR_FORMAT, "section 0: polygons 1 and 2");
    }
    snprintf(json, sizeof json, "{\"sections\": [{\"z\": 4, \"polygons\": [%s]}, {\"z\": 1, \"polygons\": []}, {\"z\": 4, \"polygons\": [%s]}]}", square,
             square);
    fails(json, LATHE_ERR_FORMAT, "sections 0 and 2 are at one height");
    CHECK(lathe__contour_json_open(&set, NULL, "/nonexistent/set.json", &err) == LATHE_ERR_IO);
    CHECK(!lathe__is_contour_json("/nonexistent/set.json"));
}

/* Every prefix, and every byte changed: an error or a set, never a crash. */
static void hostile(void) {
    static const char json[] = "{\"unit\":\"mm\",\"sections\":[{\"z\":0,\"polygons\":[[[0,0],[9,0],[9,9],[0,9]],[[2,2],[4,2],[3,5]]]},"
                               "{\"z\":2.5,\"polygons\":[[[1,1,2.5],[8,1,2.5],[8,8,2.5]]]}]}";
    CHECK(parse(json) == LATHE_OK);
    lathe__contour_set_free(&set);
    uint32_t good = 0;
    for (size_t n = 0; n < sizeof json - 1; n++) CHECK(lathe__contour_json_parse(&set, NULL, json, n, &err) != LATHE_OK);
    for (size_t n = 0; n < sizeof json - 1; n++)
        for (const char *c = "0-9]}[,\"e."; *c; c++) {
            char copy[sizeof json];
            memcpy(copy, json, sizeof json);
            copy[n] = *c;
            good += lathe__contour_json_parse(&set, NULL, copy, sizeof json - 1, &err) == LATHE_OK;
            lathe__contour_set_free(&set);
        }
    CHECK(good > 20);
    /* Too many points of one section: a limit, before anything is tried. */
    size_t points = LATHE_SET_SECTION_POINTS + 1, used;
    char *text = malloc(points * 24 + 100);
    used = (size_t)sprintf(text, "{\"sections\":[{\"z\":0,\"polygons\":[[");
    for (size_t i = 0; i < points; i++) used += (size_t)sprintf(text + used, "%s[%zu,%d]", i ? "," : "", i, (int)(i * i % 977));
    used += (size_t)sprintf(text + used, "]]}]}");
    CHECK(lathe__contour_json_parse(&set, NULL, text, used, &err) == LATHE_ERR_LIMIT);
    /* As many as allowed, all in one corner of a wide box: ends soon, whatever it says. */
    used = (size_t)sprintf(text, "{\"sections\":[{\"z\":0,\"polygons\":[[[1e6,1e6],[1e6,0],");
    for (size_t i = 0; i + 2 < LATHE_SET_SECTION_POINTS; i++)
        used += (size_t)sprintf(text + used, "%s[%zu,%d]", i ? "," : "", i % 500, (int)(i * 7919 % 499));
    used += (size_t)sprintf(text + used, "]]}]}");
    CHECK(lathe__contour_json_parse(&set, NULL, text, used, &err) != LATHE_OK);
    free(text);
}

static void of_mask(void) {
    lathe_mask m;
    int32_t size[3] = {6, 6, 2}, origin[3] = {0, 0, 0};
    if (lathe__mask_new(&m, size, origin)) abort();
    for (int w = 0; w < 2; w++)
        for (int v = 1; v < 5; v++) lathe__mask_slice(&m, w)[v * m.row_words] = w && v > 1 && v < 4 ? 0x12 : 0x1e;   /* a hole in the second */
    static const lathe_transform unit = {.m = {{1, 0, 0, 0}, {0, 1, 0, 0}, {0, 0, 1, 0}}};
    lathe__contour_set_free(&set);
    CHECK(lathe__contour_set_of_mask(&set, &m, &unit, 32) == LATHE_OK);
    CHECK_EQ(set.count, 2);
    CHECK_EQ(set.sections[0].outline.loop_count, 1);
    CHECK_EQ(set.sections[1].outline.loop_count, 2);
    CHECK_EQ(set.sections[1].height, LATHE_LATTICE_ONE);
    lathe__mask_free(&m);
}

int main(void) {
    nesting();
    repaired();
    complaints();
    hostile();
    of_mask();
    lathe__contour_set_free(&set);
    return check_end();
}
