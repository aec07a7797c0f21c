#!/usr/bin/python3
"""Measures Lathe against its peers on the scans of Debian's mricron-data and prints one table.

  bench.py [--lathe build/lathe] [--wasm build/wasm/lathe.wasm] [--keep DIR] [--quick] [--json FILE] [--markdown FILE] [--strict]

Peers, in the same run: VTK's flying edges on the same volume, and flying edges + quadric decimation to four levels. The error of
the last level is measured twice, by `lathe bake` and here with VTK, which knows nothing of Lathe. CPU seconds are user + system
of the process, all cores together. Needs Debian's python3-vtk9, python3-numpy and python3-nibabel; the wasm figures need node.
"""
import argparse, json, math, os, platform, resource, subprocess, sys, tempfile, urllib.parse, urllib.request
import numpy as np

HERE = os.path.dirname(os.path.abspath(__file__))
BUILD = os.path.normpath(os.path.join(HERE, "..", "..", "build"))
DATA = os.environ.get("LATHE_DEMO_DATA", "/usr/share/mricron/templates")
SCANS = {
    "ch2bet": {"file": "ch2bet.nii.gz", "bake": ["--iso", "46.5"], "iso": 46.5, "rms": 0.15, "max": 1.5, "stream": 50_000},
    "aal": {"file": "aal.nii.gz", "bake": ["--labels", "all"], "iso": None, "rms": 0.25, "max": 2.0, "stream": 113_000},
}
PIPELINE_FRACTIONS = (0.5, 0.1, 0.02, 0.004)  # triangles of the four decimated levels, each made from the one before it
FINE = 0.25                                   # voxel: a level with this RMS is as good as the full one to the eye
PAGE_STRUCTURE = "Thalamus_L"                 # the atlas' left thalamus
PAGE_LIMIT = 18 * 1024
RUNS = 5                                      # of what is timed: the median counts
SAMPLES = 100_000                             # points on each surface, evenly by area
STREAM_NAMES = ("bytes", "level")


# ---- clocks -------------------------------------------------------------------------------------------------------------


def run(command):
    """(CPU seconds of the process, standard output, exit status)"""
    with tempfile.TemporaryFile() as out, tempfile.TemporaryFile() as errors:
        child = subprocess.Popen(command, stdout=out, stderr=errors)
        _, status, usage = os.wait4(child.pid, 0)
        child.returncode = os.waitstatus_to_exitcode(status)
        out.seek(0), errors.seek(0)
        if child.returncode not in (0, 1): sys.exit(f"{' '.join(command)}: exit {child.returncode}: {errors.read().decode().strip()}")
        return usage.ru_utime + usage.ru_stime, out.read(), child.returncode


def output(command):
    _, out, status = run(command)
    if status: sys.exit(f"{' '.join(command)}: exit {status}")
    return out


