/** Where the eye is. World axes are the scan's: x to the right of the body, y to the front, z up. */
import type { Vector } from './model';

/** Half of the vertical field of view: a long lens, so that shapes are not distorted. */
const LENS = Math.tan((14 * Math.PI) / 180);

export class Camera {
    /** Angle of the eye around z from the x axis, and above the horizon; radians. */
    turn = 0;
    tilt = 0;
    /** From the target to the eye, mm. */
    distance = 1;
    target: Vector = [0, 0, 0];
    #centre: Vector;
    #radius: number;

    /** aspect: width of the picture by its height. */
    constructor([low, high]: [Vector, Vector], public aspect: number) {
        this.#centre = low.map((x, i) => (x + high[i]) / 2) as Vector;
        this.#radius = Math.hypot(...low.map((x, i) => (high[i] - x) / 2)) || 1;
        this.reset();
    }

    /** From the front, left and above. */
    reset() {
        this.look(2.5, 0.32);
        this.target = [...this.#centre];
        this.distance = (0.78 * this.#radius) / LENS / Math.min(1, this.aspect);
    }

    look(turn: number, tilt: number) {
        this.turn = turn;
        this.tilt = Math.max(-Math.PI / 2, Math.min(Math.PI / 2, tilt));
    }

    zoom(factor: number) {
        this.distance = Math.max(this.#radius / 50, Math.min(this.#radius * 50, this.distance * factor));
    }

    /** Moves the target in the plane of the picture by parts of its height. */
    pan(right: number, up: number) {
        const scale = 2 * LENS * this.distance, [x, y] = this.axes();
        this.target = this.target.map((t, i) => t + scale * (right * x[i] + up * y[i])) as Vector;
    }

    /** Right, up and towards the eye, in world directions. */
    axes(): [Vector, Vector, Vector] {
        const s = Math.sin(this.turn), c = Math.cos(this.turn), t = Math.sin(this.tilt), h = Math.cos(this.tilt);
        return [[-s, c, 0], [-c * t, -s * t, h], [c * h, s * h, t]];
    }

    /** World directions to eye directions, as WebGL takes it: column by column. */
    view() {
        const axes = this.axes();
        return [0, 1, 2].flatMap((i) => axes.map((axis) => axis[i]));
    }

    /** World mm to clip space, as WebGL takes it. */
    matrix() {
        const axes = this.axes(), { distance, target } = this;
        const reach = 1.3 * this.#radius + Math.hypot(...target.map((x, i) => x - this.#centre[i]));
        const near = Math.max(distance - reach, distance / 100), far = distance + reach;
        const eye = axes.map((axis, i) => axis.reduce((sum, x, k) => sum - x * target[k], i > 1 ? -distance : 0));
        // Columns of the world's axes, then of its origin.
        return [0, 1, 2, 3].flatMap((i) => {
            const [x, y, z] = i < 3 ? axes.map((axis) => axis[i]) : eye;
            const depth = (z * (far + near) + (i < 3 ? 0 : 2 * far * near)) / (near - far);
            return [x / LENS / this.aspect, y / LENS, depth, -z];
        });
    }

    /** As text for the address, and back. */
    save = () => [this.turn, this.tilt, this.distance, ...this.target].map((x) => +x.toFixed(3)).join();

    restore(text: string) {
        const [turn, tilt, distance, x, y, z] = text.split(',').map(Number);
        if (![turn, tilt, distance, x, y, z].every(Number.isFinite)) return;
        this.look(turn, tilt);
        this.target = [x, y, z];
        this.distance = distance;
        this.zoom(1);
    }
}
