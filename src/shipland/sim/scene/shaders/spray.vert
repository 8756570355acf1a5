in vec4 in_position; // camera-relative ned [m], opacity
in vec2 in_corner;   // −1 … 1 over the puff
out vec2 corner;
out float opacity;

void main() {
    corner = in_corner;
    opacity = in_position.w;
    gl_Position = clip_from_rel * vec4(in_position.xyz, 1.0);
}
