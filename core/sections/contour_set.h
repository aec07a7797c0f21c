/* Contour sets: sections, their polygons, their points [P 2], brought to the lattice; from numbers in mm or from a
 * mask. */
#ifndef LATHE_CONTOUR_SET_H
#define LATHE_CONTOUR_SET_H
#include "mask.h"
#include "sections.h"

enum {
    LATHE_SET_SECTIONS = 4096,         /* most sections of a set */
    LATHE_SET_POLYGONS = 4096,         /* most polygons of a section */
    LATHE_SET_SECTION_POINTS = 16384,  /* most points of a section */
    LATHE_SET_POINTS = 1 << 20,        /* most points of a set */
    LATHE_SET_QUANTA = 1 << 20,        /* the longest side of the set's box is so many quanta */
    LATHE_SET_QUANTUM = 64             /* lattice units: positions of a set that is read are multiples of this */
};

/* A set as it was given, in mm. Arrays are the caller's. */
/* Points, in either direction, not closed twice. */
typedef struct lathe_raw_polygon { uint32_t first, count; } lathe_raw_polygon;
typedef struct lathe_raw_section {
    double z;
    uint32_t first, count;             /* polygons */
} lathe_raw_section;
typedef struct lathe_raw_set {
    const double (*points)[2];
    const lathe_raw_polygon *polygons;
    const lathe_raw_section *sections; /* any order */
    uint32_t point_count, polygon_count, section_count;
} lathe_raw_set;

/* What was mended on the way. */
typedef struct lathe_set_repairs {
    uint32_t repeated_points;          /* equal to their neighbour once they are on the lattice: dropped */
    uint32_t spikes;                   /* points at which a polygon turns straight back: dropped */
    uint32_t turned_polygons;          /* given in the other direction than nesting asks for */
} lathe_set_repairs;

/* Brings a set to the lattice, sorts sections by height, finds outer loops and holes by parity of nesting and
 * directs them (outer: counter-clockwise). Positions are rounded to 1/2^20 of the longest side of the box of all
 * points and heights, so that every orientation is exact in overlay.c; out->transform leads back to mm. Sections may
 * have no polygon.
 * Errors (err says which section and polygon, counted from 0 as given): RANGE: a number that is not finite or beyond
 * 1e9 mm; FORMAT: no section, no polygon at all, two sections at one height, a polygon with fewer than three points
 * or without area after repairs, polygons that touch or cross each other or themselves; LIMIT: the limits above;
 * MEMORY. Hostile input is safe: at most 2^29 pairs of edges are tried. *out is untouched on failure; free it with
 * lathe__contour_set_free. */
lathe_status lathe__contour_set_build(lathe_contour_set *out, lathe_set_repairs *repairs, const lathe_raw_set *raw,
                                      lathe_error *err);

/* The outlines of a mask's slices. fraction: where vertices lie on border edges, 0..64 (LATHE_FRACTION_ONE / 2: the
 * middle). transform: of the mask's lattice. MEMORY, LIMIT. */
lathe_status lathe__contour_set_of_mask(lathe_contour_set *out, const lathe_mask *mask,
                                        const lathe_transform *transform, int fraction);
void lathe__contour_set_free(lathe_contour_set *set);

/* Fewer points: every section's outline replaced by one whose edges are within tolerance mm of it, by the hierarchy
 * that never intersects [H]. Loops stay simple and nested. LIMIT, RANGE, FORMAT as lathe__simplify_section; MEMORY. */
lathe_status lathe__contour_set_simplify(lathe_contour_set *set, double tolerance_mm);
/* The same with pixel staircases turned into polygons by the strip whose lines turn apart [L]: chords within
 * tolerance. */
lathe_status lathe__contour_set_strip(lathe_contour_set *set, double tolerance_mm);

/* The first pair of edges of an outline that meet beyond a common vertex; edges are numbered by the vertices they
 * begin in. *found: whether there is one. tests: how many pairs may still be tried; LIMIT when they run out. MEMORY. */
lathe_status lathe__find_meeting_edges(bool *found, uint32_t edge[2], lathe_arena *arena, const lathe_outline *outline,
                                       uint64_t *tests);
/* Does a loop hold a point (even-odd)? Exact but for points on the loop. */
bool lathe__loop_holds(const lathe_outline *outline, uint32_t loop, lathe_point p);
/* Twice the area that a loop encloses, positive if it is counter-clockwise. */
double lathe__loop_area2(const lathe_outline *outline, uint32_t loop);
#endif
