// The Draco deltas as a stranger gets them: over HTTP, through the npm package's decoder, under Node and in the page that the
// server ships. LATHE_MODEL=FILE.lathe also walks that model.
import assert from 'node:assert/strict';
import { execFile } from 'node:child_process';
import { basename, join } from 'node:path';
import { after, before, test } from 'node:test';
import { fileURLToPath } from 'node:url';
import { promisify } from 'node:util';
import { createRequire } from 'node:module';
import { launch, program, screenshots, serve, withFolder, writeLabels } from './browser.mjs';
import { applyDelta, newModel, positionsOf } from '../src/draco_delta.js';

process.chdir(fileURLToPath(new URL('..', import.meta.url)));
const run = promisify(execFile), draco3d = createRequire(import.meta.url)('draco3d');
let server, browser, draco, folder, release, finished;

before(async () => {
    folder = await new Promise((resolve) => {
        finished = withFolder((path) => new Promise((end) => ((release = end), resolve(path))));
    });
    await run(program, ['bake', await writeLabels(folder), '--labels', 'all', '-o', join(folder, 'shapes.lathe')]);
    server = await serve(join(folder, 'shapes.lathe'), ...(process.env.LATHE_MODEL ? [process.env.LATHE_MODEL] : []));
    browser = await launch();
    draco = await draco3d.createDecoderModule({});
});

after(async () => {
    await browser?.close();
    await server?.stop();
    release?.();
    await finished;
});

/** Long computing lets the server close an idle connection unseen: once more then. */
const get = (path, options) => fetch(server.url + path, options).catch(() => fetch(server.url + path, options));
const bytesOf = async (path) => (await get(path)).arrayBuffer();
const manifestOf = async (id) => (await get(`/models/${id}`)).json();

/** How often each directed edge is used, as text: a closed, oriented surface has each once, and its opposite once. */
function assertClosed(triangles) {
    const edges = new Set();
    for (let i = 0; i < triangles.length; i += 3)
        for (let k = 0; k < 3; k++) {
            const edge = `${triangles[i + k]} ${triangles[i + ((k + 1) % 3)]}`;
            assert.ok(!edges.has(edge), `edge ${edge} twice`);
            edges.add(edge);
        }
    for (const edge of edges) assert.ok(edges.has(edge.split(' ').reverse().join(' ')), `edge ${edge} has one side`);
}

const volumeOf = (positions, triangles) => {
    let sum = 0;
    const p = (v, k) => positions[3 * v + k];
    for (let i = 0; i < triangles.length; i += 3) {
        const [a, b, c] = triangles.slice(i, i + 3);
        sum += p(a, 0) * (p(b, 1) * p(c, 2) - p(b, 2) * p(c, 1)) + p(a, 1) * (p(b, 2) * p(c, 0) - p(b, 0) * p(c, 2))
            + p(a, 2) * (p(b, 0) * p(c, 1) - p(b, 1) * p(c, 0));
    }
    return sum / 6;
};

/** Vertices of a level from its STL, by a grid of 4 mm. */
function stlGrid(stl) {
    const view = new DataView(stl), count = view.getUint32(80, true), grid = new Map();
    for (let t = 0; t < count; t++)
        for (let k = 0; k < 3; k++) {
            const p = [0, 4, 8].map((o) => view.getFloat32(84 + 50 * t + 12 * (k + 1) + o, true)), key = p.map((v) => Math.floor(v / 4)).join();
            if (!grid.has(key)) grid.set(key, []);
            grid.get(key).push(p);
        }
    const nearest = (p) => {
        let best = Infinity;
        const cell = p.map((v) => Math.floor(v / 4));
        for (let i = 0; i < 27; i++)
            for (const q of grid.get(cell.map((v, k) => v + (Math.floor(i / 3 ** k) % 3) - 1).join()) ?? [])
                best = Math.min(best, Math.hypot(p[0] - q[0], p[1] - q[1], p[2] - q[2]));
        return best;
    };
    return { count, nearest };
}

