"""The volumes of the benchmark of bytes: two scans of Debian's mricron-data, and smooth shapes computed here. Each has a reference
surface: the trilinear isosurface by VTK's flying edges, or the dense polar mesh that a star-shaped volume was made from."""
import json, os
import numpy as np
import bench

STEEP = 24          # grey values for each voxel of distance; 128 is the surface
RAY_STEP = 1 / 8    # voxel, when a scan's outermost crossing is looked for
HEAD_SKIN = 30      # grey value between air and skin in ch2


class Volume:
    """name; path for `lathe bake` with its options; iso, or None for every label apart; kind: smooth, folded or star; reference:
    a function that gives the surface as VTK has it, world mm"""
    def __init__(self, name, path, options, iso, kind, reference=None):
        self.name, self.path, self.options, self.iso, self.kind = name, path, options, iso, kind
        self.array, self.affine = load(path)
        self.voxel = float(np.linalg.norm(self.affine[:3, :3], axis=0).min())
        self.reference = reference or (lambda: isosurface(self.array, self.affine, self.iso))

    def masks(self):
        """Each structure's voxels, in its own box"""
        whole = [self.array >= self.iso] if self.iso is not None else [self.array == label for label in np.unique(self.array) if label]
        for mask in whole:
            at = np.nonzero(mask)
            yield tuple(int(a.min()) for a in at), mask[tuple(slice(int(a.min()), int(a.max()) + 1) for a in at)].astype(np.uint8)


def load(path):
    """(array [z, y, x], matrix from voxel index to world mm)"""
    if path.endswith(".json"):
        with open(path) as file: sidecar = json.load(file)
        values = np.fromfile(os.path.join(os.path.dirname(path), sidecar["file"]), sidecar["dtype"])
        return values.reshape(sidecar["dims"][::-1]), np.diag([*sidecar["spacing"], 1.0])
    import nibabel
    scan = nibabel.load(path)
    return np.ascontiguousarray(np.squeeze(np.asanyarray(scan.dataobj)).transpose(2, 1, 0)), np.asarray(scan.affine, float)


def isosurface(array, affine, iso):
    import vtk
    every = vtk.vtkAppendPolyData()
    for job in [(array, iso, array.min(), (0, 0, 0))] if iso is not None else bench.label_boxes(array):
        every.AddInputData(bench.flying_edges(*job)[0])
    every.Update()
    return moved(every.GetOutput(), affine)


def moved(surface, affine):
    import vtk
    world, move = vtk.vtkTransform(), vtk.vtkTransformPolyDataFilter()
    world.SetMatrix(np.asarray(affine, float).ravel())
    move.SetInputData(surface)
    move.SetTransform(world)
    move.Update()
    return move.GetOutput()


def save(folder, name, values):
    """A raw volume of 1 mm voxels and its sidecar: the sidecar's path"""
    path = os.path.join(folder, name + ".json")
    np.ascontiguousarray(values).tofile(os.path.join(folder, name + ".raw"))
    with open(path, "w") as file:
        json.dump({"file": name + ".raw", "dims": values.shape[::-1], "dtype": str(values.dtype), "spacing": [1, 1, 1]}, file)
    return path


def grey(inside):
    """Grey values of signed distances in voxels, positive inside"""
    return np.rint(np.clip(128 + STEEP * inside, 0, 255)).astype(np.uint8)


# ---- star-shaped: an image of radii, over slices and rays ---------------------------------------------------------------


def directions(rays): return np.arange(rays) * (2 * np.pi / rays)


def bilinear(slice_values, x, y):
    x0, y0 = np.floor(x).astype(int), np.floor(y).astype(int)
    height, width = slice_values.shape
    def at(i, j):
        known = (i >= 0) & (i < width) & (j >= 0) & (j < height)
        return np.where(known, slice_values[np.clip(j, 0, height - 1), np.clip(i, 0, width - 1)], 0.0)
    fx, fy = x - x0, y - y0
    return (at(x0, y0) * (1 - fx) + at(x0 + 1, y0) * fx) * (1 - fy) + (at(x0, y0 + 1) * (1 - fx) + at(x0 + 1, y0 + 1) * fx) * fy


