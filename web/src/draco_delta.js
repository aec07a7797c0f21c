// Applies Lathe's Draco deltas (docs/DRACO_DELTAS.md) with a stock Draco decoder: level n out of level n - 1.
// Needs nothing but the module of the npm package draco3d (or three.js' copy of it).

const ONE = 8, NONE = -1, UNKNOWN = -0x80000000, OLD = -0x80000000, SKIPS = 4;
const START = 0, NUMBERS = 1, RANK = 2, PAIR = 194, MOST_VALUES = 64, MOST = 16;

/** What a client keeps. Vertices are only added: one that a level keeps has its number and place for good. */
export const newModel = () => ({
    at: [], // u, v, w of each vertex, eighths of a voxel edge
    next: [], // of each vertex: the next one along its outline, or -1
    parts: new Map(), // structure -> { heights, triangles, slices: Map(height -> outline vertices, ascending) }
    affine: null, // 12 numbers: u, v, w -> millimetres
    levels: 0,
});

/** u, v, w of all vertices in world millimetres. */
export function positionsOf({ at, affine: m }) {
    const out = new Float32Array(at.length);
    for (let i = 0; i < at.length; i += 3)
        for (let k = 0; k < 3; k++) out[i + k] = m[4 * k] * at[i] + m[4 * k + 1] * at[i + 1] + m[4 * k + 2] * at[i + 2] + m[4 * k + 3];
    return out;
}

/** The stock decoder's part: triangles, two whole numbers for each vertex, and the metadata. */
export function unpack(draco, bytes) {
    const decoder = new draco.Decoder(), mesh = new draco.Mesh(), querier = new draco.MetadataQuerier();
    const status = decoder.DecodeArrayToMesh(new Int8Array(bytes), bytes.byteLength, mesh);
    if (!status.ok()) throw Error(`Draco: ${status.error_msg()}`);
    const copy = (size, fill) => {
        const at = draco._malloc(size);
        fill(size, at);
        const bytes = draco.HEAPU8.slice(at, at + size).buffer;
        draco._free(at);
        return bytes;
    };
    const values = (type) => {
        const attribute = decoder.GetAttribute(mesh, decoder.GetAttributeId(mesh, type));
        return new Int32Array(copy(mesh.num_points() * 4, (size, at) => decoder.GetAttributeDataArrayForAllPoints(mesh, attribute, draco.DT_INT32, size, at)));
    };
    const words = (name) => {
        const list = new draco.DracoInt32Array();
        querier.GetIntEntryArray(decoder.GetMetadata(mesh), name, list);
        return Int32Array.from({ length: list.size() }, (_, i) => list.GetValue(i));
    };
    const triangles = new Uint32Array(copy(mesh.num_faces() * 12, (size, at) => decoder.GetTrianglesUInt32Array(mesh, size, at)));
    const result = { triangles, slice: values(draco.POSITION), place: values(draco.GENERIC),
        numbers: new Uint8Array(words('lathe').buffer), affine: new Float64Array(words('affine').buffer) };
    for (const object of [mesh, decoder, querier]) draco.destroy(object);
    return result;
}

/** Values ranked by how often a context has seen them. */
class Ranks {
    contexts = new Map(); // key -> list of { value, count }, most seen first
    get(keys, rank, more = []) {
        const lists = keys.map((key) => this.contexts.get(key) ?? []);
        const isKnown = (value, until) => {
            for (let k = 0; k < until; k++) for (const seen of lists[k]) if (seen.value === value) return true;
            return false;
        };
        for (let k = 0; k < lists.length; k++) for (const { value } of lists[k]) if (!isKnown(value, k) && !rank--) return value;
        for (const value of more) if (!isKnown(value, lists.length) && !rank--) return value;
        throw Error('no such rank');
    }
    seen(keys, value) {
        for (const key of keys) {
            let list = this.contexts.get(key), i = 0;
            if (!list) this.contexts.set(key, (list = []));
            while (i < list.length && list[i].value !== value) i++;
            if (i === list.length) list[(i = Math.min(i, MOST_VALUES - 1))] = { value, count: 0 };
            const own = list[i];
            for (own.count++; i && list[i - 1].count < own.count; i--) list[i] = list[i - 1];
            list[i] = own;
        }
    }
}

