// The viewer in a real Chromium, served by the real program. LATHE_MODEL=FILE.lathe also shows that model (screenshots).
import assert from 'node:assert/strict';
import { execFile } from 'node:child_process';
import { createServer } from 'node:http';
import { basename, join } from 'node:path';
import { after, before, test } from 'node:test';
import { fileURLToPath } from 'node:url';
import { promisify } from 'node:util';
import { launch, program, screenshots, serve, withFolder, writeLabels } from './browser.mjs';

process.chdir(fileURLToPath(new URL('..', import.meta.url)));
const run = promisify(execFile);

/** Ends the test's folder when the tests have ended. */
let server, browser, release, finished;

before(async () => {
    const folder = await new Promise((resolve) => {
        finished = withFolder((path) => new Promise((end) => ((release = end), resolve(path))));
    });
    await run(program, ['bake', await writeLabels(folder), '--labels', 'all', '-o', join(folder, 'shapes.lathe')]);
    server = await serve(join(folder, 'shapes.lathe'), ...(process.env.LATHE_MODEL ? [process.env.LATHE_MODEL] : []));
    browser = await launch();
});

after(async () => {
    await browser?.close();
    await server?.stop();
    release?.();
    await finished;
});

/** A new page; what it logs as an error fails the test unless `errors` are expected. */
async function open(path, { route, errors = false, ...options } = {}) {
    const page = await browser.newPage({ viewport: { width: 900, height: 640 }, ...options });
    page.faults = [];
    page.requests = [];
    page.on('pageerror', (error) => page.faults.push(String(error)));
    page.on('console', (message) => message.type() === 'error' && page.faults.push(message.text()));
    page.context().on('request', (request) => page.requests.push(request.url()));
    if (route) await page.context().route('**/stream?*', route);
    page.close = async () => {
        await page.context().close();
        if (!errors) assert.deepEqual(page.faults, []);
    };
    await page.goto(server.url + path);
    return page;
}

const state = (page, wanted) =>
    page.waitForFunction((wanted) => document.documentElement.dataset.state === wanted, wanted, { timeout: 60000 });
const data = (page) => page.evaluate(() => ({ ...document.documentElement.dataset }));
const settle = (page) => page.evaluate(() => new Promise((f) => requestAnimationFrame(() => requestAnimationFrame(f))));

/** Pixels that the model covers, and a sum that changes with the picture; drawn and read within one frame. */
const picture = async (page) => {
    await settle(page);
    // Without the bars at the top and bottom and the focus ring.
    const { x, y, width, height } = await page.locator('#view').boundingBox();
    const shot = await page.screenshot({ clip: { x: x + 4, y: y + 48, width: width - 8, height: height - 148 } });
    return page.evaluate(async (base64) => {
        const image = await createImageBitmap(await (await fetch('data:image/png;base64,' + base64)).blob());
        const canvas = new OffscreenCanvas(image.width, image.height), context = canvas.getContext('2d');
        context.drawImage(image, 0, 0);
        const pixels = context.getImageData(0, 0, image.width, image.height).data;
        let covered = 0, sum = 0;
        for (let i = 0; i < pixels.length; i += 4) {
            // The background is nearly grey, the structures are not.
            const spread = Math.max(pixels[i], pixels[i + 1], pixels[i + 2]) - Math.min(pixels[i], pixels[i + 1], pixels[i + 2]);
            if (spread > 24) covered++;
            sum = (sum * 31 + pixels[i] + 7 * pixels[i + 1] + 13 * pixels[i + 2]) >>> 0;
        }
        return { covered, sum };
    }, shot.toString('base64'));
};

test('the list of models leads to the model', async () => {
    const page = await open('/');
    await page.getByRole('link', { name: /shapes/ }).click();
    await state(page, 'done');
    assert.match(page.url(), /\/m\/shapes$/);
    await page.close();
});

test('the base shape is there before the stream, which then refines it; one request more, no other', async () => {
    let go;
    const gate = new Promise((resolve) => (go = resolve));
    const page = await open('/m/shapes', { route: async (route) => (await gate, route.continue()) });
    await page.waitForFunction(() => document.documentElement.dataset.level === '0');
    const base = await data(page);
    assert.equal(base.state, 'base');
    const { covered, sum } = await picture(page);
    assert.ok(covered > 5000, `${covered} pixels covered`);
    await page.screenshot({ path: join(await screenshots(), 'shapes-level0.png') });
    go();
    await state(page, 'done');
    await settle(page);
    const end = await data(page);
    assert.ok(+end.level >= 2, 'levels ' + end.level);
    assert.ok(+end.triangles > +base.triangles, `${base.triangles} -> ${end.triangles} triangles`);
    assert.notEqual((await picture(page)).sum, sum);
    await page.screenshot({ path: join(await screenshots(), 'shapes-last.png') });
    const [, ...more] = page.requests.filter((url) => url.startsWith('http'));
    assert.deepEqual(more, [server.url + '/models/shapes/stream?from=1']);
    await page.close();
});