def outermost(array, iso, rays, own_centres):
    """(radii [slices, rays], centres [slices, 2]) of the slices that reach iso: each ray's last crossing, from the medians of the
    slice's pixels or from the mean of those; lightly smoothed: twice 1 2 1 along both axes"""
    filled = [k for k in range(len(array)) if (array[k] >= iso).any()]
    shown = array[filled[0]:filled[-1] + 1].astype(float)
    centres = np.array([[np.median(a) for a in np.nonzero(s >= iso)[::-1]] for s in shown])
    if not own_centres: centres[:] = centres.mean(0)
    reach, angle = np.arange(0, np.hypot(*shown.shape[1:]), RAY_STEP), directions(rays)[:, None]
    radii = []
    for values, (x, y) in zip(shown, centres):
        inside = bilinear(values, x + reach * np.cos(angle), y + reach * np.sin(angle)) >= iso
        last = inside.shape[1] - 1 - np.argmax(inside[:, ::-1], axis=1)
        radii.append(np.where(inside.any(axis=1), reach[last] + RAY_STEP / 2, RAY_STEP))
    radii = np.array(radii)
    for _ in range(2):
        radii = (np.roll(radii, 1, 1) + 2 * radii + np.roll(radii, -1, 1)) / 4
        rows = np.pad(radii, ((1, 1), (0, 0)), "edge")
        radii = (rows[:-2] + 2 * rows[1:-1] + rows[2:]) / 4
    return radii, centres


def star_volume(radii, centres):
    """Grey values of a radius image, two empty slices at both ends; and the centres in it"""
    reach = int(np.ceil(radii.max() + np.abs(centres - centres.mean(0)).max())) + 4
    y, x = np.mgrid[-reach:reach + 1, -reach:reach + 1]
    slices, rays = radii.shape
    values = np.zeros((slices + 4, *x.shape), np.uint8)
    for k, (cx, cy) in enumerate(centres - centres.mean(0)):
        turn = np.mod(np.arctan2(y - cy, x - cx), 2 * np.pi) * (rays / (2 * np.pi))
        ray = np.floor(turn).astype(int) % rays
        part = turn - np.floor(turn)
        surface = radii[k][ray] * (1 - part) + radii[k][(ray + 1) % rays] * part
        values[k + 2] = grey(surface - np.hypot(x - cx, y - cy))
    return values, centres - centres.mean(0) + reach


def polar_mesh(radii, centres):
    """The dense mesh of a radius image in the frame of its volume: strips between slices; the ends rise as the values between the
    last slice and the empty one beyond say, then a fan"""
    slices, rays = radii.shape
    depths = (5.3, 3.5, 2.0, 1.0, 0.4)
    rise = lambda depth: STEEP * depth / (128 + STEEP * depth)      # where 128 is met on the way to 0
    rows = [(0, np.minimum(d, radii[0]), -1) for d in depths] + [(k, 0 * radii[k], 0) for k in range(slices)] + \
        [(slices - 1, np.minimum(d, radii[-1]), 1) for d in depths[::-1]]
    angle, points = directions(rays), []
    for k, depth, side in rows:
        r = radii[k] - depth
        points.append(np.stack([centres[k, 0] + r * np.cos(angle), centres[k, 1] + r * np.sin(angle), k + 2 + side * rise(depth)], 1))
    ends = [[*centres[0], points[0][:, 2].min()], [*centres[-1], points[-1][:, 2].max()]]
    first, after = np.arange(rays), np.roll(np.arange(rays), -1)
    triangles = []
    for row in range(len(rows) - 1):
        a, b, c, d = (i + rays * j for j in (row, row + 1) for i in (first, after))
        triangles += [np.stack([a, b, d], 1), np.stack([a, d, c], 1)]
    last = rays * len(rows)
    triangles += [np.stack([after, first, 0 * first + last], 1), np.stack([first + last - rays, after + last - rays, 0 * first + last + 1], 1)]
    return np.concatenate([*points, np.array(ends)]), np.concatenate(triangles)


