/* STL, PLY, GLB and Draco read back byte by byte; atomic files that fail in every way a disk can. With a folder as
 * argument, the sample files stay there for the glTF validator and draco_check. */
#include "check.h"
#include "lathe_codec.h"
#include <dirent.h>
#include <math.h>
#include <signal.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <unistd.h>

/* ---- a sink in memory ---- */

typedef struct memory {
    uint8_t *data;
    size_t size, limit;
} memory;

static int take(void *context, const void *bytes, size_t size) {
    memory *m = context;
    if (m->limit && m->size + size > m->limit) return 1;
    uint8_t *data = realloc(m->data, m->size + size + 1);
    if (!data) return 1;
    memcpy(data + m->size, bytes, size);
    m->data = data;
    m->size += size;
    data[m->size] = 0;
    return 0;
}

static uint32_t u32(const uint8_t *p) {
    return p[0] | (uint32_t)p[1] << 8 | (uint32_t)p[2] << 16 | (uint32_t)p[3] << 24;
}
static float f32(const uint8_t *p) {
    uint32_t bits = u32(p);
    float v;
    memcpy(&v, &bits, sizeof v);
    return v;
}

/* ---- two octahedra: radius 10 about the origin, radius 5 about (100.25, -30.1, 7) ---- */

static const int corner[6][3] = {{1, 0, 0}, {-1, 0, 0}, {0, 1, 0}, {0, -1, 0}, {0, 0, 1}, {0, 0, -1}};
static const uint32_t face[8][3] = {{0, 2, 4}, {2, 1, 4}, {1, 3, 4}, {3, 0, 4},
                                    {2, 0, 5}, {1, 2, 5}, {3, 1, 5}, {0, 3, 5}};
static float positions[36];
static uint32_t indices[48];
static struct lathe_world_part parts[2] = {{0, 0, 6, 0, 8}, {1, 6, 6, 8, 8}};
static lathe_world_mesh mesh = {12, 16, 2, positions, indices, parts, NULL};
static const lathe_structure_info structures[2] = {
    {.name = "Precentral \"L\" \\ \xC3\xA9", .rgb = {255, 0, 128}, .label = 2001},
    {.name = "right", .rgb = {0, 255, 10}, .label = 2002}};
static const lathe_model_info model = {.name = "atlas", .structure_count = 2, .structures = structures};
static const lathe_write_options options = {.model = &model, .name = "two\nlines"};

static void make_mesh(void) {
    const float centre[2][3] = {{0, 0, 0}, {100.25f, -30.1f, 7}}, radius[2] = {10, 5};
    for (int o = 0; o < 2; o++) {
        for (int v = 0; v < 6; v++)
            for (int i = 0; i < 3; i++) positions[(o * 6 + v) * 3 + i] = centre[o][i] + radius[o] * (float)corner[v][i];
        for (int t = 0; t < 8; t++)
            for (int k = 0; k < 3; k++) indices[(o * 8 + t) * 3 + k] = face[t][k] + 6 * (uint32_t)o;
    }
}

static void test_stl(void) {
    memory m = {0};
    CHECK_EQ(lathe_write_stl(&mesh, &options, take, &m), LATHE_OK);
    CHECK_EQ(m.size, 84 + 16 * 50);
    CHECK(memcmp(m.data, "solid", 5) != 0);
    CHECK_EQ(u32(m.data + 80), 16);
    double volume = 0;
    for (int t = 0; t < 16; t++) {
        const uint8_t *at = m.data + 84 + 50 * t;
        float v[4][3];
        for (int k = 0; k < 12; k++) v[k / 3][k % 3] = f32(at + 4 * k);
        for (int k = 0; k < 3; k++) CHECK(!memcmp(v[k + 1], positions + 3 * indices[3 * t + k], 12));
        const float *centre = t < 8 ? (float[3]){0, 0, 0} : (float[3]){100.25f, -30.1f, 7};
        double out = 0, length = 0;
        for (int i = 0; i < 3; i++) out += (double)v[0][i] * ((double)v[1][i] - (double)centre[i]);
        for (int i = 0; i < 3; i++) length += (double)v[0][i] * (double)v[0][i];
        CHECK(out > 2 && fabs(length - 1) < 1e-6); /* the normal points outwards and is a unit */
        volume += ((double)v[1][0] * ((double)v[2][1] * v[3][2] - (double)v[2][2] * v[3][1]) +
                   (double)v[1][1] * ((double)v[2][2] * v[3][0] - (double)v[2][0] * v[3][2]) +
                   (double)v[1][2] * ((double)v[2][0] * v[3][1] - (double)v[2][1] * v[3][0])) /
                  6;
        CHECK(at[48] == 0 && at[49] == 0);
    }
    CHECK(fabs(volume - 4.0 / 3 * (1000 + 125)) < 0.01); /* an octahedron: 4/3 r^3 */
    free(m.data);
}

