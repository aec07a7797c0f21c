#include "draco_bridge.h"
#include <cstdlib>
#include <cstring>
#include <draco/compression/decode.h>
#include <draco/compression/encode.h>
#include <draco/compression/expert_encode.h>
#include <draco/mesh/mesh.h>
#include <memory>
#include <new>
#include <vector>

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

lathe_status copy_out(uint8_t **out, size_t *size, const draco::EncoderBuffer &buffer) {
    auto *bytes = static_cast<uint8_t *>(std::malloc(buffer.size() + 1));
    if (!bytes) return LATHE_ERR_MEMORY;
    std::memcpy(bytes, buffer.data(), buffer.size());
    *out = bytes;
    *size = buffer.size();
    return LATHE_OK;
}

lathe_status encode(uint8_t **out, size_t *size, const draco::Mesh &mesh, int quantization_bits) {
    draco::Encoder encoder;
    encoder.SetSpeedOptions(0, 0); /* level 10 of Draco's command line */
    encoder.SetAttributeQuantization(draco::GeometryAttribute::POSITION, quantization_bits);
    encoder.SetEncodingMethod(draco::MESH_EDGEBREAKER_ENCODING);
    draco::EncoderBuffer buffer;
    if (!encoder.EncodeMeshToBuffer(mesh, &buffer).ok()) return LATHE_ERR_UNSUPPORTED;
    return copy_out(out, size, buffer);
}

// ---- carriers of deltas

const draco::GeometryAttribute::Type CARRIED[2] = {draco::GeometryAttribute::POSITION,
                                                   draco::GeometryAttribute::GENERIC};

std::unique_ptr<draco::Mesh> make_carrier(const lathe_draco_carrier &carrier) {
    std::unique_ptr<draco::Mesh> mesh(new draco::Mesh());
    mesh->set_num_points(carrier.vertex_count);
    for (int k = 0; k < 2; k++) {
        draco::GeometryAttribute attribute;
        attribute.Init(CARRIED[k], nullptr, 1, draco::DT_INT32, false, sizeof(int32_t), 0);
        const int id = mesh->AddAttribute(attribute, true, carrier.vertex_count);
        for (uint32_t v = 0; v < carrier.vertex_count; v++)
            mesh->attribute(id)->SetAttributeValue(draco::AttributeValueIndex(v), carrier.value[k] + v);
    }
    mesh->SetNumFaces(carrier.triangle_count);
    for (uint32_t t = 0; t < carrier.triangle_count; t++) {
        draco::Mesh::Face face;
        for (int k = 0; k < 3; k++) face[k] = draco::PointIndex(carrier.triangles[size_t{3} * t + k]);
        mesh->SetFace(draco::FaceIndex(t), face);
    }
    return mesh;
}

std::vector<int32_t> words_of(const void *data, size_t bytes) {
    std::vector<int32_t> words(bytes / sizeof(int32_t));
    if (bytes) std::memcpy(words.data(), data, words.size() * sizeof(int32_t));
    return words;
}

lathe_status pack(uint8_t **out, size_t *size, const lathe_draco_carrier &carrier) {
    const std::unique_ptr<draco::Mesh> mesh = make_carrier(carrier);
    std::unique_ptr<draco::GeometryMetadata> metadata(new draco::GeometryMetadata());
    if (carrier.word_count)
        metadata->AddEntryIntArray("lathe", words_of(carrier.words, carrier.word_count * sizeof(int32_t)));
    if (carrier.affine) metadata->AddEntryIntArray("affine", words_of(carrier.affine, 12 * sizeof(double)));
    mesh->AddMetadata(std::move(metadata));
    draco::ExpertEncoder encoder(*mesh);
    encoder.SetSpeedOptions(0, 0);
    encoder.SetEncodingMethod(draco::MESH_EDGEBREAKER_ENCODING);
    for (int k = 0; k < 2; k++)
        if (!encoder.SetAttributePredictionScheme(k, draco::PREDICTION_NONE).ok()) return LATHE_ERR_UNSUPPORTED;
    draco::EncoderBuffer buffer;
    if (!encoder.EncodeToBuffer(&buffer).ok()) return LATHE_ERR_UNSUPPORTED;
    return copy_out(out, size, buffer);
}

template <typename T> bool allocate(T **out, size_t count) {
    *out = static_cast<T *>(std::calloc(count + 1, sizeof(T)));
    return *out != nullptr;
}

