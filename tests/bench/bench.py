#!/usr/bin/python3
"""Measures Lathe against its baselines on the scans of Debian's mricron-data and prints one table.

  bench.py [--lathe build/lathe] [--keep DIR] [--quick] [--json FILE]

Baselines in the same run: VTK's flying edges on the same volume (python3-vtk9), and flying edges + quadric decimation to four
levels. CPU seconds are of the process and of its children, all cores together. Needs python3-vtk9, python3-numpy,
python3-nibabel; the wasm figures need node.
"""
import argparse, json, os, resource, subprocess, sys, tempfile, urllib.request
import numpy as np

DATA = os.environ.get("LATHE_DEMO_DATA", "/usr/share/mricron/templates")
SCANS = {
    "ch2bet": {"file": "ch2bet.nii.gz", "bake": ["--iso", "46.5"], "iso": 46.5, "rms": 0.15, "max": 1.5, "stream": 50_000},
    "aal": {"file": "aal.nii.gz", "bake": ["--labels", "all"], "iso": None, "rms": 0.25, "max": 2.0, "stream": 113_000},
}
FRACTIONS = (0.5, 0.25, 0.1, 0.03)          # the four decimated levels of the baseline
PAGE_STRUCTURE = "Thalamus_L"
QUARTER_VOXEL = 0.25                        # mm: both scans have voxels of 1 mm


def cpu(who):
    r = resource.getrusage(who)
    return r.ru_utime + r.ru_stime


def timed(command):
    """(CPU seconds, standard output) of a command"""
    start = cpu(resource.RUSAGE_CHILDREN)
    done = subprocess.run(command, capture_output=True, text=True)
    if done.returncode: sys.exit(f"{' '.join(command)}: exit {done.returncode}: {done.stderr.strip()}")
    return cpu(resource.RUSAGE_CHILDREN) - start, done.stdout


class Clock:
    def __enter__(self):
        self.start = cpu(resource.RUSAGE_SELF)
        return self

    def __exit__(self, *_):
        self.seconds = cpu(resource.RUSAGE_SELF) - self.start


# ---- baseline -----------------------------------------------------------------------------------------------------------


def flying_edges(array, iso, low):
    import vtk
    from vtk.util.numpy_support import numpy_to_vtk
    padded = np.ascontiguousarray(np.pad(array, 1, constant_values=low))   # closes the surface at the border
    image = vtk.vtkImageData()
    image.SetDimensions(padded.shape[::-1])
    image.GetPointData().SetScalars(numpy_to_vtk(padded.ravel(), deep=1))
    edges = vtk.vtkFlyingEdges3D()
    edges.SetInputData(image)
    edges.SetValue(0, iso)
    for off in (edges.ComputeNormalsOff, edges.ComputeGradientsOff, edges.ComputeScalarsOff): off()
    seconds = []
    for _ in range(3):
        edges.Modified()
        with Clock() as clock: edges.Update()
        seconds.append(clock.seconds)
    return edges.GetOutput(), sorted(seconds)[1]


def decimate(surface):
    import vtk
    with Clock() as clock:
        for fraction in FRACTIONS:
            quadric = vtk.vtkQuadricDecimation()
            quadric.SetInputData(surface)
            quadric.SetTargetReduction(1 - fraction)
            quadric.Update()
    return clock.seconds


def baseline(path, iso):
    """CPU seconds of flying edges, and of flying edges with four decimated levels"""
    import nibabel
    array = np.ascontiguousarray(np.squeeze(np.asanyarray(nibabel.load(path).dataobj)).transpose(2, 1, 0))
    if iso is not None:
        surface, seconds = flying_edges(array, iso, array.min())
        return seconds, seconds + decimate(surface)
    isosurfaces = pipeline = 0.0
    for label in (v for v in np.unique(array) if v):
        at = np.nonzero(array == label)
        box = tuple(slice(int(a.min()), int(a.max()) + 1) for a in at)
        surface, seconds = flying_edges((array[box] == label).astype(np.uint8), 0.5, 0)
        isosurfaces += seconds
        pipeline += seconds + decimate(surface)
    return isosurfaces, pipeline