test('the slider goes back to earlier levels, and the address remembers it', async () => {
    const page = await open('/m/shapes');
    await state(page, 'done');
    await settle(page);
    const end = await data(page);
    const slider = page.getByLabel('Level');
    await slider.focus();
    await page.keyboard.press('Home');
    await page.waitForFunction(() => document.documentElement.dataset.level === '0');
    assert.ok(+(await data(page)).triangles < +end.triangles);
    await page.waitForURL(/&l=0$/);
    await page.reload();
    await state(page, 'done');
    await settle(page);
    assert.equal((await data(page)).level, '0');
    await slider.focus();
    await page.keyboard.press('End');
    await page.waitForFunction((level) => document.documentElement.dataset.level === level, end.level);
    assert.equal((await data(page)).triangles, end.triangles);
    await page.close();
});

test('keys, mouse and wheel move the camera; r and 1-6 give known views', async () => {
    const page = await open('/m/shapes');
    await state(page, 'done');
    const start = (await picture(page)).sum;
    await page.locator('#view').focus();
    let last = start;
    const moved = async (what) => {
        const { sum, covered } = await picture(page);
        assert.notEqual(sum, last, what + ' changes the picture');
        assert.ok(covered > 500, what + ' keeps the model in sight');
        last = sum;
    };
    for (const key of ['ArrowLeft', 'ArrowUp', 'Shift+ArrowRight', '+', '-', '1', '3', '5']) {
        await page.keyboard.press(key);
        await moved(key);
    }
    await page.mouse.move(400, 300);
    await page.mouse.down();
    await page.mouse.move(450, 320);
    await page.mouse.up();
    await moved('dragging');
    await page.mouse.wheel(0, 200);
    await moved('the wheel');
    await page.keyboard.press('r');
    assert.equal((await picture(page)).sum, start, 'r resets');
    await page.close();
});

test('structures can be hidden, filtered and shown again', async () => {
    const page = await open('/m/shapes');
    await state(page, 'done');
    const all = await picture(page), boxes = page.locator('#rows label');
    assert.equal(await boxes.count(), 2);
    await boxes.first().click();
    const one = await picture(page);
    assert.ok(one.covered < all.covered && one.covered > 1000);
    await page.getByRole('button', { name: 'Show none' }).click();
    assert.ok((await picture(page)).covered < 100);
    await page.getByLabel('Filter structures').fill((await boxes.last().textContent()).slice(-3));
    assert.equal(await page.locator('#rows label:visible').count(), 1);
    await page.getByRole('button', { name: 'Show all' }).click();
    const other = await picture(page);
    assert.ok(other.covered > 1000 && other.covered < all.covered, 'only what the filter leaves is shown');
    await page.close();
});

test('one structure by its name', async () => {
    const model = await (await fetch(server.url + '/models/shapes')).json();
    const page = await open('/m/shapes?structure=' + encodeURIComponent(model.structures[1].name));
    await state(page, 'done');
    assert.ok(await page.locator('#structures').isHidden());
    assert.ok((await picture(page)).covered > 1000);
    await page.close();
});

test('a lost context comes back with the same picture', async () => {
    const page = await open('/m/shapes');
    await state(page, 'done');
    const before = (await picture(page)).sum;
    await page.evaluate(async () => {
        const canvas = document.getElementById('view');
        const lose = canvas.getContext('webgl2').getExtension('WEBGL_lose_context');
        const happens = (event) => new Promise((resolve) => canvas.addEventListener(event, resolve, { once: true }));
        const lost = happens('webglcontextlost'), restored = happens('webglcontextrestored');
        lose.loseContext();
        await lost;
        await new Promise((f) => setTimeout(f, 50));
        lose.restoreContext();
        await restored;
    });
    // The first frames after it may still lack a mesh: uploading takes a moment on a busy machine.
    let after = 0;
    for (let tries = 0; tries < 40 && after !== before; tries++) {
        if (tries) await new Promise((f) => setTimeout(f, 100));
        after = (await picture(page)).sum;
    }
    assert.equal(after, before);
    await page.close();
});

test('a broken connection is said, and another try finishes the model', async () => {
    let tries = 0;
    const page = await open('/m/shapes', { errors: true, route: (route) => (tries++ ? route.continue() : route.abort()) });
    await state(page, 'error');
    assert.match(await page.getByRole('alert').textContent(), /server cannot be reached/);
    await page.getByRole('button', { name: 'Try again' }).click();
    await state(page, 'done');
    assert.ok(await page.getByRole('alert').isHidden());
    await page.close();
});