static void test_ply(void) {
    static const char header[] = "ply\nformat binary_little_endian 1.0\ncomment Lathe, millimetres\ncomment two_lines\n"
                                 "element vertex 12\nproperty float x\nproperty float y\nproperty float z\n"
                                 "property uchar red\nproperty uchar green\nproperty uchar blue\n"
                                 "element face 16\nproperty list uchar uint vertex_indices\nend_header\n";
    memory m = {0};
    size_t head = strlen(header);
    CHECK_EQ(lathe_write_ply(&mesh, &options, take, &m), LATHE_OK);
    CHECK_EQ(m.size, head + 12 * 15 + 16 * 13);
    CHECK(!memcmp(m.data, header, head));
    for (int v = 0; v < 12; v++) {
        const uint8_t *at = m.data + head + 15 * v;
        for (int i = 0; i < 3; i++) CHECK(f32(at + 4 * i) == positions[3 * v + i]);
        CHECK(!memcmp(at + 12, structures[v / 6].rgb, 3));
    }
    for (int t = 0; t < 16; t++) {
        const uint8_t *at = m.data + head + 180 + 13 * t;
        CHECK_EQ(at[0], 3);
        for (int k = 0; k < 3; k++) CHECK_EQ(u32(at + 1 + 4 * k), indices[3 * t + k]);
    }
    free(m.data);
    m = (memory){0};
    CHECK_EQ(lathe_write_ply(&mesh, NULL, take, &m), LATHE_OK); /* without a model: no colours */
    CHECK(strstr((char *)m.data, "red") == NULL && strstr((char *)m.data, "element face 16\n") != NULL);
    free(m.data);
}

static void check_glb_binary(const uint8_t *bin) {
    for (int i = 0; i < 36; i++) CHECK(f32(bin + 4 * i) == positions[i]);
    for (int v = 0; v < 12; v++) /* the corners of an octahedron: the normal is the corner's axis */
        for (int i = 0; i < 3; i++) CHECK(fabs((double)f32(bin + 144 + 12 * v + 4 * i) - corner[v % 6][i]) < 1e-6);
    for (int i = 0; i < 48; i++) CHECK_EQ(u32(bin + 288 + 4 * i), face[i / 3 % 8][i % 3]);
}

static void test_glb(void) {
    memory m = {0};
    CHECK_EQ(lathe_write_glb(&mesh, &options, take, &m), LATHE_OK);
    CHECK(!memcmp(m.data, "glTF", 4) && u32(m.data + 4) == 2);
    CHECK_EQ(u32(m.data + 8), m.size);
    CHECK_EQ(m.size % 4, 0);
    uint32_t json = u32(m.data + 12);
    CHECK(json % 4 == 0 && !memcmp(m.data + 16, "JSON", 4));
    CHECK_EQ(u32(m.data + 20 + json), 12 * 24 + 48 * 4);
    CHECK(!memcmp(m.data + 24 + json, "BIN\0", 4));
    CHECK_EQ(m.size, 28 + json + 12 * 24 + 48 * 4);
    check_glb_binary(m.data + 28 + json);
    char *text = malloc(json + 1);
    memcpy(text, m.data + 20, json);
    text[json] = 0;
    CHECK(strstr(text, "\"name\":\"Precentral \\\"L\\\" \\\\ \xC3\xA9\"") != NULL);
    CHECK(strstr(text, "\"min\":[-10,-10,-10],\"max\":[10,10,10]") != NULL);
    CHECK(strstr(text, "\"min\":[95.25,-35.0999985,2]") != NULL);
    CHECK(strstr(text, "\"baseColorFactor\":[1,0,0.2158605") != NULL); /* sRGB 128 is 0.2158605 */
    CHECK(strstr(text, "\"generator\":\"Lathe\"") != NULL);
    const char *first = strstr(text, "\"extras\":{\"structure\":0}");
    CHECK(first != NULL && strstr(first, "\"extras\":{\"structure\":1}") != NULL);
    free(text);
    free(m.data);
    m = (memory){0};
    /* The first structure shows nothing yet: the only mesh says that it is the second one. */
    struct lathe_world_part parts[2] = {mesh.parts[0], mesh.parts[1]};
    lathe_world_mesh second = mesh;
    parts[0].triangle_count = 0;
    parts[1].first_triangle = 0;
    second.parts = parts;
    second.triangle_count = 8;
    second.indices += 24;
    CHECK_EQ(lathe_write_glb(&second, &options, take, &m), LATHE_OK);
    text = (char *)m.data + 20;
    CHECK(strstr(text, "\"extras\":{\"structure\":1}") != NULL && strstr(text, "\"structure\":0") == NULL);
    free(m.data);
    m = (memory){0};
    lathe_world_mesh bare = mesh;
    bare.structure_count = 0;
    CHECK_EQ(lathe_write_glb(&bare, NULL, take, &m), LATHE_OK);
    free(m.data);
}

