#version 300 es
precision highp float;
uniform vec3 colour;      // linear
in vec3 normal;
in float up;
in float open;
in vec3 place;
uniform vec4 cut;         // what lies beyond this plane is not drawn
out vec4 pixel;
void main() {
    if (dot(place, cut.xyz) > cut.w) discard;
    vec3 n = normalize(gl_FrontFacing ? normal : -normal);
    float cavity = mix(.12, 1., open);
    float key = max(dot(n, vec3(-.38, .56, .73)), 0.);
    float fill = max(dot(n, vec3(.73, -.1, .67)), 0.);
    vec3 sky = mix(vec3(.1, .09, .1), vec3(.22, .24, .27), up * .5 + .5);
    vec3 light = sky * open + cavity * (key * vec3(.86, .83, .78) + fill * vec3(.15, .17, .21));
    float shine = pow(max(dot(n, normalize(vec3(-.38, .56, 1.73))), 0.), 40.) * .05 * open;
    // Light that has passed through tissue: folds turn warm instead of black.
    vec3 tone = pow(colour, vec3(1.7 - .7 * open));
    pixel = vec4(pow(tone * light + shine, vec3(1. / 2.2)), 1);
}