# ---- lathe --------------------------------------------------------------------------------------------------------------


def first_fine(levels):
    """Bytes of the stream up to the first level at a quarter voxel, and that level"""
    total = 0
    for level in levels:
        total += level["polar_bytes"]
        if level["error_rms_mm"] is not None and level["error_rms_mm"] <= QUARTER_VOXEL: return total, level["level"]
    return None, None


def diagonal(lathe, archive):
    """mm, of the box of the last level"""
    stl = subprocess.run([lathe, "export", archive, "--format", "stl", "-o", "-"], capture_output=True, check=True).stdout
    corners = np.frombuffer(stl[84:], np.dtype([("xyz", "<f4", (4, 3)), ("rest", "<u2")]))["xyz"][:, 1:].reshape(-1, 3)
    return float(np.linalg.norm(corners.max(0) - corners.min(0)))


def wasm_speed(archive):
    """Seconds and hashes by the viewer's decoder, where node is"""
    script = os.path.join(os.path.dirname(os.path.abspath(__file__)), "decode_wasm.mjs")
    return json.loads(timed(["node", script, archive])[1])


def page_bytes(lathe, archive, structure):
    """Bytes on the wire, brotli, of the page with one structure's level 0 inlined"""
    server = subprocess.Popen([lathe, "serve", archive, "--port", "0"], stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)
    try:
        address = server.stdout.readline().split()[-1]
        model = os.path.basename(archive)[: -len(".lathe")]
        request = urllib.request.Request(f"{address}/m/{model}?structure={structure}", headers={"Accept-Encoding": "br"})
        with urllib.request.urlopen(request) as reply: return len(reply.read())
    finally:
        server.terminate()
        server.wait()


def measure(name, scan, lathe, folder, quick):
    volume = os.path.join(DATA, scan["file"])
    archive = os.path.join(folder, f"{name}.lathe")
    bake = [lathe, "bake", volume, *scan["bake"], "--quiet", "-o"]
    plain, _ = timed([*bake, os.path.join(folder, f"{name}-plain.lathe"), "--no-errors", "--no-draco"])
    errors, _ = timed([*bake, os.path.join(folder, f"{name}-errors.lathe"), "--no-draco"])
    timed([*bake, archive])
    info = json.loads(timed([lathe, "info", "--json", archive])[1])
    verify = subprocess.run([lathe, "verify", "--json", archive, volume], capture_output=True, text=True)
    decode = json.loads(timed([lathe, "bench", "decode", archive, "--json"])[1])
    fast, pipeline = (None, None) if quick else baseline(volume, scan["iso"])
    return {"bake": plain, "bake_errors": errors, "info": info, "verify": json.loads(verify.stdout or "{}"), "decode": decode,
            "flying_edges": fast, "pipeline": pipeline, "wasm": wasm_speed(archive), "diagonal": diagonal(lathe, archive),
            "hashes": timed([lathe, "hash", "--each", archive])[1].split(),
            "page": page_bytes(lathe, archive, PAGE_STRUCTURE) if name == "aal" else None}


# ---- the table ----------------------------------------------------------------------------------------------------------