static void test_drc(void) {
    memory m = {0}, fine = {0};
    CHECK_EQ(lathe_write_drc(&mesh, 0, take, &m), LATHE_OK);
    CHECK_EQ(lathe_write_drc(&mesh, 20, take, &fine), LATHE_OK);
    CHECK(m.size > 11 && !memcmp(m.data, "DRACO", 5) && m.data[7] == 1 && m.data[8] == 1); /* a mesh, by edgebreaker */
    CHECK(fine.size > m.size);
    CHECK_EQ(lathe_write_drc(&mesh, 31, take, &m), LATHE_ERR_RANGE);
    CHECK_EQ(lathe_write_drc(&mesh, -1, take, &m), LATHE_ERR_RANGE);
    free(m.data);
    free(fine.data);
}

static void each_refuses(const lathe_world_mesh *bad) {
    memory m = {0};
    CHECK_EQ(lathe_write_stl(bad, NULL, take, &m), LATHE_ERR_RANGE);
    CHECK_EQ(lathe_write_ply(bad, NULL, take, &m), LATHE_ERR_RANGE);
    CHECK_EQ(lathe_write_glb(bad, NULL, take, &m), LATHE_ERR_RANGE);
    CHECK_EQ(lathe_write_drc(bad, 0, take, &m), LATHE_ERR_RANGE);
    CHECK_EQ(m.size, 0);
    free(m.data);
}

static void test_bad_meshes(void) {
    lathe_world_mesh bad = {0};
    each_refuses(&bad);
    bad = mesh;
    bad.triangle_count = 0;
    each_refuses(&bad);
    indices[5] = 12;
    each_refuses(&mesh);
    indices[5] = 7; /* of the other part */
    each_refuses(&mesh);
    make_mesh();
    positions[4] = NAN;
    each_refuses(&mesh);
    positions[4] = -INFINITY;
    each_refuses(&mesh);
    make_mesh();
    parts[1].triangle_count = 9;
    each_refuses(&mesh);
    parts[1].triangle_count = 8;
    for (size_t limit = 1; limit < 400; limit += 57) {
        memory m = {.limit = limit};
        CHECK_EQ(lathe_write_stl(&mesh, NULL, take, &m), LATHE_ERR_IO);
        CHECK_EQ(lathe_write_ply(&mesh, NULL, take, &m), LATHE_ERR_IO);
        CHECK_EQ(lathe_write_glb(&mesh, NULL, take, &m), LATHE_ERR_IO);
        free(m.data);
    }
}

/* Zero-area triangles must not put NaN into a file. */
static void test_flat_mesh(void) {
    float line[9] = {0, 0, 0, 1, 1, 1, 2, 2, 2};
    uint32_t triangle[3] = {0, 1, 2};
    lathe_world_mesh flat = {3, 1, 0, line, triangle, NULL, NULL};
    memory m = {0};
    CHECK_EQ(lathe_write_stl(&flat, NULL, take, &m), LATHE_OK);
    for (int i = 0; i < 3; i++) CHECK(f32(m.data + 84 + 4 * i) == 0);
    size_t stl = m.size;
    CHECK_EQ(lathe_write_glb(&flat, NULL, take, &m), LATHE_OK);
    const uint8_t *bin = m.data + m.size - 12 - 72;
    for (int v = 0; v < 3; v++) CHECK(f32(bin + 36 + 12 * v + 8) == 1);
    CHECK(m.size > stl);
    free(m.data);
}

