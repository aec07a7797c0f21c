// Runs the Khronos glTF validator (npm: gltf-validator) over GLB files: `node tests/gltf_validate.mjs FILE...`.
// Exit 0: no errors and no warnings in any file; 1: some; 2: the validator is not installed.
import { readFileSync } from 'node:fs';
import { createRequire } from 'node:module';
import { pathToFileURL } from 'node:url';

function loadValidator() {
    const places = [import.meta.url, new URL('../web/package.json', import.meta.url).href, pathToFileURL(process.cwd() + '/x.js').href];
    for (const place of places) {
        try {
            return createRequire(place)('gltf-validator');
        } catch (error) {
            if (error.code !== 'MODULE_NOT_FOUND') throw error;
        }
    }
    console.error('gltf-validator is not installed: npm install gltf-validator in web/');
    process.exit(2);
}

const validator = loadValidator();
let bad = 0;
for (const path of process.argv.slice(2)) {
    const report = await validator.validateBytes(new Uint8Array(readFileSync(path)), { maxIssues: 20 });
    const { numErrors, numWarnings, messages } = report.issues;
    const { totalTriangleCount, materialCount } = report.info;
    console.log(`${path}: ${numErrors} errors, ${numWarnings} warnings, ${totalTriangleCount} triangles, ${materialCount} materials`);
    for (const message of messages) console.log(`  ${message.code} ${message.pointer ?? ''}: ${message.message}`);
    bad += numErrors + numWarnings;
}
process.exit(bad ? 1 : 0);
