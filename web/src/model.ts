/** What the server says about a model, and the little that the viewer derives from it. */

export type Vector = [number, number, number];

export interface LevelInfo {
    vertices: number;
    triangles: number;
    error_max_mm: number;
    error_rms_mm: number;
}

export interface StructureInfo {
    name: string;
    color: string;
    /** Count of levels, or the levels themselves. */
    levels: number | unknown[];
}

export interface Manifest {
    id: string;
    name: string;
    levels: LevelInfo[];
    bounds: [Vector, Vector];
    structures: StructureInfo[];
}

export interface ModelLine {
    id: string;
    name: string;
    structures: number;
    levels: number;
    bytes: number;
}

export const lastLevel = ({ levels }: StructureInfo) => (typeof levels === 'number' ? levels : levels.length) - 1;

/** Bytes for people: 1 kB = 1000 bytes. */
export const formatBytes = (bytes: number) =>
    bytes < 1e3 ? bytes + ' B' : bytes < 1e6 ? (bytes / 1e3).toFixed(1) + ' kB' : (bytes / 1e6).toFixed(2) + ' MB';

export const formatCount = (count: number, one: string) => `${count.toLocaleString('en')} ${one}${count === 1 ? '' : 's'}`;