lathe_status take_words(lathe_draco_carrier *out, const draco::Mesh &mesh) {
    std::vector<int32_t> words;
    if (!mesh.GetMetadata()) return LATHE_OK;
    if (mesh.GetMetadata()->GetEntryIntArray("lathe", &words)) {
        if (words.size() > UINT32_MAX / 4) return LATHE_ERR_LIMIT;
        if (!allocate(&out->words, words.size())) return LATHE_ERR_MEMORY;
        if (!words.empty()) std::memcpy(out->words, words.data(), words.size() * sizeof(int32_t));
        out->word_count = static_cast<uint32_t>(words.size());
    }
    words.clear();
    if (mesh.GetMetadata()->GetEntryIntArray("affine", &words)) {
        if (words.size() != 24) return LATHE_ERR_FORMAT;
        if (!allocate(&out->affine, 12)) return LATHE_ERR_MEMORY;
        std::memcpy(out->affine, words.data(), 12 * sizeof(double));
    }
    return LATHE_OK;
}

lathe_status take(lathe_draco_carrier *out, const draco::Mesh &mesh) {
    out->vertex_count = mesh.num_points();
    out->triangle_count = mesh.num_faces();
    for (int k = 0; k < 2; k++) {
        const draco::PointAttribute *attribute = mesh.GetNamedAttribute(CARRIED[k]);
        if (!attribute || attribute->num_components() != 1) return LATHE_ERR_FORMAT;
        if (!allocate(&out->value[k], out->vertex_count)) return LATHE_ERR_MEMORY;
        for (uint32_t v = 0; v < out->vertex_count; v++)
            if (!attribute->ConvertValue<int32_t>(attribute->mapped_index(draco::PointIndex(v)), 1, out->value[k] + v))
                return LATHE_ERR_FORMAT;
    }
    if (!allocate(&out->triangles, size_t{3} * out->triangle_count)) return LATHE_ERR_MEMORY;
    for (uint32_t t = 0; t < out->triangle_count; t++)
        for (int k = 0; k < 3; k++) {
            const uint32_t v = mesh.face(draco::FaceIndex(t))[k].value();
            if (v >= out->vertex_count) return LATHE_ERR_FORMAT;
            out->triangles[size_t{3} * t + k] = v;
        }
    return take_words(out, mesh);
}

lathe_status unpack(lathe_draco_carrier *out, const uint8_t *bytes, size_t size) {
    draco::DecoderBuffer buffer;
    buffer.Init(reinterpret_cast<const char *>(bytes), size);
    auto type = draco::Decoder::GetEncodedGeometryType(&buffer);
    if (!type.ok() || type.value() != draco::TRIANGULAR_MESH) return LATHE_ERR_FORMAT;
    draco::Decoder decoder;
    auto result = decoder.DecodeMeshFromBuffer(&buffer);
    if (!result.ok()) return LATHE_ERR_FORMAT;
    const std::unique_ptr<draco::Mesh> mesh = std::move(result).value();
    if (!mesh || mesh->num_points() / 256 > size || mesh->num_faces() / 512 > size) return LATHE_ERR_LIMIT;
    return take(out, *mesh);
}

} // namespace

extern "C" void lathe__draco_carrier_free(lathe_draco_carrier *carrier) {
    std::free(carrier->triangles);
    for (int k = 0; k < 2; k++) std::free(carrier->value[k]);
    std::free(carrier->words);
    std::free(carrier->affine);
    *carrier = lathe_draco_carrier{};
}

extern "C" lathe_status lathe__draco_pack(uint8_t **out, size_t *size, const lathe_draco_carrier *carrier) {
    if (carrier->triangle_count > INT32_MAX / 3 || carrier->vertex_count > INT32_MAX / 3) return LATHE_ERR_LIMIT;
    try {
        return pack(out, size, *carrier);
    } catch (const std::bad_alloc &) { return LATHE_ERR_MEMORY; } catch (...) {
        return LATHE_ERR_UNSUPPORTED;
    }
}

extern "C" lathe_status lathe__draco_unpack(lathe_draco_carrier *out, const uint8_t *bytes, size_t size) {
    lathe_draco_carrier carrier{};
    lathe_status status = LATHE_ERR_FORMAT;
    try {
        status = unpack(&carrier, bytes, size);
    } catch (const std::bad_alloc &) { status = LATHE_ERR_MEMORY; } catch (...) {
    }
    if (status)
        lathe__draco_carrier_free(&carrier);
    else
        *out = carrier;
    return status;
}

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
