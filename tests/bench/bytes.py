#!/usr/bin/python3
"""Bytes over error: Lathe's stream against what somebody would send instead, on the same volumes, in the same run.

  bytes.py [--lathe build/lathe] [--wasm build/wasm/lathe.wasm] [--tools build/release/tests/bench/peers] [--volumes NAME,...]
           [--volume FILE [--iso V]] [--peers JSON] [--quick] [--json FILE] [--markdown FILE] [--plots DIR] [--strict]

Errors are two-sided RMS in voxels against a reference surface, the worse direction, measured by VTK. Bytes of Lathe are all that a
client has fetched when it stands at the error: header, heads of level records, packets, checksums. It may stop behind any pass.
Peers: Lindstrom-Turk (CGAL) and quadric (VTK) decimation, each mesh under Draco and under meshoptimizer + zstd at every sensible
quantisation; the fewest bytes at no greater error count. Their levels summed: separate meshes of falling error, one after the other.
The voxel mask under a mixed 3D context model. `make bench-bytes` builds the tools and runs this.
"""
import argparse, functools, json, math, os, subprocess, sys, tempfile, time
from multiprocessing import get_context
sys.dont_write_bytecode = True
import numpy as np
import bytes_distance as distance
import bench, bytes_peers as peers, bytes_plot as plot, bytes_volumes as volumes

TARGETS = (1.0, 0.5, 0.25)
FINE = 0.25
BITS_FINEST = 0.1
MOST_WASM = 12 * 1024


def key(target): return f"{target:g}"   # as JSON has it


class Effort:
    """How closely to look"""
    def __init__(self, quick):
        self.samples = 40_000 if quick else 100_000        # points on each surface, for Lathe
        self.peer_samples = 12_000 if quick else 20_000    # for each of the many peers
        self.step = 0.5 if quick else 0.72                 # from one decimated mesh to the next
        self.names = ("ch2bet", "torso", "xcolumn", "head", "thalamus") if quick else volumes.NAMES
        self.processes = min(4, os.cpu_count() or 1)


# ---- Lathe's stream -------------------------------------------------------------------------------------------------------


class Stream:
    """What `lathe bench bytes` tells, and the meshes that a client has after each pass"""
    def __init__(self, volume, lathe, folder, repeats):
        self.archive = os.path.join(folder, "stream.lathe")
        command = [lathe, "bench", "bytes", volume.path, *volume.options, "--json", "--meshes", folder, "-o", self.archive, "--repeat", str(repeats)]
        self.report = json.loads(bench.output(command))
        self.levels, self.passes, self.folder = self.report["levels"], self.report["passes"], folder
        self.ends = [i for i, p in enumerate(self.passes) if i + 1 == len(self.passes) or self.passes[i + 1][0] != p[0]]

    def mesh(self, at):
        level, number = self.passes[at][:2]
        return distance.read_mesh(os.path.join(self.folder, f"level{level}.pass{number}.mesh"))[:2]

    def bytes(self, at): return self.passes[at][3]
    def payload(self, at): return sum(p[2] for p in self.passes[:at + 1])


class Curve:
    """A stream's error after each of its passes"""
    def __init__(self, stream, reference, samples):
        self.stream, self.reference, self.samples, self.errors = stream, reference, samples, {}

    def error(self, at): return self.errors[at]

    def look(self, at): return self.reference.error(*self.stream.mesh(at), self.samples)

    def measure(self, processes):
        self.reference.sample(self.samples)
        peers.state["curve"] = self
        with get_context("fork").Pool(processes) as pool: self.errors.update(pool.map(measure_place, range(len(self.stream.passes)), 1))

    def reach(self, target):
        """The first pass behind which the RMS is at most target, or None"""
        return next((p for p in sorted(self.errors) if self.errors[p]["rms"] <= target), None)

    def points(self): return [(self.errors[p]["rms"], self.stream.bytes(p)) for p in sorted(self.errors)]


