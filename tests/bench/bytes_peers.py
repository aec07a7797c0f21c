"""What somebody would send instead of Lathe's stream: decimated meshes under Draco and meshoptimizer, and the voxel mask."""
import json, math, os, subprocess
from multiprocessing import get_context
import numpy as np
import bench
from bytes_distance import arrays_of, read_mesh, write_mesh

WORST, BEST = 4.0, 0.05     # voxels: decimated meshes outside are left out
SPACING = 3                 # of so many decimated meshes one is measured, all of them near a target
LARGE = 200_000             # triangles of a large surface
LADDER = (4.0, 2.0, 1.0, 0.5, 0.25, 0.125)   # errors of the levels that a chain of meshes would have
state = {}                  # what forked workers inherit


def fractions(step, first=0.5, last=0.0005):
    """Falling, each `step` times the one before"""
    return [first * step ** i for i in range(int(math.log(last / first) / math.log(step)) + 1)]


def tool(folder, name, *arguments):
    done = subprocess.run([os.path.join(folder, name), *map(str, arguments)], capture_output=True, text=True)
    if done.returncode: raise SystemExit(f"{name}: {done.stderr.strip()}")
    return [json.loads(line) for line in done.stdout.splitlines()]


# ---- decimated meshes ---------------------------------------------------------------------------------------------------


def lindstrom_turk(tools, mesh, folder, wanted):
    last = math.inf
    for row in tool(tools, "lindstrom_turk", mesh, os.path.join(folder, "turk"), ",".join(f"{f:.6g}" for f in wanted)):
        if row["triangles"] >= last: return      # nothing more can be collapsed
        last = row["triangles"]
        yield "Lindstrom-Turk", row["fraction"], row["path"]


def quadric(surface, folder, wanted):
    """VTK's quadric decimation, each mesh from the one before it. Points at one place are merged first: it stalls on them"""
    import vtk
    merged = vtk.vtkCleanPolyData()
    merged.SetInputData(surface)
    merged.Update()
    surface = merged.GetOutput()
    full, last = surface.GetNumberOfPolys(), math.inf
    for i, fraction in enumerate(wanted):
        decimation = vtk.vtkQuadricDecimation()
        decimation.SetInputData(surface)
        decimation.SetTargetReduction(max(0.0, 1 - fraction * full / max(1, surface.GetNumberOfPolys())))
        decimation.Update()
        surface = decimation.GetOutput()
        if not 4 <= surface.GetNumberOfPolys() <= 0.98 * last: return
        last = surface.GetNumberOfPolys()
        path = os.path.join(folder, f"quadric{i}.mesh")
        write_mesh(path, *arrays_of(surface))
        yield "quadric", fraction, path


def sensible_bits(error, extent):
    """Grids whose own error is neither lost in the mesh's nor far above it: three or four"""
    return [b for b in range(4, 15) if 0.15 * error < extent / 2 ** b / 12 ** 0.5 < 2 * error]


