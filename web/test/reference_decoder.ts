// The second decoder, written from docs/FORMAT.md alone: plain where the first one is fast or small. It decodes every packet and builds
// the surfaces of radius maps. It does not stack outlines, and so it does not read the shapes of caps, whose contexts need their cells.

/** The bytes are not what the format says; `record` names what they belong to. */
export class Damaged extends Error {
    constructor(readonly record: string, what: string) {
        super(`${record}: ${what}`);
    }
}
/** Bytes are missing, as far as one can tell. */
class Incomplete extends Error {}

// ---- numbers of the container ----

const CRC_TABLE = Uint32Array.from({ length: 256 }, (_, n) => {
    for (let k = 0; k < 8; k++) n = n & 1 ? (n >>> 1) ^ 0x82f63b78 : n >>> 1;
    return n;
});

export function crc32c(bytes: Uint8Array): number {
    let crc = -1;
    for (const byte of bytes) crc = CRC_TABLE[(crc ^ byte) & 255] ^ (crc >>> 8);
    return ~crc >>> 0;
}

/** Little-endian reads that never leave `bytes`. */
class Cursor {
    private readonly view: DataView;
    constructor(readonly bytes: Uint8Array, public at: number, readonly record: string) {
        this.view = new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
    }
    get left(): number { return this.bytes.length - this.at; }
    private take(size: number): number {
        if (size > this.left) throw new Incomplete(this.record);
        this.at += size;
        return this.at - size;
    }
    must(condition: boolean, what: string): void {
        if (!condition) throw new Damaged(this.record, what);
    }
    block(size: number): Uint8Array { const at = this.take(size); return this.bytes.subarray(at, at + size); }
    u8(): number { return this.bytes[this.take(1)]; }
    u32(): number { return this.view.getUint32(this.take(4), true); }
    u64(): bigint { return this.view.getBigUint64(this.take(8), true); }
    f32(): number { return this.view.getFloat32(this.take(4), true); }
    f64(): number { return this.view.getFloat64(this.take(8), true); }
    long(bits = 64n): bigint {
        let value = 0n;
        for (let shift = 0n; shift < bits; shift += 7n) {
            const byte = this.u8();
            value |= BigInt(byte & 127) << shift;
            this.must(value >> bits === 0n, 'a number is too large');
            if (byte < 128) return value;
        }
        throw new Damaged(this.record, 'a number is too long');
    }
    varint(): number { return Number(this.long(32n)); }
    svarint(): number { const v = this.varint(); return (v >>> 1) ^ -(v & 1); }
    longSigned(): bigint { const v = this.long(); return (v >> 1n) ^ -(v & 1n); }
    /** The checksum of everything since `start`. */
    checksum(start: number): void {
        const computed = crc32c(this.bytes.subarray(start, this.at));
        this.must(this.u32() === computed, 'the checksum does not match');
    }
}

// ---- header and level records ----

export interface Box { origin: number[]; size: number[]; levelCount: number }
export interface Header {
    axis: number; boundary: number; affine: number[][]; parameters: number[]; structures: Box[];
    levelCount: number; fraction: number; flags: number;
    /** Of a pyramid: the axes that each level's passes halve; -1: its first raster. */
    passes: number[][] | null;
}
export const CAPS = 1, KEEP = 2, SHARED = 4, EXACT = 8, PYRAMID = 16, SURE = 32;
const MAGIC = [0x89, 0x4c, 0x54, 0x48, 0x0d, 0x0a, 0x1a, 2];

function readAffine(c: Cursor): number[][] {
    const number = (form: number): number => [() => 0, () => c.svarint(), () => c.f32(), () => c.f64()][form]();
    const m = [0, 1, 2].map(() => {
        const forms = c.u8();
        return [0, 1, 2, 3].map((k) => number((forms >> (2 * k)) & 3));
    });
    c.must(m.flat().every((v) => Math.abs(v) <= 1e12), 'the affine');
    const determinant = m[0][0] * (m[1][1] * m[2][2] - m[1][2] * m[2][1]) - m[0][1] * (m[1][0] * m[2][2] - m[1][2] * m[2][0]) +
        m[0][2] * (m[1][0] * m[2][1] - m[1][1] * m[2][0]);
    c.must(determinant !== 0, 'the affine has no inverse');
    return m;
}

function readBox(c: Cursor, before: number[]): Box {
    const origin = before.map((b) => (b + c.svarint()) | 0), size = [c.varint(), c.varint(), c.varint()], levelCount = c.u8();
    for (let k = 0; k < 3; k++) {
        const margin = k < 2 ? 1 : 0;
        c.must(size[k] >= 1 + 2 * margin && size[k] <= 4096 + 2 * margin, 'the size of a box');
        c.must(origin[k] >= -margin && origin[k] + size[k] <= 4096 + margin, 'the origin of a box');
    }
    c.must(Math.ceil(size[0] / 64) * 8 * size[1] * size[2] <= 2 ** 30, 'a box is too large');
    c.must(levelCount >= 1 && levelCount <= 12, 'a level count');
    return { origin, size, levelCount };
}

function readSchedule(c: Cursor, parameters: number[], structures: Box[]): number[][] {
    const passes: number[][] = [[-1]], strides = [1, 1, 1];
    c.must(parameters.length >= 2 && parameters.length <= 13, 'the number of levels');
    c.must(structures.every((s) => s.levelCount === parameters.length - 1), 'a level count');
    for (let code of parameters.slice(2)) {
        const axes: number[] = [];
        for (; code > 0; code = Math.floor(code / 4)) axes.push((code % 4) - 1);
        c.must(axes.length >= 1 && axes.length <= 15 && !axes.includes(-1), 'the passes of a level');
        for (const axis of axes) c.must((strides[axis] *= 2) <= 4096, 'a stride');
        passes.push(axes);
    }
    return passes;
}

function readBody(c: Cursor): Header {
    const flags = c.u8();
    c.must(flags < 8 && (flags & 3) < 3, 'flags');
    const affine = readAffine(c), parameterCount = c.u8();
    c.must(parameterCount <= 16, 'too many parameters');
    const parameters = Array.from({ length: parameterCount }, () => c.varint()), count = c.varint();
    c.must(count >= 1 && count <= 65535 && count * 7 <= c.left, 'the number of structures');
    const structures: Box[] = [];
    for (let i = 0; i < count; i++) structures.push(readBox(c, i ? structures[i - 1].origin : [0, 0, 0]));
    c.must(c.left === 0, 'bytes left over');
    return {
        axis: flags & 3, boundary: flags >> 2, affine, parameters, structures, levelCount: Math.max(...structures.map((s) => s.levelCount)),
        fraction: (parameters[0] ?? 32) & 63, flags: parameters[1] ?? 0,
        passes: (parameters[1] ?? 0) & PYRAMID ? readSchedule(c, parameters, structures) : null,
    };
}

function readHeader(bytes: Uint8Array): [Header, number] {
    const c = new Cursor(bytes, 0, 'header');
    for (const byte of MAGIC) c.must(c.u8() === byte, 'not a Lathe archive of version 2');
    const size = c.varint();
    c.must(size <= 2 ** 24, 'too large');
    const body = c.block(size);
    c.checksum(0);
    try {
        return [readBody(new Cursor(body, 0, 'header')), c.at];
    } catch (e) {
        throw e instanceof Incomplete ? new Damaged('header', 'ends early') : e;
    }
}

/** Whose packet: structure -1 stands for all. */
export interface Owner { structure: number; pass: number }
export interface LevelHead { level: number; rms: number; max: number; owners: Owner[]; sizes: number[] }

const nameOf = (level: number, structure: number): string =>
    structure < 0 ? `level ${level} of all structures` : `level ${level} of structure ${structure}`;

function ownersOf(header: Header, level: number): Owner[] {
    const present = header.structures.flatMap((s, i) => (s.levelCount > level ? [i] : []));
    if (!header.passes) return present.map((structure) => ({ structure, pass: 0 }));
    return header.passes[level].flatMap((_, pass) => (header.flags & SHARED ? [-1] : present).map((structure) => ({ structure, pass })));
}

function readLevelHead(c: Cursor, header: Header, level: number): LevelHead {
    const start = c.at;
    c.must(c.u8() === 0x4c, 'the tag');
    c.must(c.varint() === level, 'its number');
    const rms = c.f32(), max = c.f32(), count = c.varint();
    c.must(Math.abs(rms) <= Math.fround(1e30) && Math.abs(max) <= Math.fround(1e30), 'the error');
    const owners = ownersOf(header, level);
    c.must(count === owners.length, 'the number of packets');
    if (count > c.left) throw new Incomplete();
    const sizes = owners.map(() => c.varint());
    c.must(sizes.every((size) => size <= 2 ** 30), 'the size of a packet');
    c.checksum(start);
    return { level, rms, max, owners, sizes };
}

// ---- range decoder and adaptive numbers ----

