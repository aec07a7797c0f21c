/* lathe reconstruct: a surface from cross-sections, by the papers' own methods. */
#include "cli.h"
#include "contour_json.h"
#include "grey_crossing.h"
#include "mesh.h"
#include "reconstruct.h"
#include "twist.h"
#include <stdlib.h>
#include <string.h>
#include <strings.h>

typedef struct reconstruct_job {
    const char *input, *output, *format;
    double iso;
    int64_t label;
    bool has_iso, has_label, json, quiet;
    int axis;                  /* -1: auto */
    int64_t smooth;            /* pieces of an edge; 0: flat triangles */
    double tolerance, strip;   /* mm: fewer points first, by the hierarchy or by strips; 0: all */
    lathe_twist twist;
    lathe_reconstruct_options options;
} reconstruct_job;

/* ---- input ---- */

static int say(const reconstruct_job *job, const char *what, uint32_t count) {
    if (count && !job->quiet) fprintf(stderr, "lathe: %u %s\n", count, what);
    return 0;
}

static int read_contours(lathe_contour_set *set, const reconstruct_job *job) {
    lathe_set_repairs repairs;
    lathe_error err = {{0}};
    lathe_status status = lathe__contour_json_open(set, &repairs, job->input, &err);
    if (status) return lathe__status_error("reconstruct", job->input, status, &err);
    say(job, "repeated points left out", repairs.repeated_points);
    say(job, "points left out at which a polygon turned straight back", repairs.spikes);
    return LATHE_EXIT_OK;
}

static lathe_status slice_volume(lathe_contour_set *set, const reconstruct_job *job, const lathe_volume *volume,
                                 lathe_error *err) {
    lathe_mask mask;
    lathe_axis axis = job->axis < 0 ? lathe__axis_auto(volume) : (lathe_axis)job->axis;
    double iso = job->has_iso || job->has_label ? job->iso : lathe_volume_otsu(volume);
    if (!job->has_iso && !job->has_label && !job->quiet)
        fprintf(stderr, "lathe: threshold %g chosen by Otsu's method (--iso sets another)\n", iso);
    lathe_status status = job->has_label ? lathe__region_label(&mask, volume, axis, job->label, err)
                                         : lathe__region_threshold(&mask, volume, axis, iso, err);
    if (status) return status;
    lathe_transform transform = lathe__mask_transform(&mask, axis, volume->affine);
    int fraction = job->has_label ? LATHE_FRACTION_ONE / 2 : lathe__mean_fraction(&mask, volume, axis, iso, false);
    status = lathe__contour_set_of_mask(set, &mask, &transform, fraction);
    lathe__mask_free(&mask);
    return status ? lathe_fail(err, status, "the outlines could not be traced: %s", lathe_status_name(status))
                  : LATHE_OK;
}

static int read_volume(lathe_contour_set *set, reconstruct_job *job) {
    lathe_volume *volume = NULL;
    lathe_error err = {{0}};
    lathe_status status = lathe_volume_open(&volume, job->input, &err);
    if (!status) status = slice_volume(set, job, volume, &err);
    lathe_volume_close(&volume);
    /* Slices are the middles of voxels: the ends reach half a voxel further. */
    job->options.cap = LATHE_LATTICE_ONE / 2;
    job->options.lattice = true;
    return status ? lathe__status_error("reconstruct", job->input, status, &err) : LATHE_EXIT_OK;
}

/* ---- output ---- */

static lathe_status write_mesh(const reconstruct_job *job, const lathe_world_mesh *mesh, lathe_sink sink,
                               void *context) {
    lathe_write_options options = {.model = NULL, .name = "reconstruction"};
    if (strcasecmp(job->format, "stl") == 0) return lathe_write_stl(mesh, &options, sink, context);
    if (strcasecmp(job->format, "ply") == 0) return lathe_write_ply(mesh, &options, sink, context);
    if (strcasecmp(job->format, "glb") == 0) return lathe_write_glb(mesh, &options, sink, context);
    return lathe_write_drc(mesh, 0, sink, context);
}

