/** What the page and its worker say to each other. */

export interface Start {
    wasm: Uint8Array;
    /** The stream's beginning, with which the page came. */
    base: Uint8Array;
    /** Where the rest of the stream is; empty when there is none. */
    url: string;
}

/** `again`: fetch the rest once more, after a failure. `level`: send all structures as they stand at that level. */
export interface Request {
    start?: Start;
    again?: boolean;
    level?: number;
}

/** One structure at one level: positions, shading and indices in one buffer, as the wasm module writes them. */
export interface Mesh {
    structure: number;
    level: number;
    vertices: number;
    triangles: number;
    buffer: ArrayBuffer;
}

export interface Reply {
    mesh?: Mesh;
    /** Bytes of the model received so far. */
    bytes?: number;
    /** The stream has ended. */
    done?: boolean;
    /** What went wrong, for people; `retry` when asking again may help. */
    error?: string;
    retry?: boolean;
}