class RangeDecoder {
    code = 0;
    range = 2 ** 32 - 1;
    missing = 0;
    at = 0;
    constructor(private readonly bytes: Uint8Array, private readonly record: string) {
        for (let i = 0; i < 4; i++) this.code = ((this.code << 8) | this.next()) >>> 0;
    }
    get left(): number { return this.bytes.length - this.at; }
    private next(): number {
        if (this.at < this.bytes.length) return this.bytes[this.at++];
        this.missing++;
        return 0;
    }
    bit(p: number): number {
        const bound = Math.floor((this.range * p) / 65536), bit = this.code < bound ? 1 : 0;
        if (bit) this.range = bound;
        else this.code -= bound, this.range -= bound;
        for (; this.range < 2 ** 24; this.range *= 256) this.code = ((this.code << 8) | this.next()) >>> 0;
        return bit;
    }
    must(condition: boolean, what: string): void {
        if (!condition) throw new Damaged(this.record, what);
    }
    present(): void { this.must(this.missing <= 8, 'the payload ends early'); }
}

/** A context of numbers: 48 adaptive bits. */
class NumberContext {
    private readonly p: Uint16Array;
    private readonly count: Uint8Array;
    /** Chances in 256ths: not zero, a longer magnitude, all others. */
    constructor(count: number, notZero = 128, longer = 128) {
        this.p = Uint16Array.from({ length: 48 }, (_, k) => 256 * (k === 0 ? notZero : k >= 2 && k < 24 ? longer : 128));
        this.count = new Uint8Array(48).fill(count);
    }
    private bit(d: RangeDecoder, k: number): number {
        const bit = d.bit(this.p[k]), rate = this.count[k] < 30 ? this.count[k] + 2 : 32;
        if (this.count[k] < 30) this.count[k]++;
        const p = this.p[k] + Math.trunc((bit ? 65535 - this.p[k] : -this.p[k]) / rate);
        this.p[k] = Math.min(Math.max(p, 512), 65023);
        return bit;
    }
    read(d: RangeDecoder): number {
        if (!this.bit(d, 0)) return 0;
        const negative = this.bit(d, 1);
        let length = 0, a = 1;
        while (length < 20 && this.bit(d, 2 + length)) length++;
        for (let i = length - 1; i >= 0; i--) a = 2 * a + (i === length - 1 ? this.bit(d, 24 + length) : d.bit(32768));
        return negative ? -a : a;
    }
}

// ---- levels ----

/** What a structure's slices are shown by. */
class Plan {
    early: Uint8Array;
    constructor(readonly slices: number, readonly levelCount: number) { this.early = new Uint8Array(slices); }
    stride(level: number): number { return 2 ** (this.levelCount - 1 - level); }
    private begins(w: number): number {
        let level = 0;
        while (w < this.slices - 1 && w % this.stride(level)) level++;
        return Math.max(level - this.early[w], 0);
    }
    shown(level: number): number[] {
        return Array.from({ length: this.slices }, (_, w) => w).filter((w) => this.begins(w) <= level);
    }
}

// ---- rays and star polygons ----

type Point = [number, number];
const times = (a: bigint, b: bigint): bigint => (a * b) >> 30n;

export function direction(i: number, n: number): Point {
    const angle = ((i % n) * 65536) / n, within = angle % 16384, step = within <= 8192 ? within : 16384 - within;
    const t = BigInt(step) << 17n, q = times(t, t);
    const c = (1n << 30n) - times(q, 331168970n - times(q, 17023473n - times(q, 350031n - times(q, 3856n))));
    const s = times(t, 843314857n - times(q, 86699834n - times(q, 2674041n - times(q, 39273n - times(q, 336n)))));
    let x = Number((c + 32768n) >> 16n), y = Number((s + 32768n) >> 16n);
    if (within > 8192) [x, y] = [y, x];
    return ([[x, y], [-y, x], [-x, -y], [y, -x]] as Point[])[Math.floor(angle / 16384)];
}

function jitter([x, y]: Point, seed: number): Point {
    let h = Math.imul(x, 2654435761) ^ Math.imul(y, 2246822519) ^ Math.imul(seed + 1, 3266489917);
    h = Math.imul(h ^ (h >>> 15), 2246822519);
    h ^= h >>> 13;
    return [x + (h & 0x1fe) * 2 - 510, y + ((h >>> 16) & 0x1fe) * 2 - 510];
}

export interface Star { parent: number; hole: boolean; centre: Point; radii: number[] }

function polygon(star: Star, step: number, order: number): Point[] {
    const n = star.radii.length;
    return star.radii.map((_, i) => {
        const k = star.hole ? n - 1 - i : i, d = direction(k, n);
        const at = [0, 1].map((c) => (star.centre[c] * 65536 + Math.trunc((star.radii[k] * step * d[c]) / 16384)) & ~1);
        return jitter([at[0], at[1]], order);
    });
}

// ---- stars ----

const LOOPS = 0, PARENT = 1, HOLE = 2, RAYS = 3, CENTRE_NEW = 4, CENTRE = 5, RADIUS_FIRST = 6, RADIUS_ALONE = 7, RADIUS_PARENT = 8;
const starContexts = (): NumberContext[] =>
    [[40, 60], [16, 60], [4, 20], [24, 30], [230, 200], [190, 150], [240, 180], [200, 120], [200, 110]].map(
        ([notZero, longer]) => new NumberContext(6, notZero, longer));

function predictRadius(radii: number[], n: number, parent: Star | undefined): number {
    const k = radii.length;
    if (!parent) return k ? radii[k - 1] : 16;
    const m = parent.radii.length;
    let p = parent.radii[Math.floor((k * m) / n)];
    if (k) {
        const was = parent.radii[Math.floor(((k - 1) * m) / n)], is = radii[k - 1];
        p = Math.trunc((Math.trunc((2 * p * (is + 1)) / (was + 1)) + p + is + 2) / 4);
    }
    return Math.min(Math.max(p, 1), 65535);
}

function readStar(d: RangeDecoder, m: NumberContext[], index: number, before: Star[], size: number[]): Star {
    const parentIndex = m[PARENT].read(d) + (index < before.length ? index + 1 : 0);
    d.must(parentIndex >= 0 && parentIndex <= before.length, 'a parent');
    const parent = parentIndex ? before[parentIndex - 1] : undefined;
    const hole = m[HOLE].read(d) + (parent?.hole ? 1 : 0) !== 0;
    const log = m[RAYS].read(d) + (parent ? Math.log2(parent.radii.length) : 3);
    d.must(log >= 3 && log <= 7, 'the rays of a star');
    const centre = [0, 1].map((k) => m[parent ? CENTRE : CENTRE_NEW].read(d) + (parent ? parent.centre[k] : size[k] >> 1)) as Point;
    d.must(centre.every((c, k) => c >= 0 && c <= size[k]), 'a centre');
    const radii: number[] = [];
    for (let k = 0; k < 2 ** log; k++) {
        const r = predictRadius(radii, 2 ** log, parent) + m[parent ? RADIUS_PARENT : k ? RADIUS_ALONE : RADIUS_FIRST].read(d);
        d.must(r >= 1 && r <= 32767, 'a radius');
        radii.push(r);
    }
    d.present();
    return { parent: parentIndex, hole, centre, radii };
}

function readStars(d: RangeDecoder, m: NumberContext[], slices: number, size: number[]): Star[][] {
    const all: Star[][] = [];
    for (let i = 0; i < slices; i++) {
        const before = all[i - 1] ?? [], count = m[LOOPS].read(d) + (i ? before.length : 1), stars: Star[] = [];
        d.must(count >= 0 && count <= 64, 'the number of stars');
        d.present();
        for (let k = 0; k < count; k++) stars.push(readStar(d, m, k, before, size));
        all.push(stars);
    }
    return all;
}

const radiusStep = (stride: number): number => (stride < 4 ? 65536 : stride * 24576);

function checkStars(d: RangeDecoder, stars: Star[][], step: number, size: number[]): void {
    const farthest = Math.min(65536 * (size[0] + size[1]) + step, 2 ** 29);
    d.must(stars.flat().every((star) => star.radii.every((r) => r * step <= farthest)), 'a ray leaves the frame');
}

// ---- slices of pixels ----

/** Pixels of one slice, one byte each, margin included. */
export type Slice = Uint8Array;
interface Known { below: Slice | null; above: Slice | null; mode: number }

/** The pixels that a base slice's stars cover. */
function estimate(stars: Star[], step: number, order: number, width: number, height: number): Slice {
    const out = new Uint8Array(width * height);
    for (const star of stars) {
        const points = polygon(star, step, order);
        points.forEach((p, i) => {
            const q = points[(i + 1) % points.length], [a, b] = p[1] <= q[1] ? [p, q] : [q, p];
            for (let v = Math.max(1, Math.ceil(a[1] / 65536)); v < height - 1 && v * 65536 < b[1]; v++) {
                const x = a[0] + Number((BigInt(b[0] - a[0]) * BigInt(v * 65536 - a[1])) / BigInt(b[1] - a[1]));
                const u = Math.max(1, Math.ceil(x / 65536));
                if (u < width) out[v * width + u] ^= 1;
            }
        });
    }
    for (let i = 0; i < out.length; i++) if (i % width) out[i] ^= out[i - 1];
    return out;
}

const log = (x: number): number => (x ? 31 - Math.clz32(x) : 0);