/* A mesh's own normals are written, as units. */
static void test_own_normals(void) {
    float line[9] = {0, 0, 0, 1, 1, 1, 2, 2, 2}, normals[9] = {0, 3, 0, 1, 0, 0, 0, NAN, 0};
    uint32_t triangle[3] = {0, 1, 2};
    lathe_world_mesh own = {3, 1, 0, line, triangle, NULL, normals};
    memory m = {0};
    CHECK_EQ(lathe_write_glb(&own, NULL, take, &m), LATHE_OK);
    const uint8_t *bin = m.data + m.size - 12 - 72 + 36;
    const float expected[9] = {0, 1, 0, 1, 0, 0, 0, 0, 1};
    for (int i = 0; i < 9; i++) CHECK(f32(bin + 4 * i) == expected[i]);
    free(m.data);
}

/* ---- atomic files ---- */

static char folder[200];
static const char *in_folder(const char *name) {
    static char path[512];
    snprintf(path, sizeof path, "%s/%s", folder, name);
    return path;
}

static int entries(void) {
    int count = 0;
    DIR *dir = opendir(folder);
    while (dir && readdir(dir)) count++;
    if (dir) closedir(dir);
    return count - 2;
}

static long size_of(const char *path) {
    struct stat info;
    return stat(path, &info) ? -1 : (long)info.st_size;
}

static lathe_status write_file(const char *path, size_t size, lathe_error *err) {
    static uint8_t block[100000];
    lathe_atomic_file *file = NULL;
    lathe_status status = lathe_atomic_open(&file, path, err);
    if (status) return status;
    memset(block, 'x', sizeof block);
    for (size_t sent = 0; sent < size; sent += 1000)
        (void)lathe_atomic_write(file, block, size - sent < 1000 ? size - sent : 1000);
    (void)lathe_atomic_write(file, block, 0);
    status = lathe_atomic_commit(&file, err);
    CHECK(file == NULL);
    return status;
}

static void test_atomic_success(void) {
    lathe_error err;
    CHECK_EQ(write_file(in_folder("a"), 200001, &err), LATHE_OK);
    CHECK_EQ(size_of(in_folder("a")), 200001);
    CHECK_EQ(chmod(in_folder("a"), 0640), 0);
    CHECK_EQ(write_file(in_folder("a"), 5, &err), LATHE_OK);
    CHECK_EQ(size_of(in_folder("a")), 5);
    struct stat info;
    CHECK(!stat(in_folder("a"), &info) && (info.st_mode & 0777) == 0640);
    CHECK_EQ(symlink("a", in_folder("link")), 0);
    CHECK_EQ(write_file(in_folder("link"), 7, &err), LATHE_OK);
    CHECK_EQ(size_of(in_folder("a")), 7);
    CHECK(!lstat(in_folder("link"), &info) && S_ISLNK(info.st_mode));
    CHECK_EQ(write_file("/dev/null", 70000, &err), LATHE_OK);
    CHECK(!stat("/dev/null", &info) && S_ISCHR(info.st_mode));
    char longest[256];
    memset(longest, 'n', 255);
    longest[255] = 0;
    CHECK_EQ(write_file(in_folder(longest), 1, &err), LATHE_OK);
    unlink(in_folder(longest));
    unlink(in_folder("link"));
    CHECK_EQ(entries(), 1);
}