test('an answer that is not the stream is said; what was there stays', async () => {
    const cases = [
        [{ status: 503, body: 'busy' }, /answered 503/],
        [{ status: 200, body: '' }, /ended too early/],
        [{ status: 200, body: Buffer.alloc(5000, 0xa5) }, /cannot be decoded/],
    ];
    for (const [answer, text] of cases) {
        const page = await open('/m/shapes', { errors: true, route: (route) => route.fulfill(answer) });
        await state(page, 'error');
        assert.match(await page.getByRole('alert').textContent(), text);
        assert.ok((await picture(page)).covered > 5000);
        await page.close();
    }
});

test('a stream cut short is taken up where it broke', async () => {
    const body = Buffer.from(await (await fetch(server.url + '/models/shapes/stream?from=1')).arrayBuffer());
    let tries = 0;
    const page = await open('/m/shapes', {
        route: (route) => route.fulfill({ body: tries++ ? body : body.subarray(0, body.length >> 2) }),
    });
    await state(page, 'error');
    const half = await data(page);
    await page.getByRole('button', { name: 'Try again' }).click();
    await state(page, 'done');
    await settle(page);
    assert.ok(+(await data(page)).level > +half.level);
    await page.close();
});

test('a slow stream shows the passes of a level before it is whole', async () => {
    const body = Buffer.from(await (await fetch(server.url + '/models/shapes/stream?from=1')).arrayBuffer());
    const { levels } = await (await fetch(server.url + '/models/shapes')).json();
    // The last level but one has two passes: the first is there, of the second one byte is missing.
    const before = levels.length - 3, there = levels.slice(1, -1).reduce((sum, level) => sum + level.polar_bytes, 0) - 1;
    let resume;
    const slow = createServer((request, response) => {
        response.writeHead(200, { 'Content-Type': 'application/octet-stream' });
        response.write(body.subarray(0, there));
        resume = () => response.end(body.subarray(there));
    });
    await new Promise((listening) => slow.listen(0, '127.0.0.1', listening));
    const page = await open('/m/shapes', { route: (route) => route.continue({ url: `http://127.0.0.1:${slow.address().port}/` }) });
    await page.waitForFunction((least) => document.documentElement.dataset.triangles > least, levels[before].triangles, { timeout: 60000 });
    assert.equal((await data(page)).level, '' + before);
    resume();
    await state(page, 'done');
    await settle(page);
    assert.equal((await data(page)).triangles, '' + levels.at(-1).triangles);
    await page.close();
    slow.close();
});

test('a browser without WebGL2 says so', async () => {
    const context = await browser.newContext();
    await context.addInitScript(() => {
        HTMLCanvasElement.prototype.getContext = () => null;
    });
    const page = await context.newPage();
    await page.goto(server.url + '/m/shapes');
    await state(page, 'error');
    assert.match(await page.getByRole('alert').textContent(), /WebGL2/);
    await context.close();
});

test('a phone: the picture fits and two fingers zoom', async () => {
    const page = await open('/m/shapes', { viewport: { width: 360, height: 700 }, hasTouch: true, colorScheme: 'dark' });
    await state(page, 'done');
    const before = await picture(page);
    assert.ok(await page.evaluate(() => document.documentElement.scrollWidth <= innerWidth), 'nothing sticks out');
    const session = await page.context().newCDPSession(page);
    const touch = (type, spread) => session.send('Input.dispatchTouchEvent', {
        type, touchPoints: spread ? [{ x: 180 - spread, y: 250, id: 1 }, { x: 180 + spread, y: 250, id: 2 }] : [],
    });
    await touch('touchStart', 30);
    for (const spread of [40, 50, 60]) await touch('touchMove', spread);
    await touch('touchEnd');
    assert.ok((await picture(page)).covered > before.covered * 1.5, 'spreading the fingers brings it nearer');
    await page.screenshot({ path: join(await screenshots(), 'shapes-phone.png') });
    await page.close();
});

test('a real scan, for the eye', { skip: !process.env.LATHE_MODEL }, async () => {
    const name = basename(process.env.LATHE_MODEL, '.lathe'), folder = await screenshots();
    for (const [hash, file] of [['#l=0', 'level0'], ['', 'last']]) {
        const page = await open(`/m/${name}${hash}`, { viewport: { width: 1280, height: 800 } });
        await state(page, 'done');
        assert.ok((await picture(page)).covered > 20000);
        await page.screenshot({ path: join(folder, `${name}-${file}.png`) });
        await page.close();
    }
});
