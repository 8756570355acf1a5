// The cue: each quadrilateral's cover of the pixel is computed from its edges' exact lines in the picture,
// so the corners stand where the pinhole puts them, at any size and sampling.
uniform vec4 edge_lines[4 * QUADS]; // a u + b v + c = px inside the edge
uniform vec3 lamp_rgb;
#if STATUS
uniform vec4 status_lines[4];
uniform vec3 status_rgb;
const float GLASS = 0.15; // smoked: dark while it does not shine
#endif
const vec3 LENS = vec3(0.15, 1.5, 0.3); // the panel's own paint against the board's

float half_plane(vec4 line, vec3 px) {
    // Exact cover of a square by a half plane: slopes of the ramp from the line's direction.
    float inside = dot(line.xyz, px) * crop.w;
    float wide = max(abs(line.x), abs(line.y)), thin = min(abs(line.x), abs(line.y));
    float total = 0.5 * (wide + thin), flat_part = 0.5 * (wide - thin);
    float reach = abs(inside);
    float corner = max(reach - flat_part, 0.0);
    float cover = reach / wide - (thin > 1e-4 ? corner * corner / (2.0 * wide * thin) : 0.0);
    return 0.5 + sign(inside) * (reach >= total ? 0.5 : cover);
}

float cover(vec4 first, vec4 second, vec4 third, vec4 fourth, vec3 px) {
    float across = half_plane(first, px) + half_plane(third, px) - 1.0;
    float along = half_plane(second, px) + half_plane(fourth, px) - 1.0;
    return max(across, 0.0) * max(along, 0.0);
}

void main() {
    vec3 px = vec3(picture_px(), 1.0);
    float lamp = 0.0;
    for (int quad = 0; quad < QUADS; quad++)
        lamp += cover(edge_lines[4 * quad], edge_lines[4 * quad + 1], edge_lines[4 * quad + 2],
            edge_lines[4 * quad + 3], px);
    lamp = min(lamp, 1.0);
    vec3 radiance = mix(painted(), lamp_rgb + LENS * (sunlit + skylit), lamp);
#if STATUS
    float status = cover(status_lines[0], status_lines[1], status_lines[2], status_lines[3], px);
    radiance = mix(radiance, status_rgb + GLASS * (sunlit + skylit), status);
#endif
    colour = vec4(exposed(mix(horizon_rgb.rgb, radiance, clear)), 1.0);
}