static int write_stdout(void *context, const void *bytes, size_t size) {
    (void)context;
    return fwrite(bytes, 1, size, stdout) == size ? 0 : -1;
}

static int write_output(const reconstruct_job *job, const lathe_world_mesh *mesh) {
    lathe_error err = {{0}};
    lathe_atomic_file *file = NULL;
    if (strcmp(job->output, "-") == 0) {
        lathe_status status = write_mesh(job, mesh, write_stdout, NULL);
        return status == LATHE_OK || ferror(stdout)
                   ? LATHE_EXIT_OK
                   : lathe__status_error("reconstruct", "standard output", status, NULL);
    }
    lathe_status status = lathe_atomic_open(&file, job->output, &err);
    if (status) return lathe__status_error("reconstruct", job->output, status, &err);
    status = write_mesh(job, mesh, lathe_atomic_write, file);
    if (status == LATHE_OK || status == LATHE_ERR_IO) {
        lathe_status committed = lathe_atomic_commit(&file, &err);
        if (status == LATHE_OK || committed) status = committed;
    }
    lathe_atomic_abandon(&file);
    return status ? lathe__status_error("reconstruct", job->output, status, &err) : LATHE_EXIT_OK;
}

static lathe_status plain_world(lathe_world_mesh *world, const lathe_mesh *mesh, const lathe_transform *transform) {
    world->vertex_count = mesh->vertex_count;
    world->triangle_count = mesh->triangle_count;
    world->positions = malloc(3 * (size_t)mesh->vertex_count * sizeof *world->positions);
    world->indices = malloc(3 * (size_t)mesh->triangle_count * sizeof *world->indices);
    if (!world->positions || !world->indices) return LATHE_ERR_MEMORY;
    lathe_mesh_positions(mesh, transform, world->positions);
    lathe_mesh_indices(mesh, transform, world->indices);
    return LATHE_OK;
}

static int export_mesh(const reconstruct_job *job, const lathe_mesh *mesh, const lathe_transform *transform) {
    lathe_world_mesh world;
    memset(&world, 0, sizeof world);
    world.parts = calloc(1, sizeof *world.parts);
    lathe_status status = world.parts ? plain_world(&world, mesh, transform) : LATHE_ERR_MEMORY;
    if (!status) {
        world.structure_count = 1;
        world.parts[0].vertex_count = world.vertex_count;
        world.parts[0].triangle_count = world.triangle_count;
        if (job->smooth) status = lathe_world_mesh_smooth(&world, (uint32_t)job->smooth);
    }
    int result = status ? lathe__status_error("reconstruct", job->input, status, NULL) : write_output(job, &world);
    lathe_world_mesh_free(&world);
    return result;
}

/* ---- report ---- */

static void print_report(FILE *out, const reconstruct_job *job, const lathe_contour_set *set,
                         const lathe_reconstruct_report *r, const lathe_mesh_report *check) {
    const lathe_slab_counts *b = &r->blocks;
    uint64_t loops = 0;
    for (uint32_t s = 0; s < set->count; s++) loops += set->sections[s].outline.loop_count;
    fprintf(out,
            "%u sections, %llu contours -> %u vertices, %u triangles; components %llu, Euler characteristic %lld\n",
            set->count, (unsigned long long)loops, r->vertices, r->triangles, (unsigned long long)check->components,
            (long long)check->euler);
    fprintf(out, "links: %llu self, %llu one-to-one, %llu one-to-many, %llu many-to-many\n",
            (unsigned long long)b->links[0], (unsigned long long)b->links[1], (unsigned long long)b->links[2],
            (unsigned long long)b->links[3]);
    fprintf(
        out,
        "blocks: %llu tiled (%llu without trees), %llu branched (%llu by a mid-slice copy), %llu closed, "
        "%llu overlaid\n",
        (unsigned long long)b->tubes, (unsigned long long)b->treeless, (unsigned long long)b->branched,
        (unsigned long long)b->copied, (unsigned long long)b->closed, (unsigned long long)b->overlaid);
    fprintf(
        out,
        "back to the overlay: blocks %llu crossing, %llu without a polygon, %llu with holes in their overlap; "
        "whole slabs %u of %u "
        "(%u crossing, %u torn, %u flat)\n",
        (unsigned long long)b->crossed, (unsigned long long)b->refused, (unsigned long long)b->handles, r->overlaid,
        r->slabs, r->crossing, r->torn, r->flat);
    if (b->repaired)
        fprintf(out, "rank order clustering: %llu relations put right by components\n",
                (unsigned long long)b->repaired);
    if (r->moved)
        fprintf(out, "%u sections touched their neighbours: moved by %.2g mm at most\n", r->moved,
                r->farthest * set->transform.m[0][0]);
    if (r->separated)
        fprintf(out, "%u slabs could not be joined: their contours are closed one by one\n", r->separated);
    fprintf(out, "closed, manifold, free of self-intersections%s\n", job->smooth ? " (before smoothing)" : "");
}