def median(values): return sorted(values)[len(values) // 2]


class Clock:
    """CPU seconds of this process, all threads"""
    def now(self):
        r = resource.getrusage(resource.RUSAGE_SELF)
        return r.ru_utime + r.ru_stime

    def __enter__(self):
        self.start = self.now()
        return self

    def __exit__(self, *_): self.seconds = self.now() - self.start


# ---- peers --------------------------------------------------------------------------------------------------------------


def flying_edges(array, iso, low, origin):
    """(closed isosurface in voxels, median CPU seconds)"""
    import vtk
    from vtk.util.numpy_support import numpy_to_vtk
    padded = np.ascontiguousarray(np.pad(array, 1, constant_values=low))   # closes the surface at the border
    image = vtk.vtkImageData()
    image.SetDimensions(padded.shape[::-1])
    image.SetOrigin([o - 1 for o in origin])
    image.GetPointData().SetScalars(numpy_to_vtk(padded.ravel(), deep=1))
    edges = vtk.vtkFlyingEdges3D()
    edges.SetInputData(image)
    edges.SetValue(0, iso)
    for off in (edges.ComputeNormalsOff, edges.ComputeGradientsOff, edges.ComputeScalarsOff): off()
    seconds = []
    for _ in range(RUNS):
        edges.Modified()
        with Clock() as clock: edges.Update()
        seconds.append(clock.seconds)
    return edges.GetOutput(), median(seconds)


def decimate(surface):
    """CPU seconds of four levels"""
    import vtk
    full = surface.GetNumberOfPolys()
    with Clock() as clock:
        for fraction in PIPELINE_FRACTIONS:
            quadric = vtk.vtkQuadricDecimation()
            quadric.SetInputData(surface)
            quadric.SetTargetReduction(max(0, 1 - fraction * full / max(1, surface.GetNumberOfPolys())))
            quadric.Update()
            surface = quadric.GetOutput()
    return clock.seconds


def peer(path, iso):
    """The isosurface in world mm; CPU seconds of flying edges, and of flying edges with four decimated levels; all labels one
    by one, each in its own box, if iso is None"""
    import nibabel, vtk
    scan = nibabel.load(path)
    array = np.ascontiguousarray(np.squeeze(np.asanyarray(scan.dataobj)).transpose(2, 1, 0))
    every, isosurfaces, pipeline = vtk.vtkAppendPolyData(), 0.0, 0.0
    jobs = [(array, iso, array.min(), (0, 0, 0))] if iso is not None else label_boxes(array)
    for job in jobs:
        surface, seconds = flying_edges(*job)
        every.AddInputData(surface)
        isosurfaces += seconds
        pipeline += seconds + decimate(surface)
    world, moved = vtk.vtkTransform(), vtk.vtkTransformPolyDataFilter()
    world.SetMatrix(scan.affine.ravel())
    every.Update()
    moved.SetInputData(every.GetOutput())
    moved.SetTransform(world)
    moved.Update()
    return {"surface": moved.GetOutput(), "flying_edges": isosurfaces, "pipeline": pipeline}


def label_boxes(array):
    for label in (v for v in np.unique(array) if v):
        at = np.nonzero(array == label)
        low, high = [int(a.min()) for a in at], [int(a.max()) + 1 for a in at]
        yield (array[tuple(map(slice, low, high))] == label).astype(np.uint8), 0.5, 0, low[::-1]


# ---- distance between two surfaces, by VTK ------------------------------------------------------------------------------


def corners(surface):
    """(triangles, 3 corners, 3)"""
    from vtk.util.numpy_support import vtk_to_numpy
    points = vtk_to_numpy(surface.GetPoints().GetData()).astype(float)
    return points[vtk_to_numpy(surface.GetPolys().GetConnectivityArray()).reshape(-1, 3)]


def even_samples(surface, count):
    """Points on the triangles, spread evenly by area; the same ones each time"""
    random = np.random.default_rng(1)
    triangles = corners(surface)
    areas = np.linalg.norm(np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]), axis=1)
    steps = (np.arange(count) + random.random(count)) / count              # stratified: one in each share of the area
    chosen = triangles[np.minimum(np.searchsorted(np.cumsum(areas) / areas.sum(), steps), len(triangles) - 1)]
    s, t = np.sqrt(random.random(count))[:, None], random.random(count)[:, None]
    return chosen[:, 0] * (1 - s) + chosen[:, 1] * (s * (1 - t)) + chosen[:, 2] * (s * t)


def distances(points, surface):
    import vtk
    locator = vtk.vtkStaticCellLocator()
    locator.SetDataSet(surface)
    locator.BuildLocator()
    nearest, cell, part, cell_id, squared = [0.0] * 3, vtk.vtkGenericCell(), vtk.reference(0), vtk.reference(0), vtk.reference(0.0)
    found = np.empty(len(points))
    for i, point in enumerate(points.tolist()):
        locator.FindClosestPoint(point, nearest, cell, cell_id, part, squared)
        found[i] = squared.get()
    return np.sqrt(found)


def two_sided(a, b):
    ways = [distances(even_samples(x, SAMPLES), y) for x, y in ((a, b), (b, a))]
    return {"rms": max(float(math.sqrt((d ** 2).mean())) for d in ways), "max": max(float(d.max()) for d in ways)}


def exported(lathe, archive, level):
    """A level as VTK reads it"""
    import vtk
    with tempfile.TemporaryDirectory() as folder:
        path = os.path.join(folder, "level.ply")
        output([lathe, "export", archive, "--level", str(level), "-o", path])
        reader = vtk.vtkPLYReader()
        reader.SetFileName(path)
        reader.Update()
        return reader.GetOutput()


# ---- lathe --------------------------------------------------------------------------------------------------------------


