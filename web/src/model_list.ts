/** The page without a model: which there are. */
import { create, showMessage } from './dom';
import { formatBytes, formatCount, type ModelLine } from './model';

export async function listModels() {
    document.body.className = 'list';
    try {
        const response = await fetch('/models');
        const { models }: { models: ModelLine[] } = await response.json();
        document.body.append(create('main', {},
            create('h2', { textContent: models.length ? 'Models' : 'There is no model here yet: bake one.' }),
            ...models.map(({ id, name, structures, levels, bytes }) =>
                create('a', { href: '/m/' + encodeURIComponent(id) },
                    create('b', { textContent: name || id }),
                    `${formatCount(structures, 'structure')} · ${formatCount(levels, 'level')} · ${formatBytes(bytes)}`)),
        ));
    } catch {
        showMessage('The list of models cannot be loaded.', 'Try again', listModels);
    }
}
