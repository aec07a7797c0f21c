/* Teaching pictures (see draw_contour.h). Lattice coordinates have y upwards, SVG downwards. */
#include "draw_contour.h"
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define NONE UINT32_MAX
enum { PANEL = 720, MARGIN = 40, HEAD = 64, SLOT = 31, LEVEL = 46, ROW_SLOTS = 36, ROW_GAP = 44, LEGEND = 150 };
static const char *const colour_names[4] = {"royalblue", "crimson", "seagreen", "darkorange"};
static const char *const class_names[4] = {"for", "back", "up", "down"};
static const char *const type_words[4] = {"FOR", "BACK", "UP", "DOWN"};

/* ---- text that grows ---- */
typedef struct text {
    char *bytes;
    size_t used, room;
    bool failed;
} text;

static void add(text *t, const char *format, ...) __attribute__((format(printf, 2, 3)));
static void add(text *t, const char *format, ...) {
    for (int attempt = 0; attempt < 2 && !t->failed; attempt++) {
        va_list list;
        va_start(list, format);
        int length = vsnprintf(t->bytes + t->used, t->room - t->used, format, list);
        va_end(list);
        if (length >= 0 && (size_t)length < t->room - t->used) {
            t->used += (size_t)length;
            return;
        }
        size_t room = 2 * t->room + (size_t)(length > 0 ? length : 0) + 4096;
        char *more = length < 0 ? NULL : realloc(t->bytes, room);
        t->failed = !more;
        if (more) t->bytes = more, t->room = room;
    }
}
static void add_escaped(text *t, const char *plain) {
    for (; *plain; plain++) {
        unsigned char c = (unsigned char)*plain;
        if (c == '<' || c == '>' || c == '&' || c == '"' || c < 0x20)
            add(t, "&#%d;", c < 0x20 ? '?' : c);
        else
            add(t, "%c", c);
    }
}

/* ---- the contour ---- */
typedef struct view {
    const lathe_drawing *drawing;
    double low[2], scale, size[2],
        reach; /* lattice units; pixels of the picture for one; of the panel; longest radius */
} view;

static double place_x(const view *v, double x) { return MARGIN + (x - v->low[0]) * v->scale; }
static double place_y(const view *v, double y) { return HEAD + v->size[1] - (y - v->low[1]) * v->scale; }

static void widen(double low[2], double high[2], double x, double y) {
    if (x < low[0]) low[0] = x;
    if (y < low[1]) low[1] = y;
    if (x > high[0]) high[0] = x;
    if (y > high[1]) high[1] = y;
}
/* The contour, its loop and its centre, not more: other loops of the slice may lie outside. */
static view make_view(const lathe_drawing *d) {
    const lathe_ray_contour *c = d->contour;
    view v = {.drawing = d};
    double low[2] = {c->centre.x, c->centre.y}, high[2] = {c->centre.x, c->centre.y};
    for (uint32_t i = 0; i < c->count; i++) {
        widen(low, high, c->points[i].x, c->points[i].y);
        if ((double)c->radius[i] > v.reach) v.reach = (double)c->radius[i];
    }
    for (uint32_t i = 0; d->outline && i < d->outline->loops[d->loop].count; i++) {
        lathe_point p = d->outline->points[d->outline->loops[d->loop].first + i];
        widen(low, high, p.x, p.y);
    }
    double room = 0.06 * v.reach + 1;
    for (int k = 0; k < 2; k++) low[k] -= room, high[k] += room;
    double width = high[0] - low[0], height = high[1] - low[1];
    v.scale = PANEL / (width > height ? width : height);
    for (int k = 0; k < 2; k++) v.low[k] = low[k], v.size[k] = (high[k] - low[k]) * v.scale;
    return v;
}

