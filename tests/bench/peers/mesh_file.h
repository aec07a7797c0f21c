// The meshes that the programs of the benchmark exchange: int32 vertices, int32 triangles, float32 xyz, uint32 abc.
#ifndef LATHE_BENCH_MESH_FILE_H
#define LATHE_BENCH_MESH_FILE_H
#include <cstdint>
#include <cstdio>
#include <vector>

struct mesh_file {
    std::vector<float> positions;
    std::vector<uint32_t> indices;
};

inline bool read_mesh(mesh_file *mesh, const char *path) {
    FILE *file = fopen(path, "rb");
    if (!file) return false;
    int32_t counts[2];
    bool good = fread(counts, sizeof counts, 1, file) == 1 && counts[0] >= 0 && counts[1] >= 0;
    if (good) {
        mesh->positions.resize(3 * static_cast<std::size_t>(counts[0]));
        mesh->indices.resize(3 * static_cast<std::size_t>(counts[1]));
        good = fread(mesh->positions.data(), sizeof(float), mesh->positions.size(), file) == mesh->positions.size() &&
               fread(mesh->indices.data(), sizeof(uint32_t), mesh->indices.size(), file) == mesh->indices.size();
    }
    fclose(file);
    for (uint32_t index : mesh->indices) good = good && index < mesh->positions.size() / 3;
    return good;
}

inline bool write_mesh(const mesh_file &mesh, const char *path) {
    FILE *file = fopen(path, "wb");
    if (!file) return false;
    int32_t counts[2] = {static_cast<int32_t>(mesh.positions.size() / 3), static_cast<int32_t>(mesh.indices.size() / 3)};
    bool good = fwrite(counts, sizeof counts, 1, file) == 1 &&
                fwrite(mesh.positions.data(), sizeof(float), mesh.positions.size(), file) == mesh.positions.size() &&
                fwrite(mesh.indices.data(), sizeof(uint32_t), mesh.indices.size(), file) == mesh.indices.size();
    return fclose(file) == 0 && good;
}
#endif
