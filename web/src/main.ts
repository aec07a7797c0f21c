/** The one script of the page and of its worker. */
import { byId, showMessage } from './dom';
import type { Later } from './extras';
import { runViewer } from './viewer';
import { runWorker } from './worker';

/** Brings what the first picture does not need. */
const later = (): Promise<Later> =>
    import('/extras.js' as string).catch((error) => {
        showMessage('The server cannot be reached.', 'Load again', () => location.reload());
        throw error;
    });

function runPage() {
    const model = byId('model');
    if (!model) {
        void later().then(({ listModels }) => listModels());
        return;
    }
    try {
        runViewer(JSON.parse(model.textContent!), document.currentScript!.textContent!, later);
    } catch (error) {
        document.documentElement.dataset.state = 'error';
        showMessage(`This model cannot be shown: ${(error as Error).message}.`);
    }
}

if (self.document) runPage();
else runWorker();
