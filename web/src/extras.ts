/** What a teacher shows: the smooth surface, a slice with its outline, and edge types in colour. Loaded when it is asked for, and
 * with it all that the first picture of a model does not need. */
import type { Camera } from './camera';
import { byId, create, showMessage } from './dom';
import style from './extras.css';
import type { Mesh } from './messages';
import type { Manifest, Vector } from './model';

export interface Hooks {
    model: Manifest;
    camera: Camera;
    redraw: () => void;
    /** The level that is shown. */
    level: () => number;
    structure: string | null;
}
/** What the viewer asks when it draws. */
export interface Extras {
    /** A structure's mesh instead of its own. */
    mesh: (structure: number) => Mesh | undefined;
    /** A plane, world mm: what lies before it is not drawn. */
    cut: () => [number, number, number, number];
    /** After the surface. */
    paint: (canvas: HTMLCanvasElement) => void;
}

export { listModels } from './model_list';
/** This module, as the page gets it. */
export type Later = typeof import('./extras');

document.head.append(create('style', { textContent: style }));

interface Loop { structure: string; hole: boolean; points: Vector[]; centre?: Vector; edges?: string[] }
interface Slice { loops: Loop[]; picture: { corner: Vector; right: Vector; down: Vector; width: number; height: number } }

const COLOURS: Record<string, string> = { f: '#1b9e3e', b: '#d3382f', u: '#2a63d6', d: '#c98a00' };
const NAMES: Record<string, string> = { f: 'FOR', b: 'BACK', u: 'UP', d: 'DOWN' };

const cross = (a: Vector, b: Vector): Vector => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
const dot = (a: Vector | number[], b: Vector | number[]) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];

interface GlbMesh { primitives: { attributes: Record<string, number>; indices: number }[]; extras?: { structure: number } }

/** Meshes of a GLB as the viewer draws them, in mm: positions, normals with full openness, indices. */
function readGlb(bytes: ArrayBuffer): Mesh[] {
    const view = new DataView(bytes), length = view.getUint32(12, true);
    const json = JSON.parse(new TextDecoder().decode(new Uint8Array(bytes, 20, length))), start = 28 + length;
    const array = (index: number, size: number) => {
        const accessor = json.accessors[index], part = json.bufferViews[accessor.bufferView];
        const offset = start + (part.byteOffset ?? 0) + (accessor.byteOffset ?? 0);
        return size > 1 ? new Float32Array(bytes.slice(offset, offset + accessor.count * size * 4)) : new Uint32Array(bytes.slice(offset, offset + accessor.count * 4));
    };
    return json.meshes.map(({ primitives: [{ attributes, indices }], extras }: GlbMesh) => {
        const at = array(attributes.POSITION, 3), normal = array(attributes.NORMAL, 3), corners = array(indices, 1);
        const vertices = at.length / 3, buffer = new ArrayBuffer(vertices * 20 + corners.length * 4);
        // Only the node turns y up and scales to metres: the meshes themselves are in mm along the scan's axes.
        new Float32Array(buffer, 0, at.length).set(at);
        const shading = new Int16Array(buffer, vertices * 12, vertices * 4);
        for (let i = 0; i < vertices; i++)
            for (let k = 0; k < 4; k++) shading[4 * i + k] = 32767 * (k < 3 ? normal[3 * i + k] : 1);
        new Uint32Array(buffer, vertices * 20).set(corners);
        // Structures that show nothing yet have no mesh: the place in the list says nothing.
        return { structure: extras?.structure ?? 0, level: -1, vertices, triangles: corners.length / 3, buffer };
    });
}