static void draw_region(text *t, const view *v) {
    const lathe_drawing *d = v->drawing;
    if (!d->pixels) return;
    add(t, "<path class=\"region\" fill=\"#e9e2d3\" d=\"");
    for (int32_t y = 0; y < d->height; y++)
        for (int32_t x = 0; x < d->width; x++) {
            int32_t first = x;
            while (x < d->width && lathe__slice_pixel(d->pixels, d->row_words, x, y)) x++;
            if (x == first) continue;
            double unit = LATHE_LATTICE_ONE * v->scale;
            add(t, "M%.2f %.2fh%.2fv%.2fh%.2fz", place_x(v, (first - 0.5) * LATHE_LATTICE_ONE),
                place_y(v, (y + 0.5) * LATHE_LATTICE_ONE), (x - first) * unit, unit, -(x - first) * unit);
        }
    add(t, "\"/>\n");
}
static void draw_loops(text *t, const view *v) {
    const lathe_outline *o = v->drawing->outline;
    for (uint32_t i = 0; o && i < o->loop_count; i++) {
        const lathe_loop *loop = &o->loops[i];
        add(t, "<path class=\"loop\" fill=\"none\" stroke=\"#a2967c\" stroke-width=\"0.8\" d=\"");
        for (uint32_t k = 0; k < loop->count; k++) {
            lathe_point p = o->points[loop->first + k];
            add(t, "%c%.2f %.2f", k ? 'L' : 'M', place_x(v, p.x), place_y(v, p.y));
        }
        add(t, "Z\"/>\n");
    }
}
static void draw_rays(text *t, const view *v) {
    const lathe_ray_contour *c = v->drawing->contour;
    double from[2] = {place_x(v, c->centre.x), place_y(v, c->centre.y)};
    for (uint32_t i = 0; i < c->rays; i++) {
        double d[2], farthest = 0;
        lathe__ray_vector(d, i, c->rays, c->turn);
        if (c->rays > 256) break;
        for (uint32_t k = 0; k < c->count; k++)
            if (c->crossings[k].ray == i && (double)c->radius[k] > farthest) farthest = (double)c->radius[k];
        double end = farthest + 0.03 * v->reach, x = place_x(v, c->centre.x + end * d[0]),
               y = place_y(v, c->centre.y + end * d[1]);
        add(t,
            "<line class=\"ray\" stroke=\"#8d8d8d\" stroke-width=\"0.7\" x1=\"%.2f\" y1=\"%.2f\" x2=\"%.2f\" "
            "y2=\"%.2f\"/>\n",
            from[0], from[1], x, y);
        if (c->rays <= 64)
            add(t, "<text class=\"small\" x=\"%.2f\" y=\"%.2f\">r<tspan dy=\"2\" font-size=\"7\">%u</tspan></text>\n",
                x + 9 * d[0], y - 9 * d[1] + 3, i);
    }
}

static int colour_of(uint8_t type) {
    return type == LATHE_FOR ? 0 : type == LATHE_BACK ? 1 : type == LATHE_UP_I || type == LATHE_UP_O ? 2 : 3;
}
/* Signs become smaller where crossings are many. */
static double sign_size(const view *v) {
    double free = v->size[0] * v->size[1] / (double)(v->drawing->contour->count + 1), size = 0.10 * sqrt(free);
    return size > 5 ? 5 : size < 1.2 ? 1.2 : size;
}
static void draw_edges(text *t, const view *v) {
    const lathe_ray_contour *c = v->drawing->contour;
    const lathe_derivation *tree = v->drawing->tree;
    double size = sign_size(v);
    for (uint32_t i = 0; i < c->count; i++) {
        uint32_t next = i + 1 < c->count ? i + 1 : 0, ray = c->crossings[i].ray;
        int colour = colour_of(c->types[i]);
        bool main_edge = c->types[i] == LATHE_FOR && (tree->start + tree->main_edge[ray]) % c->count == i;
        double d[2], shift = colour == 2 ? 0.35 * size : colour == 3 ? -0.35 * size : 0;
        /* UP and DOWN edges lie on the ray: drawn a little beside it, so that overlapping ones are told apart. */
        lathe__ray_vector(d, ray, c->rays, c->turn);
        double x = -d[1] * shift, y = -d[0] * shift;
        add(t,
            "<line class=\"%s\" stroke=\"%s\" stroke-width=\"%.2f\"%s x1=\"%.2f\" y1=\"%.2f\" x2=\"%.2f\" "
            "y2=\"%.2f\"/>\n",
            class_names[colour], colour_names[colour], (main_edge ? 0.95 : 0.55) * size,
            c->count <= 300 ? (const char *const[]){" marker-end=\"url(#for)\"", " marker-end=\"url(#back)\"",
                                                    " marker-end=\"url(#up)\"", " marker-end=\"url(#down)\""}[colour]
                            : "",
            place_x(v, c->points[i].x) + x, place_y(v, c->points[i].y) + y, place_x(v, c->points[next].x) + x,
            place_y(v, c->points[next].y) + y);
    }
}
static void draw_crossings(text *t, const view *v) {
    const lathe_ray_contour *c = v->drawing->contour;
    double size = sign_size(v);
    for (uint32_t i = 0; i < c->count; i++)
        add(t,
            "<circle class=\"%s\" cx=\"%.2f\" cy=\"%.2f\" r=\"%.2f\" fill=\"%s\" stroke=\"black\" "
            "stroke-width=\"%.2f\"/>\n",
            c->crossings[i].in_out ? "in-out" : "out-in", place_x(v, c->points[i].x), place_y(v, c->points[i].y),
            0.8 * size, c->crossings[i].in_out ? "black" : "white", 0.25 * size);
    double x = place_x(v, c->centre.x), y = place_y(v, c->centre.y);
    add(t, "<path class=\"centre\" stroke=\"black\" stroke-width=\"1.6\" d=\"M%.2f %.2fh12m-6 -6v12\"/>\n", x - 6, y);
}