def measure_mesh(job):
    """One decimated mesh at every sensible quantisation"""
    how, fraction, path = job
    reference, samples, tools = state["reference"], state["samples"], state["tools"]
    mesh = read_mesh(path)
    if len(mesh[1]) < 4: return []
    exact = reference.error(*mesh[:2], samples // 2)["rms"]
    if not BEST <= exact <= WORST: return []
    bits = sensible_bits(exact * reference.voxel, reference.extent)
    rows = []
    for row in tool(tools, "peer_codecs", path, path + ".", ",".join(map(str, bits))) if bits else []:
        error = reference.error(*read_mesh(row["path"])[:2], samples)
        os.unlink(row["path"])
        for codec, name in (("draco", "Draco"), ("meshopt", "meshoptimizer + zstd")):
            rows.append({"peer": f"{how} + {name}", "fraction": fraction, "bits": row["bits"], "triangles": row["triangles"],
                         "bytes": row[codec], **error})
    return rows


def near_targets(rows, meshes, targets):
    """Of finely spaced decimated meshes those beside the best ones so far, so that no peer loses by the spacing"""
    found = set()
    for how, jobs in meshes.items():
        at = {fraction: i for i, (_, fraction, _) in enumerate(jobs)}
        for best in filter(None, (smallest(rows, target, f"{how} + {codec}") for target in targets for codec in ("Draco", "meshopt"))):
            beside = (at[best["fraction"]] + offset for offset in (-1, 1, 2))
            found |= {jobs[i] for i in beside if 0 < i < len(jobs) and i % SPACING}
    return sorted(found)


def decimations(reference, tools, folder, step):
    """{how: [(how, fraction, path)]} with fractions falling. Quadric decimation of large surfaces is slow and never the best
    there: it is not followed closely"""
    full, fine = os.path.join(folder, "full.mesh"), fractions(step ** (1 / SPACING))
    write_mesh(full, *arrays_of(reference.surface))
    small = reference.surface.GetNumberOfPolys() < LARGE
    return {"Lindstrom-Turk": list(lindstrom_turk(tools, full, folder, fine)),
            "quadric": list(quadric(reference.surface, folder, fine if small else fine[::SPACING]))}


def sweep(reference, tools, folder, effort, targets):
    """Every peer: decimation x codec x quantisation, each with its bytes and two-sided error; closer together at the targets"""
    samples, meshes = effort.peer_samples, decimations(reference, tools, folder, effort.step)
    state.update(reference=reference, samples=samples, tools=tools)
    reference.sample(samples), reference.sample(samples // 2)
    with get_context("fork").Pool(effort.processes) as pool:
        measured = lambda jobs: [row for found in pool.imap(measure_mesh, jobs, 1) for row in found]
        rows = measured([job for jobs in meshes.values() for job in jobs[::SPACING]])
        return rows + measured(near_targets(rows, meshes, targets))


def smallest(rows, error, what=""):
    """The row with the fewest bytes at no more than an RMS error, of peers whose name has `what`; None if there is none"""
    return min((r for r in rows if r["rms"] <= error and what in r["peer"]), key=lambda r: r["bytes"], default=None)


def envelope(rows, what):
    """Fewest bytes over error, errors rising: [(rms, bytes)]"""
    lowest, found = math.inf, []
    for row in sorted((r for r in rows if what in r["peer"]), key=lambda r: (r["rms"], r["bytes"])):
        if row["bytes"] < lowest:
            lowest = row["bytes"]
            found.append((row["rms"], row["bytes"]))
    return found


def levels_summed(rows):
    """A client that gets separate meshes of falling error, one after the other, pays for all of them"""
    total, found, last = 0, [], None
    for error in LADDER:
        best = smallest(rows, error, "Draco")
        if best is None: break
        if best is last: continue
        total, last = total + best["bytes"], best
        found.append((best["rms"], total))
    return found


# ---- the mask -----------------------------------------------------------------------------------------------------------


def smoothed_mask(volume):
    """What a receiver of the mask makes of it: the surface at the middle, smoothed as VTK does it by default for masks"""
    import vtk
    from bytes_volumes import moved
    every = vtk.vtkAppendPolyData()
    for low, mask in volume.masks():
        every.AddInputData(bench.flying_edges(mask, 0.5, 0, low[::-1])[0])
    smooth = vtk.vtkWindowedSincPolyDataFilter()
    smooth.SetInputConnection(every.GetOutputPort())
    smooth.SetNumberOfIterations(15)
    smooth.SetPassBand(0.1)
    smooth.NormalizeCoordinatesOn()
    smooth.Update()
    return moved(smooth.GetOutput(), volume.affine)


def plain_mask(volume):
    import vtk
    from bytes_volumes import moved
    every = vtk.vtkAppendPolyData()
    for low, mask in volume.masks(): every.AddInputData(bench.flying_edges(mask, 0.5, 0, low[::-1])[0])
    every.Update()
    return moved(every.GetOutput(), volume.affine)


def mask(volume, reference, tools, folder, samples):
    """Bytes of all masks, each with a fresh model and with one for all; the error that is left at the receiver, the better of the
    surface as it is and smoothed"""
    path, sizes = os.path.join(folder, "masks.raw"), []
    with open(path, "wb") as file:
        for _, voxels in volume.masks():
            file.write(np.ascontiguousarray(voxels).tobytes())
            sizes += voxels.shape[::-1]
    coded = tool(tools, "mask_model", path, *sizes)[0]
    errors = [reference.error(*arrays_of(surface(volume)), samples) for surface in (plain_mask, smoothed_mask)]
    return {**coded, **min(errors, key=lambda e: e["rms"])}
