// Applies Lathe's Draco deltas (docs/DRACO_DELTAS.md) with a stock Draco decoder: level n out of level n - 1.
// Needs nothing but the module of the npm package draco3d (or three.js' copy of it).

const ONE = 8, HEIGHT = 4, NONE = -1, UNKNOWN = -0x80000000, OLD = -0x80000000, SKIPS = 4, MOVES = 128, RINGS = 12;
const START = 0, NUMBERS = 1, RANK = 2, PAIR = 194, REST = 8, NUMBERS_KEY = 'numbers', MOST_VALUES = 64, MOST = 16;

/** What a client keeps. A vertex that a level keeps has its number for good; it may move a little. */
export const newModel = () => ({
    at: [], // u, v, w of each vertex, eighths of a voxel edge
    next: [], // of each vertex: the next one along its outline, or -1
    parts: new Map(), // structure -> { heights, grain, rings, triangles, slices: Map(height -> outline vertices, ascending) }
    affine: null, // 12 numbers: u, v, w -> millimetres
    ranks: { slices: new Ranks(), places: new Ranks(), middles: new Ranks() }, // what the deltas have seen
    spare: [], // numbers that no vertex has
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
    age() { for (const list of this.contexts.values()) for (const seen of list) seen.count = Math.floor(seen.count / 64); }
}

const zigzag = (v) => (v < 0 ? -2 * v - 1 : 2 * v);
const unzigzag = (v) => (v & 1 ? -(v + 1) / 2 : v / 2);
const limited = (radius) => Math.min(Math.max(radius, 0), 2 ** 19 - 1);

/** 2^14 times cosine and sine of 65536ths of a full turn, as Lathe has them. */
const directions = new Map();
function direction(angle) {
    if (directions.has(angle)) return directions.get(angle);
    const within = angle % 16384, times = (a, b) => Number((BigInt(a) * BigInt(b)) >> 30n), t = (within <= 8192 ? within : 16384 - within) * 131072;
    const q = times(t, t);
    let x = (2 ** 30 - times(q, 331168970 - times(q, 17023473 - times(q, 350031 - times(q, 3856)))) + 32768) >> 16;
    let y = (times(t, 843314857 - times(q, 86699834 - times(q, 2674041 - times(q, 39273 - times(q, 336))))) + 32768) >> 16;
    if (within > 8192) [x, y] = [y, x];
    for (let quadrant = Math.floor(angle / 16384); quadrant; quadrant--) [x, y] = [-y, x];
    directions.set(angle, [x, y]);
    return [x, y];
}

/** Moves a model to its next level. No bytes: the level changes nothing. Returns the structures that changed. */
export function applyDelta(draco, model, bytes) {
    model.levels++;
    if (!bytes.byteLength) return [];
    const { triangles, slice, place, numbers, affine } = unpack(draco, bytes), count = slice.length, { at, next } = model;
    if (affine.length) model.affine = affine;
    for (const ranks of Object.values(model.ranks)) ranks.age();

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
    const follow = new Int32Array(count).fill(NONE), precede = new Int32Array(count).fill(NONE), { slices, places, middles } = model.ranks;
    const flat = (a, b) => half[a] === half[b] && !(half[a] & 1);
    const open = (v, base, low, high) => (half[v] & 1 ? 0 : (half[v] === base ? low : high)[v] === NONE ? 1 : 2);
    const readHeights = (p) => {
        const head = number(), heights = head & 1 ? [...p.heights] : [], form = head & 2 ? number() : Math.log2(p.grain) + (p.samples ? RINGS + 1 : 0);
        p.form = null;
        if (form === RINGS) {
            const forms = Array.from({ length: number() }, number);
            p.form = { tubes: forms.map((v) => ({ rays: 2 ** (v >> 1), clockwise: v & 1 })), turn: signed(), step: number() };
        } else [p.grain, p.samples, p.rings] = [2 ** (form > RINGS ? form - RINGS - 1 : form), form > RINGS, null];
        for (let run = head >> 2, w = 0; run; run--) {
            w += signed();
            for (let step = number(), length = number(); length; length--, w += step) heights.push(w);
        }
        p.heights = [...new Set(heights)].sort((a, b) => a - b);
    };
    const seen = new Uint8Array(triangles.length / 3);
    for (let seed = 0, structure = 0; seed < seen.length; seed++) {
        if (seen[seed]) continue;
        structure += signed();
        if (!model.parts.has(structure)) model.parts.set(structure, { heights: [], grain: 1, rings: null, triangles: [], slices: new Map() });
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

    // ---- new vertices take numbers that none has, and those of vertices between slices of the structures that change, from the lowest on
    const id = new Int32Array(count).fill(NONE), gone = new Set(model.spare);
    for (const structure of changed) for (const v of model.parts.get(structure).triangles) gone.add(v);
    for (const structure of changed) for (const list of model.parts.get(structure).slices.values()) for (const v of list) gone.delete(v);
    const free = [...gone].sort((a, b) => b - a);
    const add = (x, ...place) => {
        id[x] = free.length ? free.pop() : at.length / 3;
        place.forEach((c, k) => { at[3 * id[x] + k] = c; });
        next[id[x]] = NONE;
    };

    // ---- where vertices in slices of radius maps lie: on rays from a centre, tube by tube. A tube: rows of { w, centre, radii, ids }
    let zeros = -1;
    const quiet = () => { // numbers that mostly are 0
        if (zeros < 0) zeros = number();
        return zeros-- ? 0 : signed();
    };
    for (const structure of changed) {
        const p = model.parts.get(structure), tubes = [];
        for (const [t, { rays, clockwise }] of (p.form?.tubes ?? []).entries()) {
            const mask = rays - 1, before = new Map((p.rings?.[t] ?? []).map((row) => [row.w, row])), rows = [];
            for (let x = 0; x < count; x++) {
                if (part[x] !== structure || half[x] & 1 || place[x] !== t) continue;
                const row = { w: p.heights[half[x] / 2], vertices: [] };
                for (let r = 0, y = x; r < rays; r++, y = (clockwise ? precede : follow)[y]) row.vertices.push(y);
                rows.push(row);
            }
            rows.sort((a, b) => a.w - b.w);
            let few = 1;
            for (const row of rows) {
                const old = before.get(row.w), q = old && rays / old.ids.length;
                row.isOld = q >= 1;
                Object.assign(row, { centre: row.isOld ? old.centre : [0, 0], radii: [], ids: [] });
                if (!row.isOld) continue;
                few = q;
                old.ids.forEach((v, r) => { row.radii[r * q] = old.radii[r]; row.ids[r * q] = v; });
            }
            const olds = rows.filter((row) => row.isOld), q = olds.length ? few : Math.max(rays / 8, 1);
            const takeRadius = (row, r, predicted) => {
                const x = row.vertices[r];
                row.radii[r] = predicted + (r ? unzigzag(place[x] - REST) : quiet()) * p.form.step;
                const d = direction((r * (65536 / rays) + p.form.turn * ((row.w - rows[0].w) >> 1)) & 65535);
                const [u, v] = d.map((c, k) => Math.floor((row.centre[k] * 32768 + Math.trunc((row.radii[r] * 1024 * c) / 16384) + 4096) / 8192));
                if (row.ids[r] === undefined) {
                    add(x, u, v, row.w * HEIGHT);
                    row.ids[r] = id[x];
                } else {
                    id[x] = row.ids[r];
                    [at[3 * id[x]], at[3 * id[x] + 1]] = [u, v];
                }
            };
            const takeCentre = (row, predicted) => { row.centre = predicted.map((c) => c + quiet()); };
            for (const row of olds) {
                takeCentre(row, row.centre);
                for (let r = 0; r < rays; r += q) takeRadius(row, r, row.radii[r]);
            }
            for (const [i, row] of rows.entries()) {
                if (row.isOld) continue;
                const { radii, w } = row, b = rows[i - 1]?.radii;
                if (!olds.length) {
                    takeCentre(row, i ? rows[i - 1].centre : [0, 0]);
                    for (let r = 0; r < rays; r += q)
                        takeRadius(row, r, !r ? (b ? b[0] : 0) : b ? Math.trunc((radii[r - q] + 2 * b[r] - b[r - q]) / 2) : radii[r - q]);
                    continue;
                }
                const below = olds.filter((o) => o.w < w).slice(-2), above = olds.filter((o) => o.w > w).slice(0, 2), around = [...below, ...above];
                const low = below.at(-1) ?? above[0], high = above[0] ?? below.at(-1), part = low === high ? 0 : (w - low.w) / (high.w - low.w);
                const weights = around.map((o) => around.reduce((all, other) => (other === o ? all : all * ((w - other.w) / (o.w - other.w))), 1));
                takeCentre(row, low.centre.map((c, k) => Math.floor(c + (high.centre[k] - c) * part + 0.5)));
                for (let r = 0; r < rays; r += q) {
                    const cubic = around.reduce((sum, o, k) => sum + weights[k] * o.radii[r], 0);
                    const round = Math.sqrt(low.radii[r] * low.radii[r] * (1 - part) + high.radii[r] * high.radii[r] * part);
                    takeRadius(row, r, limited(Math.floor((around.length === 4 ? cubic : round) + 0.5)));
                }
            }
            const cubic = (a, r, s) => (9 * (a[r - s] + a[(r + s) & mask]) - a[(r - 3 * s) & mask] - a[(r + 3 * s) & mask] + 8) >> 4;
            for (let s = q / 2; s >= 1; s /= 2)
                for (const [i, row] of rows.entries())
                    for (let r = s, b = rows[i - 1]?.radii; r < rays; r += 2 * s)
                        takeRadius(row, r, limited(cubic(row.radii, r, s) + (b ? Math.trunc((b[r] - cubic(b, r, s)) / 2) : 0)));
            tubes.push(rows.map(({ w, centre, radii, ids }) => ({ w, centre, radii, ids })));
        }
        p.rings = p.form ? tubes : null;
    }

    // ---- where those of other structures lie: outline by outline
    const neighbours = (x) => corners[x].slice(0, MOST).map((i) => triangles[after(i)]);
    const mean = (x, otherwise) => {
        const known = neighbours(x).map((y) => id[y]).filter((y) => y !== NONE), sum = [0, 0];
        for (const y of known) for (let k = 0; k < 2; k++) sum[k] += at[3 * y + k];
        return known.length ? sum.map((s) => Math.trunc(s / known.length)) : otherwise;
    };
    const waiting = (d) => { const most = Math.max(...d.map(Math.abs)); return most > 24 ? d.map((v) => 100 + Math.trunc((v * 4) / most)) : d; };
    const skip = (from, skipped) => { for (; skipped >= 0 && from !== NONE; skipped--) from = next[from]; return from; };
    const unpair = (pair) => {
        const side = Math.floor(Math.sqrt(pair)), rest = pair - side * side;
        return (rest < side ? [rest, side] : [side, rest - side]).map(unzigzag);
    };
    let begin = [0, 0];
    for (let from = 0; from < count; from++) {
        if (half[from] & 1 || id[from] !== NONE) continue;
        let start = from;
        while (place[start] !== START) if ((start = follow[start]) === from) throw Error('an outline has no start');
        const p = model.parts.get(part[start]), { grain } = p, w = p.heights[half[start] / 2] * HEIGHT, olds = p.slices.get(w) ?? [];
        let latest = NONE, here = [0, 0], step = [0, 0];
        const inGrains = (d) => d.map((v) => Math.trunc(v / grain));
        const takeOld = (x, v, move) => {
            id[x] = latest = v;
            move.forEach((d, k) => { at[3 * v + k] += d * grain; });
            return [at[3 * v], at[3 * v + 1]];
        };
        let moved; // an old one by numbers
        const byNumbers = (x, [u, v]) => {
            const form = number(), far = (o) => (at[3 * o] - u) ** 2 + (at[3 * o + 1] - v) ** 2;
            if (!form) return [u + signed() * grain, v + signed() * grain];
            if (form >= 2 + MOST_VALUES) return unpair(form - 2 - MOST_VALUES).map((d, k) => [u, v][k] + d * grain);
            let rank, value;
            if (form === 1) {
                rank = number();
                moved = [signed(), signed()];
                const [mu, mv] = moved.map(zigzag);
                if (rank < 64 && mu < MOVES && mv < MOVES) value = rank + 64 * (mu + MOVES * mv);
            } else {
                value = places.get([NUMBERS_KEY], form - 2);
                rank = value % 64;
                moved = [(value >> 6) % MOVES, value >> 13].map(unzigzag);
            }
            if (value !== undefined) places.seen([NUMBERS_KEY], value);
            return takeOld(x, [...olds].sort((a, b) => far(a) - far(b) || a - b)[rank], moved);
        };
        let x = start;
        do {
            const expected = [here[0] + step[0] * grain, here[1] + step[1] * grain], symbol = place[x], before = latest;
            const wait = latest === NONE || next[latest] === NONE ? [99, 99] : waiting(inGrains([0, 1].map((k) => at[3 * next[latest] + k] - here[k])));
            const last = (step[0] & 0xffff) * 65536 + (step[1] & 0xffff), keys = [last * 65536 + (wait[0] & 255) * 256 + (wait[1] & 255), -1 - last, NaN];
            let there, value;
            moved = undefined;
            if (x === start) there = byNumbers(x, mean(x, begin));
            else if (symbol >= PAIR) there = unpair(symbol - PAIR).map((d, k) => expected[k] + d * grain);
            else if (symbol >= RANK) {
                value = places.get(keys, symbol - RANK);
                const move = Math.floor((value - OLD) / SKIPS);
                there = move < MOVES * MOVES ? takeOld(x, skip(latest, (value - OLD) % SKIPS), [move % MOVES, move >> 7].map(unzigzag))
                    : [here[0] + (value >> 16) * grain, here[1] + ((value << 16) >> 16) * grain];
            } else there = byNumbers(x, expected);
            step = inGrains(there.map((v, k) => v - here[k]));
            here = there;
            if (id[x] === NONE) add(x, ...here, w);
            if (x === start) { begin = here; step = [0, 0]; }
            else {
                if (value === undefined && id[x] !== latest && step.every((v) => Math.abs(v) < 32767)) value = (step[0] << 16) | (step[1] & 0xffff);
                for (let k = 0; value === undefined && moved && before !== NONE && k < SKIPS; k++) {
                    const [mu, mv] = moved.map(zigzag);
                    if (skip(before, k) === id[x] && mu < MOVES && mv < MOVES) value = OLD + k + SKIPS * (mu + MOVES * mv);
                }
                if (value !== undefined) places.seen(keys, value);
            }
        } while ((x = follow[x]) !== start);
    }

    // ---- and those between: over samples, on lines of neighbours; or crossings of two outlines, or middles of diagonals
    const overSamples = (x) => {
        const lines = [new Map(), new Map()];
        const put = (...point) => lines.forEach((line, k) => line.set(point[k], (line.get(point[k]) ?? 0) + 1));
        const [u, v] = [(y) => at[3 * id[y]], (y) => at[3 * id[y] + 1]];
        for (const i of corners[x].slice(0, MOST)) {
            const y = triangles[after(i)], z = triangles[after(after(i))];
            if (id[y] === NONE) continue;
            put(u(y), v(y));
            const far = triangles[after(after(across(after(i))))];
            if (half[y] & half[z] & half[far] & 1 && id[z] !== NONE && id[far] !== NONE) put(u(y) + u(z) - u(far), v(y) + v(z) - v(far)); // the fourth corner of a parallelogram
        }
        return [...lines[0]].flatMap(([u, a]) => [...lines[1]].map(([v, b]) => ({ u, v, length: -a - b })))
            .sort((a, b) => a.length - b.length).slice(0, MOST);
    };
    for (let x = 0; x < count; x++) {
        if (!(half[x] & 1)) continue;
        const p = model.parts.get(part[x]), { heights, grain } = p, last = heights.length - 1, below = (half[x] - 1) / 2;
        const height = (i) => (i < 0 ? heights[0] - 2 : i > last ? heights[last] + 2 : heights[i]);
        const middle = (height(below) + height(below + 1)) * (HEIGHT / 2), candidates = p.samples ? overSamples(x) : [];
        const near = corners[x].map((i) => triangles[after(i)]).filter((y) => !(half[y] & 1)).slice(0, MOST);
        const [lower, upper] = [near.filter((y) => half[y] < half[x]), near.filter((y) => half[y] > half[x])];
        const xy = (y) => [at[3 * id[y]], at[3 * id[y] + 1]];
        const put = (u, v, length) => {
            let i = candidates.length;
            if (i === MOST) return;
            while (i && candidates[i - 1].length > length) i--;
            candidates.splice(i, 0, { u, v, length });
        };
        if (!p.samples) for (const a of lower) for (const b of lower) if (follow[a] === b) for (const c of upper) for (const d of upper) if (follow[c] === d) {
            const [p, q, r, s] = [a, b, c, d].map(xy), [du, dv] = [q[0] - p[0], q[1] - p[1]], [eu, ev] = [s[0] - r[0], s[1] - r[1]];
            const turn = du * ev - dv * eu, t = turn ? Math.min(Math.max(((r[0] - p[0]) * ev - (r[1] - p[1]) * eu) / turn, 0.0625), 0.9375) : 0.5;
            put(Math.floor(p[0] + du * t + 0.5), Math.floor(p[1] + dv * t + 0.5), -1);
        }
        if (!p.samples) near.forEach((a, i) => near.slice(i + 1).forEach((b) => {
            if (half[a] !== half[b] || follow[a] === b || follow[b] === a) return;
            const [p, q] = [xy(a), xy(b)];
            put((p[0] + q[0]) >> 1, (p[1] + q[1]) >> 1, (p[0] - q[0]) ** 2 + (p[1] - q[1]) ** 2);
        }));
        const key = [(Math.min(corners[x].length, 15) * 32 + lower.length) * 32 + upper.length];
        let value;
        if (place[x] >= RANK) value = middles.get(key, place[x] - RANK);
        else {
            const choice = number();
            if (choice) {
                const rise = signed();
                if (Math.abs(rise) <= 511) value = (choice - 1) * 1024 + rise + 512;
                else add(x, candidates[choice - 1].u, candidates[choice - 1].v, middle + rise * grain);
            } else {
                const ring = p.rings?.length === 1 && p.rings[0].at(below < 0 ? 0 : -1);
                const [u, v] = ring ? ring.centre.map((c) => c * (ONE / 2)) : mean(x, begin);
                add(x, u + signed() * grain, v + signed() * grain, middle + signed() * grain);
            }
        }
        if (value === undefined) continue;
        add(x, candidates[value >> 10].u, candidates[value >> 10].v, middle + ((value & 1023) - 512) * grain);
        middles.seen(key, value);
    }

    // ---- the sum that the writer had
    let sum = 2166136261;
    for (const v of id) for (let k = 0; k < 3; k++) sum = Math.imul(sum ^ at[3 * v + k], 16777619);
    for (const v of triangles) sum = Math.imul(sum ^ id[v], 16777619);
    if (sum >>> 0 !== number()) throw Error('the delta does not fit: its check sum is another');

    const taken = new Set(id), outlines = [...changed].flatMap((structure) => [...model.parts.get(structure).slices.values()].flat());
    model.spare = [...free, ...outlines.filter((v) => !taken.has(v))];
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