def rows(name, scan, r):
    """(what, measured, must, holds or None)"""
    levels = r["info"]["levels"]
    yield "levels", str(len(levels)), ">= 5" if name == "ch2bet" else "", name != "ch2bet" or len(levels) >= 5
    rms = [l["error_rms_mm"] for l in levels]
    falls = [a / b for a, b in zip(rms, rms[1:]) if a and b]
    yield "RMS of each level (mm)", " ".join(f"{e:.3f}" for e in rms if e is not None), "", None
    yield "RMS falls by, at least", f"{min(falls, default=0):.2f} x", ">= 1.5 x", min(falls, default=0) >= 1.5
    share = 100 * rms[0] / r["diagonal"]
    yield "level 0, RMS of the diagonal", f"{share:.2f} % of {r['diagonal']:.0f} mm", "<= 5 %", share <= 5
    last = levels[-1]
    yield "last level, RMS (voxel)", f"{last['error_rms_mm']:.3f}", f"<= {scan['rms']}", last["error_rms_mm"] <= scan["rms"]
    yield "last level, max (voxel)", f"{last['error_max_mm']:.3f}", f"<= {scan['max']}", last["error_max_mm"] <= scan["max"]
    size, level = first_fine(levels)
    yield "stream to RMS <= 0.25 voxel", f"{size} B (level {level})", f"<= {scan['stream']} B", size is not None and size <= scan["stream"]
    if size and levels[level]["draco_bytes"]:
        yield "  the same level in Draco, 11 bit", f"{levels[level]['draco_bytes']} B, {levels[level]['draco_bytes'] / size:.2f} x", "", None
    total = sum(l["polar_bytes"] for l in levels)
    yield "bytes of level 0 / total", f"{levels[0]['polar_bytes']} / {total}", "<= 1/8", levels[0]["polar_bytes"] * 8 <= total
    structures = r["verify"].get("structures", [])
    yield "verify with the volume", "passed" if r["verify"].get("passed") else "FAILED", "passed", bool(r["verify"].get("passed"))
    counts = {}
    for s in structures:
        for l in s["levels"]: counts[l["level"]] = counts.get(l["level"], 0) + l["self_intersections"]
    yield "self-intersections by level", " ".join(str(counts[n]) for n in sorted(counts)), "last: 0", None
    must = 20
    ratio = f" = {r['bake'] / r['flying_edges']:.1f} x flying edges ({r['flying_edges']:.2f} s)" if r["flying_edges"] else ""
    checked = name == "ch2bet" and r["flying_edges"]
    yield "bake, no errors, no Draco", f"{r['bake']:.2f} s{ratio}", f"<= {must} x" if checked else "", \
        r["bake"] <= must * r["flying_edges"] if checked else None
    if r["pipeline"]:
        yield "bake with errors, no Draco", f"{r['bake_errors']:.2f} s = {r['bake_errors'] / r['pipeline']:.3f} x pipeline ({r['pipeline']:.1f} s)", \
            "<= 0.25 x", r["bake_errors"] <= r["pipeline"] / 4
    else: yield "bake with errors, no Draco", f"{r['bake_errors']:.2f} s", "", None
    speed = r["decode"]["triangles_per_second"]
    yield "decode, native", f"{speed / 1e6:.2f} M triangles/s", ">= 2 M" if name == "ch2bet" else "", speed >= 2e6 if name == "ch2bet" else None
    slower = r["wasm"]["seconds"] / r["decode"]["seconds"]
    yield "decode, wasm / native", f"{slower:.2f} x ({r['wasm']['seconds']:.3f} s)", "<= 1.5 x", slower <= 1.5
    same = r["wasm"]["hashes"] == r["hashes"]
    yield "wasm's meshes", "identical" if same else "DIFFERENT", "identical", same
    if r["page"]: yield f"page, wasm, level 0 of {PAGE_STRUCTURE}", f"{r['page']} B brotli", "<= 18432 B", r["page"] <= 18432


def main():
    p = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    p.add_argument("--lathe", default="build/lathe")
    p.add_argument("--keep", help="folder for the archives (default: a temporary one)")
    p.add_argument("--quick", action="store_true", help="without the baselines of VTK")
    p.add_argument("--json", help="also write every figure there")
    a = p.parse_args()
    with tempfile.TemporaryDirectory() as temporary:
        folder = a.keep or temporary
        os.makedirs(folder, exist_ok=True)
        results, broken = {}, 0
        for name, scan in SCANS.items():
            results[name] = measure(name, scan, a.lathe, folder, a.quick)
            print(f"\n{name}\n{'what':34} {'measured':60} {'must':12}")
            for what, measured, must, holds in rows(name, scan, results[name]):
                mark = "" if holds is None else "ok" if holds else "MISSED"
                broken += holds is False
                print(f"{what:34} {measured:60} {must:12} {mark}", flush=True)
        if a.json: json.dump(results, open(a.json, "w"), indent=1)
    print(f"\n{broken} of the figures missed" if broken else "\nall figures reached")


if __name__ == "__main__":
    main()
