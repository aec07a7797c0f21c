/** Elements by their id in page.html, and new ones. */

export const byId = <T extends HTMLElement = HTMLElement>(id: string) => document.getElementById(id) as T;

export function create<K extends keyof HTMLElementTagNameMap>(
    tag: K, properties: object, ...children: (Node | string)[]
) {
    const element = document.createElement(tag);
    Object.assign(element, properties);
    element.append(...children);
    return element;
}

/** Shows a failure to a person; with an action, a button offers it. */
export function showMessage(text: string, label = '', action?: () => void) {
    const box = byId('message');
    box.replaceChildren(text);
    box.hidden = !text;
    if (action) box.append(create('button', { textContent: label, onclick: () => (showMessage(''), action()) }));
}