def measure_place(at): return at, peers.state["curve"].look(at)


# ---- one volume -----------------------------------------------------------------------------------------------------------


def wasm_ratio(archive, lathe, wasm, seconds):
    """CPU time of the viewer's decoder over that of the native one, which takes about so many seconds: the better of two turns each,
    one after the other. None if that decoder cannot decode the archive"""
    native, browser = [], []
    runs = str(max(15, min(1000, round(0.25 / seconds))))
    for _ in range(2):
        native.append(json.loads(bench.output([lathe, "bench", "decode", archive, "--json", "--repeat", runs]))["seconds"])
        done = subprocess.run(["node", "--single-threaded", os.path.join(bench.HERE, "decode_wasm.mjs"), archive, wasm, runs], capture_output=True, text=True)
        if done.returncode: return None
        browser.append(json.loads(done.stdout)["seconds"])
    return min(browser) / min(native)


def single_rate(volume, lathe, folder):
    """Bytes of the last level alone, coded at once by the same coder"""
    command = [lathe, "bake", volume.path, *volume.options, "--levels", "1", "--no-errors", "--no-draco", "--json", "--quiet", "-o",
               os.path.join(folder, "single.lathe")]
    return sum(level["polar_bytes"] for level in json.loads(bench.output(command))["levels"])


def measure(volume, arguments, effort, folder, known):
    """known: an earlier result, whose peers and mask are taken; or None"""
    started = time.time()
    small = volume.kind != "folded"
    reference = distance.Reference(volume.reference(), volume.voxel)
    stream = Stream(volume, arguments.lathe, folder, 1000 if small else 3)
    curve = Curve(stream, reference, effort.samples)
    curve.measure(effort.processes)
    reached = {target: curve.reach(target) for target in TARGETS}
    rows = known["peers"] if known else peers.sweep(reference, arguments.tools, folder, effort, TARGETS)
    result = {"kind": volume.kind, "voxel_mm": volume.voxel, "reference_triangles": reference.surface.GetNumberOfPolys(),
              "levels": stream.levels, "decode": stream.report["decode"], "bake_cpu_seconds": stream.report["bake_cpu_seconds"]}
    for level, end in zip(result["levels"], stream.ends):
        level.update(stream_bytes=stream.bytes(end), vtk=curve.error(end))
    result["stream"] = [{"pass": p, "level": stream.passes[p][0], "bytes": stream.bytes(p), "payload": stream.payload(p), **e}
                        for p, e in sorted(curve.errors.items())]
    result["reached"] = {key(t): next(s for s in result["stream"] if s["pass"] == p) if p is not None else None for t, p in reached.items()}
    result["peers"] = sorted(rows, key=lambda r: r["bytes"])
    result["best_peer"] = {key(t): peers.smallest(rows, t) for t in TARGETS}
    result["mask"] = known["mask"] if known else peers.mask(volume, reference, arguments.tools, folder, effort.samples)
    if volume.kind == "folded": result["single_rate"] = single_rate(volume, arguments.lathe, folder)
    result["decoder"] = bench.page_decoder(json.loads(bench.output([arguments.lathe, "info", "--json", stream.archive])), arguments.wasm)
    result["wasm_ratio"] = wasm_ratio(stream.archive, arguments.lathe, result["decoder"], result["decode"]["seconds"])
    result["curves"] = curves(curve.points(), rows, result["mask"])
    result["seconds"] = round(time.time() - started, 1)
    return result


def curves(own, rows, mask):
    exact = ", no error (drawn at 0.001)" if mask["rms"] < 1e-3 else ""
    every = {"Lathe's stream": own, "best decimation + Draco": peers.envelope(rows, "Draco"),
             "its levels summed": peers.levels_summed(rows), "quadric decimation + Draco": peers.envelope(rows, "quadric + Draco"),
             "best decimation + meshoptimizer + zstd": peers.envelope(rows, "meshopt"),
             f"voxel mask, 3D contexts, fresh model each{exact}": [(mask["rms"], mask["apart"])]}
    if mask["together"] < mask["apart"]: every[f"voxel masks, one model for all{exact}"] = [(mask["rms"], mask["together"])]
    return {name: points for name, points in every.items() if points}