/* ---- the tree ---- */
typedef struct layout {
    double *x;             /* per node, in slots */
    uint32_t *depth, *row; /* depth below the root; row of its level-1 node */
    double *row_y;         /* per row: where its level-1 nodes are */
    uint32_t rows;
    double slots, left, bottom;
} layout;

/* A leaf takes a slot; a node lies over the middle of its children. Level-1 nodes go on in a new row where one is
 * full. */
static bool place_nodes(layout *l, const lathe_derivation *t) {
    uint32_t n = t->node_count, row = 0, deepest = 1;
    l->x = calloc(n, sizeof *l->x);
    l->depth = calloc(n, sizeof *l->depth);
    l->row = calloc(n, sizeof *l->row);
    l->row_y = calloc((size_t)t->rays + 1, sizeof *l->row_y);
    if (!l->x || !l->depth || !l->row || !l->row_y) return false;
    double at = 0, y = HEAD + 50;
    l->row_y[0] = y;
    for (uint32_t i = 0; i < t->rays; i++) {
        uint32_t first = t->level1[i], end = i + 1 < t->rays ? t->level1[i + 1] : n, leaves = 0;
        for (uint32_t k = first; k < end; k++) leaves += t->nodes[k].symbol == LATHE_DER_LEAF;
        double wide = leaves ? leaves : 1;
        if (at > 0 && at + wide > ROW_SLOTS) {
            y += deepest * LEVEL + ROW_GAP;
            l->row_y[++row] = y;
            at = 0;
            deepest = 1;
        }
        double slot = at;
        for (uint32_t k = first; k < end; k++) {
            l->row[k] = row;
            if (k == first) l->depth[k] = 1;
            if (l->depth[k] > deepest) deepest = l->depth[k];
            if (t->nodes[k].symbol == LATHE_DER_LEAF) l->x[k] = slot++;
            for (uint32_t child = t->nodes[k].child; child != NONE; child = t->nodes[child].next)
                l->depth[child] = l->depth[k] + 1;
        }
        if (!leaves) l->x[first] = at;
        for (uint32_t k = end; k-- > first;) {
            uint32_t child = t->nodes[k].child, last = child;
            if (child == NONE) continue;
            while (t->nodes[last].next != NONE) last = t->nodes[last].next;
            l->x[k] = (l->x[child] + l->x[last]) / 2;
        }
        at += wide + 0.5;
        if (at > l->slots) l->slots = at;
    }
    l->rows = row + 1;
    l->bottom = y + deepest * LEVEL;
    return true;
}
static void free_layout(layout *l) {
    free(l->x);
    free(l->depth);
    free(l->row);
    free(l->row_y);
}
static double node_x(const layout *l, uint32_t node) { return l->left + 50 + l->x[node] * SLOT; }
static double node_y(const layout *l, uint32_t node) { return l->row_y[l->row[node]] + (l->depth[node] - 1.0) * LEVEL; }

