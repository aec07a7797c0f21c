/** Shaders are text; build.mjs takes comments and needless space out of them. */
declare module '*.glsl' {
    const source: string;
    export default source;
}
