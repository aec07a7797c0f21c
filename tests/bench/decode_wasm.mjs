// decode_wasm.mjs ARCHIVE [DECODER.wasm [RUNS]]: decodes an archive with the viewer's decoder. Prints as JSON what `lathe bench
// decode` measures natively, the fastest of several runs, joints included: `seconds` with only each structure's last mesh built,
// `all_levels_seconds` with the mesh of every level; and each structure's last mesh hash, to compare with `lathe hash --each`.
import { readFileSync } from 'node:fs';

const [archivePath, wasmPath = new URL('../../build/wasm/lathe.wasm', import.meta.url), runs = 9] = process.argv.slice(2);
const archive = readFileSync(archivePath);
// The stream is what lies before the footer, whose offset begins the last 16 bytes (docs/FORMAT.md).
const stream = archive.subarray(0, Number(archive.readBigUInt64LE(archive.length - 16)));
const module = new WebAssembly.Module(readFileSync(wasmPath));
// CPU time, as `lathe bench decode` takes it: another program on the machine must not count.
function seconds() {
    const { user, system } = process.cpuUsage();
    return (user + system) * 1e-6;
}

function decode(allLevels) {
    const { exports: wasm } = new WebAssembly.Instance(module, {});
    const fail = (what, status) => {
        if (status < 0) throw Error(`${what}: status ${status}`);
        return status;
    };
    let hashing = 0;
    // Builds a structure's mesh. Its hash is taken twice: the second time the mesh is there, so that is what hashing costs.
    const build = (structure) => {
        const hash = wasm.mesh_hash(structure);
        const again = seconds();
        if (wasm.mesh_hash(structure) !== hash) throw Error('the mesh changed');
        hashing += 2 * (seconds() - again);
        return BigInt.asUintN(64, hash).toString(16).padStart(16, '0');
    };
    const start = seconds();
    const at = wasm.input(stream.length);
    new Uint8Array(wasm.memory.buffer).set(stream, at);
    fail('feed', wasm.feed(stream.length));
    while (fail('step', wasm.step()) === 0) {
        if (allLevels) build(new DataView(wasm.memory.buffer).getUint32(wasm.report_words(), true));
    }
    const hashes = [];
    for (let i = 0; i < wasm.structures(); i++) hashes.push(build(i));
    return { seconds: seconds() - start - hashing, hashes };
}

function best(allLevels) {
    let fastest;
    for (let i = 0; i < runs; i++) {
        const run = decode(allLevels);
        if (!fastest || run.seconds < fastest.seconds) fastest = run;
    }
    return fastest;
}

const last = best(false), all = best(true);
if (last.hashes.join() !== all.hashes.join()) throw Error('the meshes depend on which levels were built');
console.log(JSON.stringify({ seconds: last.seconds, all_levels_seconds: all.seconds, hashes: last.hashes }));