static void test_atomic_failure(void) {
    lathe_error err = {""};
    CHECK_EQ(write_file(in_folder("missing/a"), 5, &err), LATHE_ERR_IO);
    CHECK(strstr(err.text, "missing/a") != NULL && strstr(err.text, "No such file") != NULL);
    CHECK_EQ(write_file(folder, 5, &err), LATHE_ERR_IO);
    CHECK(strstr(err.text, folder) != NULL && strstr(err.text, "directory") != NULL);
    CHECK_EQ(write_file("", 5, &err), LATHE_ERR_IO);
    if (size_of("/dev/full") >= 0) {
        CHECK_EQ(write_file("/dev/full", 5, &err), LATHE_ERR_IO); /* too small for the buffer: seen at commit */
        CHECK(strstr(err.text, "/dev/full") != NULL && strstr(err.text, "No space left") != NULL);
        CHECK_EQ(write_file("/dev/full", 500000, &err), LATHE_ERR_IO);
    }
    lathe_atomic_file *file = NULL;
    CHECK_EQ(lathe_atomic_open(&file, in_folder("a"), &err), LATHE_OK);
    CHECK_EQ(lathe_atomic_write(file, "zz", 2), 0);
    CHECK_EQ(entries(), 2);
    lathe_atomic_abandon(&file);
    lathe_atomic_abandon(&file);
    CHECK(file == NULL);
    CHECK_EQ(entries(), 1);
    CHECK_EQ(size_of(in_folder("a")), 7); /* as before */
}

/* A file that cannot grow, as on a full disk: the sink says so, commit says why, nothing is left. */
static void test_atomic_full(void) {
    struct rlimit old, small;
    lathe_error err = {""};
    signal(SIGXFSZ, SIG_IGN);
    CHECK_EQ(getrlimit(RLIMIT_FSIZE, &old), 0);
    small = old;
    small.rlim_cur = 100000;
    CHECK_EQ(setrlimit(RLIMIT_FSIZE, &small), 0);
    CHECK_EQ(write_file(in_folder("big"), 300000, &err), LATHE_ERR_IO);
    CHECK(strstr(err.text, "/big") != NULL && strstr(err.text, "too large") != NULL);
    lathe_atomic_file *file = NULL;
    CHECK_EQ(lathe_atomic_open(&file, in_folder("a"), &err), LATHE_OK);
    int refused = 0;
    static uint8_t block[80000];
    for (int i = 0; i < 3; i++) refused = lathe_atomic_write(file, block, sizeof block);
    CHECK(refused != 0);
    CHECK_EQ(lathe_atomic_commit(&file, NULL), LATHE_ERR_IO);
    CHECK_EQ(setrlimit(RLIMIT_FSIZE, &old), 0);
    CHECK_EQ(entries(), 1);
    CHECK_EQ(size_of(in_folder("a")), 7);
}

/* ---- samples for other people's programs ---- */

static void write_samples(const char *where) {
    typedef lathe_status writer(const lathe_world_mesh *, const lathe_write_options *, lathe_sink, void *);
    static const struct {
        const char *name;
        writer *write;
    } kinds[] = {{"stl", lathe_write_stl}, {"ply", lathe_write_ply}, {"glb", lathe_write_glb}};
    char path[512];
    lathe_atomic_file *file;
    for (int i = 0; i < 3; i++) {
        snprintf(path, sizeof path, "%s/sample.%s", where, kinds[i].name);
        if (!CHECK_EQ(lathe_atomic_open(&file, path, NULL), LATHE_OK)) return;
        CHECK_EQ(kinds[i].write(&mesh, &options, lathe_atomic_write, file), LATHE_OK);
        CHECK_EQ(lathe_atomic_commit(&file, NULL), LATHE_OK);
    }
    snprintf(path, sizeof path, "%s/sample.drc", where);
    if (!CHECK_EQ(lathe_atomic_open(&file, path, NULL), LATHE_OK)) return;
    CHECK_EQ(lathe_write_drc(&mesh, 0, lathe_atomic_write, file), LATHE_OK);
    CHECK_EQ(lathe_atomic_commit(&file, NULL), LATHE_OK);
}

int main(int argc, char **argv) {
    const char *root = getenv("TMPDIR");
    snprintf(folder, sizeof folder, "%s/lathe-writers-XXXXXX", root && strlen(root) < 150 ? root : "/tmp");
    make_mesh();
    test_stl();
    test_ply();
    test_glb();
    test_drc();
    test_bad_meshes();
    test_flat_mesh();
    test_own_normals();
    if (CHECK(mkdtemp(folder) != NULL)) {
        test_atomic_success();
        test_atomic_failure();
        test_atomic_full();
        unlink(in_folder("a"));
        rmdir(folder);
    }
    if (argc > 1) write_samples(argv[1]);
    return check_end();
}