export function open({ model, camera, redraw, level, structure }: Hooks): Extras {
    const base = `/models/${encodeURIComponent(model.id)}/`, only = structure ? '&structure=' + encodeURIComponent(structure) : '';
    let smooth: Mesh[] = [], smoothLevel = -1, slice: Slice | undefined, turn = 0, smoothTurn = 0;
    const fail = (error: unknown) => showMessage(String((error as Error).message ?? error), 'Close', () => 0);
    async function get(path: string) {
        const reply = await fetch(base + path);
        if (!reply.ok) throw Error((await reply.json().catch(() => ({ detail: reply.statusText }))).detail);
        return reply;
    }

    // ---- controls
    const smoothBox = create('input', { type: 'checkbox', id: 'smooth' }), sliceBox = create('input', { type: 'checkbox', id: 'slice' });
    const number = create('input', { type: 'range', id: 'slice-number', disabled: true, ariaLabel: 'Slice' });
    const rays = create('select', { id: 'rays', disabled: true, ariaLabel: 'Rays' },
        ...['outline', 8, 16, 32, 64, 128].map((n) => create('option', { value: '' + n, textContent: n === 'outline' ? n : n + ' rays' })));
    const picture = create('img', { id: 'slice-picture', alt: 'The slice', hidden: true }), legend = create('p', { id: 'edges', hidden: true });
    const lines = create('canvas', { id: 'lines' });
    byId('view').after(lines);
    const panel = create('section', { id: 'extras', ariaLabel: 'More' },
        create('label', {}, smoothBox, ' Smooth surface'), create('label', {}, sliceBox, ' Slice ', number), create('label', {}, 'Edges ', rays), picture, legend);
    document.body.append(panel);

    async function showSmooth() {
        const mine = ++smoothTurn;
        smoothLevel = smoothBox.checked ? level() : -1;
        const meshes = smoothLevel < 0 ? [] : readGlb(await (await get(`levels/${smoothLevel}.glb?smooth=2${only}`)).arrayBuffer());
        if (mine !== smoothTurn) return;   // meanwhile something else is wanted
        smooth = meshes;
        panel.dataset.smooth = '' + smooth.reduce((sum, mesh) => sum + mesh.triangles, 0);
        redraw();
    }

    async function showSlice() {
        const mine = ++turn, k = number.value, cast = rays.value !== 'outline';
        number.disabled = rays.disabled = picture.hidden = !sliceBox.checked;
        legend.hidden = !sliceBox.checked || !cast;
        slice = undefined;
        if (sliceBox.checked) {
            const reply: Slice = await (await get(`slices/${k}/` + (cast ? `contour?rays=${rays.value}` : 'outline?tolerance=0') + only)).json();
            if (mine !== turn) return;
            slice = reply;
            picture.src = `${base}slices/${k}.png` + (only && '?' + only.slice(1));
            picture.alt = 'Slice ' + k;
            const count = (type: string) => reply.loops.reduce((sum, { edges }) => sum + (edges ?? []).filter((e) => e[0] === type).length, 0);
            legend.replaceChildren(...Object.keys(NAMES).map((type) => {
                const entry = create('span', { textContent: `${NAMES[type]} ${count(type)} ` });
                entry.style.color = COLOURS[type];
                entry.dataset.edges = type;
                return entry;
            }));
        }
        panel.dataset.slice = slice ? k : '';
        panel.dataset.rays = slice && cast ? rays.value : '';
        redraw();
    }

    async function findRange() {
        // Beyond the last slice the server says which there are.
        const reply = await fetch(`${base}slices/99999/outline?${only.slice(1)}`), [, first, last] = /slices (\d+)\.\.(\d+)/.exec((await reply.json()).detail)!;
        number.min = first, number.max = last;
        number.value = '' + Math.round((+first + +last) / 2);
    }

    smoothBox.onchange = () => showSmooth().catch(fail);
    sliceBox.onchange = async () => (number.dataset.ready ??= (await findRange().catch(fail), 'yes'), showSlice().catch(fail));
    number.oninput = rays.onchange = () => showSlice().catch(fail);

    // ---- drawing
    function cut(): [number, number, number, number] {
        if (!slice) return [0, 0, 0, 0];
        const { corner, right, down } = slice.picture, n = cross(right, down), length = Math.hypot(...n) || 1;
        const side = dot(n, camera.axes()[2]) < 0 ? -1 / length : 1 / length, normal = n.map((x) => x * side) as Vector;
        return [...normal, dot(normal, corner)];
    }

    function paint(canvas: HTMLCanvasElement) {
        const { width, height } = canvas, m = camera.matrix(), pen = lines.getContext('2d')!;
        lines.width = width, lines.height = height;
        const place = (p: Vector) => {
            const [x, y, , w] = [0, 1, 2, 3].map((r) => m[r] * p[0] + m[4 + r] * p[1] + m[8 + r] * p[2] + m[12 + r]);
            return [(x / w + 1) * width / 2, (1 - y / w) * height / 2] as const;
        };
        const stroke = (a: Vector, b: Vector, colour: string, thick: number) => {
            pen.strokeStyle = colour, pen.lineWidth = thick * devicePixelRatio;
            pen.beginPath(), pen.moveTo(...place(a)), pen.lineTo(...place(b)), pen.stroke();
        };
        for (const { points, edges, centre, structure: name } of slice?.loops ?? []) {
            const own = model.structures.find((s) => s.name === name)?.color ?? '#000';
            if (centre) for (const point of points) stroke(centre, point, '#8888', 0.7);
            points.forEach((p, i) => stroke(p, points[(i + 1) % points.length], edges ? COLOURS[edges[i][0]] : own, 2.5));
        }
        if (smoothBox.checked && smoothLevel >= 0 && smoothLevel !== level()) showSmooth().catch(fail);
    }

    // A page of one structure has that one only, whatever its number in the model is.
    return { mesh: (i) => smooth.find((mesh) => structure || mesh.structure === i), cut, paint };
}