# ---- tables ---------------------------------------------------------------------------------------------------------------


def grid(head, rows):
    """Lines of text in columns, as Markdown reads them, too; words to the left, numbers to the right"""
    left = (0, head.index("measured")) if "measured" in head else (0,)
    cells = [head] + [[str(c) for c in row] for row in rows]
    wide = [max(len(row[i]) for row in cells) for i in range(len(head))]
    lines = ["| " + " | ".join(c.ljust(w) if i in left else c.rjust(w) for i, (c, w) in enumerate(zip(row, wide))) + " |" for row in cells]
    lines.insert(1, "| " + " | ".join("-" * w if i in left else "-" * (w - 1) + ":" for i, w in enumerate(wide)) + " |")
    return lines


def or_dash(value, form=",.0f"): return "-" if value is None else f"{value:{form}}"


def level_table(r):
    head = ["level", "polar B", "with headers", "stream B", "Draco delta B", "whole in Draco B", "triangles", "bit/new vertex", "RMS", "max"]
    return grid(head, [[l["level"], f"{l['payload']:,}", f"{l['fetched']:,}", f"{l['stream_bytes']:,}", or_dash(l["draco_delta"]), f"{l['draco']:,}",
                        f"{l['triangles']:,}", or_dash(l["bits_per_new_vertex"], ".3f"), f"{l['vtk']['rms']:.3f}", f"{l['vtk']['max']:.2f}"]
                       for l in r["levels"]])


def row_for(what, found):
    if found is None: return [what, "-", "-", "-"]
    return [what, f"{found['bytes']:,}", f"{found['rms']:.3f}", f"{found['max']:.2f}"]


def error_table(r):
    rows = []
    for target in TARGETS:
        rows.append(row_for(f"Lathe's stream, RMS <= {target:g}", r["reached"][key(target)]))
        for what, part in (("decimation + Draco", "Draco"), ("quadric + Draco", "quadric + Draco"), ("decimation + meshoptimizer + zstd", "meshopt")):
            best = peers.smallest(r["peers"], target, part)
            detail = f" ({best['peer'].split(' +')[0]}, {best['triangles']:,} triangles, {best['bits']} bit)" if best else ""
            rows.append(row_for(f"{what}{detail}, RMS <= {target:g}", best))
    summed = [p for p in r["curves"].get("its levels summed", []) if p[0] <= FINE]
    chain = {"bytes": summed[0][1], "rms": summed[0][0], "max": math.nan} if summed else None
    rows.append(row_for(f"separate meshes in Draco down to RMS <= {FINE:g}, summed", chain))
    mask = r["mask"]
    rows.append(row_for("voxel mask, fresh model for each", {**mask, "bytes": mask["apart"]}))
    if mask["together"] < mask["apart"]: rows.append(row_for("voxel masks, one model for all", {**mask, "bytes": mask["together"]}))
    return grid(["what", "bytes", "RMS", "max"], [[c.replace("nan", "-") for c in row] for row in rows])


# ---- the figures of the issue: (what, must, measured, holds or None) ---------------------------------------------------------


def ratio(own, other): return f"{own:,} / {other:,} B = {own / other:.2f} x"


def listed(found, form=".2f"): return ", ".join(f"{name} {value:{form}}" for name, value in found.items())


def against_peer(results, name, targets, limit):
    r = results.get(name)
    for target in targets if r else ():
        own, best = r["reached"][key(target)], r["best_peer"][key(target)]
        what = f"{name} at {target:g} voxel, against the best mesh peer"
        if own is None: yield what, f"<= {limit} x", f"RMS {target:g} is not reached", False
        elif best is None: yield what, f"<= {limit} x", "no peer reaches it", None
        else: yield what, f"<= {limit} x", ratio(own["bytes"], best["bytes"]), own["bytes"] <= limit * best["bytes"]


