uniform sampler2D clouds;
uniform vec2 px_a_sample;
out vec4 colour;

void main() {
    vec3 direction = ray_at(gl_FragCoord.xy * px_a_sample - 0.5);
    float up = -direction.z;
    vec3 radiance = sky(direction, up);
    float above = max(up, 0.0) + 0.06;
    vec2 where = direction.xy * (0.22 / above) + vec2(horizon_rgb.w, 0.4 * horizon_rgb.w);
    float dense = texture(clouds, where).r;
    float sunward = texture(clouds, where + 0.02 * sun.xy).r;
    float thick = smoothstep(0.0, 0.34, dense - 1.02 + zenith_rgb.w) * smoothstep(0.01, 0.16, up);
    float lit = clamp(0.62 + 2.2 * (dense - sunward) - 0.25 * thick, 0.2, 1.0);
    vec3 cloud = 0.45 * horizon_rgb.rgb + 0.25 * zenith_rgb.rgb + 0.62 * lit * sun_rgb.rgb;
    radiance = mix(radiance, cloud, 0.9 * thick);
    float disc = smoothstep(sun.w - 4e-6, sun.w + 4e-6, dot(direction, sun.xyz)) * (1.0 - thick);
    radiance += disc * 40.0 * sun_rgb.rgb;
    float veil = exp(-water_rgb.w * 1200.0 / (above + 0.1));
    colour = vec4(exposed(mix(horizon_rgb.rgb, radiance, veil)), 1.0);
}
