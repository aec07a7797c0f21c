// Decodes a .drc with Draco's own decoder and prints what is in it; with a binary STL of the same surface also how far
// the two sets of vertices are apart (the worse direction): draco_check FILE.drc [FILE.stl]. Exit 1 if the deviation is
// more than rounding to 11 bits allows, or the number of triangles differs.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <draco/compression/decode.h>
#include <fstream>
#include <iterator>
#include <map>
#include <vector>

using Point = std::array<float, 3>;
using Cell = std::array<long, 3>;

static std::vector<char> read_all(const char *path) {
    std::ifstream in(path, std::ios::binary);
    return std::vector<char>(std::istreambuf_iterator<char>(in), {});
}

static double distance(const Point &a, const Point &b) {
    return std::hypot(double(a[0]) - b[0], double(a[1]) - b[1], double(a[2]) - b[2]);
}

// Points by cubes of an edge length; a point's nearest within that length is in the 27 cubes around it.
class Grid {
  public:
    Grid(const std::vector<Point> &points, double edge) : edge_(edge) {
        for (const Point &p : points) cells_[cell(p)].push_back(p);
    }
    double nearest(const Point &p) const {
        double best = INFINITY;
        const Cell c = cell(p);
        for (int i = 0; i < 27; i++) {
            const auto found = cells_.find({c[0] + i % 3 - 1, c[1] + i / 3 % 3 - 1, c[2] + i / 9 - 1});
            if (found == cells_.end()) continue;
            for (const Point &q : found->second) best = std::min(best, distance(p, q));
        }
        return best;
    }

  private:
    Cell cell(const Point &p) const {
        return {long(std::floor(p[0] / edge_)), long(std::floor(p[1] / edge_)), long(std::floor(p[2] / edge_))};
    }
    double edge_;
    std::map<Cell, std::vector<Point>> cells_;
};

static double one_sided(const std::vector<Point> &from, const std::vector<Point> &to, double edge) {
    const Grid grid(to, edge);
    double worst = 0;
    for (const Point &p : from) worst = std::max(worst, grid.nearest(p));
    return worst;
}

static std::vector<Point> stl_points(const std::vector<char> &stl, uint32_t *triangles) {
    std::vector<Point> points;
    if (stl.size() < 84) return points;
    std::memcpy(triangles, stl.data() + 80, 4);
    if (stl.size() != 84 + size_t{50} * *triangles) return points;
    for (size_t t = 0; t < *triangles; t++)
        for (size_t k = 0; k < 3; k++) {
            Point p;
            std::memcpy(p.data(), stl.data() + 84 + 50 * t + 12 * (k + 1), 12);
            points.push_back(p);
        }
    std::sort(points.begin(), points.end());
    points.erase(std::unique(points.begin(), points.end()), points.end());
    return points;
}

static double largest_side(const std::vector<Point> &points) {
    double side = 0;
    for (size_t i = 0; i < 3; i++) {
        auto less = [i](const Point &a, const Point &b) { return a[i] < b[i]; };
        const auto ends = std::minmax_element(points.begin(), points.end(), less);
        side = std::max(side, double((*ends.second)[i]) - (*ends.first)[i]);
    }
    return side;
}

int main(int argc, char **argv) {
    const int bits = 11;
    if (argc < 2) return std::fprintf(stderr, "usage: draco_check FILE.drc [FILE.stl]\n"), 2;
    const std::vector<char> bytes = read_all(argv[1]);
    draco::DecoderBuffer buffer;
    buffer.Init(bytes.data(), bytes.size());
    draco::Decoder decoder;
    auto result = decoder.DecodeMeshFromBuffer(&buffer);
    if (!result.ok()) return std::fprintf(stderr, "%s: %s\n", argv[1], result.status().error_msg()), 1;
    const std::unique_ptr<draco::Mesh> mesh = std::move(result).value();
    const draco::PointAttribute *attribute = mesh->GetNamedAttribute(draco::GeometryAttribute::POSITION);
    if (!attribute) return std::fprintf(stderr, "%s: no positions\n", argv[1]), 1;
    std::vector<Point> points(mesh->num_points());
    for (uint32_t i = 0; i < mesh->num_points(); i++) attribute->GetMappedValue(draco::PointIndex(i), points[i].data());
    std::printf("%s: %zu bytes, %u vertices, %u triangles", argv[1], bytes.size(), mesh->num_points(),
                mesh->num_faces());
    if (argc < 3) return std::puts(""), 0;

    uint32_t triangles = 0;
    const std::vector<Point> original = stl_points(read_all(argv[2]), &triangles);
    if (original.empty()) return std::fprintf(stderr, "\n%s: not a binary STL\n", argv[2]), 1;
    // Rounding to a grid moves a point by at most half of a cell's diagonal; a little more for floats.
    const double step = largest_side(original) / double((1 << bits) - 1),
                 allowed = step * std::sqrt(3.0) / 2 * 1.01 + 1e-4;
    const double worst = std::max(one_sided(points, original, 2 * allowed), one_sided(original, points, 2 * allowed));
    std::printf(", max deviation %.6f mm (rounding allows %.6f)\n", worst, allowed);
    return worst <= allowed && mesh->num_faces() == triangles ? 0 : 1;
}