def against_mask(results, name):
    r = results.get(name)
    if not r: return
    total, mask = r["levels"][-1]["stream_bytes"], r["mask"]
    yield f"{name}, finest level, against the 3D-context mask", "<= 1.5 x", ratio(total, mask["apart"]), total <= 1.5 * mask["apart"]
    if mask["together"] < mask["apart"]:
        yield f"{name}, the same, one model for all masks", "", ratio(total, mask["together"]), None


def off_hull(results):
    """Ends of passes that lie above the lower convex hull of squared error over bytes: a client would rather stop before or behind them"""
    found = {}
    for name, r in results.items():
        if r["kind"] != "folded": continue
        points, hull = [(s["bytes"], s["rms"] ** 2) for s in r["stream"]], []
        for x, y in points:
            while len(hull) > 1 and (hull[-1][1] - hull[-2][1]) * (x - hull[-2][0]) >= (y - hull[-2][1]) * (hull[-1][0] - hull[-2][0]): hull.pop()
            hull.append((x, y))
        found[name] = len(points) - len(hull)
    if found: yield "ends of passes off the convex hull of squared error over bytes", "0", listed(found, "d"), max(found.values()) == 0


def overhead(results):
    found = {name: 100 * (r["levels"][-1]["stream_bytes"] / r["single_rate"] - 1) for name, r in results.items() if r.get("single_rate")}
    if found: yield "all levels against the last one coded at once, more bytes, %", "<= 3", listed(found, "+.1f"), max(found.values()) <= 3


def largest_errors(results):
    found = {n: r["reached"][key(FINE)]["max"] if r["reached"][key(FINE)] else math.inf for n, r in results.items()}
    yield f"largest error at {FINE:g} RMS, voxels", "<= 1.5", listed(found), max(found.values()) <= 1.5


def falling_bits(results):
    for name, r in results.items():
        if r["kind"] == "folded": continue
        must = r["kind"] == "smooth"      # the star-shaped ones have too few vertices at the finest level to be held to it
        bits = [l["bits_per_new_vertex"] for l in r["levels"] if l["bits_per_new_vertex"] is not None]
        falling = all(a >= b for a, b in zip(bits, bits[1:]))
        yield f"{name}: bits for each new vertex, coarse to fine", f"falling, <= {BITS_FINEST}" if must else "", " ".join(f"{b:.3f}" for b in bits), \
            falling and bits[-1] <= BITS_FINEST if must else None


def star_bytes(results, name, limit):
    if name not in results: return
    own = results[name]["reached"][key(FINE)]
    what = f"{name} at {FINE:g} voxel of its dense polar mesh, packets alone"
    if own is None: yield what, f"<= {limit} B", f"RMS {FINE:g} is not reached", False
    else:
        measured = f"{own['payload']:,} B (fetched with headers: {own['bytes']:,} B; RMS {own['rms']:.3f})"
        yield what, f"<= {limit} B", measured, own["payload"] <= limit


def decode_rows(results):
    for kind, least in (("smooth", 50), ("folded", 6)):
        decodings = {n: r["decode"] for n, r in results.items() if (r["kind"] == "folded") == (kind == "folded")}
        speeds = {n: 1e-6 * d["triangles"] / d["seconds_with_normals"] for n, d in decodings.items()}
        what = f"decode with normals, native, {kind}, M triangles/s"
        if speeds: yield what, f">= {least}", listed(speeds, ".1f"), min(speeds.values()) >= least
    ratios = {n: r["wasm_ratio"] for n, r in results.items()}
    texts = [f"{n} {'fails' if x is None else f'{x:.2f}'}" for n, x in ratios.items()]
    yield "decode without normals, wasm / native", "<= 1.4 x", ", ".join(texts), all(x is not None and x <= 1.4 for x in ratios.values())


