/** Bytes that the page carries as text. */

/** Text whose characters' low eight bits are the bytes, each xor key (see build.mjs). */
export const bytesOfText = (text: string, key = 0) => Uint8Array.from(text, (c) => c.charCodeAt(0) ^ key);

/** The decoder's key. */
export const WASM_KEY = 81;

export const bytesOfBase64 = (text: string) => bytesOfText(atob(text));
