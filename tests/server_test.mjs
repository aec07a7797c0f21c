// The server over real sockets. LATHE_BIN: the program; LATHE_MODELS: a directory of archives, else LATHE_PHANTOM computes
// two volumes that are baked first.
import assert from 'node:assert/strict';
import { execFileSync, spawn } from 'node:child_process';
import { copyFileSync, mkdtempSync, readdirSync, renameSync, rmSync, unlinkSync, writeFileSync } from 'node:fs';
import net from 'node:net';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { after, before, test } from 'node:test';
import { brotliDecompressSync, gunzipSync, inflateSync } from 'node:zlib';

const program = process.env.LATHE_BIN ?? 'build/lathe';
const folder = mkdtempSync(join(tmpdir(), 'lathe-server-'));
const sleep = (ms) => new Promise((done) => setTimeout(done, ms));
const servers = new Set();

// ---- a client that hides nothing

class Client {
    constructor(port) {
        this.parts = [];
        this.size = 0;
        this.ended = false;
        this.waiting = [];
        this.socket = net.connect({ port, host: '127.0.0.1' });
        this.socket.setNoDelay();
        this.socket.on('data', (data) => { this.parts.push(data); this.size += data.length; this.wake(); });
        const end = () => { this.ended = true; this.wake(); };
        this.socket.on('end', end).on('close', end).on('error', end);
    }
    get bytes() { return this.parts.length > 1 ? (this.parts = [Buffer.concat(this.parts)])[0] : this.parts[0] ?? Buffer.alloc(0); }
    skip(count) { this.parts = [this.bytes.subarray(count)]; this.size -= count; }
    wake() { for (const done of this.waiting.splice(0)) done(); }
    async until(condition, ms = 15000) {
        const limit = Date.now() + ms;
        for (;;) {
            const value = condition();
            if (value) return value;
            const left = limit - Date.now();
            if (left <= 0) throw new Error(`nothing for ${ms} ms; got: ${this.bytes.subarray(0, 300)}`);
            let timer;
            await Promise.race([new Promise((done) => this.waiting.push(done)),
                                new Promise((done) => { timer = setTimeout(done, left); })]);
            clearTimeout(timer);
        }
    }
    send(...parts) { for (const part of parts) if (!this.socket.destroyed) this.socket.write(part); return this; }
    async response(head = false) {
        const at = await this.until(() => {
            const found = this.bytes.indexOf('\r\n\r\n');
            if (found >= 0) return found;
            if (this.ended) throw new Error('closed without a response');
            return 0;
        });
        const [status, ...lines] = this.bytes.subarray(0, at).toString('latin1').split('\r\n');
        const headers = {};
        for (const line of lines) {
            const [, name, value] = /^([^:]+): *(.*)$/.exec(line);
            assert.ok(!(name.toLowerCase() in headers), `${name} twice`);
            headers[name.toLowerCase()] = value;
        }
        const code = Number(status.split(' ')[1]);
        const size = head || code === 304 || code === 204 ? 0 : Number(headers['content-length']);
        assert.ok(Number.isInteger(size), 'a Content-Length');
        await this.until(() => {
            if (this.size < at + 4 + size && this.ended) throw new Error('closed within a body');
            return this.size >= at + 4 + size;
        });
        const body = this.bytes.subarray(at + 4, at + 4 + size);
        this.skip(at + 4 + size);
        return { code, headers, body, text: body.toString(), json: () => JSON.parse(body.toString()) };
    }
    closed(ms = 5000) { return this.until(() => this.ended, ms); }
    close() { this.socket.destroy(); }
}

async function raw(port, bytes, head = false) {
    const client = new Client(port);
    try { return await client.send(bytes).response(head); } finally { client.close(); }
}
const write = (method, target, headers = {}) => `${method} ${target} HTTP/1.1\r\nHost: localhost\r\n`
    + Object.entries(headers).map(([name, value]) => `${name}: ${value}\r\n`).join('') + '\r\n';
const request = (method, target, headers) => raw(server.port, write(method, target, headers), method === 'HEAD');
const get = (target, headers) => request('GET', target, headers);

// ---- the program

async function start(args, env = {}) {
    const child = spawn(program, ['serve', ...args, '--port', '0', '--bind', '127.0.0.1'], { env: { ...process.env, ...env } });
    const result = { child, out: '', err: '', port: 0 };
    servers.add(child);
    result.exit = new Promise((done) => child.on('close', (code, signal) => { servers.delete(child); done(signal ?? code); }));
    child.stderr.on('data', (data) => { result.err += data; });
    await new Promise((done, fail) => {
        child.stdout.on('data', (data) => { result.out += data; if (result.out.includes('\n')) done(); });
        child.on('exit', () => fail(new Error(`the server has not started: ${result.err}`)));
        child.on('error', fail);
    });
    const [, port] = /^listening on http:\/\/127\.0\.0\.1:(\d+)\n/.exec(result.out) ?? assert.fail(result.out);
    result.port = Number(port);
    return result;
}
async function stop(which, signal = 'SIGTERM') {
    which.child.kill(signal);
    return which.exit;
}

function bakePhantoms() {
    const directory = mkdtempSync(join(tmpdir(), 'lathe-models-'));
    const kinds = [['knot', ['--iso', '0']], ['labels', ['--labels', 'all']]];
    for (const [kind, options] of kinds) {
        const volume = join(directory, `${kind}.json`);
        execFileSync(process.env.LATHE_PHANTOM ?? 'build/release/tests/make_phantom', [kind, volume, '32']);
        execFileSync(program, ['bake', volume, ...options, '-o', join(directory, `${kind}.lathe`)], { stdio: 'pipe' });
    }
    return directory;
}

let source, server, models, model, several, archive;
before(async () => {
    source = process.env.LATHE_MODELS ?? bakePhantoms();
    for (const name of readdirSync(source)) if (name.endsWith('.lathe')) copyFileSync(join(source, name), join(folder, name));
    server = await start([folder]);
    models = (await get('/models')).json().models;
    assert.ok(models.length, 'at least one model');
    model = models[0];
    several = models.find(({ structures }) => structures > 1) ?? model;
    archive = (await get(`/models/${model.id}.lathe`)).body;
});
after(() => {
    for (const child of servers) child.kill('SIGKILL');
    if (!process.env.LATHE_MODELS) rmSync(source, { recursive: true });
    rmSync(folder, { recursive: true });
});