def star(folder, name, array, iso, rays, own_centres):
    from bytes_distance import surface_of
    radii, centres = outermost(array, iso, rays, own_centres)
    values, at = star_volume(radii, centres)
    return Volume(name, save(folder, name, values), ["--iso", "128"], 128, "star", lambda: surface_of(*polar_mesh(radii, at)))


# ---- smooth ------------------------------------------------------------------------------------------------------------


def twisted_column(slices=96, long=30.0, thick=7.0, degrees=3.0, rays=256):
    """Two crossed bars that turn from slice to slice"""
    angle = directions(rays)[None, :] - np.radians(degrees) * np.arange(slices)[:, None]
    def bar(turn): return np.minimum(long / np.maximum(np.abs(np.cos(angle - turn)), 1e-9), thick / np.maximum(np.abs(np.sin(angle - turn)), 1e-9))
    return star_volume(np.maximum(bar(np.pi / 4), bar(-np.pi / 4)), np.zeros((slices, 2)))[0]


def to_segment(p, a, b):
    a, b = np.array(a, float), np.array(b, float)
    t = np.clip(((p - a) @ (b - a)) / ((b - a) @ (b - a)), 0, 1)
    return np.linalg.norm(p - a - t[..., None] * (b - a), axis=-1)


def torso(slices=144):
    """A trunk with waist and shoulders; inside it a vessel that parts into two, as a cavity"""
    y, x = np.mgrid[-56:57, -76:77]
    values = np.zeros((slices + 4, *x.shape), np.uint8)
    for k in range(slices):
        h = k / (slices - 1)
        wide, deep = 56 - 9 * np.sin(np.pi * h) + 10 * h ** 3, 36 - 5 * np.sin(np.pi * h) + 4 * h
        p = np.hypot(x / wide, y / deep)
        gradient = np.hypot(x / wide ** 2, y / deep ** 2) / np.maximum(p, 1e-9)
        trunk = np.where(p > 1e-6, (1 - p) / np.maximum(gradient, 1e-9), deep)
        at = np.stack([x, y, 0 * x + k], -1).astype(float)
        fork = (4, 6, 0.45 * slices)
        tubes = ((4, 2, 10), fork, 11), (fork, (-22, 4, slices - 14), 8), (fork, (27, 8, slices - 20), 7.5)
        vessel = np.min([to_segment(at, a, b) - r for a, b, r in tubes], axis=0)
        values[k + 2] = grey(np.minimum(trunk, vessel))
    return values


# ---- all of them -------------------------------------------------------------------------------------------------------

ABOUT = {
    "ch2bet": "A brain, mricron-data's ch2bet at 46.5, against its trilinear isosurface.",
    "aal": "116 labels of an atlas, each against the isosurface of its own 0/1 mask at 0.5; one mesh for all.",
    "torso": "Computed: a trunk with waist and shoulders, and in it a vessel that parts into two, as a cavity. Grey values of signed "
             "distance, against their trilinear isosurface.",
    "xcolumn": "Computed: two crossed bars, 60 x 14 voxels, that turn by 3 degrees a slice for 96 slices. As above.",
    "head": "mricron-data's ch2 at 30: the outermost crossing on each of 256 rays of each slice, lightly smoothed, made a volume of "
            "signed distances; against the dense polar mesh of the radii.",
    "thalamus": "Label 77 of the atlas made a star in the same way, 128 rays.",
}
NAMES = tuple(ABOUT)


def open_volume(name, folder):
    data = lambda file: os.path.join(bench.DATA, file)
    if name == "ch2bet": return Volume(name, data("ch2bet.nii.gz"), ["--iso", "46.5"], 46.5, "folded")
    if name == "aal": return Volume(name, data("aal.nii.gz"), ["--labels", "all"], None, "folded")
    if name == "torso": return Volume(name, save(folder, name, torso()), ["--iso", "128"], 128, "smooth")
    if name == "xcolumn": return Volume(name, save(folder, name, twisted_column()), ["--iso", "128"], 128, "smooth")
    if name == "head": return star(folder, name, load(data("ch2.nii.gz"))[0], HEAD_SKIN, 256, False)
    if name == "thalamus": return star(folder, name, (load(data("aal.nii.gz"))[0] == 77).astype(float), 0.5, 128, True)
    raise KeyError(name)
