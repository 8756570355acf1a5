// Sea as a plane with waves in its normal. Mipmaps hold slope and squared slope, so what a pixel averages away
// comes back as variance: Fresnel after Bruneton et al. 2010, glitter after Cox & Munk 1954.
#if SHIP
// Around the ship: its mirror image, its shadow, and foam along the hull.
uniform sampler2D mirrored_ship; // the ship below the sea's plane, premultiplied
uniform vec4 mirror_area;        // left and top edge [px], texture units a px
uniform vec2 mirror_used;        // texture units that are drawn
uniform vec2 picture_size;       // px
uniform vec4 ship_axis;          // north and east of ship's forward axis; of its origin against the camera [m]
uniform vec4 hull_plan;          // middle forward, middle starboard, half length, half width [m]

float shadow_of(int which, vec3 rel, float edge) {
    vec3 origin = (box_from_rel[which] * vec4(rel, 1.0)).xyz, inverse = sun_in_box[which].xyz;
    return clamp(path_in_box(-origin * inverse, inverse) * edge, 0.0, 1.0);
}

vec2 on_plan_back(vec2 plan) { return plan.x * ship_axis.xy + plan.y * vec2(-ship_axis.y, ship_axis.x); }

vec2 on_plan(vec2 rel) { return vec2(dot(rel, ship_axis.xy), ship_axis.x * rel.y - ship_axis.y * rel.x); }

// What a facet of a slope mirrors of the ship: the ray's end is looked up in the ship mirrored in the flat sea.
vec4 ship_in_facet(vec3 rel, vec3 direction, vec2 slope, float lod) {
    vec3 up = vec3(slope, -1.0) * inversesqrt(1.0 + dot(slope, slope));
    float facing = -dot(direction, up);
    vec3 ray = direction + 2.0 * facing * up;
    if (facing <= 0.0 || ray.z > 0.0) return vec4(0.0);
    vec2 way = ship_axis.zw + on_plan_back(hull_plan.xy) - rel.xy;
    float along2 = max(dot(ray.xy, ray.xy), 1e-4), reach = dot(way, ray.xy) / along2;
    if (reach <= 0.0) return vec4(0.0);
    vec3 end = rel + max(reach - hull_plan.w * inversesqrt(along2), 0.1) * ray;
    end.z = 2.0 * eye.x - end.z;
    vec4 clip = clip_from_rel * vec4(end, 1.0);
    if (clip.w <= 0.0) return vec4(0.0);
    vec2 px = (0.5 + 0.5 * clip.xy / clip.w) * picture_size - 0.5;
    vec2 at = (px + 0.5 - mirror_area.xy) * mirror_area.zw;
    return textureLod(mirrored_ship, clamp(at, vec2(0.0), mirror_used), lod);
}
#if WAKE
// White water of a ship under way, 0 … 1, at a place on its plan: bow wave, wash along the sides, wake astern.
uniform float wake;

