// What the ship does to the water around it: foam along the hull, its shadow, its reflection. Premultiplied.
uniform vec4 ship_axis;   // north and east of ship's forward axis; of its origin against the camera [m]
uniform vec4 hull_plan;   // middle forward, middle starboard, half length, half width [m]
uniform vec3 hull_rgb;    // radiance of its paint

float through_box(int which, vec3 rel, vec3 direction, float edge) {
    vec3 origin = (box_from_rel[which] * vec4(rel, 1.0)).xyz;
    vec3 inverse = 1.0 / (mat3(box_from_rel[which]) * direction);
    vec3 amid = -origin * inverse, reach = abs(inverse);
    vec3 near3 = amid - reach, far3 = amid + reach;
    float enter = max(max(near3.x, near3.y), max(near3.z, 0.0));
    float leave = min(min(far3.x, far3.y), far3.z);
    return clamp((leave - enter) * edge, 0.0, 1.0);
}

void main() {
    vec3 direction = ray_at(gl_FragCoord.xy * px_a_sample - 0.5);
    float down = max(direction.z, 2e-5);
    float distance_m = eye.x / down;
    vec3 rel = direction * distance_m;
    Sea sea = sea_at(rel.xy, down);

    vec2 from_ship = rel.xy - ship_axis.zw;
    vec2 plan = vec2(dot(from_ship, ship_axis.xy), ship_axis.x * from_ship.y - ship_axis.y * from_ship.x);
    float off_m = length(max(abs(plan - hull_plan.xy) - hull_plan.zw, 0.0));
    float lap = 0.5 + 0.5 * sin(2.2 * eye.w + 3.0 * plan.x + 4.0 * plan.y);
    float grain = texture(short_waves, 2.7 * TURN * (plan * sea_scale.z)).w - 0.5;
    float wash = sea_offset_b.w * exp(-off_m * (5.0 - 2.0 * lap)) * (0.75 + 0.8 * sea.crest) + 1.5 * grain;
    float foam = smoothstep(0.30, 0.75, wash) * exp(-1.5 * off_m);

    float shade = 0.0;
    shade = max(shade, through_box(0, rel, sun.xyz, 6.0));
    shade = max(shade, through_box(1, rel, sun.xyz, 6.0));
    shade = max(shade, through_box(2, rel, sun.xyz, 20.0));

    vec3 up = normalize(vec3(0.6 * sea.slope, -1.0));
    float facing = clamp(-dot(direction, up), 0.0, 1.0);
    float low = 1.0 - facing;
    float fresnel = 0.02 + 0.98 * low * low * low * low * low;
    vec3 mirrored = reflect(direction, up);
    float seen = max(through_box(0, rel, mirrored, 3.0), through_box(1, rel, mirrored, 3.0));
    float fade = exp(-off_m * off_m * 0.4) * exp(-water_rgb.w * distance_m);

    vec3 white = 0.5 * (sun_rgb.rgb * max(-sun.z, 0.0) * (1.0 - shade) + 0.6 * zenith_rgb.rgb + 0.4 * horizon_rgb.rgb);
    float cover = 0.45 * shade * (1.0 - fresnel);
    vec3 mix_rgb = vec3(0.0);
    float mirror = seen * min(fresnel * 1.6 + 0.08, 1.0);
    mix_rgb = mix(mix_rgb * cover, hull_rgb, mirror);
    cover = mix(cover, 1.0, mirror);
    mix_rgb = mix(mix_rgb, white, 0.9 * foam);
    cover = mix(cover, 1.0, 0.9 * foam);
    cover *= fade;
    vec3 shown = display(through_air(mix_rgb / max(cover / max(fade, 1e-4), 1e-3), distance_m));
    colour = vec4(shown.bgr * cover, cover);
}
