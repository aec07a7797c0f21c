// peer_codecs IN.mesh OUT-PREFIX BITS,BITS,...: a mesh under the codecs of the benchmark of bytes, positions on a grid of BITS bits
// along the longest side. For each number of bits one line of JSON and OUT-PREFIX<bits>.mesh, what a Draco decoder gives back.
//   draco:   edgebreaker, compression level 10
//   meshopt: meshoptimizer's index and vertex codecs, triangles in its order for strips, then zstd 19. The same grid as Draco's,
//            so the same error.
#include <draco/compression/decode.h>
#include <draco/compression/encode.h>
#include <draco/mesh/mesh.h>
#include <meshoptimizer.h>
#include <zstd.h>
#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <memory>
#include <string>
#include "mesh_file.h"

static std::unique_ptr<draco::Mesh> draco_mesh(const mesh_file &file) {
    std::unique_ptr<draco::Mesh> mesh(new draco::Mesh);
    uint32_t vertices = static_cast<uint32_t>(file.positions.size() / 3);
    mesh->set_num_points(vertices);
    draco::GeometryAttribute position;
    position.Init(draco::GeometryAttribute::POSITION, nullptr, 3, draco::DT_FLOAT32, false, 12, 0);
    int id = mesh->AddAttribute(position, true, vertices);
    for (uint32_t i = 0; i < vertices; i++) mesh->attribute(id)->SetAttributeValue(draco::AttributeValueIndex(i), &file.positions[3 * i]);
    mesh->SetNumFaces(file.indices.size() / 3);
    for (uint32_t i = 0; i < file.indices.size() / 3; i++) {
        draco::Mesh::Face face;
        for (uint32_t k = 0; k < 3; k++) face[k] = file.indices[3 * i + k];
        mesh->SetFace(draco::FaceIndex(i), face);
    }
    return mesh;
}

static bool draco_encode(draco::EncoderBuffer *out, const draco::Mesh &mesh, int bits) {
    draco::Encoder encoder;
    encoder.SetSpeedOptions(0, 0);
    encoder.SetEncodingMethod(draco::MESH_EDGEBREAKER_ENCODING);
    encoder.SetAttributeQuantization(draco::GeometryAttribute::POSITION, bits);
    return encoder.EncodeMeshToBuffer(mesh, out).ok();
}

static bool draco_decode(mesh_file *out, const draco::EncoderBuffer &bytes) {
    draco::DecoderBuffer buffer;
    buffer.Init(bytes.data(), bytes.size());
    draco::Decoder decoder;
    auto result = decoder.DecodeMeshFromBuffer(&buffer);
    if (!result.ok()) return false;
    std::unique_ptr<draco::Mesh> mesh = std::move(result).value();
    const draco::PointAttribute *position = mesh->GetNamedAttribute(draco::GeometryAttribute::POSITION);
    out->positions.resize(3 * static_cast<std::size_t>(mesh->num_points()));
    for (uint32_t i = 0; i < mesh->num_points(); i++)
        position->ConvertValue<float, 3>(position->mapped_index(draco::PointIndex(i)), &out->positions[3 * i]);
    for (uint32_t i = 0; i < mesh->num_faces(); i++)
        for (int k = 0; k < 3; k++) out->indices.push_back(mesh->face(draco::FaceIndex(i))[k].value());
    return true;
}

static std::size_t meshopt_bytes(const mesh_file &file, int bits) {
    std::size_t vertices = file.positions.size() / 3;
    std::vector<uint32_t> indices(file.indices.size());
    std::vector<float> positions(file.positions.size());
    meshopt_optimizeVertexCacheStrip(indices.data(), file.indices.data(), indices.size(), vertices);
    vertices = meshopt_optimizeVertexFetch(positions.data(), indices.data(), indices.size(), file.positions.data(), vertices, 12);
    float low[3] = {INFINITY, INFINITY, INFINITY}, high[3] = {-INFINITY, -INFINITY, -INFINITY};
    for (std::size_t i = 0; i < 3 * vertices; i++) {
        low[i % 3] = std::min(low[i % 3], positions[i]);
        high[i % 3] = std::max(high[i % 3], positions[i]);
    }
    float side = std::max({high[0] - low[0], high[1] - low[1], high[2] - low[2]});
    float scale = side > 0 ? static_cast<float>((1 << bits) - 1) / side : 0;
    std::vector<uint16_t> grid(4 * vertices);   // the codec takes vertices of a multiple of four bytes
    for (std::size_t i = 0; i < vertices; i++)
        for (std::size_t k = 0; k < 3; k++) grid[4 * i + k] = static_cast<uint16_t>((positions[3 * i + k] - low[k]) * scale + 0.5f);
    meshopt_encodeIndexVersion(1);
    std::size_t index_bound = meshopt_encodeIndexBufferBound(indices.size(), vertices), vertex_bound = meshopt_encodeVertexBufferBound(vertices, 8);
    std::vector<unsigned char> coded(index_bound + vertex_bound);
    std::size_t size = meshopt_encodeIndexBuffer(coded.data(), index_bound, indices.data(), indices.size());
    size += meshopt_encodeVertexBuffer(coded.data() + size, vertex_bound, grid.data(), vertices, 8);
    std::vector<unsigned char> packed(ZSTD_compressBound(size));
    return ZSTD_compress(packed.data(), packed.size(), coded.data(), size, 19) + 24;   // and the grid: origin, scale, counts
}

int main(int argc, char **argv) {
    mesh_file file;
    if (argc != 4 || !read_mesh(&file, argv[1])) return fprintf(stderr, "peer_codecs IN.mesh OUT-PREFIX BITS,...\n"), 2;
    std::unique_ptr<draco::Mesh> mesh = draco_mesh(file);
    for (char *at = argv[3]; *at;) {
        int bits = static_cast<int>(strtol(at, &at, 10));
        if (*at == ',') at++;
        if (bits < 1 || bits > 16) return fprintf(stderr, "peer_codecs: 1 to 16 bits\n"), 2;
        draco::EncoderBuffer bytes;
        mesh_file decoded;
        std::string path = argv[2] + std::to_string(bits) + ".mesh";
        if (!draco_encode(&bytes, *mesh, bits) || !draco_decode(&decoded, bytes) || !write_mesh(decoded, path.c_str()))
            return fprintf(stderr, "peer_codecs: %s, %d bits: Draco failed\n", argv[1], bits), 1;
        printf("{\"bits\": %d, \"draco\": %zu, \"meshopt\": %zu, \"triangles\": %zu, \"path\": \"%s\"}\n", bits, bytes.size(),
               meshopt_bytes(file, bits), decoded.indices.size() / 3, path.c_str());
        fflush(stdout);
    }
    return 0;
}
