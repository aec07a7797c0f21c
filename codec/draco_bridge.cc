#include "draco_bridge.h"
#include <cstdlib>
#include <cstring>
#include <draco/compression/encode.h>
#include <draco/mesh/mesh.h>
#include <memory>
#include <new>

namespace {

std::unique_ptr<draco::Mesh> make_mesh(const float *positions, uint32_t vertex_count, const uint32_t *indices,
                                       uint32_t triangle_count) {
    std::unique_ptr<draco::Mesh> mesh(new draco::Mesh());
    mesh->set_num_points(vertex_count);
    draco::GeometryAttribute position;
    position.Init(draco::GeometryAttribute::POSITION, nullptr, 3, draco::DT_FLOAT32, false, 3 * sizeof(float), 0);
    const int id = mesh->AddAttribute(position, true, vertex_count);
    for (uint32_t v = 0; v < vertex_count; v++)
        mesh->attribute(id)->SetAttributeValue(draco::AttributeValueIndex(v), positions + size_t{3} * v);
    mesh->SetNumFaces(triangle_count);
    for (uint32_t t = 0; t < triangle_count; t++) {
        draco::Mesh::Face face;
        for (int k = 0; k < 3; k++) face[k] = draco::PointIndex(indices[size_t{3} * t + k]);
        mesh->SetFace(draco::FaceIndex(t), face);
    }
    return mesh;
}

lathe_status encode(uint8_t **out, size_t *size, const draco::Mesh &mesh, int quantization_bits) {
    draco::Encoder encoder;
    encoder.SetSpeedOptions(0, 0); /* level 10 of Draco's command line */
    encoder.SetAttributeQuantization(draco::GeometryAttribute::POSITION, quantization_bits);
    encoder.SetEncodingMethod(draco::MESH_EDGEBREAKER_ENCODING);
    draco::EncoderBuffer buffer;
    if (!encoder.EncodeMeshToBuffer(mesh, &buffer).ok()) return LATHE_ERR_UNSUPPORTED;
    auto *bytes = static_cast<uint8_t *>(std::malloc(buffer.size() + 1));
    if (!bytes) return LATHE_ERR_MEMORY;
    std::memcpy(bytes, buffer.data(), buffer.size());
    *out = bytes;
    *size = buffer.size();
    return LATHE_OK;
}

} // namespace

extern "C" lathe_status lathe__draco_encode(uint8_t **out, size_t *size, const float *positions, uint32_t vertex_count,
                                            const uint32_t *indices, uint32_t triangle_count, int quantization_bits) {
    /* Draco numbers the corners of all triangles by int. */
    if (triangle_count > INT32_MAX / 3 || vertex_count > INT32_MAX / 3) return LATHE_ERR_LIMIT;
    try {
        return encode(out, size, *make_mesh(positions, vertex_count, indices, triangle_count), quantization_bits);
    } catch (const std::bad_alloc &) { return LATHE_ERR_MEMORY; } catch (...) {
        return LATHE_ERR_UNSUPPORTED;
    }
}
