// decode_wasm.mjs ARCHIVE [DECODER.wasm]: decodes an archive with the viewer's decoder; prints seconds (the fastest of five runs,
// joints included) and each structure's mesh hash as JSON, to compare with `lathe bench decode` and `lathe hash --each`.
import { readFileSync } from 'node:fs';

const [archivePath, wasmPath = new URL('../../build/wasm/lathe.wasm', import.meta.url)] = process.argv.slice(2);
const archive = readFileSync(archivePath);
// The stream is what lies before the footer, whose offset begins the last 16 bytes (docs/FORMAT.md).
const stream = archive.subarray(0, Number(archive.readBigUInt64LE(archive.length - 16)));
const module = new WebAssembly.Module(readFileSync(wasmPath));
const seconds = () => Number(process.hrtime.bigint()) * 1e-9;

function decode() {
    const { exports: wasm } = new WebAssembly.Instance(module, {});
    const fail = (what, status) => {
        if (status < 0) throw Error(`${what}: status ${status}`);
        return status;
    };
    const start = seconds();
    const at = wasm.input(stream.length);
    new Uint8Array(wasm.memory.buffer).set(stream, at);
    fail('feed', wasm.feed(stream.length));
    while (fail('step', wasm.step()) === 0);
    const hashes = [];
    for (let i = 0; i < wasm.structures(); i++) hashes.push(BigInt.asUintN(64, wasm.mesh_hash(i)).toString(16).padStart(16, '0'));
    let spent = seconds() - start;
    // The meshes are there now: what hashing them again takes is not decoding.
    const again = seconds();
    for (let i = 0; i < wasm.structures(); i++) wasm.mesh_hash(i);
    return { seconds: spent - (seconds() - again), hashes };
}

let best = decode();
for (let i = 0; i < 4; i++) {
    const run = decode();
    if (run.seconds < best.seconds) best = run;
}
console.log(JSON.stringify(best));