def encode_share(results):
    """Planning tries codings, so it counts as encoding, though it also extracts the region"""
    for what, stages, must in (("planning and encoding", ("planning", "encoding"), 0.5), ("encoding alone", ("encoding",), None)):
        spent = {n: sum(r["bake_cpu_seconds"].get(stage, 0) for stage in stages) for n, r in results.items()}
        shares = {n: s / (sum(results[n]["bake_cpu_seconds"].values()) - s) for n, s in spent.items()}
        texts = [f"{n} {100 * share:.0f} % ({spent[n]:.2f} s)" for n, share in shares.items()]
        yield f"{what} / the bake's other stages, errors on", "<= 50 %" if must else "", ", ".join(texts), max(shares.values()) <= must if must else None


def draco_rows(results):
    ratios = {}
    for name, r in results.items():
        deltas = [l["draco_delta"] for l in r["levels"]]
        if None not in deltas: ratios[name] = sum(deltas) / r["levels"][-1]["draco"]
    if ratios: yield "Draco deltas / level N in one Draco", "<= 1.4 x", listed(ratios), max(ratios.values()) <= 1.4
    else: yield "Draco deltas / level N in one Draco", "<= 1.4 x", "no archive has Draco deltas", False


def wasm_size(path):
    script = "process.stdout.write(String(require('zlib').brotliCompressSync(require('fs').readFileSync(process.argv[1])).length))"
    return int(bench.output(["node", "-e", script, path]))


def decoder_sizes(results, wasm):
    """Of what decodes a model from its first byte to its last mesh: a page carries one file"""
    users = {}
    for name, r in results.items(): users.setdefault(r["decoder"], []).append(name)
    sizes = {path: wasm_size(path) for path in users}
    texts = [f"{os.path.basename(path)} {size:,} B ({', '.join(users[path])})" for path, size in sizes.items()]
    yield "the decoder of a model's page, wasm under brotli", f"<= {MOST_WASM:,} B", "; ".join(texts), max(sizes.values()) <= MOST_WASM
    yield "the decoder that reads kept topologies and archives of before, too", "", f"{wasm_size(wasm):,} B", None


def figures(results, wasm):
    yield from against_peer(results, "ch2bet", TARGETS, 1.0)
    yield from against_peer(results, "aal", (FINE,), 0.6)
    for name in ("torso", "xcolumn"): yield from against_peer(results, name, (FINE,), 0.5)
    for name in ("ch2bet", "aal"): yield from against_mask(results, name)
    yield from overhead(results)
    yield from off_hull(results)
    yield from largest_errors(results)
    yield from falling_bits(results)
    yield from star_bytes(results, "head", 900)
    yield from star_bytes(results, "thalamus", 130)
    yield from decode_rows(results)
    yield from encode_share(results)
    yield from draco_rows(results)
    yield from decoder_sizes(results, wasm)


def verdict(holds): return "" if holds is None else "met" if holds else "MISSED"


def figure_table(rows): return grid(["what", "must", "", "measured"], [[w, must, verdict(h), got] for w, must, got, h in rows])


# ---- out ------------------------------------------------------------------------------------------------------------------


def title(name, r): return f"{name}: bytes over error ({r['kind']}, {r['reference_triangles']:,} triangles in the reference)"


def introduction(effort, reused):
    note = " The peers are of an earlier run, by --peers." if reused else ""
    return [f"Measured by `make bench-bytes` on {bench.machine()}.", "",
            f"Two-sided errors in voxels, the worse direction, by VTK: {effort.samples:,} points on each surface for Lathe and the mask, "
            f"{effort.peer_samples:,} for each of the peers. Lathe's bytes are all that has been fetched, headers and checksums included; a "
            "client may stop behind any pass of a level. A peer's bytes are the smallest single file at no greater error. All labels of the atlas are one surface in both "
            "directions, for Lathe and for the peers." + note]