static void draw_branches(text *t, const layout *l, const lathe_derivation *tree) {
    double spine = l->left + 12;
    add(t, "<path class=\"branch\" fill=\"none\" stroke=\"#777\" stroke-width=\"1\" d=\"M%.1f %dV%.1f", spine, HEAD + 6,
        l->row_y[l->rows - 1] - 24);
    for (uint32_t i = 0; i < tree->rays; i++) {
        uint32_t node = tree->level1[i];
        bool row_ends = i + 1 == tree->rays || l->row[tree->level1[i + 1]] != l->row[node];
        double x = node_x(l, node), y = node_y(l, node);
        if (row_ends) add(t, "M%.1f %.1fH%.1f", spine, y - 24, x);
        add(t, "M%.1f %.1fV%.1f", x, y - 24, y - 12);
    }
    for (uint32_t i = 1; i < tree->node_count; i++)
        for (uint32_t k = tree->nodes[i].child; k != NONE; k = tree->nodes[k].next)
            add(t, "M%.1f %.1fL%.1f %.1f", node_x(l, i), node_y(l, i), node_x(l, k), node_y(l, k));
    add(t, "\"/>\n");
}
/* "D_I" -> D with a small I below; c: of a leaf. */
static void draw_symbol(text *t, const char *name, double x, double y, const char *fill) {
    add(t, "<text x=\"%.1f\" y=\"%.1f\" fill=\"%s\">%c", x, y + 4, fill, name[0]);
    if (name[1] == '_') add(t, "<tspan dy=\"3\" font-size=\"8\">%s</tspan>", name + 2);
    add(t, "</text>\n");
}
static void draw_node(text *t, const layout *l, const lathe_derivation *tree, uint32_t i) {
    static const char *const leaf_names[] = {"f", "b", "u_i", "u_o", "d_i", "d_o"};
    const lathe_derivation_node *n = &tree->nodes[i];
    double x = node_x(l, i), y = node_y(l, i);
    if (n->symbol == LATHE_DER_LEAF) {
        add(t, "<circle class=\"leaf\" cx=\"%.1f\" cy=\"%.1f\" r=\"12\" fill=\"%s\"/>\n", x, y,
            colour_names[colour_of(n->edge)]);
        draw_symbol(t, leaf_names[n->edge], x, y, "white");
    } else if (n->symbol == LATHE_DER_F) {
        add(t,
            "<rect class=\"level-1\" x=\"%.1f\" y=\"%.1f\" width=\"24\" height=\"24\" fill=\"white\" stroke=\"%s\" "
            "stroke-width=\"2\"/>\n",
            x - 12, y - 12, colour_names[0]);
        draw_symbol(t, "F", x, y, "black");
    } else {
        add(t, "<path class=\"internal\" d=\"M%.1f %.1fl15 15l-15 15l-15 -15z\" fill=\"white\" stroke=\"black\"/>\n", x,
            y - 15);
        draw_symbol(t, lathe__derivation_symbol_name(n->symbol), x, y, "black");
    }
}
static void draw_tree(text *t, const layout *l, const lathe_derivation *tree) {
    draw_branches(t, l, tree);
    double x = l->left + 12;
    add(t,
        "<circle class=\"root\" cx=\"%.1f\" cy=\"%d\" r=\"14\" fill=\"white\" stroke=\"black\"/>\n"
        "<circle cx=\"%.1f\" cy=\"%d\" r=\"11\" fill=\"white\" stroke=\"black\"/>\n",
        x, HEAD + 6, x, HEAD + 6);
    draw_symbol(t, "S", x, HEAD + 6, "black");
    for (uint32_t i = 1; i < tree->node_count; i++) draw_node(t, l, tree, i);
    for (uint32_t i = 0; i < tree->rays; i++)
        add(t, "<text class=\"number\" x=\"%.1f\" y=\"%.1f\">%u</text>\n", node_x(l, tree->level1[i]) + 15,
            node_y(l, tree->level1[i]) - 3, i);
}

/* ---- what the signs mean ---- */
static void draw_legend(text *t, const lathe_drawing *d, double y) {
    uint32_t counts[4] = {0}, in_out = 0;
    for (uint32_t i = 0; i < d->contour->count; i++)
        counts[colour_of(d->contour->types[i])]++, in_out += d->contour->crossings[i].in_out;
    for (int k = 0; k < 4; k++) {
        double x = MARGIN + 130 * k;
        add(t,
            "<path stroke=\"%s\" stroke-width=\"4\" d=\"M%.1f %.1fh28\"/><text class=\"key\" x=\"%.1f\" y=\"%.1f\">%s: "
            "%u</text>\n",
            colour_names[k], x, y, x + 36, y + 4, type_words[k], counts[k]);
    }
    y += 30;
    add(t,
        "<circle cx=\"%d\" cy=\"%.1f\" r=\"5\" fill=\"black\"/><text class=\"key\" x=\"%d\" y=\"%.1f\">IN-OUT: "
        "%u</text>\n"
        "<circle cx=\"%d\" cy=\"%.1f\" r=\"5\" fill=\"white\" stroke=\"black\"/><text class=\"key\" x=\"%d\" "
        "y=\"%.1f\">OUT-IN: %u</text>\n"
        "<path stroke=\"black\" stroke-width=\"1.6\" d=\"M%d %.1fh12m-6 -6v12\"/><text class=\"key\" x=\"%d\" "
        "y=\"%.1f\">centre</text>\n"
        "<path stroke=\"%s\" stroke-width=\"5\" d=\"M%d %.1fh28\"/><text class=\"key\" x=\"%d\" y=\"%.1f\">level-1 "
        "edge</text>\n",
        MARGIN + 14, y, MARGIN + 36, y + 4, in_out, MARGIN + 144, y, MARGIN + 166, y + 4, d->contour->count - in_out,
        MARGIN + 268, y, MARGIN + 296, y + 4, colour_names[0], MARGIN + 390, y, MARGIN + 426, y + 4);
    y += 34;
    add(t,
        "<circle cx=\"%d\" cy=\"%.1f\" r=\"11\" fill=\"none\" stroke=\"black\"/><circle cx=\"%d\" cy=\"%.1f\" r=\"8\" "
        "fill=\"none\" "
        "stroke=\"black\"/><text class=\"key\" x=\"%d\" y=\"%.1f\">root</text>\n",
        MARGIN + 14, y, MARGIN + 14, y, MARGIN + 36, y + 4);
    add(t,
        "<rect x=\"%d\" y=\"%.1f\" width=\"20\" height=\"20\" fill=\"none\" stroke=\"%s\" stroke-width=\"2\"/>"
        "<text class=\"key\" x=\"%d\" y=\"%.1f\">level-1, its ray</text>\n",
        MARGIN + 134, y - 10, colour_names[0], MARGIN + 166, y + 4);
    add(t,
        "<path d=\"M%d %.1fl12 12l-12 12l-12 -12z\" fill=\"none\" stroke=\"black\"/><text class=\"key\" x=\"%d\" "
        "y=\"%.1f\">internal</text>\n",
        MARGIN + 290, y - 12, MARGIN + 310, y + 4);
    add(t,
        "<circle cx=\"%d\" cy=\"%.1f\" r=\"10\" fill=\"%s\"/><text class=\"key\" x=\"%d\" y=\"%.1f\">leaf: an "
        "edge</text>\n",
        MARGIN + 404, y, colour_names[3], MARGIN + 426, y + 4);
}

