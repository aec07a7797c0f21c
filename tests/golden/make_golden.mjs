// Makes a set of golden streams: node tests/golden/make_golden.mjs FOLDER [LATHE]. The ones in this folder are kept: what they decode
// to must never change, so nothing runs this by itself. A new version of the format gets new streams beside the old ones.
import { execFileSync } from 'node:child_process';
import { mkdirSync, mkdtempSync, rmSync, writeFileSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';

const [folder, lathe = 'build/lathe'] = process.argv.slice(2);
if (!folder) throw Error('usage: make_golden.mjs FOLDER [LATHE]');
const scratch = mkdtempSync(join(tmpdir(), 'lathe-golden-'));
const ball = (x, y, z, r) => r - Math.hypot(x, y, z);

/** Noise in -1 .. 1, smooth over about `size` voxels: components, cavities and tunnels of every kind. */
function foam(size) {
    const at = (i, j, k) => {
        let h = Math.imul(i, 0x9e3779b1) ^ Math.imul(j, 0x85ebca77) ^ Math.imul(k, 0xc2b2ae3d);
        h = Math.imul(h ^ (h >>> 15), 0x2c1b3c6d);
        return ((h ^ (h >>> 12)) >>> 0) / 2 ** 31 - 1;
    };
    return (x, y, z) => {
        const p = [x, y, z].map((c) => c / size), low = p.map(Math.floor);
        const t = p.map((c, i) => (c - low[i]) ** 2 * (3 - 2 * (c - low[i])));
        let sum = 0;
        for (let k = 0; k < 8; k++) {
            const bit = [k & 1, (k >> 1) & 1, k >> 2];
            sum += at(low[0] + bit[0], low[1] + bit[1], low[2] + bit[2]) * bit.reduce((w, b, i) => w * (b ? t[i] : 1 - t[i]), 1);
        }
        return sum;
    };
}

function values(dims, at) {
    const out = new Float32Array(dims[0] * dims[1] * dims[2]);
    let i = 0;
    for (let z = 0; z < dims[2]; z++) for (let y = 0; y < dims[1]; y++) for (let x = 0; x < dims[0]; x++) out[i++] = at(x, y, z);
    return Buffer.from(out.buffer);
}

function raw(name, dims, at, spacing = [1, 1, 1]) {
    writeFileSync(join(scratch, name + '.raw'), values(dims, at));
    const path = join(scratch, name + '.json');
    writeFileSync(path, JSON.stringify({ file: name + '.raw', dims, dtype: 'float32', spacing }));
    return path;
}

/** NIfTI-1 with an affine of its own. */
function nifti(name, dims, at, affine) {
    const head = Buffer.alloc(352);
    head.writeInt32LE(348, 0);
    [3, ...dims, 1, 1, 1, 1].forEach((v, i) => head.writeInt16LE(v, 40 + 2 * i));
    head.writeInt16LE(16, 70);
    head.writeInt16LE(32, 72);
    [1, ...[0, 1, 2].map((c) => Math.hypot(...affine.map((row) => row[c]))), 0, 0, 0, 0].forEach((v, i) => head.writeFloatLE(v, 76 + 4 * i));
    head.writeFloatLE(352, 108);
    head.writeFloatLE(1, 112);
    head[123] = 2;
    head.writeInt16LE(1, 254);
    affine.flat().forEach((v, i) => head.writeFloatLE(v, 280 + 4 * i));
    head.write('n+1\0', 344, 'latin1');
    const path = join(scratch, name + '.nii');
    writeFileSync(path, Buffer.concat([head, values(dims, at)]));
    return path;
}

function bake(name, input, ...options) {
    execFileSync(lathe, ['bake', input, '--name', name, '--no-draco', '--quiet', '-o', join(folder, name + '.lathe'), ...options]);
}

mkdirSync(folder, { recursive: true });
/* Streams without a kept topology and without radius maps were baked before there were pyramids: today the same calls give those. */
const rough = foam(5), fine = foam(3);
const blob = (x, y, z) => ball(x - 19, y - 18, z - 16, 13) / 8 + 1.5 * rough(x, y, z) + 0.5 * fine(x, y, z);
const label = (x, y, z) => {
    if (ball(x - 13, y - 12, z - 15, 11.5) > 0) return 1;                       /* becomes a radius map */
    if (Math.abs(Math.hypot(x - 38, z - 14) - 8) < 3 && Math.abs(y - 12) < 4) return 2;
    if (y > 25 && rough(x, y, z) + fine(x, y, z) > 0.5) return 3;               /* many components */
    return x > 48 && y < 6 && z > 4 && z < 9 ? 7 : 0;                           /* a small box */
};
const cone = (x, y, z) => 13 + 3 * Math.cos(3 * (Math.atan2(y - 19, x - 18 - z / 30) - z / 12)) - Math.hypot(y - 19, x - 18 - z / 30) - ((z - 16) / 9) ** 2;

bake('caps', raw('caps', [40, 37, 33], blob), '--iso', '0');
bake('exact', raw('exact', [24, 24, 24], (x, y, z) => ball(x - 12, y - 12, z - 12, 9)), '--iso', '0', '--exact');
bake('keep', raw('keep', [26, 25, 22], (x, y, z) => ball(x - 13, y - 12, z - 11, 11) / 9 + fine(x, y, z)), '--iso', '0', '--topology', 'keep');
bake('keep_stars', raw('keep_stars', [30, 24, 28], (x, y, z) => ball(x - 13, y - 12, (z - 14) * 0.8, 9) + rough(x, y, z)), '--iso', '0', '--topology', 'keep');
bake('radius', raw('radius', [30, 30, 30], (x, y, z) => ball(x - 14.5, y - 15, z - 15.2, 12)), '--iso', '0');
bake('twisted', raw('twisted', [36, 38, 33], cone), '--iso', '0');
bake('shared', raw('shared', [56, 37, 29], label), '--labels', 'all');
bake('independent', raw('independent', [56, 37, 29], label, [1, 1, 1.1]), '--labels', 'all', '--independent');
bake('keep_labels', raw('keep_labels', [56, 37, 29], label), '--labels', 'all', '--topology', 'keep', '--axis', 'x');
/* Turned, sheared by its spacing, mirrored. */
const tilt = [[-0.8, 0.45, 0.3, 12.5], [0.36, 1.1, -0.7, -40], [-0.12, 0.2, 2.3, 7.25]];
bake('oblique', nifti('oblique', [40, 37, 33], (x, y, z) => 100 + 60 * blob(x, y, z), tilt), '--iso', '100');
bake('oblique_radius', nifti('oblique_radius', [38, 33, 36], (x, y, z) => cone(z, x, y), tilt), '--iso', '0', '--axis', 'y');
/* Slices wide enough for larger tables: 18 and 20 bits. */
const disc = (r, n) => (x, y, z) => Math.min(r - Math.hypot(x - n / 2, y - n / 2 + 3 * z), Math.hypot(x - n / 3, y - n / 2) - r / 4) + 9 * rough(x, y, z);
bake('wide', raw('wide', [100, 100, 5], disc(38, 100)), '--iso', '0');
bake('wider', raw('wider', [150, 140, 3], disc(58, 150)), '--iso', '0', '--boundary', 'edge');
/* Many levels: gaps of 8 and more between known slices; fewer rays than levels could halve; turned to the other side. */
bake('tall', raw('tall', [20, 20, 80], (x, y, z) => Math.min(6 - Math.hypot(x - 10, y - 10), ball(x - 10, y - 10, z - 40, 39), 3 - ball(x - 10, y - 10, z - 40, 6)) + fine(x, y, z) / 2),
    '--iso', '0', '--topology', 'keep');
bake('long', raw('long', [44, 40, 80], (x, y, z) => cone(x, y, z / 3 + 4) + (x + y) / 50), '--iso', '0', '--axis', 'z');
bake('long_back', raw('long_back', [40, 44, 80], (x, y, z) => cone(y, x, z / 3 + 4)), '--iso', '0');
/* One model for structures of different sizes. */
bake('sizes', raw('sizes', [110, 90, 8], (x, y, z) => (Math.abs(Math.hypot(x - 50, y - 45) - 35) < 6 + 2 * rough(x, y, z) ? -3 : ball(x - 50, y - 45, z * 2 - 8, 9) > 0 ? 12 :
    x > 100 && y > 60 && z > 2 ? 40 : 0)), '--labels', 'all');
bake('thin', raw('thin', [20, 16, 1], (x, y) => ball(x - 9, y - 8, 0, 6) + rough(x, y, 3)), '--iso', '0');
/* Pyramids. */
bake('pyramid_caps', raw('pyramid_caps', [34, 31, 27], (x, y, z) => blob(x + 3, y + 3, z + 3)), '--iso', '0', '--exact');
bake('pyramid_shared', raw('pyramid_shared', [56, 37, 29], label), '--labels', 'all');
bake('pyramid_independent', raw('pyramid_independent', [56, 37, 29], label, [1, 1, 1.1]), '--labels', 'all', '--independent', '--axis', 'x');
bake('pyramid_thick', raw('pyramid_thick', [60, 50, 7], (x, y, z) => ball(x - 30, y - 25, 6 * (z - 3), 22) + 3 * rough(x, y, 6 * z), [0.5, 0.7, 4]), '--iso', '0', '--exact');
bake('pyramid_specks', raw('pyramid_specks', [40, 40, 40], (x, y, z) => (ball(x - 14, y - 15, z - 15, 12) > 0 ? 1 : ball(x - 35, y - 34, z - 35, 1.2) > 0 ? 2 : x === 38 && y === 3 && z === 9 ? 3 : 0)), '--labels', 'all');
bake('pyramid_slice', raw('pyramid_slice', [40, 32, 1], (x, y) => ball(x - 18, y - 16, 0, 13) + 3 * rough(x, y, 3)), '--iso', '0', '--exact');
bake('pyramid_oblique', nifti('pyramid_oblique', [34, 31, 27], (x, y, z) => 100 + 60 * blob(x + 2, y + 3, z + 3), tilt), '--iso', '100', '--exact', '--axis', 'y');
bake('pyramid_wide', raw('pyramid_wide', [150, 131, 3], disc(55, 150)), '--iso', '0', '--exact');
bake('pyramid_one', raw('pyramid_one', [30, 28, 20], (x, y, z) => blob(x + 5, y + 5, z + 6)), '--iso', '0', '--levels', '1');
/* Pyramids with SURE. The ones above were baked before there was it: today the same calls give it. Sizes for both tables, with enough
 * pixels that most are sure; a model of its own and one for many; one slice and one level, where modes 0 and 1 are. */
bake('sure', raw('sure', [70, 66, 40], (x, y, z) => 26 - Math.hypot(x - 35, y - 33, 1.4 * (z - 20)) + 3 * rough(x, y, z)), '--iso', '0', '--exact');
bake('sure_shared', raw('sure_shared', [56, 37, 29], label), '--labels', 'all');
bake('sure_independent', raw('sure_independent', [56, 37, 29], label, [1, 1, 1.1]), '--labels', 'all', '--independent', '--axis', 'x');
bake('sure_wide', raw('sure_wide', [150, 131, 3], disc(55, 150)), '--iso', '0', '--exact');
bake('sure_slice', raw('sure_slice', [40, 32, 1], (x, y) => ball(x - 18, y - 16, 0, 13) + 3 * rough(x, y, 3)), '--iso', '0', '--exact');
bake('sure_one', raw('sure_one', [60, 58, 30], (x, y, z) => 22 - Math.hypot(x - 30, y - 29, 1.6 * (z - 15)) + 3 * rough(x, y, z)), '--iso', '0', '--levels', '1');
/* Tubes: a hole that parts into two; one tube alone. */
const trunk = (x, y, z) => Math.min(17 - Math.hypot(x - 22, (y - 22) * 1.2), z - 2, 41 - z);
const vessel = (x, y, z) => {
    const apart = Math.max(0, z - 20) / 3;
    return 4 - Math.min(Math.hypot(x - 22 - apart, y - 22), Math.hypot(x - 22 + apart, y - 22));
};
bake('tubes', raw('tubes', [46, 46, 44], (x, y, z) => Math.min(trunk(x, y, z), -Math.min(vessel(x, y, z), z - 7, 36 - z))), '--iso', '0');
bake('tube', raw('tube', [36, 38, 33], (x, y, z) => cone(x, y, z) + 0.4), '--iso', '0');
/* Rays ahead of slices: all of them, and once more; slices that come early because of a notch, in a tube alone and beside others. */
const bars = (x, y, turn) => {
    const [p, q] = [Math.cos(turn) * x + Math.sin(turn) * y, Math.cos(turn) * y - Math.sin(turn) * x].map(Math.abs);
    return Math.max(Math.min(4 - p, 16 - q), Math.min(4 - q, 16 - p));
};
const dented = (x, y, z) => 24 - Math.hypot(x, y, z) - 6 * Math.exp(-(((z - 5) / 1.2) ** 2) - (Math.atan2(y, x) / 0.2) ** 2);
const rod = (x, y, z) => Math.min(4 - Math.hypot(x, y), z - 9, 40 - z);
bake('ahead', raw('ahead', [40, 40, 48], (x, y, z) => Math.min(bars(x - 19.3, y - 19.6, z * 0.05), z - 2.4, 45.2 - z)), '--iso', '0');
bake('ahead_tubes', raw('ahead_tubes', [60, 60, 60], (x, y, z) => Math.max(Math.min(13 + 6 * Math.cos(2 * Math.atan2(y - 30, x - 24)) - Math.hypot(y - 30, x - 24),
    z - 3, 56 - z), rod(x - 52, y - 30, z))), '--iso', '0');
bake('early', raw('early', [56, 56, 56], (x, y, z) => dented(x - 27, y - 28, z - 27)), '--iso', '0');
bake('early_tubes', raw('early_tubes', [70, 56, 56], (x, y, z) => Math.max(dented(x - 27, y - 28, z - 27), rod(x - 60, y - 30, z))), '--iso', '0');
/* Surfaces cube by cube, with a fraction of their own along w; shared, independent, of one slice; a speck that strides miss. */
bake('cubes', raw('cubes', [34, 31, 27], (x, y, z) => blob(x + 3, y + 3, z + 3)), '--iso', '0', '--exact');
bake('cubes_shared', raw('cubes_shared', [56, 37, 29], label), '--labels', 'all');
bake('cubes_independent', raw('cubes_independent', [56, 37, 29], label, [1, 1, 1.1]), '--labels', 'all', '--independent', '--axis', 'x');
bake('cubes_thick', raw('cubes_thick', [60, 50, 7], (x, y, z) => ball(x - 30, y - 25, 6 * (z - 3), 22) + 3 * rough(x, y, 6 * z), [0.5, 0.7, 4]), '--iso', '0', '--exact');
bake('cubes_specks', raw('cubes_specks', [40, 40, 40], (x, y, z) => (ball(x - 14, y - 15, z - 15, 12) > 0 ? 1 : x === 38 && y === 3 && z === 9 ? 2 : 0)), '--labels', 'all');
bake('cubes_slice', raw('cubes_slice', [40, 32, 1], (x, y) => ball(x - 18, y - 16, 0, 13) + 3 * rough(x, y, 3)), '--iso', '0', '--exact');
/* Plain tubes (older streams of several tubes were baked before there were those: today the same calls give them): a hole that parts, in a trunk
 * where it is open below; one solid that becomes three, and two that become one; a plate with two holes through it. */
bake('plain_hole', raw('plain_hole', [46, 46, 44], (x, y, z) => Math.min(trunk(x, y, z), -Math.min(vessel(x, y, z), 36 - z))), '--iso', '0');
const blend = (a, b) => Math.max(a, b) + Math.max(5 - Math.abs(a - b), 0) ** 2 / 20;
const rods = (x, y, ...at) => at.map(([u, v, r]) => r - Math.hypot(x - u, y - v)).reduce(blend);
const opened = (z) => Math.max(0, z - 25);
bake('plain_parts', raw('plain_parts', [70, 70, 60], (x, y, z) => Math.min(z - 3, 56 - z,
    rods(x, y, [35 + opened(z) / 2, 35, 6], [35 - opened(z) / 3, 35 + opened(z) / 2, 6], [35 - opened(z) / 3, 35 - opened(z) / 2, 6]))), '--iso', '0');
const merged = (z) => Math.max(0, 30 - z) / 2;
bake('plain_merges', raw('plain_merges', [60, 46, 60], (x, y, z) => Math.min(z - 3, 56.4 - z, rods(x, y, [30 - merged(z), 23, 7.2], [30 + merged(z), 20, 6.6]))), '--iso', '0');
bake('plain_plate', raw('plain_plate', [70, 50, 40], (x, y, z) => Math.min(20 - Math.hypot((x - 35) * 0.65, y - 25), z - 4, 36 - z, Math.hypot(x - 24, y - 25) - 5, Math.hypot(x - 46, y - 25) - 4.6)), '--iso', '0');
rmSync(scratch, { recursive: true });