const CHANCE = new Uint16Array(2 * 3071 + 1), LOGIT = new Int16Array(4096);
{
    let power = 2n ** 32n;
    for (let k = 0; k <= 3071; k++) {
        const p = Math.min(Math.max(Number(2n ** 48n / (2n ** 32n + power)), 1), 65535);
        CHANCE[3071 + k] = p;
        CHANCE[3071 - k] = 65536 - p;
        power = (power * 4278222847n) >> 32n;
    }
    let k = 0;
    for (let p = 2048; p <= 4095; p++) {
        while (k < 3071 && CHANCE[3071 + k] >> 4 < p) k++;
        LOGIT[p] = k;
        LOGIT[4095 - p] = -k;
    }
}

/** Decides a bit with probability p: reads it, or says what it has to be. */
type Decide = (p: number, truth: number) => number;
const times64 = 0x9e3779b97f4a7c15n;

class OccupancyModel {
    limit = 4;
    mixed = 0;
    slots: Uint32Array;
    surprise = new Uint32Array(8 * 8 * 16).fill(2 ** 28);
    place = new Uint32Array(2 * 16 * 16).fill(2 ** 28);
    seen: Int32Array;
    near: Int32Array;
    side = new Int32Array(32 * 6);
    small = new Uint32Array(4 * 2 ** 13).fill(2 ** 31);
    constructor(readonly bits: number, readonly sure: boolean) {
        this.slots = new Uint32Array(2 ** bits).fill(2 ** 31);
        this.seen = new Int32Array(8 * 6).fill(sure ? 6553 : 5461);
        this.near = new Int32Array(16 * 6).fill(sure ? 6553 : 5461);
    }

    private learn(slots: Uint32Array, i: number, bit: number): void {
        const count = slots[i] & 1023, p = slots[i] >>> 10, rate = Math.floor(327680 / (5 * count + 8));
        const better = p + Math.floor(((bit ? 2 ** 22 - 1 : 0) - p) * rate / 65536);
        slots[i] = better * 1024 + Math.min(count + 1, this.limit);
    }

    private plain(slots: Uint32Array, i: number, decide: Decide, truth: number): number {
        const bit = decide(Math.min(Math.max(slots[i] >>> 16, 1), 65535), truth);
        this.learn(slots, i, bit);
        return bit;
    }

    /** One slice: read with `decide`, whose second argument is the bit of `truth`, if that is given. */
    code(width: number, height: number, known: Known, decide: Decide, truth?: Slice): Slice {
        const walk = new SliceWalk(this, width, height, known, decide, truth);
        for (let y = 1; y < height - 1; y++) walk.row(y);
        return walk.out;
    }

    /** The calm stretch from pixel x on: how many of its pixels keep its value. */
    stretch(decide: Decide, mode: number, value: number, ends: number, length: number, kept: number): number {
        if (!this.plain(this.surprise, (mode * 8 + value * 4 + ends) * 16 + log(length), decide, kept < length ? 1 : 0)) return length;
        let i = 0;
        while (i < length - 1 && !this.plain(this.place, (value * 16 + log(length - i)) * 16 + log(i + 1), decide, kept === i ? 1 : 0)) i++;
        return i;
    }

    /** One mixed pixel: its small context, keys and salts of the six inputs, which weights. */
    mix(decide: Decide, small: number, keys: [bigint, bigint][], near: number, side: number, truth: number): number {
        const [count, chance] = [this.small[small] & 1023, this.small[small] >>> 16];
        if (this.sure && count >= 30 && (chance < 4096 || chance >= 61440)) return this.plain(this.small, small, decide, truth);
        const slot = keys.map(([key, salt]) =>
            Number((((key + (salt << 40n)) * times64) & (2n ** 64n - 1n)) >> BigInt(64 - this.bits)));
        /* Which inputs there are, and where their slots. */
        const inputs = this.sure ? [0, 1, 3, 4, 5] : [0, 1, 2, 3, 4, 5];
        const at = slot.map((place, i): [Uint32Array, number] => (this.sure && i === 0 ? [this.small, small] : [this.slots, place]));
        const now = at.map(([slots, place]) => slots[place]);
        const l = now.map((value) => LOGIT[value >>> 20]), seen = now.map((value) => log((value & 1023) + 1));
        let sum = 0;
        for (const i of inputs) sum += (this.seen[seen[i] * 6 + i] + this.near[near * 6 + i] + this.side[side * 6 + i]) * l[i];
        const p = CHANCE[3071 + Math.min(Math.max(Math.floor(sum / 65536), -3071), 3071)], bit = decide(p, truth);
        const step = Math.trunc(((bit * 65536 - p) * (this.sure ? 20 : this.mixed < 32768 ? 10 : 4)) / 16);
        if (this.mixed < 32768) this.mixed++;
        for (const i of inputs) {
            const change = (l[i] * step + 32768) >> 16;
            this.seen[seen[i] * 6 + i] += change;
            this.near[near * 6 + i] += change;
            this.side[side * 6 + i] += change;
            this.learn(...at[i], bit);
        }
        return bit;
    }

    /** A copy with a larger table. */
    enlarged(bits: number): OccupancyModel {
        const to = new OccupancyModel(bits, this.sure);
        to.limit = this.limit;
        for (const name of ['surprise', 'place', 'seen', 'near', 'side', 'small'] as const) to[name].set(this[name]);
        to.slots = to.slots.map((_, i) => this.slots[i >>> (bits - this.bits)]);
        return to;
    }
}

/** One walk over the pixels of a slice. */
class SliceWalk {
    readonly out: Slice;
    private y = 0;
    constructor(private readonly model: OccupancyModel, private readonly width: number, private readonly height: number,
        private readonly known: Known, private readonly decide: Decide, private readonly truth?: Slice) {
        this.out = new Uint8Array(width * height);
    }

    private pixel(slice: Slice | null, x: number, y: number): number {
        return slice && x >= 0 && x < this.width && y >= 0 && y < this.height ? slice[y * this.width + x] : 0;
    }

    private calm(x: number, value: number): boolean {
        const y = this.y, is = (slice: Slice, dx: number, dy: number): boolean => this.pixel(slice, x + dx, y + dy) === value;
        if (!is(this.out, -1, -1) || !is(this.out, 0, -1) || !is(this.out, 1, -1)) return false;
        return [this.known.below, this.known.above].every(
            (s) => !s || (is(s, 0, -1) && is(s, 0, 1) && is(s, -1, 0) && is(s, 0, 0) && is(s, 1, 0)));
    }

    private truthAt(x: number): number { return this.truth ? this.truth[this.y * this.width + x] : 0; }

    row(y: number): void {
        this.y = y;
        const end = this.width - 1;
        let before = 0, before2 = 0, x = 1;
        while (x < end) {
            let length = 0, bit: number;
            if (before === before2) while (x + length < end && this.calm(x + length, before)) length++;
            if (length) {
                let kept = 0;
                while (this.truth && kept < length && this.truthAt(x + kept) === before) kept++;
                kept = this.model.stretch(this.decide, this.known.mode, before, (x === 1 ? 1 : 0) + (x + length === end ? 2 : 0), length, kept);
                this.out.fill(before, y * this.width + x, y * this.width + x + kept);
                x += kept;
                if (kept === length) continue;
                bit = 1 - before;
            } else {
                bit = this.mixed(x, before);
            }
            this.out[y * this.width + x++] = bit;
            before2 = before;
            before = bit;
        }
    }

    private mixed(x: number, flip: number): number {
        const field = (slice: Slice | null) => (r: number, a: number, n: number): number => {
            let bits = 0;
            for (let i = 0; i < n; i++) bits |= (this.pixel(slice, x + a + i, this.y + r) ^ flip) << i;
            return bits;
        };
        const R = field(this.out), B = field(this.known.below), A = field(this.known.above), mode = this.known.mode;
        type Field = typeof R;
        const cross = (f: Field): number => f(0, -1, 3) | (f(-1, 0, 1) << 3) | (f(1, 0, 1) << 4);
        const square = (f: Field): number => f(-1, -1, 3) | (f(0, -1, 3) << 3) | (f(1, -1, 3) << 6);
        const left = R(0, -4, 4), below = cross(B), above = cross(A), centres = B(0, 0, 1) | (A(0, 0, 1) << 1);
        const near = (left >> 3) | (R(-1, -1, 3) << 1);
        const causal10 = (left >> 2) | (R(-1, -2, 5) << 2) | (R(-2, -1, 3) << 7);
        const causal19 = left | (R(-1, -3, 7) << 4) | (R(-2, -2, 5) << 11) | (R(-3, -1, 3) << 16);
        const causal25 = left | (R(-1, -4, 9) << 4) | (R(-2, -3, 7) << 13) | (R(-3, -2, 5) << 20);
        const wide = near | (((left >> 2) & 1) << 4) | (square(B) << 5) | (square(A) << 14) | (R(-2, 0, 1) << 23) | (R(-1, 2, 1) << 24);
        const keys: [bigint, bigint][] = [
            [BigInt(near | (below << 4) | (above << 9) | (mode << 14)), 1n], [BigInt(causal19 | (centres << 19) | (mode << 21)), 2n],
            [BigInt(causal25 | (centres << 25)), 3n], [BigInt(wide), 4n], [BigInt(causal10 | (below << 10)), 5n],
            [BigInt(causal10 | (above << 10)), 5n],
        ];
        const small = R(-1, -1, 3) | (below << 3) | (above << 8) | (mode << 13);
        return this.model.mix(this.decide, small, keys, near, mode * 4 + B(0, 0, 1) + 2 * A(0, 0, 1), this.truthAt(x) ^ flip) ^ flip;
    }
}