static void draw_all(text *t, const lathe_drawing *d, const view *v, layout *l) {
    double low = HEAD + v->size[1] + 40, wide = MARGIN + (v->size[0] > 560 ? v->size[0] : 560) + 60;
    l->left = wide;
    double height = (low + LEGEND > l->bottom ? low + LEGEND : l->bottom) + MARGIN,
           width = wide + 100 + l->slots * SLOT;
    add(t,
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"%.0f\" height=\"%.0f\" viewBox=\"0 0 %.0f %.0f\">\n<title>",
        width, height, width, height);
    add_escaped(t, d->title);
    add(t, "</title>\n<style>text{font:12px "
           "sans-serif;text-anchor:middle}.small,.number{font-size:10px;fill:#555}.number{text-anchor:start}.key{font-"
           "size:13px;"
           "text-anchor:start}.title{font-size:17px;text-anchor:start}</style>\n<defs>\n");
    for (int k = 0; k < 4; k++)
        add(t,
            "<marker id=\"%s\" viewBox=\"0 0 6 6\" refX=\"9\" refY=\"3\" markerWidth=\"3.4\" markerHeight=\"3.4\" "
            "orient=\"auto\">"
            "<path d=\"M0 0L6 3L0 6z\" fill=\"%s\"/></marker>\n",
            class_names[k], colour_names[k]);
    add(t, "<clipPath id=\"panel\"><rect x=\"%d\" y=\"%d\" width=\"%.1f\" height=\"%.1f\"/></clipPath>\n</defs>\n",
        MARGIN, HEAD, v->size[0], v->size[1]);
    add(t, "<rect width=\"100%%\" height=\"100%%\" fill=\"white\"/>\n<text class=\"title\" x=\"%d\" y=\"32\">", MARGIN);
    add_escaped(t, d->title);
    add(t, "</text>\n<g clip-path=\"url(#panel)\">\n");
    draw_region(t, v);
    draw_loops(t, v);
    add(t, "</g>\n");
    draw_rays(t, v);
    add(t, "<g stroke-linecap=\"round\">\n");
    draw_edges(t, v);
    add(t, "</g>\n");
    draw_crossings(t, v);
    draw_tree(t, l, d->tree);
    draw_legend(t, d, low);
    add(t, "</svg>\n");
}

lathe_status lathe__draw_contour(char **svg, size_t *size, const lathe_drawing *drawing) {
    if (drawing->contour->count > LATHE_DRAW_MAX_EDGES) return LATHE_ERR_LIMIT;
    text t = {0};
    layout l = {0};
    view v = make_view(drawing);
    if (place_nodes(&l, drawing->tree))
        draw_all(&t, drawing, &v, &l);
    else
        t.failed = true;
    free_layout(&l);
    if (t.failed) {
        free(t.bytes);
        return LATHE_ERR_MEMORY;
    }
    *svg = t.bytes;
    *size = t.used;
    return LATHE_OK;
}