static bool is_perfect(const lathe_mesh_report *r) {
    return !r->boundary_edges && !r->nonmanifold_edges && !r->misoriented_edges && !r->nonmanifold_vertices &&
           !r->degenerate_triangles && !r->duplicate_positions && !r->unused_vertices && !r->bad_indices &&
           !r->self_intersections;
}

static int reconstruct_set(const reconstruct_job *job, const lathe_contour_set *set) {
    lathe_mesh mesh = {0};
    lathe_reconstruct_report report;
    lathe_mesh_report check;
    lathe_error err = {{0}};
    lathe_status status = lathe__reconstruct(&mesh, &report, set, &job->options, &err);
    if (!status) status = lathe__mesh_check(&check, &mesh, true);
    if (status) {
        lathe_mesh_free(&mesh);
        return lathe__status_error("reconstruct", job->input, status, &err);
    }
    int result =
        is_perfect(&check) ? LATHE_EXIT_OK : lathe__input_error("reconstruct: %s: the surface has flaws", job->input);
    if (result == LATHE_EXIT_OK) result = export_mesh(job, &mesh, &set->transform);
    if (result == LATHE_EXIT_OK && !job->quiet)
        print_report(strcmp(job->output, "-") ? stdout : stderr, job, set, &report, &check);
    lathe_mesh_free(&mesh);
    return result;
}

/* ---- arguments ---- */

static int choose(const char *text, const char *const *names, int count) {
    for (int i = 0; text && i < count; i++)
        if (strcmp(text, names[i]) == 0) return i;
    return text ? -1 : 0;
}

typedef struct reconstruct_texts {
    const char *output, *format, *iso, *label, *axis, *tiling, *links, *threshold, *branching, *mid, *rays, *smooth,
        *hierarchy, *strip, *twist;
} reconstruct_texts;

static int parse_methods(reconstruct_job *job, const lathe_command *command, const reconstruct_texts *t) {
    static const char *const tilings[] = {"trees", "toroidal", "christiansen", "shortest"}, *const links[] = {"regions",
                                                                                                              "paper"};
    static const char *const branchings[] = {"overlay", "paper"}, *const mids[] = {"never", "wide"};
    lathe_slab_options *o = &job->options.slab;
    int tiling = choose(t->tiling, tilings, 4), link = choose(t->links, links, 2),
        branching = choose(t->branching, branchings, 2);
    int mid = choose(t->mid, mids, 2);
    int64_t rays = 0;
    if (tiling < 0)
        return lathe__usage_error(command, "--tiling %s: it is one of trees, toroidal, christiansen, shortest",
                                  t->tiling);
    if (link < 0) return lathe__usage_error(command, "--links %s: it is one of regions, paper", t->links);
    if (branching < 0) return lathe__usage_error(command, "--branching %s: it is one of overlay, paper", t->branching);
    if (mid < 0) return lathe__usage_error(command, "--mid-slices %s: it is one of never, wide", t->mid);
    if (t->threshold &&
        (!lathe__option_number(&o->threshold, t->threshold) || !(o->threshold > 0 && o->threshold <= 1)))
        return lathe__usage_error(command, "--threshold %s: a number above 0, up to 1", t->threshold);
    if (t->rays && (!lathe__option_integer(&rays, t->rays, 8, 65536) || (rays & (rays - 1))))
        return lathe__usage_error(command, "--rays %s: a power of two from 8 to 65536", t->rays);
    o->tiling = (lathe_tiling_method)tiling;
    o->links = (lathe_link_rule)link;
    o->branching = (lathe_branching)branching;
    o->mid_slices = mid == 1;
    o->rays = (uint32_t)rays;
    return LATHE_PARSED;
}