async function walk(id, { closed = true, far = 0.3 } = {}) {
    const { levels } = await manifestOf(id), model = newModel();
    const inSlices = () => new Set([...model.parts.values()].flatMap(({ slices }) => [...slices.values()].flat()));
    let sum = 0, old = 0, kept = 0;
    for (let n = 0; n < levels.length; n++) {
        const bytes = await bytesOf(`/models/${id}/deltas/${n}.drc`), before = [...model.at], outlines = inSlices();
        applyDelta(draco, model, bytes); // throws if its result is not what the writer had, to the last digit
        sum += bytes.byteLength;
        const now = inSlices();
        old += outlines.size;
        kept += [...outlines].filter((v) => now.has(v) && before[3 * v + 2] === model.at[3 * v + 2]).length;
        const all = [...model.parts.values()].flatMap(({ triangles }) => triangles);
        assert.equal(all.length / 3, levels[n].triangles);
        assert.equal(new Set(all).size, levels[n].vertices);
        if (closed) for (const { triangles } of model.parts.values()) assertClosed(triangles);
        const positions = positionsOf(model), stl = stlGrid(await bytesOf(`/models/${id}/levels/${n}.stl`));
        assert.equal(stl.count, levels[n].triangles);
        let close = 0, worst = 0;
        const used = [...new Set(all)], grain = Math.max(...[...model.parts.values()].map((p) => p.grain));
        for (const v of used) {
            const d = stl.nearest([...positions.subarray(3 * v, 3 * v + 3)]);
            close += d <= 0.18 * grain;
            worst = Math.max(worst, d);
        }
        assert.ok(close >= 0.97 * used.length, `${close} of ${used.length} near`);
        assert.ok(worst <= 1.3 * grain + far, `one ${worst} mm away`);
        for (const { triangles } of model.parts.values()) assert.ok(volumeOf(positions, triangles) > 0, 'turned outside in');
    }
    assert.ok(kept >= 0.96 * old, `${kept} of ${old} old vertices in slices kept`);
    const used = new Set([...model.parts.values()].flatMap(({ triangles }) => triangles)).size;
    assert.ok(used >= 0.98 * (model.at.length / 3), `${used} of ${model.at.length / 3} vertices used`);
    return { sum, model, levels };
}

test('deltas from the server, decoded by the stock decoder, are the levels', async () => {
    const { sum, model, levels } = await walk('shapes');
    let separate = 0;
    for (let n = 0; n < levels.length; n++) separate += (await bytesOf(`/models/shapes/levels/${n}.drc`)).byteLength;
    assert.ok(sum < separate, `${sum} bytes of deltas, ${separate} of levels`);
    assert.equal(model.parts.size, 2);
});

test('one structure alone; a level that changes nothing is empty', async () => {
    const { structures, levels } = await manifestOf('shapes');
    for (const [index, { name, levels: own }] of structures.entries()) {
        const model = newModel(), query = `?structure=${encodeURIComponent(name)}`;
        for (let n = 0; n < levels.length; n++) {
            const bytes = await bytesOf(`/models/shapes/deltas/${n}.drc${query}`);
            assert.equal(bytes.byteLength > 0, n < own.length);
            applyDelta(draco, model, bytes);
        }
        assert.deepEqual([...model.parts.keys()], [index]);
        assert.equal(model.parts.get(index).triangles.length / 3, own.at(-1).triangles);
    }
});

test('a delta that does not fit is found out', async () => {
    const deltas = [await bytesOf('/models/shapes/deltas/0.drc'), await bytesOf('/models/shapes/deltas/1.drc')];
    assert.throws(() => applyDelta(draco, newModel(), deltas[1]));
    assert.throws(() => applyDelta(draco, newModel(), deltas[0].slice(0, deltas[0].byteLength >> 1)));
    const model = newModel();
    applyDelta(draco, model, deltas[0]);
    model.at[0]++;
    for (const part of model.parts.values()) part.heights = part.heights.map((w) => w + 1);
    assert.throws(() => applyDelta(draco, model, deltas[1]));
});

test('the program writes the same file', async () => {
    const out = join(folder, 'delta.drc');
    await run(program, ['export', join(folder, 'shapes.lathe'), '--delta', '1', '-o', out]);
    const { readFile } = await import('node:fs/promises');
    assert.ok((await readFile(out)).equals(Buffer.from(await bytesOf('/models/shapes/deltas/1.drc'))));
    for (const wrong of [['--delta', '99'], ['--delta', 'x'], ['--delta', '1', '--level', '1'], ['--delta', '1', '--format', 'stl']])
        await assert.rejects(run(program, ['export', join(folder, 'shapes.lathe'), ...wrong, '-o', out]));
});

