// What the browser tests share: a served model directory and a Chromium.
import { spawn } from 'node:child_process';
import { mkdir, mkdtemp, rm } from 'node:fs/promises';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { chromium } from 'playwright-core';

export const program = process.env.LATHE_BIN ?? '../build/lathe';

/** Starts `lathe serve` on a free port; stop() ends it and waits for that. */
export async function serve(...paths) {
    const child = spawn(program, ['serve', ...paths, '--port', '0', '--quiet'], { stdio: ['ignore', 'pipe', 'inherit'] });
    const url = await new Promise((resolve, reject) => {
        let text = '';
        child.stdout.on('data', (data) => {
            const found = /listening on (http:\/\/[\d.:]+)/.exec((text += data));
            if (found) resolve(found[1]);
        });
        child.on('exit', (code) => reject(Error(`lathe serve ended with ${code}`)));
        child.on('error', reject);
    });
    const ended = new Promise((resolve) => child.on('exit', resolve));
    return { url, stop: () => (child.kill('SIGTERM'), ended) };
}

/** A Chromium that draws in software and calls nobody. */
export const launch = () =>
    chromium.launch({
        executablePath: process.env.CHROMIUM ?? '/usr/bin/chromium',
        args: ['--no-sandbox', '--use-angle=swiftshader', '--enable-unsafe-swiftshader', '--disable-background-networking',
            '--disable-component-update', '--disable-sync', '--no-first-run'],
    });

/** An empty folder that is removed after fn. */
export async function withFolder(fn) {
    const folder = await mkdtemp(join(tmpdir(), 'lathe-web-'));
    try {
        return await fn(folder);
    } finally {
        await rm(folder, { recursive: true });
    }
}

/** A raw volume with labels: a ball and, beside it, a ring; the sidecar's path. */
export async function writeLabels(folder) {
    const { writeFile } = await import('node:fs/promises');
    const n = 48, bytes = new Uint8Array(n ** 3);
    for (let z = 0, i = 0; z < n; z++)
        for (let y = 0; y < n; y++)
            for (let x = 0; x < n; x++, i++) {
                const ball = Math.hypot(x - 12, y - 24, z - 24) < 9.3;
                const ring = Math.hypot(Math.hypot(x - 33, y - 24) - 8.2, z - 24) < 3.6;
                bytes[i] = ball ? 1 : ring ? 2 : 0;
            }
    await writeFile(join(folder, 'shapes.raw'), bytes);
    const sidecar = join(folder, 'shapes.json');
    await writeFile(sidecar, JSON.stringify({ file: 'shapes.raw', dims: [n, n, n], dtype: 'uint8', spacing: [1, 1, 1.2] }));
    return sidecar;
}

/** Where screenshots are kept. */
export async function screenshots() {
    const folder = process.env.LATHE_SCREENSHOTS ?? '../build/screenshots';
    await mkdir(folder, { recursive: true });
    return folder;
}