static int parse_input(reconstruct_job *job, const lathe_command *command, const reconstruct_texts *t) {
    static const char *const axes[] = {"auto", "x", "y", "z"}, *const formats[] = {"stl", "ply", "glb", "drc"};
    int axis = choose(t->axis, axes, 4);
    const char *dot = t->output ? strrchr(t->output, '.') : NULL;
    if (!t->output) return lathe__usage_error(command, "-o OUT is needed");
    job->output = t->output;
    job->format = t->format ? t->format : dot ? dot + 1 : "";
    bool known = false;
    for (int i = 0; i < 4; i++) known |= strcasecmp(job->format, formats[i]) == 0;
    if (!known)
        return lathe__usage_error(command, "--format stl, ply, glb or drc is needed: \"%s\" does not tell it",
                                  t->output);
    if (axis < 0) return lathe__usage_error(command, "--axis %s: it is one of x, y, z, auto", t->axis);
    job->axis = axis - 1;
    if (t->iso && t->label) return lathe__usage_error(command, "only one of --iso and --label");
    if (t->iso && !lathe__option_number(&job->iso, t->iso))
        return lathe__usage_error(command, "--iso %s: a number is needed", t->iso);
    if (t->label && !lathe__option_integer(&job->label, t->label, -(1 << 24), 1 << 24))
        return lathe__usage_error(command, "--label %s: a whole number is needed", t->label);
    if (t->smooth && !lathe__option_integer(&job->smooth, t->smooth, 1, 16))
        return lathe__usage_error(command, "--smooth %s: 1 to 16", t->smooth);
    if (t->hierarchy && (!lathe__option_number(&job->tolerance, t->hierarchy) || job->tolerance <= 0))
        return lathe__usage_error(command, "--hierarchy %s: a number of mm above 0", t->hierarchy);
    if (t->strip && (!lathe__option_number(&job->strip, t->strip) || job->strip <= 0))
        return lathe__usage_error(command, "--strip %s: a number of mm above 0", t->strip);
    lathe_error err;
    if (t->twist && lathe__parse_twist(&job->twist, t->twist, &err))
        return lathe__usage_error(command, "--twist %s: %s", t->twist, err.text);
    job->has_iso = t->iso != NULL;
    job->has_label = t->label != NULL;
    return LATHE_PARSED;
}

/* Fewer points, and rays that turn with the shape. */
static int prepare(lathe_contour_set *set, reconstruct_job *job) {
    lathe_status status = LATHE_OK;
    if (job->strip > 0) status = lathe__contour_set_strip(set, job->strip);
    if (!status && job->tolerance > 0) status = lathe__contour_set_simplify(set, job->tolerance);
    if (job->strip > 0 || job->tolerance > 0) job->options.lattice = false;
    if (!status && job->twist.method != LATHE_TWIST_NONE) {
        uint32_t **turns;
        status = lathe__turn_sections(&turns, &set->arena, set->sections, set->count, &job->twist);
        job->options.turns = (const uint32_t *const *)turns;
    }
    return status ? lathe__status_error("reconstruct", job->input, status, NULL) : LATHE_EXIT_OK;
}