// ---- training ----

const BLOB = 40, BLOB_SLICES = 17;

/** Each value becomes half the sum of the seven around it in its line. */
function smooth(values: Int32Array, start: number, count: number, stride: number): void {
    const line = Array.from({ length: count }, (_, i) => values[start + i * stride]);
    for (let i = 0; i < count; i++) {
        let sum = 0;
        for (let k = i - 3; k <= i + 3; k++) sum += line[k] ?? 0;
        values[start + i * stride] = sum >> 1;
    }
}

function makeBlob(): Slice[] {
    const area = BLOB * BLOB, values = new Int32Array(area * BLOB_SLICES);
    let r = 1;
    for (let i = 0; i < values.length; i++) {
        r = (Math.imul(r, 1664525) + 1013904223) >>> 0;
        values[i] = ((r >>> 16) & 2047) - 1024;
    }
    for (let pass = 0; pass < 3; pass++) {
        for (let i = 0; i < BLOB * BLOB_SLICES; i++) smooth(values, i * BLOB, BLOB, 1);
        for (let i = 0; i < BLOB * BLOB_SLICES; i++) smooth(values, Math.floor(i / BLOB) * area + (i % BLOB), BLOB, BLOB);
        for (let i = 0; i < area; i++) smooth(values, i, BLOB_SLICES, area);
    }
    const inner = (c: number): boolean => c >= 1 && c <= BLOB - 2;
    return Array.from({ length: BLOB_SLICES }, (_, w) => Uint8Array.from({ length: area }, (_, i) =>
        values[w * area + i] > 0 && inner(i % BLOB) && inner(Math.floor(i / BLOB)) ? 1 : 0));
}

const modeOfGap = (gap: number, sure: boolean): number => (gap < 2 ? 2 : gap < 4 || sure ? 3 : gap < 8 ? 4 : 5);

function train(sure: boolean): OccupancyModel {
    const model = new OccupancyModel(17, sure), blob = makeBlob(), say: Decide = (_, truth) => truth;
    const code = (w: number, known: Known): void => void model.code(BLOB, BLOB, known, say, blob[w]);
    for (const w of [0, 8, 16]) code(w, { below: w ? blob[w - 8] : null, above: null, mode: w ? 1 : 0 });
    for (const gap of [4, 2, 1])
        for (let w = gap; w < BLOB_SLICES; w += 2 * gap) code(w, { below: blob[w - gap], above: blob[w + gap], mode: modeOfGap(gap, sure) });
    model.limit = sure ? 192 : 254;
    model.mixed = 0;
    return model;
}

const trained: { [sure: string]: OccupancyModel } = {};
function freshModel(area: number, flags: number): OccupancyModel {
    const sure = (flags & PYRAMID) !== 0 && (flags & SURE) !== 0, model = (trained[String(sure)] ??= train(sure));
    return model.enlarged(area <= 4096 ? 17 : area <= 16384 || sure ? 18 : 20);
}

// ---- radius maps ----

class RadiusContexts {
    readonly centre = new NumberContext(3, 24, 77);
    readonly start = new NumberContext(3, 200, 200);
    readonly radius = [0, 1, 2].map((kind) =>
        [8, 24, 64, 100, 128, 154, 192, 216, 240].map((usual) => new NumberContext(3, kind ? usual : 250, kind ? 77 : 180)));
}

/** Rows of centres and radii, refined pass by pass; a simple map's passes are its levels. */
class RadiusImage {
    centres: Point[];
    radii: Int32Array[];
    private magnitudes: Uint8Array[];

    /** start: of a tube, what its first centre and radius are predicted to be. early: which rows a pass codes before their time. */
    constructor(readonly slices: number, readonly passes: number, readonly rays: number, private readonly contexts: RadiusContexts,
        private readonly farthest: number, private readonly start: { centre: Point; radius: number } | null, private readonly ahead = 0,
        private readonly early: { pass: number; rows: Set<number> } | null = null) {
        this.centres = Array.from({ length: slices }, () => [0, 0]);
        this.radii = this.centres.map(() => new Int32Array(rays));
        this.magnitudes = this.centres.map(() => new Uint8Array(rays));
    }

    copy(): RadiusImage {
        const to = new RadiusImage(this.slices, this.passes, this.rays, this.contexts, this.farthest, this.start, this.ahead, this.early);
        to.centres = this.centres.map(([u, v]) => [u, v]);
        to.radii = this.radii.map((r) => r.slice());
        to.magnitudes = this.magnitudes.map((m) => m.slice());
        return to;
    }

    get last(): number { return this.slices - 1; }
    stride(pass: number): number { return 2 ** (this.passes - 1 - pass); }
    rayStride(pass: number): number { return Math.min(Math.max(Math.floor(this.stride(pass) / 2 ** this.ahead), 1), this.rays / 8); }
    rows(pass: number): number[] {
        const stride = this.stride(pass), rows: number[] = [];
        for (let row = 0; row < this.last; row += stride) rows.push(row);
        return [...rows, this.last];
    }

    /** The numbers of one pass; without a decoder all are 0. earlyStep: that of the rows which come before their time. */
    read(d: RangeDecoder | null, pass: number, step: number, earlyStep: number): void {
        if (pass === 0) this.rows(0).forEach((row, i, all) => this.firstRow(d, step, row, i ? all[i - 1] : -1));
        else this.between(d, pass, step, false);
        if (this.early && this.early.pass === pass) this.between(d, pass + 1, earlyStep, true);
        d?.present();
    }

    /** A pass's new rows and rays: of its early rows or of the others. */
    private between(d: RangeDecoder | null, pass: number, step: number, early: boolean): void {
        const s = this.stride(pass), known = this.rayStride(pass - 1), rays = this.rayStride(pass);
        const wanted = (row: number): boolean => (this.early !== null && this.early.pass === pass - 1 && this.early.rows.has(row)) === early;
        for (let row = s; row < this.last; row += 2 * s) if (wanted(row)) this.newRow(d, step, row, s, known);
        if (rays < known) this.rows(pass).forEach((row, i, all) => {
            if (wanted(row)) this.newRays(d, step, row, i && !early ? all[i - 1] : -1, row % (2 * s) !== 0 && row !== this.last, rays);
        });
    }

    private centre(d: RangeDecoder | null, row: number, predicted: Point, context = this.contexts.centre): void {
        this.centres[row] = predicted.map((p) => {
            const number = d ? context.read(d) : 0;
            d?.must(Math.abs(number) <= 2 ** 14, 'a centre');
            return p + number;
        }) as Point;
    }

    private radius(d: RangeDecoder | null, step: number, kind: number, near: number, row: number, i: number, predicted: number): void {
        const kindOf = [1, 3, 6, 10, 16, 25, 40, 80].filter((limit) => limit <= near).length;
        const number = d ? this.contexts.radius[kind][kindOf].read(d) : 0;
        this.magnitudes[row][i] = Math.min(Math.abs(number), 127);
        let r = predicted + number * step;
        if (this.start) r = Math.min(r, this.farthest);
        else d?.must(r <= this.farthest, 'a radius');
        this.radii[row][i] = Math.max(r, 16);
    }

    private firstRow(d: RangeDecoder | null, step: number, row: number, before: number): void {
        const q = this.rayStride(0), r = this.radii[row], b = this.radii[before];
        if (before < 0 && this.start) this.centre(d, row, this.start.centre, this.contexts.start);
        else this.centre(d, row, before < 0 ? [0, 0] : this.centres[before]);
        for (let i = 0; i < this.rays; i += q) {
            const first = this.start ? this.start.radius : 1024;
            const predicted = before < 0 ? (i ? r[i - q] : first) : i ? Math.trunc((r[i - q] + 2 * b[i] - b[i - q]) / 2) : b[0];
            this.radius(d, step, 0, 0, row, i, predicted);
        }
    }

    private magnitude(row: number, i: number): number { return this.magnitudes[row][(i + this.rays) % this.rays]; }

    private newRow(d: RangeDecoder | null, step: number, row: number, s: number, q: number): void {
        const l = row - s, h = Math.min(row + s, this.last), r = this.radii;
        const between = (a: number, b: number): number =>
            Math.trunc((a * (h - row) * 2 + b * (row - l) * 2 + h - l) / (2 * (h - l)));
        const round = (a: number, b: number): number => Math.floor(Math.sqrt(Math.floor((a * a * (h - row) + b * b * (row - l)) / (h - l))));
        this.centre(d, row, [0, 1].map((k) => between(this.centres[l][k], this.centres[h][k])) as Point);
        const cubic = l - 2 * s >= 0 && h + 2 * s <= this.last && h - row === s, straight = this.start ? round : between;
        for (let i = 0; i < this.rays; i += q) {
            const predicted = cubic ? (9 * (r[l][i] + r[h][i]) - r[l - 2 * s][i] - r[h + 2 * s][i] + 8) >> 4 : straight(r[l][i], r[h][i]);
            let near = i > 0 ? 10 * this.magnitude(row, i - q) : 0;
            if (i > q) near += 5 * this.magnitude(row, i - 2 * q);
            const below = row - 2 * s;
            if (below >= 0) near += 10 * this.magnitude(below, i) + 4 * this.magnitude(below, i - q) + 4 * this.magnitude(below, i + q);
            this.radius(d, step, 1, near, row, i, predicted);
        }
    }

