// The second decoder (reference_decoder.ts, from docs/FORMAT.md alone) decodes the golden streams to what the first one says of them:
// tests/golden/packets.txt, line by line. Of meshes it computes those of radius maps; it does not rebuild surfaces of outlines.
import assert from 'node:assert/strict';
import { execFile } from 'node:child_process';
import { readFile, readdir } from 'node:fs/promises';
import { test } from 'node:test';
import { fileURLToPath } from 'node:url';
import { promisify } from 'node:util';
import { transform } from 'esbuild';

process.chdir(fileURLToPath(new URL('..', import.meta.url)));
const golden = process.env.LATHE_GOLDEN ?? '../tests/golden';
const source = await readFile('test/reference_decoder.ts', 'utf8');
const { code } = await transform(source, { loader: 'ts', format: 'esm', target: 'es2022' });
const { Damaged, Decoder, SHARED, Tubes, crc32c, direction, radiusMesh, readArchive } =
    await import('data:text/javascript;base64,' + Buffer.from(code).toString('base64'));

const names = (await readdir(golden)).filter((name) => name.endsWith('.lathe')).map((name) => name.slice(0, -6)).sort();
const files = new Map(await Promise.all(names.map(async (name) => [name, new Uint8Array(await readFile(`${golden}/${name}.lathe`))])));
const lines = async (file) => (await readFile(`${golden}/${file}`, 'utf8')).trimEnd().split('\n');

