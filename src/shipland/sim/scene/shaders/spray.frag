in vec2 corner;
in float opacity;
out vec4 colour;

void main() {
    float core = max(1.0 - dot(corner, corner), 0.0);
    float cover = opacity * core * core;
    vec3 white = 0.45 * sun_rgb.rgb * (0.4 + 0.6 * max(-sun.z, 0.0)) + 0.4 * (zenith_rgb.rgb + horizon_rgb.rgb);
    colour = vec4(exposed(white) * cover, cover);
}