class Server:
    """`lathe serve` of one archive on the loopback"""
    def __init__(self, lathe, archive):
        self.process = subprocess.Popen([lathe, "serve", archive, "--port", "0", "--quiet"], stdout=subprocess.PIPE,
                                        stderr=subprocess.DEVNULL, text=True)
        self.address = self.process.stdout.readline().split()[-1]
        self.model = os.path.basename(archive)[: -len(".lathe")]

    def __enter__(self): return self

    def __exit__(self, *_):
        self.process.terminate()
        self.process.wait()

    def body_size(self, path, **headers):
        with urllib.request.urlopen(urllib.request.Request(self.address + path, headers=headers)) as reply:
            size = len(reply.read())
            if headers.get("Accept-Encoding", "identity") != reply.headers.get("Content-Encoding", "identity"):
                sys.exit(f"{path}: not encoded as asked")
            return size

    def page(self, structure):
        return self.body_size(f"/m/{self.model}?structure={urllib.parse.quote(structure)}", **{"Accept-Encoding": "br"})

    def stream(self, to): return self.body_size(f"/models/{self.model}/stream?from=0&to={to}")


def first_fine(levels, voxel):
    """Bytes of the stream up to the first level at a quarter voxel, and that level"""
    total = 0
    for level in levels:
        total += level["polar_bytes"]
        if level["error_rms_mm"] is not None and level["error_rms_mm"] <= FINE * voxel: return total, level["level"]
    return None, None


def smallest_spacing(path):
    import nibabel
    return float(min(nibabel.load(path).header.get_zooms()[:3]))


def bake_seconds(lathe, volume, scan, path, *options):
    command = [lathe, "bake", volume, *scan["bake"], "--quiet", "-o", path, *options]
    seconds = []
    for _ in range(RUNS):
        spent, _, status = run(command)
        if status: sys.exit(f"{' '.join(command)}: exit {status}")
        seconds.append(spent)
    return median(seconds)


def page_decoder(info, wasm):
    """The decoder that the page of a model carries, beside the whole one"""
    name = {"whole": "lathe"}.get(info["decoder"], info["decoder"])
    return os.path.join(os.path.dirname(wasm), name + ".wasm")


def measure(name, scan, lathe, wasm, folder, quick):
    volume = os.path.join(DATA, scan["file"])
    archive, other = os.path.join(folder, f"{name}.lathe"), os.path.join(folder, f"{name}-timed.lathe")
    result = {"voxel": smallest_spacing(volume),
              "bake": bake_seconds(lathe, volume, scan, other, "--no-errors", "--no-draco"),
              "bake_errors": bake_seconds(lathe, volume, scan, other, "--no-draco")}
    output([lathe, "bake", volume, *scan["bake"], "--quiet", "-o", archive])
    result["info"] = json.loads(output([lathe, "info", "--json", archive]))
    result["verify"] = json.loads(run([lathe, "verify", "--json", archive, volume])[1] or b"{}")
    result["draco"] = len(output([lathe, "export", archive, "--format", "drc", "-o", "-"]))
    # One after the other and twice, so that a busy moment of the machine does not decide.
    speed = [(json.loads(output([lathe, "bench", "decode", archive, "--json"])),
              json.loads(output(["node", "--single-threaded", os.path.join(HERE, "decode_wasm.mjs"), archive, page_decoder(result["info"], wasm)]))) for _ in range(2)]
    result["native"] = min((n for n, _ in speed), key=lambda n: n["seconds"])
    result["native"]["all_levels_seconds"] = min(n["all_levels_seconds"] for n, _ in speed)
    result["wasm"] = {**speed[0][1], **{k: min(w[k] for _, w in speed) for k in ("seconds", "all_levels_seconds")}}
    result["hashes"] = output([lathe, "hash", "--each", archive]).decode().split()
    with Server(lathe, archive) as server:
        result["fine"] = dict(zip(STREAM_NAMES, first_fine(result["info"]["levels"], result["voxel"])))
        if result["fine"]["bytes"]: result["fine"]["fetched"] = server.stream(result["fine"]["level"])
        result["page"] = server.page(PAGE_STRUCTURE) if name == "aal" else None
    last = exported(lathe, archive, "last")
    box = last.GetBounds()
    result["diagonal"] = math.dist(box[::2], box[1::2])
    if not quick:
        peers = peer(volume, scan["iso"])
        surface = peers.pop("surface")
        result.update(peers, peer_triangles=surface.GetNumberOfPolys(), distance=two_sided(surface, last))
    return result


