// The wasm decoders in node, of every model, of rasters alone and of tubes alone: the same meshes as the native one, and no input that traps them.
// LATHE_HASH_STREAM=FILE with LATHE_HASH_EXPECT=FILE (lines as `lathe hash --each` prints them) checks another stream.
import assert from 'node:assert/strict';
import { execFile } from 'node:child_process';
import { readdir, readFile } from 'node:fs/promises';
import { join } from 'node:path';
import { before, test } from 'node:test';
import { fileURLToPath } from 'node:url';
import { promisify } from 'node:util';
import { program, serve, withFolder, writeLabels } from './browser.mjs';

process.chdir(fileURLToPath(new URL('..', import.meta.url)));
const run = promisify(execFile);

const load = async (path) => WebAssembly.compile(await readFile(path));
const modules = process.env.LATHE_WASM
    ? { given: await load(process.env.LATHE_WASM) }
    : { whole: await load('../build/wasm/lathe.wasm'), rasters: await load('../build/wasm/rasters.wasm'), tubes: await load('../build/wasm/tubes.wasm') };
const open = async (module) => (await WebAssembly.instantiate(module)).exports;

function feed(wasm, bytes) {
    const address = wasm.input(bytes.length);
    assert.ok(address);
    new Uint8Array(wasm.memory.buffer).set(bytes, address);
    return wasm.feed(bytes.length);
}

/** Steps to the end: the last status. */
function stepAll(wasm, each = () => {}) {
    for (;;) {
        const status = wasm.step();
        if (status) return status;
        each(...new Uint32Array(wasm.memory.buffer, wasm.report_words(), 10));
    }
}

const hashes = (wasm) => Array.from({ length: wasm.structures() },
    (_, i) => BigInt.asUintN(64, wasm.mesh_hash(i)).toString(16).padStart(16, '0'));

/** What a decoder is tried on: the labels of a ball and a ring, or a trunk with a vessel in it that parts into two. */
const subjects = { labels: {}, vessel: {} };
before(() => withFolder(async (folder) => {
    const archives = { labels: join(folder, 'labels.lathe'), vessel: '../tests/golden/plain_hole.lathe' };
    await run(program, ['bake', await writeLabels(folder), '--labels', 'all', '-o', archives.labels]);
    for (const [name, archive] of Object.entries(archives)) {
        const expected = (await run(program, ['hash', '--each', archive])).stdout.trim().split(/\s+/);
        const server = await serve(archive);
        const { models } = await (await fetch(server.url + '/models')).json();
        const stream = new Uint8Array(await (await fetch(`${server.url}/models/${models[0].id}/stream?from=0`)).arrayBuffer());
        await server.stop();
        subjects[name] = { stream, expected };
    }
}));

const tried = Object.entries(modules).flatMap(([name, module]) =>
    ({ rasters: ['labels'], tubes: ['vessel'] }[name] ?? ['labels', 'vessel']).map((what) => [`${name}, ${what}`, module, what]));

