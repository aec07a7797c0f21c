// Builds the viewer: node build.mjs [DECODER.wasm [RASTERS.wasm [TUBES.wasm [VIEWER.html]]]]. One page with style and script in it; beside
// it the decoders as text, of which the server puts one into the page: decoder.txt reads every model, the others those made of rasters or tubes.
import { build, transform } from 'esbuild';
import { mkdir, readFile, writeFile } from 'node:fs/promises';
import { dirname } from 'node:path';
import { fileURLToPath } from 'node:url';

const here = (path) => fileURLToPath(new URL(path, import.meta.url));
const wasm = (name) => here(`../build/wasm/${name}.wasm`);
const [wasmPath = wasm('lathe'), rastersPath = wasm('rasters'), tubesPath = wasm('tubes'), pagePath = here('dist/viewer.html')] = process.argv.slice(2);
const beside = (name) => pagePath.replace(/[^/]*$/, name);

const minifyStyle = async (path) => (await transform(await readFile(path, 'utf8'), { loader: 'css', minify: true })).code.trim();

/** Styles and shaders as text, without comments and needless space; a shader's preprocessor lines keep their line ends. */
const texts = {
    name: 'texts',
    setup({ onLoad }) {
        onLoad({ filter: /\.css$/ }, async ({ path }) => ({ loader: 'text', contents: await minifyStyle(path) }));
        onLoad({ filter: /\.glsl$/ }, async ({ path }) => ({
            loader: 'text',
            contents: (await readFile(path, 'utf8'))
                .replace(/\/\/.*/g, '')
                .replace(/^(#.*)\n|\s+/gm, (_, line) => (line ? line + '\0' : ' '))
                .replace(/ ?([^\w\s#.\0]) ?/g, '$1')
                .replace(/\0 ?/g, '\n')
                .trim(),
        }));
    },
};

/**
 * Bytes as characters of the same number: brotli then sees bytes where base64 would show it none. NUL, CR and < would not
 * come through an HTML parser, so they go 256 higher and take two bytes. The key makes them rare: in a module of 55 KB, 6,161
 * such bytes become 56, and the page's text compresses to 24,981 B (without a key 25,946, in base64 31,909, raw 25,076).
 */
const WASM_KEY = +/WASM_KEY = (\d+)/.exec(await readFile(here('src/bytes.ts'), 'utf8'))[1];
const textOfBytes = (bytes) =>
    Array.from(bytes, (b) => {
        const c = b ^ WASM_KEY;
        return String.fromCharCode(c === 0 || c === 13 || c === 60 ? c + 256 : c);
    }).join('');

const bundle = await build({
    entryPoints: [here('src/main.ts')],
    bundle: true,
    minify: true,
    format: 'esm',      // but a classic script, as the worker's is: it exports nothing, and a block keeps its names off the window
    target: 'es2022',
    write: false,
    charset: 'utf8',
    legalComments: 'none',
    plugins: [texts],
    external: ['/extras.js'],
});
const script = `{${bundle.outputFiles[0].text.trim()}}`;
if (/<\/script|<!--/i.test(script)) throw Error('the script would end its own element');

const parts = { STYLE: await minifyStyle(here('src/style.css')), SCRIPT: script };
const template = (await readFile(here('src/page.html'), 'utf8')).replace(/>\s+</g, '><').replace(/\s+/g, ' ').trim();
const page = template.replace(/\/\*([A-Z]+)\*\//g, (_, part) => parts[part]);

// What is loaded only when somebody asks for more: a module beside the page.
await build({
    entryPoints: [here('src/extras.ts')], bundle: true, minify: true, format: 'esm', target: 'es2022', charset: 'utf8', legalComments: 'none',
    plugins: [texts], outfile: beside('extras.js'),
});

await mkdir(dirname(pagePath), { recursive: true });
await writeFile(pagePath, page);
await writeFile(beside('decoder.txt'), textOfBytes(await readFile(wasmPath)));
await writeFile(beside('rasters.txt'), textOfBytes(await readFile(rastersPath)));
await writeFile(beside('tubes.txt'), textOfBytes(await readFile(tubesPath)));