static int run(int argc, char **argv) {
    const lathe_command *command = &lathe__command_reconstruct;
    reconstruct_texts t;
    reconstruct_job job = {.axis = -1};
    const lathe_option options[] = {
        LATHE_OPTION_TEXT("output", 'o', &t.output),       LATHE_OPTION_TEXT("format", 'f', &t.format),
        LATHE_OPTION_TEXT("iso", 0, &t.iso),               LATHE_OPTION_TEXT("label", 0, &t.label),
        LATHE_OPTION_TEXT("axis", 0, &t.axis),             LATHE_OPTION_TEXT("tiling", 0, &t.tiling),
        LATHE_OPTION_TEXT("links", 0, &t.links),           LATHE_OPTION_TEXT("threshold", 0, &t.threshold),
        LATHE_OPTION_TEXT("branching", 0, &t.branching),   LATHE_OPTION_TEXT("mid-slices", 0, &t.mid),
        LATHE_OPTION_TEXT("rays", 0, &t.rays),             LATHE_OPTION_TEXT("smooth", 0, &t.smooth),
        LATHE_OPTION_TEXT("hierarchy", 0, &t.hierarchy),   LATHE_OPTION_TEXT("strip", 0, &t.strip),
        LATHE_OPTION_TEXT("twist", 0, &t.twist),
        LATHE_OPTION_FLAG("quiet", &job.quiet, true),
    };
    memset(&t, 0, sizeof t);
    int count, status = lathe__parse_options(command, argc, argv, options, sizeof options / sizeof *options, &count);
    if (status != LATHE_PARSED) return status;
    if (count != 1) return lathe__usage_error(command, "one INPUT is needed");
    job.input = argv[1];
    lathe_reconstruct_defaults(&job.options);
    if ((status = parse_methods(&job, command, &t)) != LATHE_PARSED) return status;
    if ((status = parse_input(&job, command, &t)) != LATHE_PARSED) return status;
    lathe_contour_set set;
    memset(&set, 0, sizeof set);
    status = lathe__is_contour_json(job.input) ? read_contours(&set, &job) : read_volume(&set, &job);
    if (status == LATHE_EXIT_OK) status = prepare(&set, &job);
    if (status == LATHE_EXIT_OK) status = reconstruct_set(&job, &set);
    lathe__contour_set_free(&set);
    return status;
}

const lathe_command lathe__command_reconstruct = {
    "reconstruct", "a surface from cross-sections, by the papers' methods",
    "Usage: lathe reconstruct INPUT -o OUT.stl|ply|glb|drc [options]\n\n"
    "INPUT is a contour set (.json with \"sections\", see docs/CONTOUR_SETS.md) or a volume, whose slices are traced.\n"
    "The surface is closed, manifold and free of self-intersections whatever is chosen here: what would not be falls\n"
    "back to the lifted overlay.\n\n"
    "      --iso V, --label N    volumes: which region; default: Otsu's threshold\n"
    "      --axis x|y|z|auto     volumes: slices lie across it\n"
    "      --tiling T            one-to-one links: trees (default; derivation trees), toroidal (least area),\n"
    "                            christiansen, shortest\n"
    "      --rays N              trees: rays of a contour, a power of two; default: by its size\n"
    "      --links L             regions (default: contours whose regions overlap, with the topology that the\n"
    "                            overlap has), paper (overlap degree of convex hulls)\n"
    "      --threshold X         of --links paper; default 0.45\n"
    "      --branching B         overlay (default), paper (exterior and interior polygons)\n"
    "      --mid-slices M        --branching paper: never (default), wide (copies in the middle of high slabs)\n"
    "      --hierarchy MM        first fewer points: edges within MM of the contours, by the hierarchy without\n"
    "                            intersections\n"
    "      --strip MM            first polygons instead of staircases: chords within MM of the contours\n"
    "      --twist none|DEG|auto trees: rays turn from slice to slice with the shape\n"
    "      --smooth K            writes the smooth surface, every edge in K pieces (1 to 16)\n"
    "  -f, --format F            default: what OUT ends with\n"
    "      --quiet               no report\n"
    "  -o, --output OUT          `-` is standard output\n",
    run};
