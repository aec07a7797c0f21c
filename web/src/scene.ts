/** Everything on the graphics card. Meshes are uploaded when first drawn, and again after a lost context. */
import type { Camera } from './camera';
import type { Mesh } from './messages';
import fragmentSource from './surface_fragment.glsl';
import vertexSource from './surface_vertex.glsl';

export interface Part {
    mesh: Mesh;
    /** "#rrggbb" */
    color: string;
}

interface Upload {
    array: WebGLVertexArrayObject;
    buffers: WebGLBuffer[];
}

/** Attribute slots, the same in every program. */
const POSITION = 0, SHADING = 1;

const linear = (color: string) =>
    [1, 3, 5].map((i) => (parseInt(color.slice(i, i + 2), 16) / 255) ** 2.2) as [number, number, number];

export class Scene {
    #gl: WebGL2RenderingContext;
    #program!: WebGLProgram;
    #uploads = new Map<Mesh, Upload>();

    /** Throws if there is no WebGL2. redraw is called when the context comes back. */
    constructor(canvas: HTMLCanvasElement, redraw: () => void) {
        const gl = canvas.getContext('webgl2', { powerPreference: 'high-performance' });
        if (!gl) throw Error('no WebGL2');
        this.#gl = gl;
        canvas.addEventListener('webglcontextlost', (event) => event.preventDefault());
        canvas.addEventListener('webglcontextrestored', () => {
            this.#uploads.clear();
            this.#build();
            redraw();
        });
        this.#build();
    }

    #build() {
        const gl = this.#gl, program = (this.#program = gl.createProgram()!);
        for (const [type, source] of [[gl.VERTEX_SHADER, vertexSource], [gl.FRAGMENT_SHADER, fragmentSource]] as const) {
            const shader = gl.createShader(type)!;
            gl.shaderSource(shader, source);
            gl.compileShader(shader);
            gl.attachShader(program, shader);
            gl.deleteShader(shader);
        }
        gl.bindAttribLocation(program, POSITION, 'position');
        gl.bindAttribLocation(program, SHADING, 'shading');
        gl.linkProgram(program);
        gl.enable(gl.DEPTH_TEST);
    }

    #upload(mesh: Mesh) {
        const gl = this.#gl, array = gl.createVertexArray()!, end = mesh.vertices * 20;
        const fill = (target: number, data: Uint8Array) => {
            const buffer = gl.createBuffer()!;
            gl.bindBuffer(target, buffer);
            gl.bufferData(target, data, gl.STATIC_DRAW);
            return buffer;
        };
        gl.bindVertexArray(array);
        const buffers = [
            fill(gl.ARRAY_BUFFER, new Uint8Array(mesh.buffer, 0, end)),
            fill(gl.ELEMENT_ARRAY_BUFFER, new Uint8Array(mesh.buffer, end)),
        ];
        gl.enableVertexAttribArray(POSITION);
        gl.vertexAttribPointer(POSITION, 3, gl.FLOAT, false, 0, 0);
        gl.enableVertexAttribArray(SHADING);
        gl.vertexAttribPointer(SHADING, 4, gl.SHORT, true, 0, mesh.vertices * 12);
        const upload = { array, buffers };
        this.#uploads.set(mesh, upload);
        return upload;
    }

    /** Gives the mesh's memory on the card back. */
    drop(mesh: Mesh) {
        const upload = this.#uploads.get(mesh);
        if (!upload) return;
        this.#gl.deleteVertexArray(upload.array);
        for (const buffer of upload.buffers) this.#gl.deleteBuffer(buffer);
        this.#uploads.delete(mesh);
    }

    /** cut: a plane (normal, distance); what lies beyond is left out. */
    draw(camera: Camera, parts: Part[], cut = [0, 0, 0, 0]) {
        const gl = this.#gl, program = this.#program, { width, height } = gl.canvas;
        if (gl.isContextLost()) return;
        const uniform = (name: string) => gl.getUniformLocation(program, name);
        camera.aspect = width / height;
        gl.viewport(0, 0, width, height);
        gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
        gl.useProgram(program);
        gl.uniformMatrix4fv(uniform('camera'), false, camera.matrix());
        gl.uniformMatrix3fv(uniform('view'), false, camera.view());
        gl.uniform4fv(uniform('cut'), cut);
        for (const { mesh, color } of parts) {
            gl.bindVertexArray((this.#uploads.get(mesh) ?? this.#upload(mesh)).array);
            gl.uniform3fv(uniform('colour'), linear(color));
            gl.drawElements(gl.TRIANGLES, mesh.triangles * 3, gl.UNSIGNED_INT, 0);
        }
        gl.bindVertexArray(null);
    }
}
