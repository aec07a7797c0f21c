/** Bytes that the page carries as text. */

/** Text whose characters' low eight bits are the bytes (see build.mjs). */
export const bytesOfText = (text: string) => Uint8Array.from(text, (c) => c.charCodeAt(0));

export const bytesOfBase64 = (text: string) => bytesOfText(atob(text));
