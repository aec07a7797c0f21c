/** The one script of the page and of its worker. */
import { byId, showMessage } from './dom';
import { listModels } from './model_list';
import { runViewer } from './viewer';
import { runWorker } from './worker';

function runPage() {
    const model = byId('model');
    if (!model) {
        void listModels();
        return;
    }
    try {
        runViewer(JSON.parse(model.textContent!), document.currentScript!.textContent!);
    } catch (error) {
        document.documentElement.dataset.state = 'error';
        showMessage(`This model cannot be shown: ${(error as Error).message}.`);
    }
}

if (self.document) runPage();
else runWorker();