function isProblem(reply, status, words) {
    assert.equal(reply.code, status, reply.text);
    assert.equal(reply.headers['content-type'], 'application/problem+json');
    assert.equal(reply.headers['access-control-allow-origin'], '*');
    const problem = reply.json();
    assert.deepEqual(Object.keys(problem).sort(), ['detail', 'status', 'title', 'type']);
    assert.equal(problem.status, status);
    if (words) assert.match(problem.detail, words);
}

// ---- what is there

test('the list of models has ids, hashes and sizes', () => {
    for (const { id, name, hash, structures, levels, bytes } of models) {
        assert.match(id, /^[a-z0-9._-]{1,64}$/);
        assert.match(hash, /^[0-9a-f]{32}$/);
        assert.equal(typeof name, 'string');
        assert.ok(structures >= 1 && levels >= 1 && bytes > 0);
    }
});

test('the manifest describes every level of every structure', async () => {
    for (const { id, structures, levels } of models) {
        const reply = await get(`/models/${id}`);
        assert.equal(reply.headers['content-type'], 'application/json');
        const manifest = reply.json();
        assert.equal(manifest.id, id);
        assert.ok(['x', 'y', 'z'].includes(manifest.axis));
        assert.ok(['edge', 'iso'].includes(manifest.boundary));
        assert.ok(manifest.iso === null || Number.isFinite(manifest.iso));
        assert.equal(manifest.structures.length, structures);
        assert.equal(manifest.levels.length, levels);
        for (const { name, color, levels: own } of [...manifest.structures, { name: '', color: '#000000', levels: manifest.levels }]) {
            assert.equal(typeof name, 'string');
            assert.match(color, /^#[0-9a-f]{6}$/);
            own.forEach((level, n) => {
                assert.equal(level.level, n);
                for (const key of ['rays', 'slices', 'vertices', 'triangles', 'polar_bytes']) assert.ok(Number.isInteger(level[key]), key);
                for (const key of ['error_max_mm', 'error_rms_mm', 'draco_bytes']) assert.ok(level[key] === null || level[key] >= 0, key);
            });
        }
        const [low, high] = manifest.bounds;
        for (let axis = 0; axis < 3; axis++) assert.ok(low[axis] <= high[axis]);
    }
});

test('the stream is a slice of the archive; its parts and the deltas join to the whole', async () => {
    for (const { id, levels } of models) {
        const whole = (await get(`/models/${id}.lathe`)).body;
        const stream = (await get(`/models/${id}/stream?from=0`)).body;
        assert.ok(whole.indexOf(stream) >= 0, 'a slice');
        const deltas = [];
        for (let n = 0; n < levels; n++) deltas.push((await get(`/models/${id}/deltas/${n}.lathe`)).body);
        assert.ok(Buffer.concat(deltas).equals(stream));
        assert.ok((await get(`/models/${id}/stream?from=0&to=0`)).body.equals(deltas[0]));
        assert.ok((await get(`/models/${id}/stream?from=1`)).body.equals(Buffer.concat(deltas.slice(1))));
        assert.ok((await get(`/models/${id}/stream?from=0&to=9999`)).body.equals(stream), 'to is clamped');
        assert.equal((await get(`/models/${id}/stream?from=${levels}`)).body.length, 0);
        const { levels: totals, structures } = (await get(`/models/${id}`)).json();
        const bytes = (infos) => infos.reduce((sum, { polar_bytes: own }) => sum + own, 0);
        assert.equal(bytes(totals), stream.length, 'polar_bytes of the model');
        assert.equal(bytes(structures.flatMap((structure) => structure.levels)), stream.length, 'polar_bytes of its structures');
    }
});

test('one structure of many has a stream of its own', async () => {
    const { structures, levels } = (await get(`/models/${several.id}`)).json();
    const whole = (await get(`/models/${several.id}/stream`)).body;
    const query = `structure=${encodeURIComponent(structures[0].name)}`;
    const own = (await get(`/models/${several.id}/stream?${query}`)).body;
    assert.ok(own.length > 0 && own.length <= whole.length);
    const deltas = [];
    for (let n = 0; n < levels.length; n++) deltas.push((await get(`/models/${several.id}/deltas/${n}.lathe?${query}`)).body);
    assert.ok(Buffer.concat(deltas).equals(own));
});

test('levels come in every format, whole or of one structure', async () => {
    const { structures, levels } = (await get(`/models/${several.id}`)).json();
    const name = encodeURIComponent(structures.at(-1).name).replaceAll('%20', '+');
    for (const query of ['', `?structure=${name}`]) {
        for (const n of new Set([0, levels.length - 1])) {
            const glb = await get(`/models/${several.id}/levels/${n}.glb${query}`);
            assert.equal(glb.headers['content-type'], 'model/gltf-binary');
            assert.equal(glb.body.subarray(0, 4).toString(), 'glTF');
            const smooth = await get(`/models/${several.id}/levels/${n}.stl${query}${query ? '&' : '?'}smooth=2`);
            assert.equal(smooth.body.readUInt32LE(80), 4 * (await get(`/models/${several.id}/levels/${n}.stl${query}`)).body.readUInt32LE(80));
            const stl = await get(`/models/${several.id}/levels/${n}.stl${query}`);
            assert.equal(stl.headers['content-type'], 'model/stl');
            assert.equal(stl.body.length, 84 + 50 * stl.body.readUInt32LE(80));
            assert.equal((await get(`/models/${several.id}/levels/${n}.ply${query}`)).body.subarray(0, 4).toString(), 'ply\n');
            const drc = await get(`/models/${several.id}/levels/${n}.drc${query}`);
            assert.equal(drc.body.subarray(0, 4).toString(), 'DRAC');
            assert.match(drc.headers['content-disposition'], query ? /^inline; filename="[\w.-]+-\d+\.drc"$/ : new RegExp(`filename="${several.id}-${n}\\.drc"`));
        }
    }
});

// ---- slices

/* A PNG as written here: eight bits, RGBA, rows filtered by the one above. */
function readPicture(bytes) {
    assert.ok(bytes.subarray(0, 8).equals(Buffer.from([0x89, 0x50, 0x4e, 0x47, 13, 10, 26, 10])));
    const chunks = {};
    for (let at = 8; at < bytes.length;) {
        const size = bytes.readUInt32BE(at), type = bytes.toString('latin1', at + 4, at + 8);
        assert.equal(bytes.readUInt32BE(at + 8 + size), crc32(bytes.subarray(at + 4, at + 8 + size)), type);
        chunks[type] = bytes.subarray(at + 8, at + 8 + size);
        at += 12 + size;
    }
    const width = chunks.IHDR.readUInt32BE(0), height = chunks.IHDR.readUInt32BE(4), rows = inflateSync(chunks.IDAT);
    assert.deepEqual([...chunks.IHDR.subarray(8)], [8, 6, 0, 0, 0]);
    assert.equal(rows.length, height * (width * 4 + 1));
    const pixels = Buffer.alloc(width * height * 4);
    for (let y = 0; y < height; y++) {
        const row = y * (width * 4 + 1);
        assert.equal(rows[row], 2);
        for (let i = 0; i < width * 4; i++) pixels[y * width * 4 + i] = rows[row + 1 + i] + (y ? pixels[(y - 1) * width * 4 + i] : 0);
    }
    return { width, height, at: (x, y) => pixels.subarray((y * width + x) * 4, (y * width + x) * 4 + 4) };
}
function crc32(bytes) {
    let crc = ~0;
    for (const byte of bytes) {
        crc ^= byte;
        for (let k = 0; k < 8; k++) crc = (crc >>> 1) ^ (crc & 1 ? 0xedb88320 : 0);
    }
    return ~crc >>> 0;
}
async function slicesOf(id, structure) {
    const reply = await get(`/models/${id}/slices/9999.png${structure ? `?structure=${encodeURIComponent(structure)}` : ''}`);
    isProblem(reply, 404, /slices \d+\.\.\d+/);
    return /slices (\d+)\.\.(\d+)/.exec(reply.json().detail).slice(1).map(Number);
}
/* World millimetres to picture pixels. */
function toPicture({ corner, right, down }, point) {
    const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2], from = point.map((p, i) => p - corner[i]);
    return [dot(from, right) / dot(right, right), dot(from, down) / dot(down, down)];
}
const turnOf = (a, b, c) => (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
const cross = (a, b, c, d) => turnOf(a, b, c) * turnOf(a, b, d) < 0 && turnOf(c, d, a) * turnOf(c, d, b) < 0;

test('the picture of a slice and its outlines show the same', async () => {
    for (const { id } of models) {
        const [low, high] = await slicesOf(id);
        const { structures } = (await get(`/models/${id}`)).json();
        for (const k of [low, Math.floor((low + high) / 2), high]) {
            const reply = await get(`/models/${id}/slices/${k}.png`);
            assert.equal(reply.code, 200, reply.text);
            assert.equal(reply.headers['content-type'], 'image/png');
            const picture = readPicture(reply.body), outline = (await get(`/models/${id}/slices/${k}/outline`)).json();
            assert.equal(outline.slice, k);
            assert.equal(outline.tolerance_mm, 0);
            assert.deepEqual([outline.picture.width, outline.picture.height], [picture.width, picture.height]);
            const loops = outline.loops.map(({ structure, points }) => ({ structure, points: points.map((p) => toPicture(outline.picture, p)) }));
            let seen = 0;
            for (let y = 0; y < picture.height; y++)
                for (let x = 0; x < picture.width; x++) {
                    const inside = new Set();
                    for (const { structure, points } of loops)
                        points.forEach((a, i) => {
                            const b = points[(i + 1) % points.length];
                            if ((a[1] > y + 0.5) === (b[1] > y + 0.5) || x + 0.5 > a[0] + (b[0] - a[0]) * (y + 0.5 - a[1]) / (b[1] - a[1])) return;
                            if (!inside.delete(structure)) inside.add(structure);
                        });
                    const [r, g, b, opacity] = picture.at(x, y);
                    assert.equal(opacity, inside.size ? 255 : 0, `${id} ${k}: ${x} ${y}`);
                    seen += inside.size;
                    if (inside.size !== 1) continue;
                    const { color } = structures.find(({ name }) => inside.has(name));
                    assert.equal(`#${[r, g, b].map((v) => v.toString(16).padStart(2, '0')).join('')}`, color);
                }
            assert.ok(seen > 0 || k !== Math.floor((low + high) / 2), 'something is in the middle slice');
        }
    }
});

test('outlines at a tolerance have fewer points and never cross', async () => {
    for (const { id } of models) {
        const [low, high] = await slicesOf(id), k = Math.floor((low + high) / 2);
        let before = Infinity;
        for (const tolerance of ['0', '0.3', '1.5', '5', '1000']) {
            const reply = await get(`/models/${id}/slices/${k}/outline?tolerance=${tolerance}`);
            const { loops, tolerance_mm: told, picture } = reply.json();
            assert.equal(told, Number(tolerance));
            const count = loops.reduce((sum, { points }) => sum + points.length, 0);
            assert.ok(count <= before);
            before = count;
            const edges = loops.flatMap(({ structure, points }) => {
                const flat = points.map((p) => toPicture(picture, p));
                assert.ok(flat.length >= 3);
                return flat.map((p, i) => [structure, p, flat[(i + 1) % flat.length]]);
            });
            edges.forEach(([s, a, b], i) => { for (const [t, c, d] of edges.slice(i + 1)) assert.ok(s !== t || !cross(a, b, c, d), `${id} ${tolerance}`); });
        }
    }
});

test('a contour says how its rays meet it', async () => {
    const name = several.structures > 1 ? (await get(`/models/${several.id}`)).json().structures[1].name : undefined;
    const query = name ? `structure=${encodeURIComponent(name)}` : '';
    const [low, high] = await slicesOf(several.id, name), k = Math.floor((low + high) / 2);
    for (const rays of [undefined, 16, 256]) {
        const reply = await get(`/models/${several.id}/slices/${k}/contour?${query}${rays ? `&rays=${rays}` : ''}`);
        assert.equal(reply.code, 200, reply.text);
        const { ray_count: count, loops } = reply.json();
        assert.equal(count, rays ?? 64);
        assert.ok(loops.length > 0);
        for (const loop of loops) {
            if (name) assert.equal(loop.structure, name);
            assert.equal(typeof loop.hole, 'boolean');
            assert.equal(loop.centre.length, 3);
            for (const list of [loop.rays, loop.in_out, loop.edges]) assert.equal(list.length, loop.points.length);
            let turned = 0;
            loop.edges.forEach((edge, i) => {
                const next = (i + 1) % loop.edges.length, step = (loop.rays[next] - loop.rays[i] + count) % count;
                assert.equal(step, { f: 1, b: count - 1 }[edge] ?? 0, edge);
                assert.ok(['f', 'b', 'ui', 'uo', 'di', 'do'].includes(edge));
                turned += edge === 'f' ? 1 : edge === 'b' ? -1 : 0;
            });
            assert.equal(turned, loop.points.length ? count : 0, 'once round');
        }
    }
});

test('slices are kept, compressed and refused like everything else', async () => {
    const [low, high] = await slicesOf(model.id), base = `/models/${model.id}/slices/${low}`;
    isProblem(await get(`/models/${model.id}/slices/${high + 1}.png`), 404);
    if (low > 0) isProblem(await get(`/models/${model.id}/slices/${low - 1}/outline`), 404);
    for (const bad of ['x', '-1', '1.5', '007', '99999', '']) isProblem(await get(`/models/${model.id}/slices/${bad}/outline`), 404);
    for (const bad of ['-1', 'x', '', '1e3', '0x10', 'nan', 'inf', '1.2.3', '.', '%201', '2000000', '1'.repeat(40)])
        isProblem(await get(`${base}/outline?tolerance=${bad}`), 400, /tolerance/);
    for (const bad of ['0', '12', '2', '8192', '-8', 'x', '']) isProblem(await get(`${base}/contour?rays=${bad}`), 400, /rays/);
    isProblem(await get(`${base}/outline?tolerance=1&tolerance=2`), 400, /twice/);
    isProblem(await get(`${base}.png?structure=no%20such`), 404, /structure/);
    isProblem(await get(`${base}.gif`), 404);
    isProblem(await request('POST', `${base}.png`), 405);
    for (const path of [`${base}.png`, `${base}/outline?tolerance=.5`, `${base}/contour`]) {
        const first = await get(path), again = await get(path), head = await request('HEAD', path);
        assert.match(first.headers.etag, /^"[0-9a-f]{32}"$/);
        assert.ok(first.body.equals(again.body));
        assert.equal(head.headers['content-length'], String(first.body.length));
        assert.equal(head.headers.etag, first.headers.etag);
        assert.equal((await get(path, { 'If-None-Match': first.headers.etag })).code, 304);
        const packed = await get(path, { 'Accept-Encoding': 'gzip' });
        if (path.endsWith('.png')) assert.ok(!('content-encoding' in packed.headers));
        else assert.ok(gunzipSync(packed.body).equals(first.body));
    }
    const part = await get(`${base}.png`, { Range: 'bytes=0-7' });
    assert.equal(part.code, 206);
    assert.equal(part.body.length, 8);
    assert.match((await get(`${base}.png?v=${model.hash}`)).headers['cache-control'], /immutable/);
});

/** The manifest that a page carries, and its decoder's text. */
const CARRIED = /<script type="text\/plain" id="model">(.*?)<\/script><script type="text\/plain" id="wasm">(.+?)<\/script>/s;

test('the page has manifest and base shape inlined, and nothing in it ends a script early', async () => {
    const { body, headers } = await get(`/m/${several.id}`);
    assert.equal(headers['content-type'], 'text/html; charset=utf-8');
    assert.match(headers['content-security-policy'], /'wasm-unsafe-eval'/);
    assert.equal(headers['x-content-type-options'], 'nosniff');
    const html = body.toString();
    assert.ok(!html.includes('<!--LATHE_MODEL-->'));
    const json = CARRIED.exec(html), manifest = JSON.parse(json[1]);
    assert.equal(manifest.structures.length, several.structures);
    assert.ok(!json[1].includes('<'));
    for (const structure of manifest.structures) assert.deepEqual(Object.keys(structure).sort(), ['color', 'levels', 'name']);
    assert.ok(Number.isInteger(manifest.structures[0].levels));
    const whole = (await get(`/models/${several.id}`)).json();
    for (const key of ['id', 'name', 'bounds']) assert.deepEqual(manifest[key], whole[key]);
    assert.equal(manifest.levels.length, whole.levels.length);
    for (const [i, level] of manifest.levels.entries())
        for (const key of ['error_rms_mm', 'error_max_mm'])
            if (whole.levels[i][key] === null) assert.equal(level[key], null);
            else assert.equal(level[key], +whole.levels[i][key].toPrecision(2));
    assert.ok(Buffer.from(manifest.base, 'base64').equals((await get(`/models/${several.id}/deltas/0.lathe`)).body));
});

test('the page of one structure has only that one', async () => {
    const { structures, bounds } = (await get(`/models/${several.id}`)).json();
    for (const { name } of structures.slice(0, 3)) {
        if (name.includes('?')) continue;
        const html = (await get(`/m/${several.id}?structure=${encodeURIComponent(name)}`)).text;
        const manifest = JSON.parse(CARRIED.exec(html)[1]);
        assert.deepEqual(manifest.structures.map((s) => s.name), [name]);
        for (let axis = 0; axis < 3; axis++)
            assert.ok(manifest.bounds[0][axis] >= bounds[0][axis] && manifest.bounds[1][axis] <= bounds[1][axis]);
        const delta = (await get(`/models/${several.id}/deltas/0.lathe?structure=${encodeURIComponent(name)}`)).body;
        assert.ok(Buffer.from(manifest.base, 'base64').equals(delta));
    }
});

test('the root is the page without a model; health is told', async () => {
    const root = await get('/');
    assert.equal(root.code, 200);
    assert.ok(!root.text.includes('id="model"') && !root.text.includes('<!--LATHE_MODEL-->'));
    assert.deepEqual((await get('/healthz')).json(), { status: 'ok' });
});

// ---- HTTP

const paths = () => ['/', '/healthz', '/models', `/models/${model.id}`, `/m/${model.id}`, `/models/${model.id}.lathe`,
    `/models/${model.id}/stream`, `/models/${model.id}/stream?from=0&to=0`, `/models/${model.id}/deltas/0.lathe`, `/models/${model.id}/deltas/0.drc`,
    ...['drc', 'glb', 'stl', 'ply'].map((suffix) => `/models/${model.id}/levels/0.${suffix}`)];

test('HEAD is GET without the body', async () => {
    for (const path of paths()) {
        const full = await get(path), head = await request('HEAD', path);
        assert.equal(head.code, 200, path);
        for (const name of ['content-length', 'content-type', 'etag', 'cache-control']) assert.equal(head.headers[name], full.headers[name]);
        assert.equal(Number(head.headers['content-length']), full.body.length);
    }
    const client = new Client(server.port);
    client.send(write('HEAD', '/models'), write('GET', '/healthz'));
    await client.response(true);
    assert.deepEqual((await client.response()).json(), { status: 'ok' }, 'no body between');
    client.close();
});

test('strong validators: the same bytes, the same ETag, 304 when known', async () => {
    const seen = new Map();
    for (const path of paths()) {
        const { headers, body } = await get(path);
        assert.match(headers.etag, /^"[0-9a-f]{32}"$/);
        assert.equal(headers['cache-control'], 'no-cache');
        if (seen.has(headers.etag)) assert.ok(seen.get(headers.etag).equals(body));
        seen.set(headers.etag, body);
        for (const value of [headers.etag, `W/${headers.etag}`, `"x", ${headers.etag}`, '*', `"a,b" ,${headers.etag},"c"`]) {
            const reply = await get(path, { 'If-None-Match': value });
            assert.equal(reply.code, 304, `${path} ${value}`);
            assert.equal(reply.headers.etag, headers.etag);
            assert.equal(reply.headers['cache-control'], 'no-cache');
        }
        for (const value of ['"x"', headers.etag.slice(0, -2), '', `"${headers.etag.slice(1, -1)}x"`])
            assert.equal((await get(path, { 'If-None-Match': value })).code, 200, `${path} ${value}`);
    }
});

test('a URL that names the version may be kept for ever; another version is not served', async () => {
    const { headers } = await get(`/models/${model.id}/stream?v=${model.hash}`);
    assert.match(headers['cache-control'], /immutable/);
    assert.match((await get(`/models/${model.id}/stream?v=${model.hash}`, { 'If-None-Match': headers.etag })).headers['cache-control'], /immutable/);
    assert.equal((await get(`/m/${model.id}?v=${model.hash}`)).headers['cache-control'], 'no-cache', 'the page changes with the program');
    isProblem(await get(`/models/${model.id}/stream?v=${'0'.repeat(32)}`), 404, new RegExp(model.hash));
});

test('pages and JSON are compressed when the client takes it, binary never', async () => {
    for (const path of ['/', '/models', `/models/${model.id}`, `/m/${model.id}`]) {
        const plain = await get(path);
        assert.equal(plain.headers['content-encoding'], undefined);
        assert.equal(plain.headers.vary, 'Accept-Encoding');
        const etags = new Set([plain.headers.etag]);
        for (const [accept, encoding, unpack] of [['gzip, deflate, br', 'br', brotliDecompressSync], ['gzip', 'gzip', gunzipSync],
            ['br;q=0, gzip', 'gzip', gunzipSync], ['gzip;q=0.5, br;q=0.4', 'gzip', gunzipSync], ['*', 'br', brotliDecompressSync],
            ['identity;q=0, gzip;q=0.1', 'gzip', gunzipSync]]) {
            const packed = await get(path, { 'Accept-Encoding': accept });
            assert.equal(packed.headers['content-encoding'], encoding, accept);
            assert.equal(packed.headers.vary, 'Accept-Encoding');
            assert.ok(unpack(packed.body).equals(plain.body));
            etags.add(packed.headers.etag);
            assert.equal((await get(path, { 'Accept-Encoding': accept, 'If-None-Match': packed.headers.etag })).code, 304);
        }
        assert.equal(etags.size, 3, 'an ETag for each encoding');
        for (const accept of ['deflate', '', 'identity', 'br;q=0', 'brx', 'gzip;q=0.0'])
            assert.equal((await get(path, { 'Accept-Encoding': accept })).headers['content-encoding'], undefined, accept);
        isProblem(await get(path, { 'Accept-Encoding': '*;q=0' }), 406, /Accept-Encoding/);
    }
    const stream = await get(`/models/${model.id}/stream`, { 'Accept-Encoding': 'gzip, br' });
    assert.equal(stream.headers['content-encoding'], undefined);
    isProblem(await get(`/models/${model.id}/stream`, { 'Accept-Encoding': 'br, identity;q=0' }), 406);
});

test('ranges of the archive', async () => {
    const path = `/models/${model.id}.lathe`, size = archive.length;
    const { headers: { etag, ...headers } } = await get(path);
    assert.equal(headers['accept-ranges'], 'bytes');
    for (const [range, first, last] of [['0-0', 0, 0], ['0-15', 0, 15], ['10-', 10, size - 1], ['-7', size - 7, size - 1],
        [`-${size + 5}`, 0, size - 1], [`5-${size * 2}`, 5, size - 1], [`${size - 1}-`, size - 1, size - 1]]) {
        const reply = await get(path, { Range: `bytes=${range}` });
        assert.equal(reply.code, 206, range);
        assert.equal(reply.headers['content-range'], `bytes ${first}-${last}/${size}`);
        assert.equal(reply.headers.etag, etag);
        assert.ok(reply.body.equals(archive.subarray(first, last + 1)));
    }
    for (const range of [`${size}-`, '-0', `${size + 1}-${size + 9}`, '99999999999999999-']) {
        const reply = await get(path, { Range: `bytes=${range}` });
        isProblem(reply, 416);
        assert.equal(reply.headers['content-range'], `bytes */${size}`);
    }
    for (const range of ['bytes=', 'bytes=a-b', 'bytes=5-2', 'bytes=0-1,3-4', 'items=0-1', 'bytes=-', 'bytes=1', 'bytes=0-1x',
        'bytes=99999999999999999999999-'])
        assert.equal((await get(path, { Range: range })).code, 200, range);
    assert.equal((await get(path, { Range: 'bytes=0-3', 'If-Range': etag })).code, 206);
    assert.equal((await get(path, { Range: 'bytes=0-3', 'If-Range': '"other"' })).code, 200);
    assert.equal((await get(path, { Range: 'bytes=0-3', 'If-Range': `W/${etag}` })).code, 200, 'weak validators do not do');
    assert.equal((await get(path, { Range: 'bytes=0-3', 'If-Range': 'Sun, 06 Nov 1994 08:49:37 GMT' })).code, 200);
    assert.equal((await get(path, { Range: 'bytes=0-3', 'If-None-Match': etag })).code, 304);
    assert.equal((await request('HEAD', path, { Range: 'bytes=0-3' })).code, 200);
    assert.equal((await get('/models', { Range: 'bytes=0-3' })).code, 200);
});

test('other origins may read, and ask before', async () => {
    for (const path of [`/models/${model.id}`, `/models/${model.id}/stream`]) {
        const { headers } = await get(path, { Origin: 'https://example.org' });
        assert.equal(headers['access-control-allow-origin'], '*');
        for (const name of ['ETag', 'Content-Range']) assert.ok(headers['access-control-expose-headers'].includes(name));
        const asked = await request('OPTIONS', path, { Origin: 'https://example.org', 'Access-Control-Request-Method': 'GET' });
        assert.equal(asked.code, 204);
        assert.equal(asked.headers['access-control-allow-methods'], 'GET, HEAD, OPTIONS');
        assert.ok(asked.headers['access-control-allow-headers'].includes('Range'));
    }
    assert.equal((await request('OPTIONS', '*')).code, 204);
    isProblem(await request('OPTIONS', '/nowhere'), 404);
});

test('what is not there', async () => {
    const { id, levels } = model, all = new RegExp(`levels 0\\.\\.${levels - 1}`);
    for (const path of ['/nowhere', '/models/', '/models/none', '/m', '/m/', '/m/none', '//', '/models//levels/0.glb', '/healthz/',
        `/models/${id}/levels`, `/models/${id}/levels/`, `/models/${id}/stream/x`, '/models/none.lathe', '/models/none/stream',
        '/models/..%2f..%2fetc%2fpasswd', '/models/%2e%2e', '/models/..', '/models/../healthz', `/models%2f${id}`, '/a/b/c/d/e/f/g/h/i',
        `/models/${id.toUpperCase()}X`, `/models/${id}/deltas/0.glb`, '/models/.lathe', '/%', '/models/%zz'])
        assert.ok([404, 400].includes((await get(path)).code), path);
    for (const name of [`${levels}.glb`, '9999.stl'])
        isProblem(await get(`/models/${id}/levels/${name}`), 404, all);
    for (const name of ['0.obj', '0', 'glb', '.glb', '-1.glb', '00.glb', '0x0.glb', '0.glb.glb', '1e0.stl', '99999999999.stl'])
        isProblem(await get(`/models/${id}/levels/${name}`), 404, /drc/);
    for (const name of [levels, 'x', '', '-1', '99999999999999999999'])
        isProblem(await get(`/models/${id}/deltas/${name}.lathe`), 404);
    isProblem(await get(`/models/${id}/stream?structure=nobody`), 404, /structure/);
    isProblem(await get(`/m/${id}?structure=%ff%fe`), 404, /structure/);
});

test('arguments that are none', async () => {
    const { id, levels } = model;
    for (const smooth of ['0', '9', 'x', '']) isProblem(await get(`/models/${id}/levels/0.glb?smooth=${smooth}`), 400, /smooth/);
    for (const query of ['from=x', 'from=-1', 'from=', 'to=1.5', 'from=1&to=0', `from=${levels + 1}`, 'from=99999999999999999999', 'structure=',
        'from=0&from=1', 'structure=a&structure=b', 'structure=%00', 'structure=%', 'structure=%4', 'from=0x1', 'from=+1',
        `${'a&'.repeat(17)}`])
        isProblem(await get(`/models/${id}/stream?${query}`), 400);
    for (const query of ['', '&', 'other=1', 'From=9', 'a=b&from=0&c', '=', 'a==b'])
        assert.equal((await get(`/models/${id}/stream?${query}`)).code, 200, query);
    assert.equal((await get(`/models/${id}/stream?${'a&'.repeat(3000)}`)).code, 400, 'many parameters');
});

test('methods that are not taken', async () => {
    for (const method of ['POST', 'PUT', 'DELETE', 'PATCH', 'TRACE', 'BREW', 'get']) {
        const reply = await request(method, '/models');
        isProblem(reply, 405);
        assert.equal(reply.headers.allow, 'GET, HEAD, OPTIONS');
    }
    isProblem(await request('POST', '/nowhere'), 404);
});

test('keep-alive, pipelining, HTTP/1.0, absolute targets, requests in pieces', async () => {
    const client = new Client(server.port);
    for (let i = 0; i < 20; i++) assert.equal((await client.send(write('GET', '/healthz')).response()).code, 200);
    client.send(Array.from({ length: 50 }, (_, i) => write('GET', i % 2 ? '/healthz' : `/models/${model.id}/deltas/0.lathe`)).join(''));
    for (let i = 0; i < 50; i++) assert.equal((await client.response()).body.toString().includes('"ok"'), i % 2 === 1);
    for (const target of ['/nowhere', '/models/%zz', `/models/${model.id}/levels/77.glb`])
        assert.ok((await client.send(write('GET', target)).response()).code >= 400);
    for (const character of write('GET', '/healthz')) { client.send(character); await sleep(1); }
    assert.equal((await client.response()).code, 200, 'byte by byte, after errors');
    assert.equal((await client.send(write('GET', '/healthz', { Connection: 'close' })).response()).headers.connection, 'close');
    await client.closed();
    const old = new Client(server.port);
    assert.equal((await old.send('GET /healthz HTTP/1.0\r\n\r\n').response()).code, 200);
    await old.closed();
    assert.equal((await get('http://localhost/healthz')).code, 200);
    assert.equal((await get(`http://localhost?x`)).code, 200);
});

test('requests that two readers could understand in two ways are refused, and the connection closed', async () => {
    const host = 'Host: localhost\r\n', next = `GET /models HTTP/1.1\r\n${host}\r\n`;
    const cases = [];
    for (const method of ['GET', 'POST', 'PUT', 'DELETE', 'HEAD'])
        for (const fields of ['Content-Length: 0\r\nContent-Length: 5', 'Content-Length: 5\r\nContent-Length: 0',
            'Content-Length: 5\r\nContent-Length: 5', 'Content-Length: 5\r\nTransfer-Encoding: chunked',
            'Transfer-Encoding: chunked\r\nContent-Length: 5', 'Transfer-Encoding: chunked', 'Transfer-Encoding: gzip, chunked',
            'Transfer-Encoding: what', 'Transfer-Encoding:\tchunked', 'Transfer-Encoding : chunked', 'Content-Length : 5',
            'Transfer-Encoding: identity', 'Transfer-Encoding: chunked\r\nTransfer-Encoding: identity',
            'Content-Length: 5', 'Content-Length: +5', 'Content-Length: -5', 'Content-Length: 5, 5', 'Content-Length: 0x5',
            'Content-Length: 99999999999999999999999', 'Content-Length:'])
            cases.push(`${method} /healthz HTTP/1.1\r\n${host}${fields}\r\n\r\nhello`);
    cases.push(`GET /healthz HTTP/1.1\r\n${host}${host}\r\n`, 'GET /healthz HTTP/1.1\r\n\r\n',
        `GET /healthz\0/x HTTP/1.1\r\n${host}\r\n`, `GET /healthz?a\0b HTTP/1.1\r\n${host}\r\n`, `GE\0T /healthz HTTP/1.1\r\n${host}\r\n`,
        `GET  /healthz HTTP/1.1\r\n${host}\r\n`, `GET /healthz HTTP/1.1\r\n Transfer-Encoding: chunked\r\n${host}\r\n`,
        `GET /healthz HTTP/1.1\r\n${host}a\0b: c\r\n\r\n`, `GET /healthz HTTP/2.0\r\n${host}\r\n`, 'GET /healthz\r\n\r\n',
        `GET /${'a'.repeat(20000)} HTTP/1.1\r\n${host}\r\n`, `GET / HTTP/1.1\r\n${host}a: ${'b'.repeat(20000)}\r\n\r\n`,
        `GET / HTTP/1.1\r\n${host}${Array.from({ length: 900 }, (_, i) => `a${i}: b\r\n`).join('')}\r\n`);
    for (const bytes of cases) {
        const client = new Client(server.port);
        client.send(bytes + next);
        await client.closed();
        const got = client.bytes.toString('latin1'), label = bytes.slice(0, 120);
        assert.ok(!got.includes(' 200 ') && !got.includes('"models"'), label);
        assert.match(got, /^HTTP\/1\.[01] (400|405|413|414|431|505) /, label);
        client.close();
    }
    isProblem(await get('/models/%00'), 400);
    isProblem(await get(`/models/${model.id}%00`), 400);
    for (const target of ['nowhere', '*', '/a#b', '/\x7f', '/\u00e9']) isProblem(await get(target), 400);
});

test('garbage does not hurt', async () => {
    for (let i = 0; i < 60; i++) {
        const client = new Client(server.port);
        const bytes = Buffer.from(Array.from({ length: 200 + i * 10 }, (_, k) => (k * 7919 + i * 104729 + (k * k >> 3)) & 255));
        client.send(i % 2 ? Buffer.concat([Buffer.from('GET /'), bytes]) : bytes, '\r\n\r\n');
        await Promise.race([client.closed(), sleep(20)]).catch(() => {});
        client.close();
    }
    assert.equal((await get('/healthz')).code, 200);
});

test('a large body is refused without being read', async () => {
    const client = new Client(server.port);
    client.send(`POST /models HTTP/1.1\r\nHost: x\r\nContent-Length: 1000000000\r\n\r\n`, Buffer.alloc(1 << 20));
    await client.closed();
    client.close();
    const polite = new Client(server.port);
    isProblem(await polite.send('POST /models HTTP/1.1\r\nHost: x\r\nContent-Length: 5\r\nExpect: 100-continue\r\n\r\n').response(), 405);
    await polite.closed();
});

test('100 clients at once get the same bytes as one', async () => {
    const wanted = ['/models', `/models/${several.id}`, `/models/${several.id}/stream`, `/models/${several.id}/levels/0.glb`, `/m/${several.id}`];
    const expected = await Promise.all(wanted.map((path) => get(path)));
    await Promise.all(Array.from({ length: 100 }, async (_, i) => {
        const client = new Client(server.port);
        for (let k = 0; k < 20; k++) {
            const which = (i + k) % wanted.length;
            const { code, body } = await client.send(write('GET', wanted[which])).response();
            assert.equal(code, 200);
            assert.ok(body.equals(expected[which].body));
        }
        client.close();
    }));
});

test('100 clients ask at once for what is not built yet', async () => {
    const fresh = await start([folder]);
    const path = `/models/${several.id}/levels/0.stl`, expected = (await get(path)).body;
    const replies = await Promise.all(Array.from({ length: 100 }, () => raw(fresh.port, write('GET', path))));
    for (const { code, body } of replies) assert.ok(code === 200 && body.equals(expected));
    assert.equal(await stop(fresh), 0);
});

test('a small cache serves everything all the same', async () => {
    const tight = await start([folder], { LATHE_CACHE_MB: '1', LATHE_THREADS: '4' });
    await Promise.all(Array.from({ length: 20 }, async (_, i) => {
        for (const { id, levels } of models)
            for (const suffix of ['stl', 'ply']) {
                const { code } = await raw(tight.port, write('GET', `/models/${id}/levels/${i % Math.min(levels, 2)}.${suffix}`));
                assert.equal(code, 200);
            }
    }));
    assert.equal(await stop(tight), 0);
});

test('clients that drip, sit or do not read are cut off, and hinder nobody', async () => {
    const strict = await start([folder], { LATHE_HEADER_SECONDS: '1', LATHE_IDLE_SECONDS: '1' });
    const started = Date.now();
    const dripping = Array.from({ length: 100 }, () => new Client(strict.port).send('GET /healthz HTTP/1.1\r\nHost: x\r\n'));
    const silent = new Client(strict.port);
    const idle = new Client(strict.port);
    assert.equal((await idle.send(write('GET', '/healthz')).response()).code, 200);
    const drip = setInterval(() => dripping.forEach((client) => client.send('a: b\r\n')), 100);
    const again = setInterval(() => idle.send('G'), 300);
    while (Date.now() - started < 600) {
        const asked = Date.now();
        assert.equal((await raw(strict.port, write('GET', '/healthz'))).code, 200);
        assert.ok(Date.now() - asked < 500, 'an honest client is served');
    }
    await Promise.all([...dripping, silent, idle].map((client) => client.closed(4000)));
    assert.ok(Date.now() - started < 4000);
    clearInterval(drip);
    clearInterval(again);
    assert.equal(await stop(strict), 0);
});

test('no more connections than allowed, and those wait', async () => {
    const narrow = await start([folder], { LATHE_MAX_CONNECTIONS: '4', LATHE_HEADER_SECONDS: '1' });
    const sitting = Array.from({ length: 20 }, () => new Client(narrow.port));
    await sleep(100);
    const late = new Client(narrow.port);
    await Promise.all(sitting.map((client) => client.closed(10000)));
    late.close();
    assert.equal((await raw(narrow.port, write('GET', '/healthz'))).code, 200);
    assert.equal(await stop(narrow), 0);
});

// ---- files come, change and go

test('a damaged archive is reported and skipped', async () => {
    const directory = mkdtempSync(join(folder, 'damaged-')), bytes = archive;
    writeFileSync(join(directory, 'good.lathe'), bytes);
    writeFileSync(join(directory, 'short.lathe'), bytes.subarray(0, bytes.length >> 1));
    writeFileSync(join(directory, 'empty.lathe'), '');
    writeFileSync(join(directory, 'noise.lathe'), Buffer.alloc(5000, 'noise'));
    writeFileSync(join(directory, '.hidden.lathe'), bytes);
    writeFileSync(join(directory, 'other.txt'), bytes);
    const one = await start([directory]);
    const { models: list } = (await raw(one.port, write('GET', '/models'))).json();
    assert.deepEqual(list.map(({ id }) => id), ['good']);
    for (const name of ['short', 'empty', 'noise']) isProblem(await raw(one.port, write('GET', `/models/${name}`)), 404);
    await sleep(2500);                              // it is looked at again, and not reported again
    assert.equal(await stop(one), 0);
    for (const name of ['short', 'empty', 'noise']) assert.equal(one.err.split(`${name}.lathe is not served`).length, 2, one.err);
});

test('ids come from file names; files may be named; the same id twice is reported', async () => {
    const directory = mkdtempSync(join(folder, 'names-')), other = mkdtempSync(join(folder, 'names-'));
    writeFileSync(join(directory, 'Left Thalamus (1).lathe'), archive);
    writeFileSync(join(other, 'left-thalamus--1-.lathe'), archive);
    writeFileSync(join(other, `${'x'.repeat(100)}.lathe`), archive);
    const one = await start([join(directory, 'Left Thalamus (1).lathe'), other]);
    const { models: list } = (await raw(one.port, write('GET', '/models'))).json();
    assert.deepEqual(list.map(({ id }) => id), ['left-thalamus--1-', 'x'.repeat(64)]);
    assert.equal(await stop(one), 0);
    assert.match(one.err, /same id/);
});

test('archives that appear, change and vanish while the server runs', async () => {
    const directory = mkdtempSync(join(folder, 'live-'));
    const one = await start([directory]);
    const list = async () => (await raw(one.port, write('GET', '/models'))).json().models;
    const until = async (condition) => {
        for (let i = 0; i < 80; i++) { if (condition(await list())) return; await sleep(100); }
        assert.fail('the list has not changed');
    };
    assert.deepEqual(await list(), []);
    const publish = (name, from) => { copyFileSync(from, join(directory, '.new')); renameSync(join(directory, '.new'), join(directory, name)); };
    const files = readdirSync(folder).filter((name) => name.endsWith('.lathe')).map((name) => join(folder, name));
    publish('a.lathe', files[0]);
    await until((now) => now.length === 1);
    const before_ = (await list())[0].hash;
    const page = await raw(one.port, write('GET', '/models/a/stream'));
    if (files.length > 1) {
        publish('a.lathe', files.at(-1));
        await until((now) => now[0].hash !== before_);
        assert.notEqual((await raw(one.port, write('GET', '/models/a/stream'))).headers.etag, page.headers.etag);
    }
    unlinkSync(join(directory, 'a.lathe'));
    await until((now) => now.length === 0);
    assert.equal(await stop(one), 0);
});

// ---- start and end

test('the access log has one line for each request, which no client can forge', async () => {
    const one = await start([folder]);
    const client = new Client(one.port);           // one connection, since threads log in no order
    await client.send(write('GET', '/healthz?"\\x')).response();
    await client.send('GET /a\x1b[31m\x80 HTTP/1.1\r\nHost: x\r\n\r\n').response();
    await client.send(write('HEAD', '/models')).response(true);
    client.close();
    assert.equal(await stop(one), 0);
    const lines = one.err.trim().split('\n').slice(-3);
    assert.match(lines[0], /^127\.0\.0\.1 "GET \/healthz\?\\x22\\x5cx" 200 15 \d+ms$/);
    assert.match(lines[1], /^127\.0\.0\.1 "GET \/a\\x1b\[31m[^"]*" 400 \d+ \d+ms$/);
    assert.match(lines[2], /^127\.0\.0\.1 "HEAD \/models" 200 0 \d+ms$/);
    const quiet = await start([folder, '--quiet']);
    await raw(quiet.port, write('GET', '/healthz'));
    assert.equal(await stop(quiet), 0);
    assert.doesNotMatch(quiet.err, /healthz/);
});

test('a port in use, an address that is not here, a path that is not there: a clear message, exit 1', async () => {
    const fails = (args) => new Promise((done) => {
        const child = spawn(program, ['serve', ...args]);
        let err = '';
        child.stderr.on('data', (data) => { err += data; });
        child.on('close', (code) => done({ code, err }));
    });
    const taken = await fails([folder, '--port', String(server.port), '--bind', '127.0.0.1']);
    assert.equal(taken.code, 1);
    assert.match(taken.err, new RegExp(`port ${server.port}.*in use`));
    assert.equal((await fails([folder, '--port', '0', '--bind', '192.0.2.1'])).code, 1);
    assert.equal((await fails([folder, '--port', '0', '--bind', 'no such host'])).code, 1);
    const missing = await fails([join(folder, 'missing'), '--port', '0']);
    assert.equal(missing.code, 1);
    assert.match(missing.err, /missing: No such file/);
});

for (const signal of ['SIGTERM', 'SIGINT'])
    test(`${signal} ends it cleanly while clients are connected`, async () => {
        const one = await start([folder]);
        const idle = new Client(one.port), half = new Client(one.port), used = new Client(one.port);
        half.send('GET /healthz HTTP/1.1\r\n');
        await used.send(write('GET', '/healthz')).response();
        const asked = Date.now();
        assert.equal(await stop(one, signal), 0);
        assert.ok(Date.now() - asked < 3000);
        await Promise.all([idle, half, used].map((client) => client.closed()));
    });

test('a reply under way is finished before the end', async () => {
    const one = await start([folder]);
    const sizes = await Promise.all(models.map(async ({ id, levels }) => {
        const path = `/models/${id}/levels/${levels - 1}.stl`;
        return { path, size: Number((await request('HEAD', path)).headers['content-length']) };
    }));
    const { path, size } = sizes.sort((a, b) => b.size - a.size)[0];
    const client = new Client(one.port);
    client.send(write('GET', path));
    await sleep(20);
    const code = stop(one);
    const { body } = await client.response();
    assert.equal(body.length, size);
    assert.equal(await code, 0);
});

test('a client that does not read does not hold up the end for ever', async () => {
    const one = await start([folder], { LATHE_DRAIN_SECONDS: '1' });
    const client = new Client(one.port);
    client.socket.pause();
    const { id, levels } = several;
    client.send(write('GET', `/models/${id}/levels/${levels - 1}.stl`).repeat(200));
    await sleep(300);
    const asked = Date.now();
    assert.equal(await stop(one), 0);
    assert.ok(Date.now() - asked < 5000);
    client.close();
});
