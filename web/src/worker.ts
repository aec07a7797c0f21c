/** The worker: fetches the stream, decodes it as it comes, and hands every mesh over. */
import { Decoder, type Step } from './decoder';
import type { Reply, Request, Start } from './messages';

/** How long nothing must come until the passes of an unfinished level are shown, ms. */
const PATIENCE = 150;

/** A failure that another try may get over. */
class NetworkError extends Error {}

export function runWorker() {
    const send = (reply: Reply, transfer: Transferable[] = []) => postMessage(reply, { transfer });
    let source: Start, module: WebAssembly.Module, decoder: Decoder;
    const portions: Uint8Array[] = [], steps: Step[] = [], unshown = new Map<number, Step>();
    let received = 0;
    let tail = Promise.resolve();   // requests are served one after the other

    /** Passes count as the level before them, whose error is the one that is known. */
    function sendMesh(of: Decoder, { structure, level, passesLeft }: Step) {
        if (passesLeft) level--;
        const mesh = { ...of.mesh(structure), structure, level };
        send({ mesh }, [mesh.buffer]);
    }

    function take(portion: Uint8Array) {
        portions.push(portion);
        received += portion.length;
        decoder.feed(portion);
        for (let step; (step = decoder.step()); ) {
            steps.push(step);
            if (step.passesLeft) unshown.set(step.structure, step);
            else {
                unshown.delete(step.structure);
                sendMesh(decoder, step);
            }
        }
        send({ bytes: received });
    }

    function showPasses() {
        for (const step of unshown.values()) sendMesh(decoder, step);
        unshown.clear();
    }

    /** A second try skips what the first one brought. */
    async function fetchRest() {
        if (source.url) {
            let skip = received - source.base.length, reader;
            try {
                const response = await fetch(source.url);
                if (!response.ok) throw new NetworkError(`The server answered ${response.status} ${response.statusText}.`);
                reader = response.body!.getReader();
            } catch (error) {
                throw error instanceof NetworkError ? error : new NetworkError('The server cannot be reached.');
            }
            for (;;) {
                const waiting = setTimeout(showPasses, PATIENCE);
                const { value } = await reader
                    .read()
                    .catch(() => {
                        throw new NetworkError('The connection broke off.');
                    })
                    .finally(() => clearTimeout(waiting));
                if (!value) break;
                if (skip < value.length) take(value.slice(skip));
                skip = Math.max(0, skip - value.length);
            }
        }
        send({ done: true });
    }

    async function start(from: Start) {
        source = from;
        module = await WebAssembly.compile(from.wasm as BufferSource);
        decoder = await Decoder.open(module);
        take(from.base);
        await fetchRest();
    }

    /** Decodes what is here again, up to a level that the page has thrown away. */
    async function decodeAgain(level: number) {
        const again = await Decoder.open(module), latest = new Map<number, Step>();
        for (const portion of portions) again.feed(portion);
        // Levels come in order, so those up to this one are the first steps.
        for (const step of steps) {
            if (step.level > level) break;
            again.step();
            if (!step.passesLeft) latest.set(step.structure, step);
        }
        for (const step of latest.values()) sendMesh(again, step);
    }

    onmessage = ({ data }: MessageEvent<Request>) => {
        tail = tail
            .then(() => (data.start ? start(data.start) : data.again ? fetchRest() : decodeAgain(data.level!)))
            .catch((error: Error) => {
                const retry = error instanceof NetworkError;
                send({ retry, error: retry ? error.message : `The model cannot be decoded: ${error.message}.` });
            });
    };
}
