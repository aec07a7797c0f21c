/** The list of structures: which are seen, and their colours. */
import { byId, create } from './dom';
import type { StructureInfo } from './model';

/** Returns the set of hidden structures, which it keeps; changed is called when it changes. */
export function listStructures(structures: StructureInfo[], changed: () => void) {
    const hidden = new Set<number>();
    if (structures.length < 2) return hidden;

    const boxes = structures.map(({ name, color }, i) => {
        const box = create('input', { type: 'checkbox', checked: true, onchange: () => set(i, box.checked) });
        const swatch = create('i', {});
        swatch.style.background = color;
        return { box, row: create('label', {}, box, swatch, name.replaceAll('_', ' ')) };
    });

    function set(i: number, visible: boolean) {
        boxes[i].box.checked = visible;
        hidden[visible ? 'delete' : 'add'](i);
        changed();
    }
    /** All that the filter leaves in the list. */
    const setListed = (visible: boolean) => boxes.forEach(({ row }, i) => row.hidden || set(i, visible));

    byId('rows').append(...boxes.map(({ row }) => row));
    byId('all').onclick = () => setListed(true);
    byId('none').onclick = () => setListed(false);
    const filter = byId<HTMLInputElement>('filter');
    filter.oninput = () =>
        boxes.forEach(({ row }) => (row.hidden = !row.textContent!.toLowerCase().includes(filter.value.toLowerCase())));
    byId('structures').hidden = false;
    return hidden;
}