for (const [name, module, what] of tried) {
    const subject = () => subjects[what];

    test(name + ': nothing is imported', () => assert.deepEqual(WebAssembly.Module.imports(module), []));

    test(name + ': the same meshes as the native decoder, whatever the portions', async () => {
        const { stream, expected } = subject();
        for (const size of [1, 7, 100, stream.length]) {
            const wasm = await open(module);
            for (let at = 0; at < stream.length; at += size) {
                assert.equal(feed(wasm, stream.subarray(at, at + size)), 0);
                assert.equal(stepAll(wasm), 1);
            }
            assert.deepEqual(hashes(wasm), expected);
        }
    });

    test(name + ': another stream, if one is given', { skip: !process.env.LATHE_HASH_STREAM }, async () => {
        const wasm = await open(module);
        assert.equal(feed(wasm, await readFile(process.env.LATHE_HASH_STREAM)), 0);
        assert.equal(stepAll(wasm), 1);
        assert.deepEqual(hashes(wasm), (await readFile(process.env.LATHE_HASH_EXPECT, 'utf8')).trim().split(/\s+/));
    });

    test(name + ': meshes for the GPU: closed, unit normals, openness between 0 and 1', async () => {
        const wasm = await open(module), { stream } = subject();
        feed(wasm, stream);
        stepAll(wasm, (structure) => {
            assert.equal(wasm.mesh(structure), 0);
            const [, , , , , , , vertices, triangles, start] = new Uint32Array(wasm.memory.buffer, wasm.report_words(), 10);
            const memory = wasm.memory.buffer;
            const positions = new Float32Array(memory, start, 3 * vertices);
            const shading = new Int16Array(memory, start + 12 * vertices, 4 * vertices);
            const indices = new Uint32Array(memory, start + 20 * vertices, 3 * triangles);
            assert.ok(positions.every(Number.isFinite));
            const edges = new Set();
            for (let i = 0; i < indices.length; i++)
                edges.add(indices[i] * vertices + indices[i % 3 === 2 ? i - 2 : i + 1]);
            assert.equal(edges.size, indices.length);
            for (const edge of edges) assert.ok(edges.has((edge % vertices) * vertices + Math.floor(edge / vertices)));
            for (let v = 0; v < vertices; v++) {
                const length = Math.hypot(...shading.subarray(4 * v, 4 * v + 3)) / 32767;
                assert.ok(Math.abs(length - 1) < 1e-3 || length === 0);
                assert.ok(shading[4 * v + 3] >= 0);
            }
        });
    });

    test(name + ': the normals of a ball point outwards', { skip: what !== 'labels' }, async () => {
        const wasm = await open(module), { stream } = subject();
        feed(wasm, stream);
        stepAll(wasm);
        wasm.mesh(0);
        const [, , , , , , , vertices, , start] = new Uint32Array(wasm.memory.buffer, wasm.report_words(), 10);
        const positions = new Float32Array(wasm.memory.buffer, start, 3 * vertices);
        const shading = new Int16Array(wasm.memory.buffer, start + 12 * vertices, 4 * vertices);
        const centre = [12, 24, 24 * 1.2];
        for (let v = 0; v < vertices; v++) {
            const dot = centre.reduce((sum, c, i) => sum + (positions[3 * v + i] - c) * shading[4 * v + i], 0);
            assert.ok(dot > 0);
        }
    });

    test(name + ': every prefix waits for more; every flipped byte is refused or decoded, never a trap', async () => {
        const { stream } = subject();
        for (let size = 0; size < stream.length; size++) {
            const wasm = await open(module);
            if (size) feed(wasm, stream.subarray(0, size));
            assert.equal(stepAll(wasm), 1);
        }
        for (let at = 0; at < stream.length; at++) {
            const wasm = await open(module), damaged = stream.slice();
            damaged[at] ^= 1 << at % 8;
            if (feed(wasm, damaged) === 0) stepAll(wasm, (structure) => wasm.mesh(structure));
        }
    });

    test(name + ': memory is used again: a second mesh of the same structure needs no more', async () => {
        const wasm = await open(module), { stream } = subject();
        feed(wasm, stream);
        stepAll(wasm);
        for (let i = 0; i < 3; i++) wasm.mesh(wasm.structures() - 1);
        const size = wasm.memory.buffer.byteLength;
        for (let i = 0; i < 200; i++) assert.equal(wasm.mesh(i % wasm.structures()), 0);
        assert.equal(wasm.memory.buffer.byteLength, size);
    });
}

for (const [small, others] of Object.entries({ rasters: ['radius', 'keep', 'exact'], tubes: ['tubes', 'keep', 'exact', 'cubes'] })) {
    test(`the decoder of ${small} refuses other models with words`, { skip: !modules[small] }, async () => {
        for (const golden of others) {
            const wasm = await open(modules[small]);
            assert.equal(feed(wasm, await readFile(`../tests/golden/${golden}.lathe`)), 0);
            assert.ok(wasm.step() < 0);
            const text = new Uint8Array(wasm.memory.buffer, wasm.error_text(), 80);
            assert.match(new TextDecoder().decode(text.slice(0, text.indexOf(0))), /made of something else/);
            const whole = await open(modules.whole);
            assert.equal(feed(whole, await readFile(`../tests/golden/${golden}.lathe`)), 0);
            assert.equal(whole.step(), 0);
        }
    });
}

test('the decoder that a page carries reads the model of that page', { skip: !modules.rasters }, async () => {
    const goldens = (await readdir('../tests/golden')).filter((name) => name.endsWith('.lathe'));
    const server = await serve('../tests/golden');
    const key = +/WASM_KEY = (\d+)/.exec(await readFile('src/bytes.ts', 'utf8'))[1], sizes = new Set();
    try {
        for (const golden of goldens) {
            const name = golden.slice(0, -'.lathe'.length);
            const html = await (await fetch(`${server.url}/m/${name}`)).text();
            const text = /<script type="text\/plain" id="wasm">(.*?)<\/script>/s.exec(html)[1];
            const module = await WebAssembly.compile(Uint8Array.from(text, (c) => c.charCodeAt(0) ^ key));
            sizes.add(text.length);
            const wasm = await open(module), stream = await (await fetch(`${server.url}/models/${name}/stream`)).arrayBuffer();
            let steps = 0;
            assert.equal(feed(wasm, new Uint8Array(stream)), 0, name);
            assert.equal(stepAll(wasm, () => steps++), 1, `${name}: the page's decoder reads all of it`);
            assert.ok(steps > 0, name);
        }
    } finally {
        await server.stop();
    }
    assert.equal(sizes.size, 3, 'each decoder is carried by some page');
});