    private newRays(d: RangeDecoder | null, step: number, row: number, before: number, fresh: boolean, q: number): void {
        const r = (i: number): number => this.radii[row][(i + this.rays) % this.rays];
        for (let i = q; i < this.rays; i += 2 * q) {
            const predicted = (9 * (r(i - q) + r(i + q)) - r(i - 3 * q) - r(i + 3 * q) + 8) >> 4;
            let near = i > q ? 10 * this.magnitude(row, i - 2 * q) : 0;
            if (i > 3 * q) near += 5 * this.magnitude(row, i - 4 * q);
            if (before >= 0)
                near += 10 * this.magnitude(before, i) + 4 * this.magnitude(before, i - 2 * q) + 4 * this.magnitude(before, i + 2 * q);
            if (fresh) near += 5 * this.magnitude(row, i - q) + 5 * this.magnitude(row, i + q);
            this.radius(d, step, 2, near, row, i, predicted);
        }
    }
}

/** Step behind `times` levels below the one that it is the step of. */
const fallen = (step: number, times: number, eighths: number): number => {
    for (; times > 0; times--) if (step > 3) step = Math.floor((step * eighths) / 8);
    return step;
};

/** One loop in each slice. */
export class SimpleMap {
    readonly step: number;
    readonly turn: number;
    readonly apex: number[];
    readonly image: RadiusImage;

    constructor(d: RangeDecoder, m: NumberContext, log: number, plan: Plan, farthest: number) {
        d.must(log >= 3 && log <= 10, 'the rays of a radius map');
        this.step = m.read(d);
        this.turn = m.read(d);
        this.apex = [4 + m.read(d), 4 + m.read(d)];
        d.must(this.step >= 1 && this.step <= 65536 && Math.abs(this.turn) <= 32768, 'the step or the turn');
        d.must(this.apex.every((a) => a >= 1 && a <= 7), 'an apex');
        d.must(plan.slices * 2 ** log <= 2 ** 24, 'a radius map is too large');
        this.image = new RadiusImage(plan.slices, plan.levelCount, 2 ** log, new RadiusContexts(), farthest, null);
    }

    read(d: RangeDecoder, level: number): void { this.image.read(d, level, fallen(this.step, this.image.passes - 1 - level, 6), 0); }
}

export interface Tube { first: number; rows: number; rays: number; hole: boolean; image: RadiusImage | null }

/** Several of them, or one with more to say; `form` is 5, 6 or 7. */
export class Tubes {
    /** Numbers of the steps, and the steps. */
    readonly steps: number[];
    private readonly step: number;
    private readonly fineStep: number;
    readonly fall: number;
    readonly fine: number;
    readonly turn: number;
    readonly apex: number[];
    readonly ahead: number = 0;
    /** The level that has early slices, or -1; and those. */
    readonly earlyLevel: number = -1;
    readonly early: number[] = [];
    readonly plain: boolean;
    readonly tubes: Tube[] = [];
    private readonly contexts = new RadiusContexts();
    private readonly kinds = new Map<string, NumberContext>();

    constructor(d: RangeDecoder, form: number, private readonly plan: Plan, private readonly box: number[]) {
        const number = (kind: string): number => {
            if (!this.kinds.has(kind)) this.kinds.set(kind, new NumberContext(2));
            return (this.kinds.get(kind) as NumberContext).read(d);
        };
        const within = (value: number, least: number, most: number, what: string): number => {
            d.must(value >= least && value <= most, what);
            return value;
        };
        const stepOf = (k: number): number => (8 + (k % 8)) * 2 ** Math.floor(k / 8);
        const count = within(1 + number('count'), 1, 8, 'the number of tubes'), k = within(32 + number('step'), 0, 79, 'the step');
        this.step = stepOf(k);
        this.fall = within(6 + number('fall'), 3, 8, 'the fall');
        this.fine = within(number('fine'), 0, plan.levelCount - 1, 'the fine level');
        const fine = this.fine ? within(k - number('step'), 0, 79, 'the fine step') : k;
        this.fineStep = stepOf(fine);
        this.steps = [k, fine];
        this.turn = within(number('turn'), -32768, 32768, 'the turn');
        this.apex = [0, 1].map(() => within(4 + number('apex'), 1, 7, 'an apex'));
        this.plain = form === 7;
        if (form !== 5) {
            this.ahead = within(number('ahead'), 0, 12, 'how far rays are ahead');
            this.earlyLevel = within(number('early'), 0, plan.levelCount - 1, 'the level of early slices') - 1;
            for (let slice = -1, gap = 1; this.earlyLevel >= 0 && gap;) {
                gap = within(number('gap'), 0, plan.slices - 1 - slice, 'an early slice');
                if (gap) this.early.push((slice += gap));
            }
        }
        let log = 6, samples = 0;
        for (let i = 0; i < count; i++) {
            const before = this.tubes[i - 1], n = within(number('first'), 0, plan.slices, 'where a tube begins');
            const first = !before ? Math.max(n - 1, 0) : n === 0 ? before.first : n === 1 ? before.first + before.rows : before.first + n - 1;
            const rows = within(plan.slices - first - number('rows'), 1, plan.slices - first, 'the rows of a tube');
            log = within(log + number('rays'), 3, count === 1 ? 10 : 8, 'the rays of a tube');
            samples += rows * 2 ** log;
            d.must(samples <= 2 ** 22, 'the tubes are too large');
            this.tubes.push({ first, rows, rays: 2 ** log, hole: number('hole') !== 0, image: null });
        }
    }

    private passes(tube: Tube): number {
        let passes = this.plan.levelCount;
        while (2 ** (passes - 1) < tube.rows - 1) passes++;
        return passes;
    }

    private startOf(i: number): { centre: Point; radius: number } {
        const [width, height] = this.box, tube = this.tubes[i];
        if (!i) return { centre: [width - 1, height - 1], radius: Math.floor((64 * (width + height)) / 4) };
        let from = this.tubes[i - 1], row = 0;
        for (const t of this.tubes.slice(0, i)) if (t.hole === tube.hole && t.first + t.rows === tube.first) [from, row] = [t, t.rows - 1];
        const image = from.image as RadiusImage, [u, v] = image.centres[row];
        return { centre: [u, v], radius: Math.floor(image.radii[row][0] / 2) };
    }

    read(d: RangeDecoder, level: number): void {
        this.tubes.forEach((tube, i) => {
            const passes = this.passes(tube), last = passes - this.plan.levelCount + level;
            const early = this.earlyLevel < 0 ? null :
                { pass: passes - this.plan.levelCount + this.earlyLevel, rows: new Set(this.early.map((w) => w - tube.first)) };
            tube.image ??= new RadiusImage(tube.rows, passes, tube.rays, this.contexts, 64 * (this.box[0] + this.box[1]), this.startOf(i), this.ahead, early);
            for (let pass = level ? last : 0; pass <= last; pass++) {
                const fine = this.fine > 0 && pass >= passes - this.plan.levelCount + this.fine;
                const step = fallen(fine ? this.fineStep : this.step, passes - 1 - pass, this.fall);
                tube.image.read(d, pass, step, fallen(step, 1, this.fall));
            }
        });
    }

    /** All rows and rays, those to come predicted. */
    shown(tube: Tube, level: number): RadiusImage {
        const image = (tube.image as RadiusImage).copy(), passes = image.passes;
        for (let pass = passes - this.plan.levelCount + level + 1; pass < passes; pass++) image.read(null, pass, 1, 1);
        return image;
    }

    /** Is the surface one of strips? */
    get single(): boolean { return this.tubes.length === 1 && !this.tubes[0].hole && this.tubes[0].rows === this.plan.slices; }

    strideAt(level: number): number { return this.plan.stride(level); }
    shownSlices(level: number): number[] {
        const s = this.plan.stride(level), slices = new Set<number>([this.plan.slices - 1, ...(level === this.earlyLevel ? this.early : [])]);
        for (let w = 0; w < this.plan.slices; w += s) slices.add(w);
        for (const { first, rows } of this.tubes) {
            const last = first + rows - 1;
            slices.add(first).add(last);
            for (let k = 1; k < s; k *= 2) {
                if (first + k < last) slices.add(first + k);
                if (last - k > first) slices.add(last - k);
            }
        }
        return [...slices].sort((a, b) => a - b);
    }
}

export interface Mesh { vertices: number[][]; triangles: number[][] }

export function radiusMesh(packet: Packet & { kind: 'radii' }, level: number): Mesh | null {
    const { map } = packet;
    if (map instanceof SimpleMap) return stripMesh(map.image, map.turn, map.apex, map.image.rows(level), map.image.rayStride(level));
    if (!map.single) return map.plain ? new PlainTubes(map, level).mesh : null;
    const s = map.shownSlices(level), rays = map.tubes[0].rays, stride = Math.max(Math.floor(map.strideAt(level) / 2 / 2 ** map.ahead), 1);
    return stripMesh(map.shown(map.tubes[0], level), map.turn, map.apex, s, Math.min(stride, rays / 8));
}

