/** The page with a model: brings stream, picture and controls together. */
import { bytesOfBase64, bytesOfText, WASM_KEY } from './bytes';
import { Camera } from './camera';
import { attachControls } from './controls';
import { byId, showMessage } from './dom';
import { Levels } from './levels';
import type { Reply, Request } from './messages';
import { formatBytes, formatCount, type Manifest } from './model';
import { Scene, type Part } from './scene';
import { listStructures } from './structures';
import type { Extras, Later } from './extras';

/** later: brings what is not needed for the first picture. */
export function runViewer(model: Manifest, script: string, later: () => Promise<Later>) {
    const canvas = byId<HTMLCanvasElement>('view'), slider = byId<HTMLInputElement>('level');
    const page = document.documentElement.dataset, last = model.levels.length - 1;
    const structure = new URLSearchParams(location.search).get('structure');
    let bytes = 0, frame = 0, saving = 0, extras: Extras | undefined;

    const redraw = () => (frame ||= requestAnimationFrame(draw));
    const camera = new Camera(model.bounds, canvas.clientWidth / canvas.clientHeight);
    const scene = new Scene(canvas, redraw);
    const levels = new Levels(model.structures, (mesh) => scene.drop(mesh));
    const hidden = listStructures(model.structures, redraw);

    function draw() {
        frame = 0;
        const parts: Part[] = model.structures.flatMap(({ color }, i) => {
            const mesh = !hidden.has(i) && (extras?.mesh(i) ?? levels.shown(i));
            return mesh ? [{ mesh, color }] : [];
        });
        scene.draw(camera, parts, extras?.cut());
        extras?.paint(canvas);
        const triangles = parts.reduce((sum, { mesh }) => sum + mesh.triangles, 0);
        const level = Math.min(last, levels.complete, levels.wanted);
        if (level < 0) return;
        const { error_rms_mm: rms, error_max_mm: max } = model.levels[level];
        page.level = '' + level;
        page.triangles = '' + triangles;
        slider.value = page.level;
        byId('status').textContent = [
            `Level ${level} of ${last}`, formatCount(triangles, 'triangle'), formatBytes(bytes) + ' received',
            ...(rms != null && rms >= 0 ? [`error ${rms.toPrecision(2)} mm RMS, ${max.toPrecision(2)} mm max`] : []),
        ].join(' · ');
    }

    // ---- camera and level in the address

    function save() {
        clearTimeout(saving);
        saving = setTimeout(() => {
            const level = levels.wanted < last ? '&l=' + levels.wanted : '';
            history.replaceState(null, '', '#c=' + camera.save() + level);
        }, 250);
        redraw();
    }

    function restore() {
        const saved = new URLSearchParams(location.hash.slice(1));
        camera.restore(saved.get('c') ?? '');
        want(saved.has('l') ? +saved.get('l')! : Infinity);
    }

    function want(level: number) {
        levels.wanted = level < last ? Math.max(0, level) : Infinity;
        if (levels.missing) ask({ level: levels.wanted });
        redraw();
    }

    // ---- stream

    const worker = new Worker(URL.createObjectURL(new Blob([script], { type: 'text/javascript' })));
    const ask = (request: Request) => worker.postMessage(request);

    function fail(text: string, retry?: boolean) {
        page.state = 'error';
        showMessage(text, retry ? 'Try again' : 'Load again', () => (retry ? ask({ again: true }) : location.reload()));
    }

    worker.onerror = () => fail('The decoder cannot be started in this browser.');
    worker.onmessage = ({ data }: MessageEvent<Reply>) => {
        if (data.mesh) levels.add(data.mesh);
        if (data.bytes) {
            bytes = data.bytes;
            page.state = bytes > base.length ? 'streaming' : 'base';
        }
        if (data.error) fail(data.error, data.retry);
        if (data.done) {
            if (levels.complete < last) fail('The model ended too early.', true);
            else page.state = 'done';
        }
        redraw();
    };

    document.title = model.name + ' – Lathe';
    byId('name').textContent = model.name;
    slider.max = '' + last;
    slider.oninput = () => (want(+slider.value), save());
    byId('share').onclick = ({ target }) =>
        navigator.clipboard?.writeText(location.href).then(() => ((target as HTMLElement).textContent = 'Link copied'));
    byId('more').onclick = async ({ target }) => {
        (target as HTMLButtonElement).disabled = true;
        const { open } = await later();
        extras = open({ model, camera, redraw, level: () => +(page.level ?? 0), structure });
    };
    attachControls(canvas, camera, save);
    onhashchange = restore;
    restore();
    new ResizeObserver(() => {
        canvas.width = canvas.clientWidth * devicePixelRatio;
        canvas.height = canvas.clientHeight * devicePixelRatio;
        cancelAnimationFrame(frame);
        draw();   // at once: setting the size has cleared the picture
    }).observe(canvas);

    const base = bytesOfBase64(model.base);
    const url = `${location.origin}/models/${encodeURIComponent(model.id)}/stream?from=1`
        + (structure ? '&structure=' + encodeURIComponent(structure) : '');
    ask({ start: { wasm: bytesOfText(byId('wasm').textContent!, WASM_KEY), base, url: last ? url : '' } });
}
