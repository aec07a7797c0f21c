// lindstrom_turk IN.mesh OUT-PREFIX FRACTION,FRACTION,...: CGAL's edge collapse with the costs of Lindstrom and Turk, a peer of the
// benchmark of bytes. Fractions of IN's triangles, falling; writes OUT-PREFIX<index>.mesh and one line of JSON for each. The costs
// keep no memory of earlier collapses, so going on from the fraction before equals starting from IN.
// A .mesh file: int32 vertices, int32 triangles, float32 xyz of each vertex, uint32 abc of each triangle.
#include <CGAL/Polygon_mesh_processing/orient_polygon_soup.h>
#include <CGAL/Polygon_mesh_processing/polygon_soup_to_polygon_mesh.h>
#include <CGAL/Simple_cartesian.h>
#include <CGAL/Surface_mesh.h>
#include <CGAL/Surface_mesh_simplification/Policies/Edge_collapse/Count_stop_predicate.h>
#include <CGAL/Surface_mesh_simplification/Policies/Edge_collapse/LindstromTurk_cost.h>
#include <CGAL/Surface_mesh_simplification/Policies/Edge_collapse/LindstromTurk_placement.h>
#include <CGAL/Surface_mesh_simplification/edge_collapse.h>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <string>
#include <vector>
#include "mesh_file.h"

namespace simplification = CGAL::Surface_mesh_simplification;
namespace processing = CGAL::Polygon_mesh_processing;
typedef CGAL::Simple_cartesian<double>::Point_3 Point;
typedef CGAL::Surface_mesh<Point> Mesh;

static Mesh half_edges(const mesh_file &file) {
    std::vector<Point> points;
    std::vector<std::vector<std::size_t>> triangles;
    for (std::size_t i = 0; i < file.positions.size(); i += 3)
        points.emplace_back(file.positions[i], file.positions[i + 1], file.positions[i + 2]);
    for (std::size_t i = 0; i < file.indices.size(); i += 3) {
        std::size_t a = file.indices[i], b = file.indices[i + 1], c = file.indices[i + 2];
        if (a != b && b != c && c != a) triangles.push_back({a, b, c});
    }
    processing::orient_polygon_soup(points, triangles);   // parts what is not manifold
    Mesh mesh;
    processing::polygon_soup_to_polygon_mesh(points, triangles, mesh);
    return mesh;
}

static mesh_file from_half_edges(const Mesh &mesh) {
    mesh_file file;
    std::vector<uint32_t> index(mesh.num_vertices());
    uint32_t count = 0;
    for (auto v : mesh.vertices()) {
        index[v] = count++;
        for (int k = 0; k < 3; k++) file.positions.push_back(static_cast<float>(mesh.point(v)[k]));
    }
    for (auto f : mesh.faces())
        for (auto v : vertices_around_face(mesh.halfedge(f), mesh)) file.indices.push_back(index[v]);
    return file;
}

int main(int argc, char **argv) {
    mesh_file file;
    if (argc != 4 || !read_mesh(&file, argv[1])) return fprintf(stderr, "lindstrom_turk IN.mesh OUT-PREFIX FRACTION,...\n"), 2;
    Mesh mesh = half_edges(file);
    double faces = static_cast<double>(mesh.number_of_faces());
    char *at = argv[3];
    for (int i = 0; *at; i++) {
        double fraction = strtod(at, &at);
        if (*at == ',') at++;
        simplification::Count_stop_predicate<Mesh> stop(static_cast<std::size_t>(fraction * faces * 1.5));   // edges
        simplification::edge_collapse(mesh, stop, CGAL::parameters::get_cost(simplification::LindstromTurk_cost<Mesh>())
                                                      .get_placement(simplification::LindstromTurk_placement<Mesh>()));
        mesh.collect_garbage();
        std::string path = argv[2] + std::to_string(i) + ".mesh";
        if (!write_mesh(from_half_edges(mesh), path.c_str())) return fprintf(stderr, "%s: cannot be written\n", path.c_str()), 1;
        std::size_t triangles = mesh.number_of_faces();
        printf("{\"fraction\": %g, \"triangles\": %zu, \"path\": \"%s\"}\n", fraction, triangles, path.c_str());
        fflush(stdout);
    }
    return 0;
}
