/** The wasm decoder: bytes in, meshes out. */

/** What a structure came to: a level, or a pass on the way to it. */
export interface Step {
    structure: number;
    level: number;
    passesLeft: number;
}

/** See web/wasm/README.md. */
interface Exports {
    memory: WebAssembly.Memory;
    report_words(): number;
    input(size: number): number;
    feed(size: number): number;
    every_pass(): void;
    step(): number;
    mesh(structure: number): number;
    error_text(): number;
}

export class Decoder {
    #wasm: Exports;

    private constructor(instance: WebAssembly.Instance) {
        this.#wasm = instance.exports as unknown as Exports;
    }

    static open = async (module: WebAssembly.Module) => new Decoder(await WebAssembly.instantiate(module));

    /** Throws an Error with the decoder's own words if status is a failure. */
    #check(status: number) {
        if (status >= 0) return status;
        const bytes = new Uint8Array(this.#wasm.memory.buffer, this.#wasm.error_text(), 480);
        throw Error(new TextDecoder().decode(bytes.slice(0, bytes.indexOf(0))) || 'status ' + status);
    }

    feed(bytes: Uint8Array) {
        const address = this.#wasm.input(bytes.length);
        if (!address) throw Error('out of memory');
        new Uint8Array(this.#wasm.memory.buffer).set(bytes, address);
        this.#check(this.#wasm.feed(bytes.length));
        this.#wasm.every_pass();
    }

    /** Decodes the next pass of a structure; undefined if more bytes are needed. */
    step(): Step | undefined {
        if (this.#check(this.#wasm.step())) return;
        const [structure, level, , , , , passesLeft] = this.#report();
        return { structure, level, passesLeft };
    }

    mesh(structure: number) {
        this.#check(this.#wasm.mesh(structure));
        const [, , , , , , , vertices, triangles, start] = this.#report();
        // A copy: the module's memory is replaced when it grows.
        const buffer = this.#wasm.memory.buffer.slice(start, start + vertices * 20 + triangles * 12) as ArrayBuffer;
        return { vertices, triangles, buffer };
    }

    #report = () => new Uint32Array(this.#wasm.memory.buffer, this.#wasm.report_words(), 10);
}
