// What the viewer loads when asked for more: the smooth surface, a slice with its outline, edge types. A real Chromium, the real program.
import assert from 'node:assert/strict';
import { execFile } from 'node:child_process';
import { join } from 'node:path';
import { test } from 'node:test';
import { fileURLToPath } from 'node:url';
import { promisify } from 'node:util';
import { launch, program, screenshots, serve, withFolder, writeLabels } from './browser.mjs';

process.chdir(fileURLToPath(new URL('..', import.meta.url)));
const run = promisify(execFile);

test('smooth surface, slice with its outline, edge types in colour', () => withFolder(async (folder) => {
    const file = process.env.LATHE_MODEL ?? join(folder, 'shapes.lathe');
    if (!process.env.LATHE_MODEL) await run(program, ['bake', await writeLabels(folder), '--labels', 'all', '-o', file]);
    const server = await serve(file), browser = await launch();
    try {
        const [{ id }] = (await (await fetch(server.url + '/models')).json()).models;
        const page = await browser.newPage({ viewport: { width: 900, height: 640 } }), faults = [], requests = [];
        page.on('pageerror', (error) => faults.push(String(error)));
        page.on('console', (message) => message.type() === 'error' && !/404/.test(message.text()) && faults.push(message.text()));
        page.on('request', (request) => requests.push(new URL(request.url()).pathname));
        await page.goto(server.url + '/m/' + id);
        await page.waitForFunction(() => document.documentElement.dataset.state === 'done');
        assert.ok(!requests.includes('/extras.js'), 'loaded before it is asked for');
        const triangles = () => page.evaluate(() => +document.documentElement.dataset.triangles);
        /** Pixels of the picture that are not the nearly grey background. */
        const covered = async () => {
            await page.evaluate(() => new Promise((f) => requestAnimationFrame(() => requestAnimationFrame(f))));
            const shot = await page.screenshot({ clip: { x: 4, y: 48, width: 600, height: 480 } });
            return page.evaluate(async (base64) => {
                const image = await createImageBitmap(await (await fetch('data:image/png;base64,' + base64)).blob());
                const canvas = new OffscreenCanvas(image.width, image.height), context = canvas.getContext('2d');
                context.drawImage(image, 0, 0);
                const p = context.getImageData(0, 0, image.width, image.height).data;
                let n = 0;
                for (let i = 0; i < p.length; i += 4) n += Math.max(p[i], p[i + 1], p[i + 2]) - Math.min(p[i], p[i + 1], p[i + 2]) > 24;
                return n;
            }, shot.toString('base64'));
        };
        const before = await covered(), flat = await triangles();   // after the last level has been drawn
        await page.getByRole('button', { name: 'More' }).click();
        await page.getByLabel('Smooth surface').check();
        await page.waitForFunction((flat) => +document.documentElement.dataset.triangles === 4 * flat, flat);
        await page.screenshot({ path: join(await screenshots(), 'smooth.png') });
        const smooth = await covered();
        assert.ok(before > 2000 && Math.abs(smooth - before) < before / 10, `${smooth} pixels smooth, ${before} flat`);
        await page.getByLabel('Smooth surface').uncheck();
        await page.waitForFunction((flat) => +document.documentElement.dataset.triangles === flat, flat);

        // A level at which the first structure shows nothing yet: its mesh is not in the file, the second's is not taken for it.
        if (!process.env.LATHE_MODEL) {
            const { structures } = await (await fetch(`${server.url}/models/${id}`)).json(), [first, second] = structures;
            const level = await page.evaluate(() => document.documentElement.dataset.level);
            const glb = async (query) => Buffer.from(await (await fetch(`${server.url}/models/${id}/levels/${level}.glb?${query}`)).arrayBuffer());
            const parsed = (bytes) => JSON.parse(bytes.subarray(20, 20 + bytes.readUInt32LE(12)).toString());
            const only = await glb('smooth=2&structure=' + second.name), flatSecond = parsed(await glb('structure=' + second.name));
            assert.deepEqual(parsed(only).meshes.map((m) => m.extras), [{ structure: 1 }]);
            assert.deepEqual(parsed(await glb('')).meshes.map((m) => m.extras.structure), [0, 1]);
            const own = flatSecond.accessors[2].count / 3;   // flat triangles of the second structure
            await page.route('**/levels/*.glb?smooth=2', (route) => route.fulfill({ body: only, contentType: 'model/gltf-binary' }));
            await page.getByLabel('Smooth surface').check();
            await page.waitForFunction((want) => +document.documentElement.dataset.triangles === want, flat + 3 * own);
            assert.ok(first.name !== second.name && own > 100);
            await page.getByLabel('Smooth surface').uncheck();
            await page.waitForFunction((flat) => +document.documentElement.dataset.triangles === flat, flat);
            await page.unroute('**/levels/*.glb?smooth=2');
            // The page of the second structure alone.
            await page.goto(`${server.url}/m/${id}?structure=${second.name}`);
            await page.waitForFunction(() => document.documentElement.dataset.state === 'done');
            await page.getByRole('button', { name: 'More' }).click();
            await page.getByLabel('Smooth surface').check();
            await page.waitForFunction((own) => +document.documentElement.dataset.triangles === 4 * own, own);
            await page.goto(`${server.url}/m/${id}`);
            await page.waitForFunction(() => document.documentElement.dataset.state === 'done');
            await page.getByRole('button', { name: 'More' }).click();
        }

        await page.locator('#slice').check();
        await page.waitForFunction(() => document.getElementById('extras').dataset.slice);
        const k = await page.evaluate(() => document.getElementById('extras').dataset.slice);
        await page.waitForFunction(() => document.getElementById('slice-picture').naturalWidth > 8);
        assert.ok(requests.some((path) => path.endsWith(`/slices/${k}/outline`)) && requests.some((path) => path.endsWith(`/slices/${k}.png`)));
        const painted = () => page.evaluate(() => {
            const c = document.getElementById('lines'), d = c.getContext('2d').getImageData(0, 0, c.width, c.height).data;
            let n = 0;
            for (let i = 3; i < d.length; i += 4) n += d[i] > 0;
            return n;
        });
        /* Drawn with the next frame, which may take a while. */
        const paintedSoon = async (good) => {
            for (let tries = 0; tries < 100 && !good(await painted()); tries++) await page.waitForTimeout(100);
            return good(await painted());
        };
        assert.ok(await paintedSoon((n) => n > 200), 'the outline is drawn');
        await page.screenshot({ path: join(await screenshots(), 'slice.png') });

        await page.locator('#rays').selectOption('32');
        await page.waitForFunction(() => document.getElementById('extras').dataset.rays === '32');
        const said = await page.evaluate(() => Object.fromEntries([...document.querySelectorAll('[data-edges]')].map((e) => [e.dataset.edges, +e.textContent.match(/\d+/)[0]])));
        const { loops } = await (await fetch(`${server.url}/models/${id}/slices/${k}/contour?rays=32`)).json();
        for (const type of 'fbud') assert.equal(said[type], loops.flatMap((l) => l.edges).filter((e) => e[0] === type).length, type);
        assert.ok(said.f >= 32);
        await page.screenshot({ path: join(await screenshots(), 'edges.png') });
        await page.locator('#slice').uncheck();
        await page.waitForFunction(() => !document.getElementById('extras').dataset.slice);
        assert.ok(await paintedSoon((n) => n === 0), 'the outline is gone');
        assert.deepEqual(faults, []);
    } finally {
        await browser.close();
        await server.stop();
    }
}));