float white_water(vec2 plan) {
    float along = plan.x - hull_plan.x + hull_plan.z, length_m = 2.0 * hull_plan.z, across = abs(plan.y - hull_plan.y);
    float coarse = texture(short_waves, 0.021 * plan).w - 0.5, fine = texture(short_waves, TURN * plan * 0.11).w - 0.5;
    float grain = 1.6 * coarse + 1.2 * fine;
    float aft = max(-along, 0.0), churned = 0.95 * hull_plan.w + 0.07 * aft;
    float cover = along < 0.0 ? smoothstep(1.15, 0.5, across / churned) * exp(-aft / 140.0) : 0.0;
    float share = clamp(along / length_m, 0.0, 1.0), taper = clamp((share - 0.45) / 0.52, 0.0, 1.0);
    float half_m = hull_plan.w * (1.0 - pow(taper, 1.7)) * mix(0.86, 0.97, min(share / 0.3, 1.0));
    if (along > 0.0 && along < length_m + 1.0) // as the hull's waterline in frigate.py
        cover = max(cover, (0.45 + 0.5 * share * share) * smoothstep(1.0 + 2.5 * share, 0.0, across - half_m));
    float behind = length_m - along, arm = across - 0.354 * behind; // Kelvin's 19.5 degrees
    if (behind > 0.0)
        cover = max(cover, 0.9 * exp(-behind / 45.0) * smoothstep(1.0, 0.0, abs(arm) / (1.2 + 0.04 * behind)));
    return wake * smoothstep(0.22, 0.75, cover * (0.8 + grain));
}
#endif
#endif

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
#if SHIP
    // Three facets along the view, weighted by how far they are turned to the eye.
    vec3 rel = direction * distance_m;
    vec2 ahead = direction.xy * inversesqrt(max(dot(direction.xy, direction.xy), 1e-6));
    float lateral_px = sigma * down * eye.y / max(distance_m, 0.5) * 1.5;
    float lod = clamp(log2(max(max(lateral_px, px_a_sample.x) * mirror_area.z * 256.0, 1.0)) - 0.5, 0.0, 4.0);
    vec4 ship = vec4(0.0);
    float weights = 1e-4;
    for (int facet = -1; facet <= 1; facet++) {
        float off = 1.1 * float(facet);
        vec2 slope = sea.slope + sigma * off * ahead;
        float weight = max(dot(direction, vec3(-slope, 1.0)), 0.0);
        ship += weight * ship_in_facet(rel, direction, slope, lod);
        weights += weight;
    }
    ship /= weights;
    sky_rgb = sky_rgb * (1.0 - ship.a) + ship.bgr / glow_rgb.w;
    vec2 plan = on_plan(rel.xy - ship_axis.zw);
    vec2 beside_m = abs(plan - hull_plan.xy) - hull_plan.zw;
    float off_m = abs(length(max(beside_m, 0.0)) + min(max(beside_m.x, beside_m.y), 0.0)); // from the hull's side
    float shade = max(shadow_of(1, rel, 6.0), shadow_of(2, rel, 20.0));
    if (max(beside_m.x, beside_m.y) > 0.0) shade = max(shade, shadow_of(0, rel, 6.0));
    shade *= exp(-0.06 * off_m * off_m);
    float sunny = 1.0 - shade;
#else
    const float sunny = 1.0;
#endif
#if GLITTER
    vec3 half_way = sun.xyz - direction;
    vec2 facet = half_way.xy / half_way.z + sea.slope;
    float glitter = exp(-dot(facet, facet) / sea.variance) / (3.1416 * sea.variance);
    float steep2 = half_way.z * half_way.z / dot(half_way, half_way);
    glitter *= 0.25 * fresnel / (max(facing, 0.03) * max(steep2 * steep2, 0.02));
    glint = sunny * min(glitter * sun_rgb.w, 30.0) * sun_rgb.rgb;
#endif
    // Light that comes through thin crests makes them greener.
    vec3 body = water_rgb.rgb * (1.0 + 1.2 * max(sea.crest, 0.0) * vec3(0.6, 1.0, 0.8));
    body *= 0.35 + 0.65 * sunny;
    vec3 radiance = mix(body, sky_rgb, fresnel) + glint;

    float foam = smoothstep(sea_gain.w - 0.03, sea_gain.w + 0.05, sea.crest);
    foam = mix(foam, eye.z, smoothstep(60.0, 250.0, distance_m));
    vec3 white = 0.55 * (sunny * sun_rgb.rgb * max(-sun.z, 0.0) + 0.6 * zenith_rgb.rgb + 0.4 * horizon_rgb.rgb);
    radiance = mix(radiance, white, foam * sea.grain);
#if WAKE
    radiance = mix(radiance, white, 0.85 * white_water(plan));
#elif SHIP
    float lap = 0.5 + 0.5 * sin(2.2 * eye.w + 3.0 * plan.x + 4.0 * plan.y);
    float grain = texture(short_waves, 2.7 * TURN * (plan * sea_scale.z)).w - 0.5;
    float wash = sea_offset_b.w * exp(-off_m * (5.0 - 2.0 * lap)) * (0.75 + 0.8 * sea.crest) + 1.5 * grain;
    radiance = mix(radiance, white, 0.9 * smoothstep(0.30, 0.75, wash) * exp(-1.5 * off_m));
#endif
    colour = vec4(exposed(through_air(radiance, distance_m)), 1.0);
}
