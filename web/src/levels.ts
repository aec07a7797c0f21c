/** The meshes that have come: of each structure, by level. */
import type { Mesh } from './messages';
import type { StructureInfo } from './model';

/** Bytes of meshes kept; beyond them earlier levels are thrown away and decoded again when they are asked for. */
const BUDGET = 4e8;

export class Levels {
    #meshes: Mesh[][];
    #reached: number[];
    #bytes = 0;
    /** The level that was asked for. */
    wanted = Infinity;

    /** dropped is called for each mesh that is given up. */
    constructor(private structures: StructureInfo[], private dropped: (mesh: Mesh) => void) {
        this.#meshes = structures.map(() => []);
        this.#reached = structures.map(() => -1);
    }

    add(mesh: Mesh) {
        const own = this.#meshes[mesh.structure];
        if (!own) return;
        if (own[mesh.level]) this.#drop(own[mesh.level]);
        own[mesh.level] = mesh;
        this.#reached[mesh.structure] = Math.max(mesh.level, this.#reached[mesh.structure]);
        this.#bytes += mesh.buffer.byteLength;
        if (this.#bytes > BUDGET) this.#makeRoom();
    }

    #drop(mesh: Mesh) {
        delete this.#meshes[mesh.structure][mesh.level];
        this.#bytes -= mesh.buffer.byteLength;
        this.dropped(mesh);
    }

    #makeRoom() {
        this.#meshes.forEach((own, structure) => {
            const shown = this.shown(structure);
            for (const mesh of own) if (mesh && mesh !== shown && mesh.level < this.#reached[structure]) this.#drop(mesh);
        });
    }

    /** The mesh to draw: the best up to the wanted level. */
    shown(structure: number): Mesh | undefined {
        return this.#meshes[structure].findLast((mesh) => mesh?.level <= this.wanted);
    }

    /** True if a level that has come is wanted, but has been thrown away. */
    get missing() {
        return this.#reached.some((reached, i) => reached >= 0 && !this.#meshes[i][Math.min(reached, this.wanted)]);
    }

    /** The level at which all structures are, or Infinity when they are all at their last. */
    get complete() {
        return Math.min(...this.#reached.map((reached, i) => (reached < this.structures[i].levels - 1 ? reached : Infinity)));
    }
}
