// bytes_wasm.mjs ARCHIVE DECODER.wasm [BLOCK [BLOCKS]]: CPU seconds of the viewer's decoder for one decoding of an archive to the last
// meshes, as `lathe bench decode` measures it natively. The sum of BLOCK decodings one after the other, so that small archives take long
// enough to be measured; the fastest of BLOCKS counts. Building a mesh is asked for through its hash, so the same hashes are computed once
// more and their time is taken off. The native decoder has the pages, and what the caches hold of them, of the decoding before. So does
// this one: an instance is made new by writing back what its memory began with, while the clock stands still.
import { readFileSync } from 'node:fs';

const [archivePath, wasmPath, block = '1', blocks = '5'] = process.argv.slice(2);
const archive = readFileSync(archivePath);
const stream = archive.subarray(0, Number(archive.readBigUInt64LE(archive.length - 16)));   // the footer's offset: docs/FORMAT.md
const module = new WebAssembly.Module(readFileSync(wasmPath));

function seconds() {
    const { user, system } = process.cpuUsage();
    return (user + system) * 1e-6;
}

// Each mesh is hashed so many times while it is there.
function decode(wasm, hashings) {
    const check = (what, status) => {
        if (status < 0) throw Error(`${what}: status ${status}`);
        return status;
    };
    const at = wasm.input(stream.length);
    new Uint8Array(wasm.memory.buffer).set(stream, at);
    check('feed', wasm.feed(stream.length));
    while (check('step', wasm.step()) === 0);
    for (let i = 0; i < wasm.structures(); i++) {
        const hash = wasm.mesh_hash(i);
        for (let k = 1; k < hashings; k++) if (wasm.mesh_hash(i) !== hash) throw Error('the mesh changed');
    }
}

const wasm = new WebAssembly.Instance(module, {}).exports;
const first = new Uint8Array(wasm.memory.buffer).slice();

function time(hashings) {
    let spent = 0;
    for (let i = 0; i < Number(block); i++) {
        new Uint8Array(wasm.memory.buffer).set(first);
        const start = seconds();
        decode(wasm, hashings);
        spent += seconds() - start;
    }
    return spent / Number(block);
}

time(1);   // the engine compiles again what is hot
const once = [], twice = [];
for (let i = 0; i < Number(blocks); i++) {
    once.push(time(1));
    twice.push(time(2));
}
console.log(JSON.stringify({ seconds: 2 * Math.min(...once) - Math.min(...twice) }));
