"""Two-sided distance between surfaces by VTK, which knows nothing of Lathe: points spread evenly by area on each surface, from each
the nearest point of the other; the worse direction counts."""
import os
os.environ.setdefault("VTK_SMP_BACKEND_IN_USE", "Sequential")   # threads of VTK do not survive a fork
import math
import numpy as np
import bench


def surface_of(points, triangles):
    import vtk
    from vtk.util.numpy_support import numpy_to_vtk, numpy_to_vtkIdTypeArray
    surface, at, cells = vtk.vtkPolyData(), vtk.vtkPoints(), vtk.vtkCellArray()
    at.SetData(numpy_to_vtk(np.ascontiguousarray(points, np.float32), deep=1))
    cells.SetData(3, numpy_to_vtkIdTypeArray(np.ascontiguousarray(triangles, np.int64).ravel(), deep=1))
    surface.SetPoints(at)
    surface.SetPolys(cells)
    return surface


def arrays_of(surface):
    from vtk.util.numpy_support import vtk_to_numpy
    return vtk_to_numpy(surface.GetPoints().GetData()), vtk_to_numpy(surface.GetPolys().GetConnectivityArray()).reshape(-1, 3)


def write_mesh(path, points, triangles):
    with open(path, "wb") as file:
        np.array([len(points), len(triangles)], "<i4").tofile(file)
        np.ascontiguousarray(points, "<f4").tofile(file)
        np.ascontiguousarray(triangles, "<u4").tofile(file)


def read_mesh(path):
    """(points, triangles, what follows them as uint32)"""
    with open(path, "rb") as file:
        vertices, count = np.fromfile(file, "<i4", 2)
        points = np.fromfile(file, "<f4", 3 * vertices).reshape(-1, 3)
        return points, np.fromfile(file, "<u4", 3 * count).reshape(-1, 3), np.fromfile(file, "<u4")


class Locator:
    def __init__(self, surface):
        import vtk
        self.locator = vtk.vtkStaticCellLocator()
        self.locator.SetDataSet(surface)
        self.locator.BuildLocator()

    def distances(self, points):
        import vtk
        nearest, cell, part, cell_id, squared = [0.0] * 3, vtk.vtkGenericCell(), vtk.reference(0), vtk.reference(0), vtk.reference(0.0)
        found = np.empty(len(points))
        for i, point in enumerate(points.tolist()):
            self.locator.FindClosestPoint(point, nearest, cell, cell_id, part, squared)
            found[i] = squared.get()
        return np.sqrt(found)


class Reference:
    """A surface that others are compared with; errors in voxels"""
    def __init__(self, surface, voxel):
        self.surface, self.voxel, self.locator, self.samples = surface, voxel, Locator(surface), {}
        self.extent = max(b - a for a, b in zip(surface.GetBounds()[::2], surface.GetBounds()[1::2]))

    def sample(self, count):
        if count not in self.samples: self.samples[count] = bench.even_samples(self.surface, count)
        return self.samples[count]

    def error(self, points, triangles, count):
        """{"rms", "max"} of the worse direction; count points on each surface"""
        other = surface_of(points, triangles)
        ways = self.locator.distances(bench.even_samples(other, count)), Locator(other).distances(self.sample(count))
        return {"rms": max(math.sqrt((d ** 2).mean()) for d in ways) / self.voxel, "max": max(float(d.max()) for d in ways) / self.voxel}