const square = (p: number[], q: number[]): bigint => [0, 1].reduce((sum, k) => sum + BigInt(p[k] - q[k]) ** 2n, 0n);

/** Of a lower ring a, b and an upper one, counter-clockwise: two triangles for each pair of neighbours. */
function strip(mesh: Mesh, lower: number[], upper: number[]): void {
    const at = mesh.vertices, n = lower.length;
    for (let k = 0; k < n; k++) {
        const [a, b, c, e] = [lower[k], lower[(k + 1) % n], upper[(k + 1) % n], upper[k]];
        if (square(at[a], at[c]) <= square(at[b], at[e])) mesh.triangles.push([a, b, c], [a, c, e]);
        else mesh.triangles.push([a, b, e], [b, c, e]);
    }
}

interface Ring { tube: number; hole: boolean; centre: number[]; vertices: number[] }

class PlainTubes {
    readonly mesh: Mesh = { vertices: [], triangles: [] };
    private readonly slices: number[];
    private readonly rings: Ring[][];   /* of each shown slice */

    constructor(private readonly map: Tubes, level: number) {
        this.slices = map.shownSlices(level);
        const stride = Math.max(Math.floor(map.strideAt(level) / 2 / 2 ** map.ahead), 1), images = map.tubes.map((tube) => map.shown(tube, level));
        this.rings = this.slices.map((w) => map.tubes.flatMap((tube, i) => {
            const row = w - tube.first;
            return row >= 0 && row < tube.rows ? [this.ring(tube, i, images[i], row, w, Math.min(stride, tube.rays / 8))] : [];
        }));
        for (let i = 0; i <= this.slices.length; i++) this.slab(i);
    }

    private ring(tube: Tube, index: number, image: RadiusImage, row: number, w: number, q: number): Ring {
        const centre = image.centres[row].map((c) => c * 32768), vertices: number[] = [];
        for (let k = 0; k < tube.rays; k += q) {
            const i = tube.hole ? tube.rays - q - k : k, turned = (((i * (65536 / tube.rays) + this.map.turn * row) % 65536) + 65536) % 65536;
            const d = direction(turned, 65536);
            vertices.push(this.mesh.vertices.length);
            this.mesh.vertices.push([...[0, 1].map((c) => 2 * Math.floor((centre[c] + Math.trunc((image.radii[row][i] * 1024 * d[c]) / 16384)) / 2)), w * 65536]);
        }
        return { tube: index, hole: tube.hole, centre, vertices };
    }

    private slab(i: number): void {
        const sides = [this.rings[i - 1] ?? [], this.rings[i] ?? []], tubes = this.map.tubes.map((_, t) => sides.map((rings) => rings.find((r) => r.tube === t)));
        const single = tubes.flatMap(([a, b], t) => (!a === !b ? [] : [t])), joint = new Map(single.map((t) => [t, [t]])), over = new Set<number>();
        const ringOf = (t: number): Ring => (tubes[t][0] ?? tubes[t][1]) as Ring;
        const areOver = (t: number, u: number): boolean => this.encloses(ringOf(t), ringOf(u)) || this.encloses(ringOf(u), ringOf(t));
        const merge = (t: number, u: number): void => {
            const all = [...new Set([...(joint.get(t) as number[]), ...(joint.get(u) as number[])])].sort((a, b) => a - b);
            for (const k of all) joint.set(k, all);
        };
        const sameSide = (t: number, u: number): boolean => !tubes[t][0] === !tubes[u][0], alike = (t: number, u: number): boolean => ringOf(t).hole === ringOf(u).hole;
        if (this.slices[i] - this.slices[i - 1] === 1)
            for (const t of single) for (const u of single) if (!sameSide(t, u) && alike(t, u) && areOver(t, u)) { merge(t, u); over.add(t).add(u); }
        for (const t of single) for (const u of single)
            if (!over.has(t) && !over.has(u) && sameSide(t, u) && !alike(t, u) && areOver(t, u)) merge(t, u);
        tubes.forEach(([a, b], t) => {
            if (a && b) strip(this.mesh, a.vertices, b.vertices);
            else if ((a || b) && (joint.get(t) as number[])[0] === t) this.join(joint.get(t) as number[], tubes, over.has(t));
        });
    }

    /** Is a vertex of the other one inside? */
    private encloses(ring: Ring, other: Ring): boolean {
        const at = this.mesh.vertices, n = ring.vertices.length;
        return other.vertices.some((v) => {
            let odd = false;
            ring.vertices.forEach((a, i) => {
                const p = at[a], q = at[ring.vertices[(i + 1) % n]], c = at[v];
                if (p[1] > c[1] === q[1] > c[1]) return;
                const turn = BigInt(q[0] - p[0]) * BigInt(c[1] - p[1]) - BigInt(q[1] - p[1]) * BigInt(c[0] - p[0]);
                if (turn > 0n === q[1] > p[1]) odd = !odd;
            });
            return odd;
        });
    }

    private join(members: number[], tubes: (Ring | undefined)[][], over: boolean): void {
        const chains: number[][] = [[], []], at = this.mesh.vertices;
        if (over) {
            for (const side of [0, 1]) for (const t of members) {
                const ring = tubes[t][side];
                if (ring) this.addRing(chains[side], ring.vertices, side, side ? -32768 : 32768);
            }
        } else {
            const side = tubes[members[0]][0] ? 0 : 1, alone = members.length === 1, rise = 8192 * this.map.apex[1 - side] * (side ? -1 : 1);
            for (const t of members) {
                const { vertices, centre, hole } = tubes[t][side] as Ring, inner = !alone && hole;
                const rim = vertices.map((v) => at.push([...[0, 1].map((k) => at[v][k] + Math.trunc((at[v][k] - centre[k]) / (inner ? 8 : -8))), at[v][2] + rise]) - 1);
                strip(this.mesh, side ? rim : vertices, side ? vertices : rim);
                this.addRing(chains[inner ? 1 - side : side], rim, side, 0);
                if (alone) chains[1 - side].push(at.push([...centre, at[rim[0]][2]]) - 1);
            }
            chains[1 - side].reverse();
        }
        this.tile(chains[0], chains[1]);
    }

    /** By a bridge, if it is not the first. */
    private addRing(chain: number[], ring: number[], side: number, rise: number): void {
        if (!chain.length) return void chain.push(...ring);
        const at = this.mesh.vertices, n = ring.length, slice = at[ring[0]][2];
        let least: bigint | null = null, i = 0, k = 0;
        chain.forEach((a, c) => {
            const p = at[a], q = at[chain[(c + 1) % chain.length]];
            if (p[2] !== slice || q[2] !== slice) return;
            ring.forEach((b, r) => {
                const d = square(p, at[ring[(r + 1) % n]]) + square(q, at[b]);
                if (least === null || d < least) [least, i, k] = [d, c, r];
            });
        });
        const [a, b, p, q] = [chain[i], chain[(i + 1) % chain.length], ring[k], ring[(k + 1) % n]];
        const middle = (v: number, w: number): number => at.push([...[0, 1].map((x) => Math.trunc((at[v][x] + at[w][x]) / 2)), at[v][2] + rise]) - 1;
        const enter = middle(a, q), leave = middle(b, p);
        for (const [x, y, z] of [[a, b, leave], [a, leave, enter], [enter, leave, p], [enter, p, q]]) this.mesh.triangles.push(side ? [x, z, y] : [x, y, z]);
        chain.splice(i + 1, 0, enter, ...ring.slice(k + 1), ...ring.slice(0, k + 1), leave);
    }

    private nearest(chain: number[], to: number): number {
        const at = this.mesh.vertices, distances = chain.map((v) => square(at[v], at[to]));
        return distances.indexOf(distances.reduce((x, y) => (y < x ? y : x)));
    }

    private start(lower: number[], upper: number[]): number[] {
        const at = this.mesh.vertices, mean = [0, 1].map((k) => Number(upper.reduce((sum, v) => sum + BigInt(at[v][k]), 0n) / BigInt(upper.length)));
        const distances = upper.map((v) => square(at[v], mean));
        let from = 0, to = distances.indexOf(distances.reduce((x, y) => (y > x ? y : x)));
        for (let i = 0; i < 2; i++) {
            from = this.nearest(lower, upper[to]);
            to = this.nearest(upper, lower[from]);
        }
        return [from, to];
    }

    private tile(a: number[], b: number[]): void {
        const [f, g] = this.start(a, b), m = a.length, n = b.length, rows = m > 1 ? m : 0, columns = n > 1 ? n : 0;
        const low = (i: number): number => a[(f + i) % m], high = (k: number): number => b[(g + k) % n];
        const sum: bigint[][] = [], fromBelow: boolean[][] = [];
        for (let i = 0; i <= rows; i++) {
            sum.push([]);
            fromBelow.push([]);
            for (let k = 0; k <= columns; k++) {
                const below = !k || (i > 0 && sum[i - 1][k] <= sum[i][k - 1]), before = !below ? sum[i][k - 1] : i ? sum[i - 1][k] : 0n;
                fromBelow[i].push(below);
                sum[i].push(before + square(this.mesh.vertices[low(i)], this.mesh.vertices[high(k)]));
            }
        }
        for (let i = rows, k = columns; i || k;) {
            if (fromBelow[i][k]) { this.mesh.triangles.push([low(i - 1), low(i), high(k)]); i--; }
            else { this.mesh.triangles.push([low(i), high(k), high(k - 1)]); k--; }
        }
    }
}

