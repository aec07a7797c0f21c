// decode_wasm.mjs ARCHIVE [DECODER.wasm [RUNS]]: decodes an archive with the viewer's decoder. Prints as JSON what `lathe bench
// decode` measures natively, the fastest of RUNS, joints included: `seconds` with only each structure's last mesh built,
// `all_levels_seconds` with the mesh of every level; and each structure's last mesh hash, to compare with `lathe hash --each`.
//
// The native decoder has the pages, and what the caches hold of them, of the decoding before. So does this one: an instance is made new
// by writing back what its memory began with, while the clock stands still. For times run it with --single-threaded: the engine's own
// threads are not to count.
import { readFileSync } from 'node:fs';

const [archivePath, wasmPath = new URL('../../build/wasm/lathe.wasm', import.meta.url), runs = '9'] = process.argv.slice(2);
const archive = readFileSync(archivePath);
// The stream is what lies before the footer, whose offset begins the last 16 bytes (docs/FORMAT.md).
const stream = archive.subarray(0, Number(archive.readBigUInt64LE(archive.length - 16)));
const { exports: wasm } = new WebAssembly.Instance(new WebAssembly.Module(readFileSync(wasmPath)), {});
let memory = new Uint8Array(wasm.memory.buffer);
const first = memory.slice();

// CPU time, as `lathe bench decode` takes it: another program on the machine must not count.
function seconds() {
    const { user, system } = process.cpuUsage();
    return (user + system) * 1e-6;
}

/** A view of all of the memory, which is another buffer once it has grown. */
function view() {
    if (memory.buffer !== wasm.memory.buffer) memory = new Uint8Array(wasm.memory.buffer);
    return memory;
}

function check(what, status) {
    if (status < 0) throw Error(`${what}: status ${status}`);
    return status;
}

function decode(allLevels) {
    const at = wasm.input(stream.length);
    view().set(stream, at);
    check('feed', wasm.feed(stream.length));
    while (check('step', wasm.step()) === 0)
        if (allLevels) check('build', wasm.build(new DataView(wasm.memory.buffer).getUint32(wasm.report_words(), true)));
    for (let i = 0; i < wasm.structures(); i++) check('build', wasm.build(i));
}

function time(allLevels) {
    view().set(first);
    const start = seconds();
    decode(allLevels);
    return seconds() - start;
}

function hashes() {
    return Array.from({ length: wasm.structures() }, (_, i) => BigInt.asUintN(64, wasm.mesh_hash(i)).toString(16).padStart(16, '0'));
}

function best(allLevels) {
    for (const end = seconds() + 0.5; seconds() < end; ) time(allLevels);   // the engine compiles again what is hot
    return Math.min(...Array.from({ length: Number(runs) }, () => time(allLevels)));
}

const last = best(false), meshes = hashes(), all = best(true);
if (hashes().join() !== meshes.join()) throw Error('the meshes depend on which levels were built');
console.log(JSON.stringify({ seconds: last, all_levels_seconds: all, hashes: meshes }));
