// bytes_wasm.mjs ARCHIVE DECODER.wasm [RUNS]: CPU seconds of the viewer's decoder for one decoding of an archive to the last meshes, the
// fastest of RUNS, as `lathe bench decode` measures it natively. The native decoder has the pages, and what the caches hold of them, of
// the decoding before. So does this one: an instance is made new by writing back what its memory began with, while the clock stands still.
// Run with --single-threaded: the engine's own threads are not to count.
import { readFileSync } from 'node:fs';

const [archivePath, wasmPath, runs = '5'] = process.argv.slice(2);
const archive = readFileSync(archivePath);
const stream = archive.subarray(0, Number(archive.readBigUInt64LE(archive.length - 16)));   // the footer's offset: docs/FORMAT.md
const module = new WebAssembly.Module(readFileSync(wasmPath));

function seconds() {
    const { user, system } = process.cpuUsage();
    return (user + system) * 1e-6;
}

const wasm = new WebAssembly.Instance(module, {}).exports;
let memory = new Uint8Array(wasm.memory.buffer);
const first = memory.slice();

/** A view of all of the memory, which is another buffer once it has grown. */
function view() {
    if (memory.buffer !== wasm.memory.buffer) memory = new Uint8Array(wasm.memory.buffer);
    return memory;
}

function check(what, status) {
    if (status < 0) throw Error(`${what}: status ${status}`);
    return status;
}

function decode() {
    const at = wasm.input(stream.length);
    view().set(stream, at);
    check('feed', wasm.feed(stream.length));
    while (check('step', wasm.step()) === 0);
    for (let i = 0; i < wasm.structures(); i++) check('build', wasm.build(i));
}

function time() {
    view().set(first);
    const start = seconds();
    decode();
    return seconds() - start;
}

for (const end = seconds() + 0.5; seconds() < end; ) time();   // the engine compiles again what is hot
console.log(JSON.stringify({ seconds: Math.min(...Array.from({ length: Number(runs) }, time)) }));
