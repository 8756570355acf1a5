#if WATER
// The sea stands and laps at the hull: what is below its waves is not seen, what is just above is white or wet.
uniform sampler2D long_waves;
uniform sampler2D short_waves;
in vec2 ground_m; // from the camera's foot [m]
in float above_m; // over the mean sea
#endif

void main() {
    vec3 radiance = painted();
#if WATER
    float unit_m = sea_offset_b.z, most_m = min(0.5 * unit_m, 0.6) + 0.25;
    if (above_m < most_m) {
        float wave = texture(long_waves, ground_m * sea_scale.x + sea_offset_a.xy).w
            + texture(long_waves, TURN * ground_m * sea_scale.y + sea_offset_a.zw).w - 1.0;
        float fine = texture(short_waves, 1.7 * (ground_m + above_m) * sea_scale.z + sea_offset_b.xy).w - 0.5;
        float over_m = above_m - min(unit_m * wave, 0.6) - 0.02 - 0.1 * unit_m * (fine + 0.5) * (fine + 0.5);
        if (over_m < 0.0) discard;
        float wash = smoothstep(0.0, 0.02 + 0.06 * unit_m, 0.03 + 0.5 * unit_m * (0.08 + 0.3 * fine) - over_m);
        vec3 white = 0.5 * (sun_rgb.rgb * max(-sun.z, 0.0) + 0.6 * zenith_rgb.rgb + 0.4 * horizon_rgb.rgb);
        radiance *= 0.55 + 0.45 * smoothstep(0.0, 0.04 + 0.15 * unit_m, over_m); // wet paint is darker
        radiance = mix(radiance, white, 0.8 * sea_offset_b.w * wash);
    }
#endif
    colour = vec4(exposed(mix(horizon_rgb.rgb, radiance, clear)), 1.0);
}