/** Moves a model to its next level. No bytes: the level changes nothing. Returns the structures that changed. */
export function applyDelta(draco, model, bytes) {
    model.levels++;
    if (!bytes.byteLength) return [];
    const { triangles, slice, place, numbers, affine } = unpack(draco, bytes), count = slice.length, { at, next } = model;
    if (affine.length) model.affine = affine;

    let read = 0;
    const number = () => {
        for (let v = 0, scale = 1; read < numbers.length; scale *= 128) {
            const byte = numbers[read++];
            v += (byte & 127) * scale;
            if (byte < 128) return v;
        }
        throw Error('the numbers are at their end');
    };
    const signed = () => { const v = number(); return v % 2 ? -(v + 1) / 2 : v / 2; };

    // Corners of each vertex, and across each edge the one the other way. Corner 3 t + k: the edge from there to the next corner.
    const after = (i) => i - (i % 3) + ((i + 1) % 3), corners = Array.from({ length: count }, () => []);
    triangles.forEach((v, i) => corners[v].push(i));
    const across = (i) => {
        for (const j of corners[triangles[after(i)]]) if (triangles[after(j)] === triangles[i]) return j;
        throw Error('the mesh is not closed');
    };

    // ---- in which slice each vertex lies: 2 i in shown slice i of its structure, odd between two
    const half = new Int32Array(count).fill(UNKNOWN), part = new Int32Array(count), changed = new Set();
    const follow = new Int32Array(count).fill(NONE), precede = new Int32Array(count).fill(NONE), slices = new Ranks();
    const flat = (a, b) => half[a] === half[b] && !(half[a] & 1);
    const open = (v, base, low, high) => (half[v] & 1 ? 0 : (half[v] === base ? low : high)[v] === NONE ? 1 : 2);
    const readHeights = (p) => {
        const head = number(), heights = head & 1 ? [...p.heights] : [];
        for (let run = head >> 1, w = 0; run; run--) {
            w += signed();
            for (let step = number(), length = number(); length; length--, w += step) heights.push(w);
        }
        p.heights = [...new Set(heights)].sort((a, b) => a - b);
    };
    const seen = new Uint8Array(triangles.length / 3);
    for (let seed = 0, structure = 0; seed < seen.length; seed++) {
        if (seen[seed]) continue;
        structure += signed();
        if (!model.parts.has(structure)) model.parts.set(structure, { heights: [], triangles: [], slices: new Map() });
        if (!changed.has(structure)) readHeights(model.parts.get(structure));
        changed.add(structure);
        const first = signed() * 2, queue = [];
        for (const v of triangles.subarray(3 * seed, 3 * seed + 3)) { half[v] = first + number(); part[v] = structure; }
        for (let t = seed, head = 0; t !== undefined;) {
            seen[t] = 1;
            for (let i = 3 * t; i < 3 * t + 3; i++) { // an edge within a slice is a piece of an outline
                let a = triangles[i], b = triangles[after(i)];
                queue.push(i);
                if (!flat(a, b)) continue;
                if (half[triangles[after(after(i))]] < half[a]) [a, b] = [b, a];
                follow[a] = b;
                precede[b] = a;
            }
            while (head < queue.length && seen[Math.floor(across(queue[head]) / 3)]) head++;
            if (head === queue.length) break;
            const i = queue[head++], a = triangles[i], b = triangles[after(i)], y = triangles[after(after(i))], j = across(i);
            const x = triangles[after(after(j))], low = Math.min(half[a], half[b], half[y]);
            if (half[x] === UNKNOWN) {
                const base = flat(a, b) ? half[a] - (half[y] > half[a] ? 2 : 0) : low - (low & 1);
                const key = [half[a] - base, half[b] - base, flat(a, b) ? 3 : half[y] - base, open(a, base, follow, precede),
                    open(b, base, precede, follow), Math.min(corners[x].length, 12)].reduce((all, v) => all * 16 + v);
                const value = slices.get([key], slice[x], [0, 1, 2]);
                slices.seen([key], value);
                half[x] = base + value;
                part[x] = part[a];
            }
            t = Math.floor(j / 3);
        }
    }

    // ---- where vertices in slices lie: outline by outline
    const id = new Int32Array(count).fill(NONE), old = at.length / 3, places = new Ranks();
    const add = (x, u, v, w) => { id[x] = at.length / 3; at.push(u, v, w); next.push(NONE); };
    const neighbours = (x) => corners[x].slice(0, MOST).map((i) => triangles[after(i)]);
    const mean = (x, otherwise) => {
        const known = neighbours(x).map((y) => id[y]).filter((y) => y !== NONE), sum = [0, 0];
        for (const y of known) for (let k = 0; k < 2; k++) sum[k] += at[3 * y + k];
        return known.length ? sum.map((s) => Math.trunc(s / known.length)) : otherwise;
    };
    const waiting = (d) => { const most = Math.max(...d.map(Math.abs)); return most > 24 ? d.map((v) => 100 + Math.trunc((v * 4) / most)) : d; };
    const skip = (from, skipped) => { for (; skipped >= 0 && from !== NONE; skipped--) from = next[from]; return from; };
    const unzigzag = (v) => (v & 1 ? -(v + 1) / 2 : v / 2);
    const unpair = (pair) => {
        const side = Math.floor(Math.sqrt(pair)), rest = pair - side * side;
        return (rest < side ? [rest, side] : [side, rest - side]).map(unzigzag);
    };
    let begin = [0, 0];
    for (let from = 0; from < count; from++) {
        if (half[from] & 1 || id[from] !== NONE) continue;
        let start = from;
        while (place[start] !== START) if ((start = follow[start]) === from) throw Error('an outline has no start');
        const p = model.parts.get(part[start]), w = p.heights[half[start] / 2] * ONE, olds = p.slices.get(w) ?? [];
        let latest = NONE, here = [0, 0], step = [0, 0];
        const takeOld = (x, v) => { id[x] = latest = v; return [at[3 * v], at[3 * v + 1]]; };
        const byNumbers = (x, [u, v]) => {
            const rank = number();
            if (!rank) return [u + signed(), v + signed()];
            const far = (o) => (at[3 * o] - u) ** 2 + (at[3 * o + 1] - v) ** 2;
            return takeOld(x, [...olds].sort((a, b) => far(a) - far(b) || a - b)[rank - 1]);
        };
        let x = start;
        do {
            const expected = [here[0] + step[0], here[1] + step[1]], symbol = place[x], before = latest;
            const wait = latest === NONE || next[latest] === NONE ? [99, 99] : waiting([0, 1].map((k) => at[3 * next[latest] + k] - here[k]));
            const last = (step[0] & 0xffff) * 65536 + (step[1] & 0xffff), keys = [last * 65536 + (wait[0] & 255) * 256 + (wait[1] & 255), -1 - last, NaN];
            let there, value;
            if (x === start) there = byNumbers(x, mean(x, begin));
            else if (symbol >= PAIR) there = unpair(symbol - PAIR).map((d, k) => expected[k] + d);
            else if (symbol >= RANK) {
                value = places.get(keys, symbol - RANK);
                there = value < OLD + SKIPS ? takeOld(x, skip(latest, value - OLD)) : [here[0] + (value >> 16), here[1] + ((value << 16) >> 16)];
            } else there = byNumbers(x, expected);
            step = there.map((v, k) => v - here[k]);
            here = there;
            if (id[x] === NONE) add(x, ...here, w);
            if (x === start) { begin = here; step = [0, 0]; }
            else {
                if (value === undefined && id[x] >= old && step.every((v) => Math.abs(v) < 32767)) value = (step[0] << 16) | (step[1] & 0xffff);
                for (let k = 0; value === undefined && before !== NONE && k < SKIPS; k++) if (skip(before, k) === id[x]) value = OLD + k;
                if (value !== undefined) places.seen(keys, value);
            }
        } while ((x = follow[x]) !== start);
    }

    // ---- and those between: crossings of two outlines, or middles of diagonals
    const between = new Ranks();
    for (let x = 0; x < count; x++) {
        if (!(half[x] & 1)) continue;
        const { heights } = model.parts.get(part[x]), last = heights.length - 1, below = (half[x] - 1) / 2;
        const height = (i) => (i < 0 ? heights[0] - 1 : i > last ? heights[last] + 1 : heights[i]);
        const middle = (height(below) + height(below + 1)) * (ONE / 2), candidates = [];
        const near = corners[x].map((i) => triangles[after(i)]).filter((y) => !(half[y] & 1)).slice(0, MOST);
        const [lower, upper] = [near.filter((y) => half[y] < half[x]), near.filter((y) => half[y] > half[x])];
        const xy = (y) => [at[3 * id[y]], at[3 * id[y] + 1]];
        const put = (u, v, length) => {
            let i = candidates.length;
            if (i === MOST) return;
            while (i && candidates[i - 1].length > length) i--;
            candidates.splice(i, 0, { u, v, length });
        };
        for (const a of lower) for (const b of lower) if (follow[a] === b) for (const c of upper) for (const d of upper) if (follow[c] === d) {
            const [p, q, r, s] = [a, b, c, d].map(xy), [du, dv] = [q[0] - p[0], q[1] - p[1]], [eu, ev] = [s[0] - r[0], s[1] - r[1]];
            const turn = du * ev - dv * eu, t = Math.min(Math.max(((r[0] - p[0]) * ev - (r[1] - p[1]) * eu) / turn, 0.0625), 0.9375);
            if (turn) put(Math.floor(p[0] + du * t + 0.5), Math.floor(p[1] + dv * t + 0.5), -1);
        }
        near.forEach((a, i) => near.slice(i + 1).forEach((b) => {
            if (half[a] !== half[b] || follow[a] === b || follow[b] === a) return;
            const [p, q] = [xy(a), xy(b)];
            put((p[0] + q[0]) >> 1, (p[1] + q[1]) >> 1, (p[0] - q[0]) ** 2 + (p[1] - q[1]) ** 2);
        }));
        const key = [(Math.min(corners[x].length, 15) * 32 + lower.length) * 32 + upper.length];
        let value;
        if (place[x] >= RANK) value = between.get(key, place[x] - RANK);
        else {
            const choice = number();
            if (choice) {
                const rise = signed();
                if (Math.abs(rise) <= 511) value = (choice - 1) * 1024 + rise + 512;
                else add(x, candidates[choice - 1].u, candidates[choice - 1].v, middle + rise);
            } else {
                const [u, v] = mean(x, begin);
                add(x, u + signed(), v + signed(), middle + signed());
            }
        }
        if (value === undefined) continue;
        add(x, candidates[value >> 10].u, candidates[value >> 10].v, middle + (value & 1023) - 512);
        between.seen(key, value);
    }

    // ---- the sum that the writer had
    let sum = 2166136261;
    for (let i = 3 * old; i < at.length; i++) sum = Math.imul(sum ^ at[i], 16777619);
    for (const v of triangles) sum = Math.imul(sum ^ id[v], 16777619);
    if (sum >>> 0 !== number()) throw Error('the delta does not fit: its check sum is another');

    for (const structure of changed) Object.assign(model.parts.get(structure), { triangles: [], slices: new Map() });
    for (let x = 0; x < count; x++) {
        if (half[x] & 1) continue;
        const { slices: list } = model.parts.get(part[x]), w = at[3 * id[x] + 2];
        next[id[x]] = id[follow[x]];
        if (!list.has(w)) list.set(w, []);
        list.get(w).push(id[x]);
    }
    for (let i = 0; i < triangles.length; i++) model.parts.get(part[triangles[i]]).triangles.push(id[triangles[i]]);
    return [...changed];
}
