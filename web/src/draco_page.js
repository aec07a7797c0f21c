// /draco/{model}: fetches the Draco deltas one after another, applies each and draws what there is.
import createDecoder from 'draco3d/draco_decoder_nodejs.js';
import { applyDelta, newModel, positionsOf } from './draco_delta.js';

const element = (id) => document.getElementById(id), [, , id] = location.pathname.split('/');
const query = new URLSearchParams(location.search).get('structure'), search = query === null ? '' : `?structure=${encodeURIComponent(query)}`;
const gl = element('view').getContext('webgl2', { antialias: true });

const VERTEX = `#version 300 es
in vec3 at; uniform vec3 middle; uniform vec4 view; uniform float size; out vec3 place;
void main() {
    vec3 p = (at - middle) / size;
    float c = cos(view.x), s = sin(view.x), d = cos(view.y), e = sin(view.y);
    vec3 q = vec3(c * p.x - s * p.y, p.z, s * p.x + c * p.y);
    place = vec3(q.x, d * q.y - e * q.z, e * q.y + d * q.z);
    gl_Position = vec4(place.x / view.z, place.y, place.z * .4, 1);
}`;
const FRAGMENT = `#version 300 es
precision highp float; in vec3 place; uniform vec3 color; out vec4 pixel;
void main() { pixel = vec4(color * (.25 + .75 * abs(normalize(cross(dFdx(place), dFdy(place))).z)), 1); }`;

function program() {
    const made = gl.createProgram();
    for (const [type, text] of [[gl.VERTEX_SHADER, VERTEX], [gl.FRAGMENT_SHADER, FRAGMENT]]) {
        const shader = gl.createShader(type);
        gl.shaderSource(shader, text);
        gl.compileShader(shader);
        gl.attachShader(made, shader);
    }
    gl.linkProgram(made);
    gl.useProgram(made);
    return (name) => gl.getUniformLocation(made, name);
}

const scene = { parts: [], turn: [0.6, -0.3], middle: [0, 0, 0], size: 1 }, uniform = gl && program();
const buffers = gl && { at: gl.createBuffer(), index: gl.createBuffer() };

function draw() {
    if (!gl) return;
    const canvas = gl.canvas, { clientWidth: w, clientHeight: h } = canvas;
    Object.assign(canvas, { width: w, height: h });
    gl.viewport(0, 0, w, h);
    gl.clearColor(0.08, 0.09, 0.1, 1);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    gl.enable(gl.DEPTH_TEST);
    gl.uniform3fv(uniform('middle'), scene.middle);
    gl.uniform1f(uniform('size'), scene.size);
    gl.uniform4f(uniform('view'), scene.turn[0], scene.turn[1], w / h, 0);
    for (const { first, count, color } of scene.parts) {
        gl.uniform3fv(uniform('color'), color);
        gl.drawElements(gl.TRIANGLES, count, gl.UNSIGNED_INT, 4 * first);
    }
}

function show(model, colors) {
    const positions = positionsOf(model), index = [];
    scene.parts = [...model.parts].map(([structure, { triangles }]) => {
        const first = index.length;
        for (const v of triangles) index.push(v);
        return { first, count: triangles.length, color: colors[structure] ?? [0.9, 0.85, 0.8] };
    });
    if (model.levels === 1) {
        const low = [0, 1, 2].map((k) => positions.reduce((a, v, i) => (i % 3 === k ? Math.min(a, v) : a), Infinity));
        const high = [0, 1, 2].map((k) => positions.reduce((a, v, i) => (i % 3 === k ? Math.max(a, v) : a), -Infinity));
        scene.middle = low.map((v, k) => (v + high[k]) / 2);
        scene.size = Math.hypot(...low.map((v, k) => high[k] - v)) / 2 || 1;
    }
    if (!gl) return;
    gl.bindBuffer(gl.ARRAY_BUFFER, buffers.at);
    gl.bufferData(gl.ARRAY_BUFFER, positions, gl.STATIC_DRAW);
    gl.enableVertexAttribArray(0);
    gl.vertexAttribPointer(0, 3, gl.FLOAT, false, 0, 0);
    gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, buffers.index);
    gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, Uint32Array.from(index), gl.STATIC_DRAW);
    draw();
}

async function fetched(path) {
    const reply = await fetch(path);
    if (!reply.ok) throw Error((await reply.json().catch(() => ({}))).detail ?? `${path}: ${reply.status}`);
    return reply;
}

async function main() {
    const wasmBinary = Uint8Array.from(atob(element('wasm').textContent), (c) => c.charCodeAt(0));
    const draco = await createDecoder({ wasmBinary }), manifest = await (await fetched(`/models/${id}`)).json(), model = newModel();
    const colors = manifest.structures.map(({ color }) => [1, 3, 5].map((i) => parseInt(color.slice(i, i + 2), 16) / 255));
    element('name').textContent = manifest.name;
    let total = 0;
    for (let n = 0; n < manifest.levels.length; n++) {
        const bytes = await (await fetched(`/models/${id}/deltas/${n}.drc${search}`)).arrayBuffer(), before = model.at.length / 3;
        applyDelta(draco, model, bytes);
        total += bytes.byteLength;
        show(model, colors);
        const triangles = [...model.parts.values()].reduce((sum, part) => sum + part.triangles.length / 3, 0);
        const row = element('levels').insertRow();
        for (const v of [n, bytes.byteLength, model.at.length / 3 - before, triangles]) row.insertCell().textContent = v.toLocaleString('en');
        element('status').textContent = `${total.toLocaleString('en')} bytes`;
        await new Promise((next) => setTimeout(next));
    }
    globalThis.model = model; // for whoever wants to look at it in the console
    document.documentElement.dataset.state = 'complete';
}

element('view').addEventListener('pointermove', ({ buttons, movementX, movementY }) => {
    if (!buttons) return;
    scene.turn = [scene.turn[0] + movementX / 150, scene.turn[1] + movementY / 150];
    draw();
});
addEventListener('resize', draw);
main().catch((error) => {
    element('status').textContent = error.message;
    document.documentElement.dataset.state = 'failed';
});
