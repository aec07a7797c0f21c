/** What the server says about a model, and the little that the viewer derives from it. */

export type Vector = [number, number, number];

export interface LevelInfo {
    error_max_mm: number;
    error_rms_mm: number;
}

export interface StructureInfo {
    name: string;
    color: string;
    /** Their count. */
    levels: number;
}

/** What the page carries of it. */
export interface Manifest {
    id: string;
    name: string;
    levels: LevelInfo[];
    bounds: [Vector, Vector];
    structures: StructureInfo[];
    /** The stream's beginning, in base64. */
    base: string;
}

export interface ModelLine {
    id: string;
    name: string;
    structures: number;
    levels: number;
    bytes: number;
}

/** Bytes for people: 1 kB = 1000 bytes. */
export const formatBytes = (bytes: number) =>
    bytes < 1e3 ? bytes + ' B' : bytes < 1e6 ? (bytes / 1e3).toFixed(1) + ' kB' : (bytes / 1e6).toFixed(2) + ' MB';

export const formatCount = (count: number, one: string) => `${count.toLocaleString('en')} ${one}${count === 1 ? '' : 's'}`;
