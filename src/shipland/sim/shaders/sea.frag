// Sea as a plane with waves in its normal. Mipmaps hold slope and squared slope, so what a pixel averages away
// comes back as variance: Fresnel after Bruneton et al. 2010, Eq. 18; glitter after Cox & Munk 1954.
uniform sampler2D long_waves;
uniform sampler2D short_waves;
uniform vec2 px_a_sample;
out vec4 colour;

const mat2 TURN = mat2(0.940, 0.342, -0.342, 0.940);
const mat2 TURN_BACK = mat2(0.766, -0.643, 0.643, 0.766);

void main() {
    vec3 direction = ray_at(gl_FragCoord.xy * px_a_sample - 0.5);
    float down = max(direction.z, 2e-5);
    float distance_m = eye.x / down;
    vec2 ground = direction.xy * distance_m;

    float squeeze = 0.35 * log2(down);
    vec4 a0 = texture(long_waves, ground * sea_scale.x + sea_offset_a.xy, squeeze);
    vec4 a1 = texture(long_waves, TURN * ground * sea_scale.y + sea_offset_a.zw, squeeze);
    vec4 b0 = texture(short_waves, TURN_BACK * ground * sea_scale.z + sea_offset_b.xy, squeeze);
    vec2 slope_a0 = (a0.xy - 0.5) * sea_gain.x, slope_a1 = (a1.xy - 0.5) * sea_gain.x;
    vec2 slope_b0 = (b0.xy - 0.5) * sea_gain.y;
    float variance = (a0.z + a1.z) * sea_gain.x * sea_gain.x + b0.z * sea_gain.y * sea_gain.y;
    variance -= dot(slope_a0, slope_a0) + dot(slope_a1, slope_a1) + dot(slope_b0, slope_b0);
    variance = max(variance, 0.0) + sea_gain.z;
    vec2 slope = slope_a0 + slope_a1 * TURN + slope_b0 * TURN_BACK;

    vec3 up = normalize(vec3(slope, -1.0));
    float facing = -dot(direction, up);
    // Facets turned away are hidden: at grazing view the seen mean tilts towards the eye.
    float sigma = sqrt(0.5 * variance);
    facing = max(facing, 0.0) + 0.35 * sigma * exp(-3.0 * max(facing, 0.0) / (sigma + 1e-3));
    float fresnel = 0.02 + 0.98 * pow(1.0 - min(facing, 1.0), 5.0 * exp(-2.69 * sigma)) / (1.0 + 22.7 * pow(sigma, 1.5));
    vec3 mirrored = direction + 2.0 * facing * up;
    vec3 sky_rgb = sky(mirrored, abs(mirrored.z) + 0.6 * sigma);

    vec3 half_way = sun.xyz - direction;
    vec2 facet = half_way.xy / half_way.z - slope * -1.0;
    float glitter = exp(-dot(facet, facet) / variance) / (3.1416 * variance);
    float steep = -half_way.z * inversesqrt(dot(half_way, half_way));
    glitter *= 0.25 * fresnel / (max(facing, 0.03) * max(steep * steep * steep * steep, 0.02));
    vec3 radiance = mix(water_rgb.rgb, sky_rgb, fresnel) + min(glitter * sun_rgb.w, 30.0) * sun_rgb.rgb;

    float crest = 0.5 * (a0.w + a1.w) + 0.35 * (b0.w - 0.5);
    float foam = smoothstep(sea_gain.w, sea_gain.w + 0.06, crest);
    foam = mix(foam, eye.z, smoothstep(40.0, 160.0, distance_m));
    radiance = mix(radiance, 0.25 * (sun_rgb.rgb * max(-sun.z, 0.0) + 2.0 * zenith_rgb.rgb + horizon_rgb.rgb), foam);

    radiance = through_air(radiance, distance_m);
    colour = vec4(display(radiance).bgr, 1.0);
}