def markdown(results, rows, head, pictures):
    lines = ["# Bytes over error", "", *head, "", "## The figures", "", *figure_table(rows)]
    for name, r in results.items():
        lines += ["", f"## {name}", "", *([volumes.ABOUT[name], ""] if name in volumes.ABOUT else [])]
        if pictures: lines += [f"![bytes over error](img/bytes_{name}.svg)", ""]
        lines += [*level_table(r), "", *error_table(r)]
    return "\n".join(lines) + "\n"


def chosen(arguments, effort):
    """(name, function that opens the Volume, which may write into a folder)"""
    if arguments.volume:
        name = "given_" + os.path.basename(arguments.volume).split(".")[0]   # no figures are asked of it by its name
        options = ["--iso", str(arguments.iso)] if arguments.iso is not None else ["--labels", "all"]
        yield name, lambda _: volumes.Volume(name, arguments.volume, options, arguments.iso, "folded")
        return
    for name in arguments.volumes.split(",") if arguments.volumes else effort.names: yield name, functools.partial(volumes.open_volume, name)


def parse_arguments():
    p = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    p.add_argument("--lathe", default=os.path.join(bench.BUILD, "lathe"))
    p.add_argument("--wasm", default=os.path.join(bench.BUILD, "wasm", "lathe.wasm"))
    p.add_argument("--tools", default=os.path.join(bench.BUILD, "release", "tests", "bench", "peers"), help="folder of the peers' programs")
    p.add_argument("--volumes", help=f"some of {','.join(volumes.NAMES)}")
    p.add_argument("--volume", help="another volume: NIfTI, or the sidecar of a raw one")
    p.add_argument("--iso", type=float, help="its threshold; without one: all labels")
    p.add_argument("--peers", action="append", default=[], metavar="JSON", help="what --json wrote: the peers are taken from there, Lathe alone is "
                   "measured again")
    p.add_argument("--quick", action="store_true", help="fewer peers, fewer samples, no atlas")
    p.add_argument("--json", help="also write every figure there")
    p.add_argument("--markdown", help="also write the tables there")
    p.add_argument("--plots", help="also write one SVG for each volume into this folder")
    p.add_argument("--strict", action="store_true", help="exit status 1 if a figure is missed")
    return p.parse_args()


def write_text(path, words):
    with open(path, "w") as file: file.write(words)


def main():
    arguments = parse_arguments()
    effort, results, started = Effort(arguments.quick), {}, time.time()
    bench.RUNS = 1
    print("\n".join(introduction(effort, arguments.peers)), flush=True)
    if arguments.plots: os.makedirs(arguments.plots, exist_ok=True)
    known = {name: r for path in arguments.peers for name, r in json.load(open(path))["volumes"].items()}
    with tempfile.TemporaryDirectory() as folder:
        for name, opened in chosen(arguments, effort):
            with tempfile.TemporaryDirectory() as own:
                results[name] = measure(opened(folder), arguments, effort, own, known.get(name))
            r = results[name]
            print("\n".join(["", title(name, r), *level_table(r), *error_table(r), f"({r['seconds']} s)"]), flush=True)
            if arguments.plots: write_text(os.path.join(arguments.plots, f"bytes_{name}.svg"), plot.svg(title(name, r), r["curves"]))
    rows = list(figures(results, arguments.wasm))
    missed = sum(holds is False for *_, holds in rows)
    print("\n".join(["", *figure_table(rows), "", f"{missed} of the figures missed" if missed else "all figures reached",
                     f"{time.time() - started:.0f} s"]))
    if arguments.markdown: write_text(arguments.markdown, markdown(results, rows, introduction(effort, arguments.peers), bool(arguments.plots)))
    if arguments.json:
        found = [dict(zip(("what", "must", "measured", "holds"), row)) for row in rows]
        write_text(arguments.json, json.dumps({"machine": bench.machine(), "figures": found, "volumes": results}, indent=1))
    return 1 if missed and arguments.strict else 0


if __name__ == "__main__": sys.exit(main())