/** FNV-1a, 64 bits, over little-endian words: what tests/test_golden.c computes. */
class Digest {
    #hash = 0xcbf29ce484222325n;
    #view = new DataView(new ArrayBuffer(8));
    bytes(bytes) {
        for (const byte of bytes) this.#hash = ((this.#hash ^ BigInt(byte)) * 0x100000001b3n) & 0xffffffffffffffffn;
        return this;
    }
    #put(size, method, value) {
        this.#view[method](0, value, true);
        return this.bytes(new Uint8Array(this.#view.buffer, 0, size));
    }
    words(...values) {
        for (const value of values) this.#put(4, 'setUint32', value);
        return this;
    }
    float(value) { return this.#put(4, 'setFloat32', value); }
    double(value) { return this.#put(8, 'setFloat64', value); }
    long(value) { return this.#put(8, 'setBigInt64', BigInt.asIntN(64, value)); }
    get text() { return this.#hash.toString(16).padStart(16, '0'); }
}

function headerDigest(h) {
    const d = new Digest().words(h.axis, h.boundary);
    for (const value of h.affine.flat()) d.double(value);
    d.words(h.parameters.length, ...h.parameters, h.structures.length);
    for (const s of h.structures) {
        for (let k = 0; k < 3; k++) d.words(s.origin[k], s.size[k]);
        d.words(s.levelCount);
    }
    return d.text;
}

function footerDigest(a) {
    const d = new Digest(), counts = (l) => d.words(l.rays, l.slices, l.vertices, l.triangles).long(l.draco);
    d.words(a.name.length).bytes(a.name).double(a.iso);
    a.levels.forEach(counts);
    for (const s of a.structures) {
        d.words(s.name.length).bytes(s.name).words(...s.colour).long(s.label);
        for (const l of s.levels) {
            counts(l).float(l.rms).float(l.max).words(l.components, l.waiting).float(l.volume);
        }
    }
    return d.text;
}

function addStars(d, { shown, stars }) {
    shown.forEach((w, i) => {
        d.words(w, stars[i].length);
        for (const s of stars[i]) d.words(s.parent, +s.hole, s.radii.length, ...s.centre, ...s.radii);
    });
}

function addSlices(d, { shown, finer, slices, width, height, rest }) {
    const row = new Uint8Array(Math.ceil(width / 64) * 8);
    shown.forEach((w, i) => {
        d.words(w, finer[i]);
        for (let v = 0; v < height; v++) {
            row.fill(0);
            for (let u = 0; u < width; u++) row[u >> 3] |= slices[i][v * width + u] << (u & 7);
            d.bytes(row);
        }
    });
    if (rest) d.words(...rest);
}

function addRadii(d, { map }, level) {
    if (map instanceof Tubes) {
        d.words(map.tubes.length, map.steps[0], map.fine, map.steps[1]);
        for (const tube of map.tubes) {
            const { centres, radii } = map.shown(tube, level);
            d.words(tube.first, +tube.hole, tube.rows, tube.rays, map.fall, map.turn, ...map.apex);
            for (let row = 0; row < tube.rows; row++) d.words(...centres[row], ...radii[row]);
        }
        return;
    }
    const { image } = map;
    d.words(image.rays, map.step, map.turn, ...map.apex);
    for (const row of image.rows(level)) {
        d.words(row, ...image.centres[row]);
        for (let i = 0; i < image.rays; i += image.rayStride(level)) d.words(image.radii[row][i]);
    }
}

function addRaster(d, { stride, size, bits, rest }) {
    const [width, height, slices] = size, row = new Uint8Array(Math.ceil(width / 64) * 8);
    d.words(...stride, ...size);
    for (let v = 0; v < height * slices; v++) {
        row.fill(0);
        for (let u = 0; u < width; u++) row[u >> 3] |= bits[v * width + u] << (u & 7);
        d.bytes(row);
    }
    if (rest) d.words(...rest);
}

function packetDigest({ level, rms, max, packet }) {
    const d = new Digest().float(rms).float(max);
    ({ stars: addStars, slices: addSlices, radii: addRadii, raster: addRaster })[packet.kind](d, packet, level);
    return d.text;
}

/** A level, or so many passes before it is whole. */
const levelText = ({ level, passesLeft }) => (passesLeft ? `${level}-${passesLeft}` : `${level}`);

function* steps(decoder) {
    for (let step; (step = decoder.step()); ) yield step;
}

test('it is strict TypeScript', async () => {
    const options = ['--noEmit', '--strict', '--noUnusedLocals', '--noUnusedParameters', '--noImplicitReturns', '--noFallthroughCasesInSwitch',
        '--target', 'es2022', '--module', 'es2022', '--moduleResolution', 'bundler', '--lib', 'es2022,dom'];
    await promisify(execFile)(process.execPath, ['node_modules/typescript/bin/tsc', ...options, 'test/reference_decoder.ts']);
});

test('it knows nothing but its input: no imports, nothing from outside of the language', () => {
    assert.doesNotMatch(source, /\bimport\b|\brequire\b|\bprocess\b|\bfetch\b|\bglobalThis\b/);
});

test('tables: a known checksum, directions of a circle', () => {
    assert.equal(crc32c(new TextEncoder().encode('123456789')), 0xe3069283);
    for (let i = 0; i < 65536; i += 7) {
        const [x, y] = direction(i, 65536), angle = (2 * Math.PI * i) / 65536;
        assert.ok(Math.hypot(x - 16384 * Math.cos(angle), y - 16384 * Math.sin(angle)) < 0.72);
    }
});

test('all packets of all golden streams, headers and footers', async () => {
    const computed = [];
    assert.ok(names.length >= 12);
    for (const name of names) {
        const archive = readArchive(files.get(name)), decoder = new Decoder();
        computed.push(`${name} header ${headerDigest(archive.header)}`);
        decoder.feed(archive.stream);
        for (const step of steps(decoder)) computed.push(`${name} ${levelText(step)} ${step.structure} ${step.packet.kind} ${packetDigest(step)}`);
        computed.push(`${name} footer ${footerDigest(archive)}`);
    }
    assert.deepEqual(computed, await lines('packets.txt'));
});

test('surfaces of radius maps, vertex by vertex', async () => {
    const known = new Map((await lines('meshes.txt')).map((line) => [line.split(' ').slice(0, 3).join(' '), line]));
    let compared = 0;
    for (const name of names) {
        const decoder = new Decoder();
        decoder.feed(readArchive(files.get(name)).stream);
        for (const { level, structure, packet } of steps(decoder)) {
            if (packet.kind !== 'radii') continue;
            const mesh = radiusMesh(packet, level), d = new Digest();
            if (!mesh) continue;
            const { vertices, triangles } = mesh;
            for (const words of [...vertices, ...triangles]) d.words(...words);
            assert.equal(`${name} ${level} ${structure} ${vertices.length} ${triangles.length} ${d.text}`, known.get(`${name} ${level} ${structure}`));
            compared++;
        }
    }
    assert.ok(compared >= 12);
});

/** One decoder, fed byte by byte: what it says behind each packet, and where that ends. Computed once for each stream. */
const fedSlowly = new Map();
function feedSlowly(name) {
    if (fedSlowly.has(name)) return fedSlowly.get(name);
    const { stream } = readArchive(files.get(name)), decoder = new Decoder(), packets = [];
    assert.equal(decoder.step(), null);
    for (let at = 0; at < stream.length; at++) {
        decoder.feed(stream.subarray(at, at + 1));
        for (const step of steps(decoder)) {
            const all = decoder.header.passes && decoder.header.flags & SHARED;
            packets.push({ end: at + 1, record: `level ${step.level} of ${all ? 'all structures' : 'structure ' + step.structure}`, digest: packetDigest(step) });
        }
    }
    fedSlowly.set(name, packets);
    return packets;
}

test('every prefix waits for more, however it is cut', () => {
    for (const name of names) {
        const { header, stream } = readArchive(files.get(name)), whole = new Decoder(), packets = feedSlowly(name);
        whole.feed(stream);
        assert.deepEqual(packets.map((p) => p.digest), [...steps(whole)].map(packetDigest));
        assert.equal(packets.at(-1).end, stream.length);
        const passes = header.passes?.flat().length;
        assert.equal(packets.length, header.structures.reduce((sum, s) => sum + (passes ?? s.levelCount), 0));
        for (let size = 0; size < files.get(name).length; size++)
            assert.throws(() => readArchive(files.get(name).subarray(0, size)), Damaged);
    }
});

test('every flipped byte of every file is found, in a packet by the name of the packet', () => {
    for (const name of names) {
        const bytes = files.get(name).slice(), { stream } = readArchive(bytes), owner = new Map();
        for (const { end, record } of feedSlowly(name))
            for (let at = payloadBegin(stream, end - 4); at < end; at++) owner.set(at, record);
        for (let at = 0; at < bytes.length; at++) {
            bytes[at] ^= 1 << at % 8;
            assert.throws(() => readArchive(bytes), (e) => e instanceof Damaged && (!owner.has(at) || e.record === owner.get(at)), `${name}, byte ${at}`);
            bytes[at] ^= 1 << at % 8;
        }
    }
});

/** Where the payload that ends at `end` begins: where the checksum behind it holds. */
function payloadBegin(stream, end) {
    const stored = new DataView(stream.buffer, stream.byteOffset + end, 4).getUint32(0, true);
    for (let begin = end; begin >= 0; begin--) if (crc32c(stream.subarray(begin, end)) === stored) return begin;
    assert.fail('no checksum holds');
}

test('damage behind right checksums is refused or decoded, and it ends', () => {
    let refused = 0, decoded = 0, random = 1;
    const next = (n) => ((random = (Math.imul(random, 1664525) + 1013904223) >>> 0) >>> 8) % n;
    for (const name of names) {
        const { stream } = readArchive(files.get(name)), ends = feedSlowly(name).map(({ end }) => end - 4);
        for (let round = 0; round < 4; round++) {
            const damaged = stream.slice(), end = ends[next(ends.length)], begin = payloadBegin(stream, end);
            if (begin === end) continue;
            damaged[begin + next(end - begin)] ^= 1 + next(255);
            new DataView(damaged.buffer).setUint32(end, crc32c(damaged.subarray(begin, end)), true);
            const other = new Decoder();
            other.feed(damaged);
            try {
                for (const step of steps(other)) packetDigest(step);
                decoded++;
            } catch (e) {
                assert.ok(e instanceof Damaged && e.record.startsWith('level'), String(e));
                refused++;
            }
        }
    }
    assert.ok(refused > 10 && decoded > 10, `${refused} refused, ${decoded} decoded`);
});
