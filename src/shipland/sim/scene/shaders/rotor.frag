// A turning rotor: a thin veil, denser at its rim.
void main() {
    float cover = 0.24 + 0.40 * smoothstep(0.80, 0.97, length(uv));
    colour = vec4(exposed(mix(horizon_rgb.rgb, painted(), clear)) * cover, cover);
}
