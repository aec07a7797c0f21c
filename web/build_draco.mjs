// Builds the page of the Draco deltas: node build_draco.mjs [PAGE.html]. The decoder of the npm package draco3d is in it.
import { build } from 'esbuild';
import { mkdir, readFile, writeFile } from 'node:fs/promises';
import { dirname } from 'node:path';
import { fileURLToPath } from 'node:url';

const here = (path) => fileURLToPath(new URL(path, import.meta.url));
const pagePath = process.argv[2] ?? here('dist/draco.html');
const bundle = await build({
    entryPoints: [here('src/draco_page.js')],
    bundle: true,
    minify: true,
    format: 'iife',
    target: 'es2022',
    write: false,
    charset: 'utf8',
    legalComments: 'none',
    external: ['fs', 'path', 'crypto'], // used under Node only
});
const script = bundle.outputFiles[0].text.trim();
if (/<\/script|<!--/i.test(script)) throw Error('the script would end its own element');
const wasm = (await readFile(here('node_modules/draco3d/draco_decoder.wasm'))).toString('base64');
const page = (await readFile(here('src/draco.html'), 'utf8')).replace(/\/\*([A-Z]+)\*\//g, (_, part) => ({ SCRIPT: script, WASM: wasm })[part]);
await mkdir(dirname(pagePath), { recursive: true });
await writeFile(pagePath, page);
