// cgal_check FILE.stl: merges the corners of a binary STL that have exactly the same float position and asks CGAL about the
// surface. Prints {"closed":bool,"self_intersections":N,"components":N,"outward":bool}: closed: every edge joins two triangles
// of one orientation and every vertex one fan; outward: the orientation is right for every component, cavities included.
// Exit 0: closed, outward, no self-intersection; 1: not; 2: not a binary STL.
#include <CGAL/Exact_predicates_inexact_constructions_kernel.h>
#include <CGAL/Polygon_mesh_processing/connected_components.h>
#include <CGAL/Polygon_mesh_processing/orient_polygon_soup.h>
#include <CGAL/Polygon_mesh_processing/orientation.h>
#include <CGAL/Polygon_mesh_processing/polygon_soup_to_polygon_mesh.h>
#include <CGAL/Polygon_mesh_processing/self_intersections.h>
#include <CGAL/Surface_mesh.h>
#include <array>
#include <cstdint>
#include <cstdio>
#include <cstring>
#include <fstream>
#include <iterator>
#include <map>
#include <vector>

using Kernel = CGAL::Exact_predicates_inexact_constructions_kernel;
using Mesh = CGAL::Surface_mesh<Kernel::Point_3>;
namespace processing = CGAL::Polygon_mesh_processing;

struct Soup {
    std::vector<Kernel::Point_3> points;
    std::vector<std::array<std::size_t, 3>> triangles;
};

static bool read_stl(Soup &soup, const char *path) {
    std::ifstream file(path, std::ios::binary);
    std::vector<char> bytes((std::istreambuf_iterator<char>(file)), {});
    if (bytes.size() < 84) return false;
    std::uint32_t count;
    std::memcpy(&count, bytes.data() + 80, 4);
    if (bytes.size() != 84 + 50 * static_cast<std::size_t>(count)) return false;
    std::map<std::array<float, 3>, std::size_t> known;
    for (std::uint32_t i = 0; i < count; i++) {
        std::array<std::size_t, 3> triangle;
        for (int corner = 0; corner < 3; corner++) {
            std::array<float, 3> p;
            std::memcpy(p.data(), bytes.data() + 84 + 50 * static_cast<std::size_t>(i) + 12 + 12 * corner, 12);
            auto [at, added] = known.emplace(p, soup.points.size());
            if (added) soup.points.emplace_back(p[0], p[1], p[2]);
            triangle[corner] = at->second;
        }
        soup.triangles.push_back(triangle);
    }
    return true;
}

int main(int argc, char **argv) {
    Soup soup;
    if (argc != 2 || !read_stl(soup, argv[1])) {
        std::fprintf(stderr, "usage: cgal_check BINARY.stl\n");
        return 2;
    }
    // It must be right as it is; what is not is torn apart at the faults, only so that it can be counted.
    bool manifold = processing::is_polygon_soup_a_polygon_mesh(soup.triangles);
    if (!manifold) processing::orient_polygon_soup(soup.points, soup.triangles);
    Mesh mesh;
    processing::polygon_soup_to_polygon_mesh(soup.points, soup.triangles, mesh);
    std::vector<std::pair<Mesh::Face_index, Mesh::Face_index>> pairs;
    processing::self_intersections(faces(mesh), mesh, std::back_inserter(pairs));
    auto component = mesh.add_property_map<Mesh::Face_index, std::size_t>("f:component").first;
    std::size_t components = processing::connected_components(mesh, component);
    bool closed = manifold && CGAL::is_closed(mesh);
    bool outward =
        closed && processing::is_outward_oriented(mesh) && (!pairs.empty() || processing::does_bound_a_volume(mesh));
    std::printf("{\"closed\":%s,\"self_intersections\":%zu,\"components\":%zu,\"outward\":%s}\n",
                closed ? "true" : "false", pairs.size(), components, outward ? "true" : "false");
    return closed && outward && pairs.empty() ? 0 : 1;
}