function stripMesh(map: RadiusImage, turn: number, apex: number[], rows: number[], q: number): Mesh {
    const n = map.rays / q, vertices: number[][] = [], triangles: number[][] = [];
    const distance = (a: number, b: number): bigint =>
        [0, 1].reduce((sum, k) => sum + BigInt(vertices[a][k] - vertices[b][k]) ** 2n, 0n);
    rows.forEach((row, order) => {
        for (let i = 0; i < map.rays; i += q) {
            const angle = (i * (65536 / map.rays) + turn * row) % 65536, d = direction((angle + 65536) % 65536, 65536);
            vertices.push([...[0, 1].map((k) => map.centres[row][k] * 32768 + Math.trunc((map.radii[row][i] * 1024 * d[k]) / 16384)), row * 65536]);
        }
        for (let k = 0; order && k < n; k++) {
            const next = (k + 1) % n, lower = (order - 1) * n, upper = order * n, [a, b, c, e] = [lower + k, lower + next, upper + next, upper + k];
            if (distance(a, c) <= distance(b, e)) triangles.push([a, b, c], [a, c, e]);
            else triangles.push([a, b, e], [b, c, e]);
        }
    });
    for (const [side, row, first] of [[0, 0, 0], [1, map.last, (rows.length - 1) * n]]) {
        const tip = vertices.length;
        vertices.push([...map.centres[row].map((c) => c * 32768), row * 65536 + (side ? 8192 : -8192) * apex[side]]);
        for (let k = 0; k < n; k++) {
            const a = first + k, b = first + ((k + 1) % n);
            triangles.push(side ? [tip, a, b] : [tip, b, a]);
        }
    }
    return { vertices, triangles };
}

// ---- structures ----

/** What a packet said. Of slices with caps, `rest` is where the shapes begin: code, range, bytes left, bytes missing. */
export type Packet =
    | { kind: 'stars'; shown: number[]; stars: Star[][] }
    | { kind: 'slices'; shown: number[]; finer: number[]; slices: Slice[]; width: number; height: number; rest: number[] | null }
    | { kind: 'radii'; map: SimpleMap | Tubes }
    | { kind: 'raster'; stride: number[]; size: number[]; bits: Uint8Array; rest: number[] | null };

/** What adapts for all structures. */
interface Shared { stars: NumberContext[]; model: OccupancyModel | null; area: number }

class Structure {
    level = -1;
    private readonly plan: Plan;
    private map: SimpleMap | Tubes | null = null;
    private stars: Star[][] | null = null;
    private firstSlices = 1;
    private readonly slices: (Slice | null)[];
    private model: OccupancyModel | null = null;

    constructor(private readonly box: Box, private readonly flags: number, private readonly shared: Shared) {
        this.plan = new Plan(box.size[2], box.levelCount);
        this.slices = [];
    }

    decode(payload: Uint8Array, record: string): Packet {
        const d = new RangeDecoder(payload, record), level = ++this.level;
        if (level === 0 && !(this.flags & EXACT) && d.bit(8192)) {
            const m = new NumberContext(2), number = m.read(d), [width, height] = this.box.size;
            this.map = number >= 5 && number <= 7 ? new Tubes(d, number, this.plan, this.box.size) : new SimpleMap(d, m, 6 + number, this.plan, 64 * (width + height));
        }
        if (this.map) {
            this.map.read(d, level);
            return { kind: 'radii', map: this.map };
        }
        if (level === 0) this.readPlan(d);
        return level < this.firstSlices ? this.readBase(d) : this.readSlices(d, level);
    }

    private readPlan(d: RangeDecoder): void {
        const m = new NumberContext(2, 4);
        this.plan.early = this.plan.early.map(() => {
            const v = m.read(d);
            return v < 0 || v > 12 ? 12 : v;
        });
        if (this.flags & KEEP && d.bit(32768)) this.firstSlices = 0;
    }

    private readBase(d: RangeDecoder): Packet {
        const shown = this.plan.shown(0), contexts = this.flags & SHARED ? this.shared.stars : starContexts();
        this.stars = readStars(d, contexts, shown.length, this.box.size);
        checkStars(d, this.stars, radiusStep(this.plan.stride(0)), this.box.size);
        return { kind: 'stars', shown, stars: this.stars };
    }

    private startModel(): OccupancyModel {
        if (!(this.flags & SHARED)) return freshModel(this.box.size[0] * this.box.size[1], this.flags);
        return (this.shared.model ??= freshModel(this.shared.area, this.flags));
    }

    private readSlices(d: RangeDecoder, level: number): Packet {
        const [width, height] = this.box.size, shown = this.plan.shown(level), coarseness = this.plan.levelCount - 1 - level;
        this.model ??= this.startModel();
        const m = new NumberContext(2), finer = shown.map(() => {
            const v = this.flags & KEEP ? m.read(d) : 0;
            return v < 0 || v > coarseness ? coarseness : v;
        });
        const before = level > this.firstSlices ? this.plan.shown(level - 1) : [];
        const estimated = level === 1 && this.stars ? this.plan.shown(0) : [], model = this.model;
        shown.forEach((w, i) => {
            if (before.includes(w)) return;
            const known = this.known(w, shown[i - 1], before.find((b) => b > w), estimated);
            this.slices[w] = model.code(width, height, known, (p) => d.bit(p));
            d.present();
        });
        const last = coarseness === 0 && this.flags & CAPS;
        return {
            kind: 'slices', shown, finer, width, height, slices: shown.map((w) => this.slices[w] as Slice),
            rest: last ? [d.code, d.range, d.left, d.missing] : null,
        };
    }

    private known(w: number, below: number | undefined, above: number | undefined, estimated: number[]): Known {
        const slice = (at: number | undefined): Slice | null => (at === undefined ? null : (this.slices[at] as Slice));
        const order = estimated.findIndex((b) => b >= w);
        if (order >= 0 && this.stars) {
            const from = estimate(this.stars[order], radiusStep(this.plan.stride(0)), order, this.box.size[0], this.box.size[1]);
            return { below: slice(below), above: from, mode: estimated[order] === w ? 6 : 7 };
        }
        const both = below !== undefined && above !== undefined;
        const mode = both ? modeOfGap(Math.min(w - below, above - w), false) : below === undefined && above === undefined ? 0 : 1;
        return { below: slice(below), above: slice(above), mode };
    }
}

// ---- pyramids ----

class Pyramid {
    level = -1;
    private readonly stride: number[];
    private size: number[] = [];
    private bits = new Uint8Array(0);
    private model: OccupancyModel | null = null;

    constructor(private readonly box: Box, private readonly passes: number[][], private readonly flags: number, private readonly shared: Shared) {
        this.stride = [0, 1, 2].map((axis) => 2 ** passes.flat().filter((a) => a === axis).length);
    }

    private sizeNow(): number[] {
        const [width, height, slices] = this.box.size, [p, q, r] = this.stride;
        return [Math.floor((width - 2 + p) / p) + 1, Math.floor((height - 2 + q) / q) + 1, Math.floor((slices - 1) / r) + 1];
    }

    private startModel(): OccupancyModel {
        if (!(this.flags & SHARED)) return freshModel(this.box.size[0] * this.box.size[1], this.flags);
        return (this.shared.model ??= freshModel(this.shared.area, this.flags));
    }

    /** Halves the stride of an axis: old samples go to even numbers. */
    private spread(axis: number): void {
        const [a, b, c] = this.size, old = this.bits;
        this.stride[axis] /= 2;
        const size = (this.size = this.sizeNow()), to = (this.bits = new Uint8Array(size[0] * size[1] * size[2]));
        for (let k = 0; k < c; k++)
            for (let j = 0; j < b; j++)
                for (let i = 0; i < a; i++) {
                    if (!old[(k * b + j) * a + i]) continue;
                    const at = [i, j, k].map((x, n) => (n === axis ? 2 * x : x));
                    to[(at[2] * size[1] + at[1]) * size[0] + at[0]] = 1;
                }
    }

    /** The planes across an axis: their size, how many, and where a pixel of one is in the raster (-1: margin). */
    private planes(axis: number): { width: number; height: number; count: number; at: (c: number, x: number, y: number) => number } {
        const [a, b, c] = this.size, at = (i: number, j: number, k: number): number => (k < 0 || k >= c ? -1 : (k * b + j) * a + i);
        if (axis === 0) return { width: b, height: c + 2, count: a, at: (n, x, y) => at(n, x, y - 1) };
        if (axis === 1) return { width: a, height: c + 2, count: b, at: (n, x, y) => at(x, n, y - 1) };
        return { width: a, height: b, count: c, at: (n, x, y) => at(x, y, n) };
    }

