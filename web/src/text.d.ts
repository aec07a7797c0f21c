/** Files that a bundle carries as text; build.mjs takes comments and needless space out of them. */
declare module '*.glsl' {
    const source: string;
    export default source;
}
declare module '*.css' {
    const text: string;
    export default text;
}