# ---- the table: (what, measured, must, holds or None) -------------------------------------------------------------------


def level_rows(name, scan, r):
    levels, voxel = r["info"]["levels"], r["voxel"]
    rms = [l["error_rms_mm"] / voxel for l in levels]
    falls = [a / b for a, b in zip(rms, rms[1:])]
    first = name == "ch2bet"
    yield "levels", str(len(levels)), ">= 5" if first else "", len(levels) >= 5 if first else None
    yield "RMS of each level (voxel)", " ".join(f"{e:.3f}" for e in rms), "", None
    yield "RMS falls from each to the next by", " ".join(f"{f:.2f}" for f in falls), ">= 1.5", min(falls, default=0) >= 1.5
    share = 100 * levels[0]["error_rms_mm"] / r["diagonal"]
    yield "level 0: RMS / diagonal", f"{share:.2f} % of {r['diagonal']:.0f} mm", "<= 5 %", share <= 5
    must = f"<= {scan['rms']}, {scan['max']}"
    reach = lambda rms, most: rms <= scan["rms"] and most <= scan["max"]
    own = [levels[-1][k] / voxel for k in ("error_rms_mm", "error_max_mm")]
    yield "last level: RMS, max (voxel)", f"{own[0]:.3f}, {own[1]:.3f}", must, reach(*own)
    if "distance" in r:
        by_vtk = [r["distance"][k] / voxel for k in ("rms", "max")]
        yield "the same, measured by VTK", f"{by_vtk[0]:.3f}, {by_vtk[1]:.3f}", must, reach(*by_vtk)


def check_rows(r):
    structures = r["verify"].get("structures", [])
    good = sum(all(l["passed"] for l in s["levels"]) for s in structures)
    yield "verify with the volume, structures", f"{good} of {len(structures)} pass at every level", "all", bool(r["verify"].get("passed"))
    counts = {}
    for s in structures:
        for l in s["levels"]: counts[l["level"]] = counts.get(l["level"], 0) + l["self_intersections"]
    listed = [counts[n] for n in sorted(counts)]
    yield "self-intersections of each level", " ".join(map(str, listed)), "last: 0", bool(listed) and listed[-1] == 0


def size_rows(scan, r):
    levels, fine = r["info"]["levels"], r["fine"]
    total = sum(l["polar_bytes"] for l in levels)
    if fine["bytes"]:
        as_said = "as fetched" if fine["fetched"] == fine["bytes"] else f"but fetched: {fine['fetched']}"
        yield f"stream to RMS <= {FINE} voxel", f"{fine['bytes']:,} B, {as_said} (level {fine['level']})", f"<= {scan['stream']:,} B", \
            fine["fetched"] == fine["bytes"] <= scan["stream"]
    else: yield f"stream to RMS <= {FINE} voxel", "no level", f"<= {scan['stream']:,} B", False
    yield "the last level in Draco, 11 bit", f"{r['draco']:,} B = {r['draco'] / total:.1f} x our {total:,} B", "", None
    base = levels[0]["polar_bytes"]
    yield "level 0 / total", f"{base:,} / {total:,} B = 1/{total / base:.1f}", "<= 1/8", base * 8 <= total
    if r["page"]: yield f"page + wasm + level 0 of {PAGE_STRUCTURE}", f"{r['page']:,} B brotli", f"<= {PAGE_LIMIT:,} B", r["page"] <= PAGE_LIMIT


def bake_rows(name, r):
    plain, full = f"{r['bake']:.2f} s CPU", f"{r['bake_errors']:.2f} s CPU"
    if "pipeline" not in r:
        yield "bake without errors, Draco", plain, "", None
        yield "bake with errors, without Draco", full, "", None
        return
    ratio, checked = r["bake"] / r["flying_edges"], name == "ch2bet"
    yield "bake without errors, Draco", f"{plain} = {ratio:.1f} x flying edges ({r['flying_edges']:.3f} s)", \
        "<= 20 x" if checked else "", ratio <= 20 if checked else None
    share = r["bake_errors"] / r["pipeline"]
    yield "bake with errors, without Draco", f"{full} = {share:.2f} x flying edges + decimation ({r['pipeline']:.1f} s)", "<= 0.25 x", share <= 0.25