    decode(d: RangeDecoder, level: number, pass: number): Packet {
        const axis = this.passes[level][pass], first = axis < 0;
        this.model ??= this.startModel();
        if (first) this.bits = new Uint8Array((this.size = this.sizeNow()).reduce((x, y) => x * y));
        else this.spread(axis);
        const { width, height, count, at } = this.planes(axis), model = this.model;
        const plane = (c: number): Slice | null => {
            if (c < 0 || c >= count) return null;
            const out = new Uint8Array(width * height);
            for (let y = 0; y < height; y++) for (let x = 0; x < width; x++) out[y * width + x] = at(c, x, y) < 0 ? 0 : this.bits[at(c, x, y)];
            return out;
        };
        const end = axis === 0 || axis === 1 ? count - 1 : count;
        for (let c = first ? 0 : 1; c < end; c += first ? 1 : 2) {
            const below = plane(c - 1), above = first ? null : plane(c + 1), mode = (below ? 1 : 0) + (above ? 1 : 0);
            model.code(width, height, { below, above, mode }, (p) => d.bit(p)).forEach((bit, n) => {
                if (bit) this.bits[at(c, n % width, Math.floor(n / width))] = 1;
            });
            d.present();
        }
        if (pass + 1 === this.passes[level].length) this.level = level;
        const whole = this.level + 1 === this.passes.length, caps = whole && this.flags & CAPS && !(this.flags & SHARED);
        return {
            kind: 'raster', stride: [...this.stride], size: this.size, bits: this.bits, rest: caps ? [d.code, d.range, d.left, d.missing] : null,
        };
    }
}

// ---- streams ----

/** passesLeft: until the level is whole. */
export interface Step { level: number; structure: number; passesLeft: number; rms: number; max: number; packet: Packet }

/** Takes a stream in any portions; step() gives the next packet's content, or null while that is not all there. */
export class Decoder {
    header: Header | null = null;
    private bytes: Uint8Array = new Uint8Array(0);
    private at = 0;
    private head: LevelHead | null = null;
    private level = 0;
    private next = 0;
    private structures: (Structure | Pyramid)[] = [];
    /** A packet of all structures that is being decoded, and whose turn it is. */
    private open: { d: RangeDecoder; turn: number } | null = null;

    feed(bytes: Uint8Array): void {
        const more = new Uint8Array(this.bytes.length - this.at + bytes.length);
        more.set(this.bytes.subarray(this.at));
        more.set(bytes, this.bytes.length - this.at);
        this.bytes = more;
        this.at = 0;
    }

    step(): Step | null {
        try {
            return this.tryStep();
        } catch (e) {
            if (e instanceof Incomplete) return null;
            throw e;
        }
    }

    private start(header: Header): void {
        const shared: Shared = { stars: starContexts(), model: null, area: Math.max(...header.structures.map((s) => s.size[0] * s.size[1])) };
        this.structures = header.structures.map((box) =>
            header.passes ? new Pyramid(box, header.passes, header.flags, shared) : new Structure(box, header.flags, shared));
        this.header = header;
    }

    private tryStep(): Step | null {
        if (!this.header) {
            const [header, size] = readHeader(this.bytes);
            this.start(header);
            this.at = size;
        }
        const header = this.header as unknown as Header;
        if (!this.head) {
            if (this.at === this.bytes.length) return null;
            if (this.level === header.levelCount) throw new Damaged('stream', 'bytes behind the last level');
            const c = new Cursor(this.bytes, this.at, `level ${this.level}`);
            this.head = readLevelHead(c, header, this.level);
            this.at = c.at;
            this.next = 0;
        }
        const { owners, sizes, level, rms, max } = this.head, { structure: owner, pass } = owners[this.next], record = nameOf(level, owner);
        let payload: Uint8Array | null = null;
        if (!this.open) {
            const c = new Cursor(this.bytes, this.at, record);
            payload = c.block(sizes[this.next]);
            c.checksum(this.at);
            this.at = c.at;
        }
        if (owner < 0) this.open ??= { d: new RangeDecoder(payload as Uint8Array, record), turn: 0 };
        const structure = this.open ? this.open.turn++ : owner, of = this.structures[structure];
        const passesLeft = header.passes ? header.passes[level].length - 1 - pass : 0;
        if (!this.open || this.open.turn === this.structures.length) {
            if (++this.next === owners.length) {
                this.head = null;
                this.level++;
            }
        }
        const packet = of instanceof Structure ? of.decode(payload as Uint8Array, record)
            : of.decode(this.open ? this.open.d : new RangeDecoder(payload as Uint8Array, record), level, pass);
        if (this.open?.turn === this.structures.length) this.open = null;
        return { level, structure, passesLeft, rms, max, packet };
    }
}

// ---- whole files ----

export interface Counts { rays: number; slices: number; vertices: number; triangles: number; draco: bigint }
export interface LevelStats extends Counts { rms: number; max: number; components: number; waiting: number; volume: number }
export interface StructureStats { name: Uint8Array; colour: number[]; label: bigint; levels: LevelStats[] }
export interface Archive { header: Header; stream: Uint8Array; name: Uint8Array; iso: number; levels: Counts[]; structures: StructureStats[] }

const readCounts = (c: Cursor): Counts =>
    ({ rays: c.varint(), slices: c.varint(), vertices: c.varint(), triangles: c.varint(), draco: c.long() });

function checkName(c: Cursor, name: Uint8Array, most: number): void {
    c.must(name.length >= 1 && name.length <= most, 'the length of a name');
    let text = '';
    try {
        text = new TextDecoder('utf-8', { fatal: true, ignoreBOM: true }).decode(name);
    } catch {
        c.must(false, 'a name is not UTF-8');
    }
    c.must(!/[\0-\x1f\x7f]/.test(text), 'a name has control characters');
}

function readStats(c: Cursor, levelCount: number, before: StructureStats | undefined): StructureStats {
    const previous = before?.name ?? new Uint8Array(0), shared = c.varint();
    c.must(shared <= previous.length, 'a name shares too much');
    const rest = c.block(c.varint()), name = new Uint8Array(shared + rest.length);
    name.set(previous.subarray(0, shared));
    name.set(rest, shared);
    checkName(c, name, 95);
    const colour = [...c.block(3)], label = BigInt.asIntN(64, (before?.label ?? 0n) + c.longSigned()), components = c.varint();
    const levels: LevelStats[] = [];
    for (let i = 0; i < levelCount; i++) {
        const counts = readCounts(c), rms = c.f32(), max = c.f32(), waiting = c.varint(), volume = waiting ? c.f32() : 0;
        c.must(Math.abs(rms) <= Math.fround(1e30) && Math.abs(max) <= Math.fround(1e30), 'an error');
        c.must(waiting <= components && volume >= 0 && volume <= 1e30, 'what waits');
        levels.push({ ...counts, rms, max, components: components - waiting, waiting, volume });
    }
    return { name, colour, label, levels };
}

/** Where the records of the stream end: the header, then each level. All packets' checksums are checked. */
function checkStream(stream: Uint8Array): [Header, number[]] {
    const [header, size] = readHeader(stream), ends = [size];
    const c = new Cursor(stream, size, 'stream');
    for (let level = 0; level < header.levelCount; level++) {
        const head = readLevelHead(Object.assign(c, { record: `level ${level}` }), header, level);
        head.sizes.forEach((bytes, i) => {
            const start = c.at;
            Object.assign(c, { record: nameOf(level, head.owners[i].structure) });
            c.block(bytes);
            c.checksum(start);
        });
        ends.push(c.at);
    }
    c.must(c.left === 0, 'bytes behind the last level');
    return [header, ends];
}

function readFooter(footer: Uint8Array, header: Header, ends: number[]): Omit<Archive, 'header' | 'stream'> {
    const whole = new Cursor(footer, 0, 'footer');
    const body = whole.block(footer.length - 4);
    whole.checksum(0);
    const c = new Cursor(body, 0, 'footer');
    c.must(c.u8() === 0x46, 'the tag');
    const name = c.block(c.varint());
    checkName(c, name, 255);
    const iso = c.f64();
    c.must(c.long() === BigInt(ends[0]) && c.varint() === header.levelCount, 'it belongs to another model');
    const levels: Counts[] = [];
    for (let i = 0; i < header.levelCount; i++) {
        c.must(c.long() === BigInt(ends[i + 1] - ends[i]), 'the size of a level');
        levels.push(readCounts(c));
    }
    c.must(header.structures.reduce((sum, s) => sum + s.levelCount, 0) * 14 <= c.left, 'it is too short');
    const structures: StructureStats[] = [];
    for (const box of header.structures) structures.push(readStats(c, box.levelCount, structures[structures.length - 1]));
    c.must(c.left === 0, 'bytes left over');
    c.must(new Set(structures.map((s) => s.name.join())).size === structures.length, 'two structures have one name');
    return { name, iso, levels, structures };
}

/** Checks a whole file: every checksum, every count; throws Damaged. */
export function readArchive(bytes: Uint8Array): Archive {
    try {
        const c = new Cursor(bytes, Math.max(bytes.length - 16, 0), 'trailer');
        const offset = c.u64(), size = c.u32();
        c.must([0x4c, 0x54, 0x48, 0x5a].every((byte) => c.u8() === byte), 'its end');
        c.must(offset + BigInt(size) + 16n === BigInt(bytes.length) && size >= 4, 'the place of the footer');
        const stream = bytes.subarray(0, Number(offset)), [header, ends] = checkStream(stream);
        return { header, stream, ...readFooter(bytes.subarray(stream.length, stream.length + size), header, ends) };
    } catch (e) {
        throw e instanceof Incomplete ? new Damaged(e.message || 'file', 'it is truncated') : e;
    }
}
