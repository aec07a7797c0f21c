/** Mouse, touch and keys move the camera. */
import type { Camera } from './camera';

/** Radians for each pixel dragged; steps of the keys. */
const DRAG = 0.008, STEP = 0.12;

const HALF = Math.PI / 2;
/** Keys 1-6: from the front, back, left, right, top, bottom; the front of the body is up in the last two. */
const VIEWS = [[HALF, 0], [-HALF, 0], [2 * HALF, 0], [0, 0], [-HALF, HALF], [HALF, -HALF]];

const ARROWS: Record<string, [number, number]> = {
    ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1],
};

/** changed is called after every movement. */
export function attachControls(canvas: HTMLElement, camera: Camera, changed: () => void) {
    const fingers = new Map<number, PointerEvent>();

    const orbit = (x: number, y: number) => camera.look(camera.turn - x, camera.tilt + y);

    /** Middle and spread of two fingers. */
    const pair = () => {
        const [a, b] = fingers.values();
        return { x: (a.x + b.x) / 2, y: (a.y + b.y) / 2, spread: Math.hypot(a.x - b.x, a.y - b.y) || 1 };
    };

    canvas.onpointerdown = (event) => {
        canvas.setPointerCapture(event.pointerId);
        fingers.set(event.pointerId, event);
    };
    canvas.onpointerup = canvas.onpointercancel = ({ pointerId }) => fingers.delete(pointerId);
    canvas.onpointermove = (event) => {
        const before = fingers.get(event.pointerId), height = canvas.clientHeight;
        if (!before) return;
        if (fingers.size > 1) {
            const from = pair();
            fingers.set(event.pointerId, event);
            const to = pair();
            camera.zoom(from.spread / to.spread);
            camera.pan((from.x - to.x) / height, (to.y - from.y) / height);
        } else {
            const x = event.x - before.x, y = event.y - before.y;
            if (event.shiftKey || event.buttons > 1) camera.pan(-x / height, y / height);
            else orbit(x * DRAG, y * DRAG);
            fingers.set(event.pointerId, event);
        }
        changed();
    };
    canvas.oncontextmenu = (event) => event.preventDefault();
    canvas.addEventListener('wheel', (event) => {
        event.preventDefault();
        // Lines and pages (deltaMode 1, 2) as pixels; a pinch on a touch pad comes as small steps with ctrlKey.
        const pixels = event.deltaY * [1, 16, 400][event.deltaMode];
        camera.zoom(Math.exp(Math.max(-200, Math.min(200, pixels)) * (event.ctrlKey ? 0.01 : 0.002)));
        changed();
    }, { passive: false });
    canvas.ondblclick = () => {
        camera.reset();
        changed();
    };

    onkeydown = ({ key, shiftKey, ctrlKey, metaKey, altKey, target }) => {
        if (ctrlKey || metaKey || altKey || (target as HTMLElement).matches('input')) return;
        const arrow = ARROWS[key], view = VIEWS[+key - 1];
        if (arrow) {
            if (shiftKey) camera.pan(arrow[0] * STEP / 2, arrow[1] * STEP / 2);
            else orbit(-arrow[0] * STEP, arrow[1] * STEP);
        } else if (view) camera.look(view[0], view[1]);
        else if (key === '+' || key === '=') camera.zoom(0.9);
        else if (key === '-') camera.zoom(1 / 0.9);
        else if (key === 'r') camera.reset();
        else return;
        changed();
    };
}