test('the route is like the others: validators, HEAD, ranges, caching, errors', async () => {
    const path = '/models/shapes/deltas/1.drc', whole = await get(path), etag = whole.headers.get('etag'), { hash } = await manifestOf('shapes');
    const bytes = Buffer.from(await whole.arrayBuffer());
    assert.equal(whole.headers.get('content-type'), 'application/octet-stream');
    assert.equal(whole.headers.get('content-disposition'), 'inline; filename="shapes-delta-1.drc"');
    assert.equal(whole.headers.get('access-control-allow-origin'), '*');
    assert.match(etag, /^"[0-9a-f]{32}"$/);
    assert.equal(bytes.subarray(0, 5).toString(), 'DRACO');
    assert.equal((await get(path, { headers: { 'if-none-match': etag } })).status, 304);
    const head = await get(path, { method: 'HEAD' });
    assert.equal(head.status, 200);
    assert.equal(head.headers.get('content-length'), String(bytes.length));
    assert.equal(head.headers.get('etag'), etag);
    const part = await get(path, { headers: { range: 'bytes=5-9' } });
    assert.equal(part.status, 206);
    assert.ok(Buffer.from(await part.arrayBuffer()).equals(bytes.subarray(5, 10)));
    assert.match((await get(`${path}?v=${hash}`)).headers.get('cache-control'), /immutable/);
    assert.equal((await get(path)).headers.get('cache-control'), 'no-cache');
    assert.equal((await get(path, { method: 'POST' })).status, 405);
    for (const [wrong, words] of [['/models/shapes/deltas/99.drc', /levels 0\.\.\d/], ['/models/shapes/deltas/x.drc', /\{n\}\.drc/],
        ['/models/none/deltas/0.drc', /no such model/], [`${path}?structure=none`, /no structure/], ['/draco/none', /no such model/], [`${path}?v=0`, /version/]]) {
        const reply = await get(wrong);
        assert.equal(reply.status, 404, wrong);
        assert.match((await reply.json()).detail, words);
    }
    assert.match((await get('/draco/shapes')).headers.get('content-type'), /^text\/html/);
});

async function visit(id, query = '') {
    const page = await browser.newPage({ viewport: { width: 1000, height: 640 } }), faults = [];
    page.on('pageerror', (error) => faults.push(String(error)));
    page.on('console', (message) => message.type() === 'error' && faults.push(message.text()));
    await page.goto(`${server.url}/draco/${id}${query}`);
    await page.waitForFunction(() => ['complete', 'failed'].includes(document.documentElement.dataset.state), null, { timeout: 120000 });
    return { page, faults };
}

test('the page decodes every level and draws it', async () => {
    const { levels } = await manifestOf('shapes'), { page, faults } = await visit('shapes');
    assert.equal(await page.evaluate(() => document.documentElement.dataset.state), 'complete', await page.textContent('#status'));
    const rows = await page.$$eval('#levels tr', (list) => list.map((row) => [...row.cells].map((cell) => Number(cell.textContent.replaceAll(',', '')))));
    assert.equal(rows.length, levels.length);
    for (const [n, [level, bytes, , triangles]] of rows.entries()) {
        assert.equal(level, n);
        assert.equal(bytes, (await bytesOf(`/models/shapes/deltas/${n}.drc`)).byteLength);
        assert.equal(triangles, levels[n].triangles);
    }
    const sum = rows.reduce((all, [, bytes]) => all + bytes, 0);
    assert.equal(await page.textContent('#status'), `${sum.toLocaleString('en')} bytes`);
    // Both structures are seen: pixels of many shades that are not the background.
    const shot = await page.locator('#view').screenshot({ path: join(await screenshots(), 'draco.png') });
    const shades = await page.evaluate(async (base64) => {
        const image = await createImageBitmap(await (await fetch(`data:image/png;base64,${base64}`)).blob());
        const context = Object.assign(document.createElement('canvas'), { width: image.width, height: image.height }).getContext('2d');
        context.drawImage(image, 0, 0);
        const { data } = context.getImageData(0, 0, image.width, image.height), seen = new Set();
        let covered = 0;
        for (let i = 0; i < data.length; i += 4) {
            if (data[i] + data[i + 1] + data[i + 2] < 100) continue;
            covered++;
            seen.add((data[i] << 16) | (data[i + 1] << 8) | data[i + 2]);
        }
        return { share: covered / (image.width * image.height), shades: seen.size };
    }, shot.toString('base64'));
    assert.ok(shades.share > 0.03 && shades.share < 0.9 && shades.shades > 50, JSON.stringify(shades));
    assert.deepEqual(faults, []);
    await page.context().close();
});

test('the page says what is wrong', async () => {
    const { page } = await visit('shapes', '?structure=none');
    assert.equal(await page.evaluate(() => document.documentElement.dataset.state), 'failed');
    assert.match(await page.textContent('#status'), /no structure/);
    await page.context().close();
});

test('LATHE_MODEL', { skip: !process.env.LATHE_MODEL }, async () => {
    const id = basename(process.env.LATHE_MODEL, '.lathe').toLowerCase(), { sum, levels } = await walk(id, { closed: false, far: 5 });
    const last = (await bytesOf(`/models/${id}/levels/${levels.length - 1}.drc`)).byteLength;
    console.log(`${id}: ${sum} bytes of deltas, ${(sum / last).toFixed(3)} of the last level's ${last}`);
    assert.ok(sum <= 1.4 * last);
});
