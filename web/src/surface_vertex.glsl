#version 300 es
uniform mat4 camera;      // world mm to clip space
uniform mat3 view;        // world to eye directions
in vec3 position;
in vec4 shading;          // normal, openness
out vec3 normal;          // in eye space
out float up;             // of the normal in the world
out float open;
out vec3 place;           // world mm
void main() {
    gl_Position = camera * vec4(position, 1);
    normal = view * shading.xyz;
    up = shading.z;
    open = shading.w;
    place = position;
}