def decode_rows(name, r):
    native, wasm, checked = r["native"], r["wasm"], name == "ch2bet"
    speed = native["triangles"] / native["seconds"]
    yield "decode to the mesh, native", f"{speed / 1e6:.2f} M triangles/s ({native['triangles']:,} in {1e3 * native['seconds']:.0f} ms)", \
        ">= 2 M/s" if checked else "", speed >= 2e6 if checked else None
    for what, key in (("last mesh only", "seconds"), ("mesh of every level", "all_levels_seconds")):
        slower = wasm[key] / native[key]
        yield f"wasm / native, {what}", f"{slower:.2f} x ({1e3 * wasm[key]:.0f} ms / {1e3 * native[key]:.0f} ms)", "<= 1.5 x", slower <= 1.5
    same = wasm["hashes"] == r["hashes"] and len(r["hashes"]) > 0
    yield "wasm's meshes", "identical (hash)" if same else "DIFFERENT", "identical", same


def rows(name, scan, r):
    yield from level_rows(name, scan, r)
    yield from check_rows(r)
    yield from size_rows(scan, r)
    yield from bake_rows(name, r)
    yield from decode_rows(name, r)


def verdict(holds): return "" if holds is None else "ok" if holds else "MISSED"


def print_table(name, table):
    print(f"\n{name}\n{'what':42} {'measured':62} {'must':15}")
    for what, measured, must, holds in table: print(f"{what:42} {measured:62} {must:15} {verdict(holds)}", flush=True)


def machine():
    model = next((l.split(":", 1)[1].strip() for l in open("/proc/cpuinfo") if l.startswith("model name")), platform.machine())
    system = next((l.split("=", 1)[1].strip().strip('"') for l in open("/etc/os-release") if l.startswith("PRETTY_NAME")), "Linux")
    return f"{os.cpu_count()} cores ({model}), {system}"


def markdown(tables):
    lines = [f"Measured by `make bench` on {machine()}:", "",
             f"| what | {' | '.join(tables)} | must |", "| --- |" + " --- |" * (len(tables) + 1)]
    named = {name: {row[0]: row for row in table} for name, table in tables.items()}
    for what in dict.fromkeys(what for table in tables.values() for what, *_ in table):
        found = [named[name].get(what) for name in tables]
        cells = [(row[1] + (" (**missed**)" if row[3] is False else "")) if row else "" for row in found]
        musts = list(dict.fromkeys(row[2] for row in found if row and row[2]))
        lines.append(f"| {what} | {' | '.join(cells)} | {'; '.join(musts)} |")
    return "\n".join(lines) + "\n"


def main():
    p = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    p.add_argument("--lathe", default=os.path.join(BUILD, "lathe"))
    p.add_argument("--wasm", default=os.path.join(BUILD, "wasm", "lathe.wasm"))
    p.add_argument("--keep", help="folder for the archives (default: a temporary one)")
    p.add_argument("--quick", action="store_true", help="without VTK's peers and distances")
    p.add_argument("--json", help="also write every figure there")
    p.add_argument("--markdown", help="also write the table there, as README has it")
    p.add_argument("--strict", action="store_true", help="exit status 1 if a figure is missed")
    a = p.parse_args()
    with tempfile.TemporaryDirectory() as temporary:
        folder = a.keep or temporary
        os.makedirs(folder, exist_ok=True)
        results, tables = {}, {}
        print(machine())
        for name, scan in SCANS.items():
            results[name] = measure(name, scan, a.lathe, a.wasm, folder, a.quick)
            tables[name] = list(rows(name, scan, results[name]))
            print_table(name, tables[name])
    missed = sum(row[3] is False for table in tables.values() for row in table)
    if a.json:
        listed = {n: [dict(zip(("what", "measured", "must", "holds"), row)) for row in t] for n, t in tables.items()}
        with open(a.json, "w") as file: json.dump({"machine": machine(), "table": listed, "figures": results}, file, indent=1)
    if a.markdown:
        with open(a.markdown, "w") as file: file.write(markdown(tables))
    print(f"\n{missed} of the figures missed" if missed else "\nall figures reached")
    return 1 if missed and a.strict else 0


if __name__ == "__main__":
    sys.exit(main())
