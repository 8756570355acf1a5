// Sea as a plane with waves in its normal. Mipmaps hold slope and squared slope, so what a pixel averages away
// comes back as variance: Fresnel after Bruneton et al. 2010, glitter after Cox & Munk 1954.
void main() {
    vec3 direction = ray_at(gl_FragCoord.xy * px_a_sample - 0.5);
    float down = max(direction.z, 2e-5);
    float distance_m = eye.x / down;
    Sea sea = sea_at(direction.xy * distance_m, down);

    vec3 up = vec3(sea.slope, -1.0) * inversesqrt(1.0 + dot(sea.slope, sea.slope));
    // Facets turned away are hidden: at grazing view the seen mean tilts towards the eye.
    float sigma = sqrt(0.5 * sea.variance);
    float facing = max(-dot(direction, up), 0.0);
    facing = min(facing + 0.15 * sigma * exp(-3.0 * facing / (sigma + 1e-3)), 1.0);
    float fresnel = 0.02 + 0.98 * pow(1.0 - facing, 5.0 * exp(-2.69 * sigma)) / (1.0 + 22.7 * sigma * sqrt(sigma));
    vec3 mirrored = direction + 2.0 * facing * up;
    vec3 sky_rgb = sky(mirrored, abs(mirrored.z) + 0.25 * sigma);

    vec3 glint = vec3(0.0);
#if GLITTER
    vec3 half_way = sun.xyz - direction;
    vec2 facet = half_way.xy / half_way.z + sea.slope;
    float glitter = exp(-dot(facet, facet) / sea.variance) / (3.1416 * sea.variance);
    float steep2 = half_way.z * half_way.z / dot(half_way, half_way);
    glitter *= 0.25 * fresnel / (max(facing, 0.03) * max(steep2 * steep2, 0.02));
    glint = min(glitter * sun_rgb.w, 30.0) * sun_rgb.rgb;
#endif
    // Light that comes through thin crests makes them greener.
    vec3 body = water_rgb.rgb * (1.0 + 1.2 * max(sea.crest, 0.0) * vec3(0.6, 1.0, 0.8));
    vec3 radiance = mix(body, sky_rgb, fresnel) + glint;

    float foam = smoothstep(sea_gain.w - 0.03, sea_gain.w + 0.05, sea.crest);
    foam = mix(foam, eye.z, smoothstep(60.0, 250.0, distance_m));
    vec3 white = 0.55 * (sun_rgb.rgb * max(-sun.z, 0.0) + 0.6 * zenith_rgb.rgb + 0.4 * horizon_rgb.rgb);
    radiance = mix(radiance, white, foam * sea.grain);
    colour = vec4(display(through_air(radiance, distance_m)).bgr, 1.0);
}
