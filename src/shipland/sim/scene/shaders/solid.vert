// Faces are flat: light and air are taken at the corners, shadows and paint at the pixel.
in vec3 in_position;
in vec3 in_normal;
in vec2 in_uv;
in vec4 in_paint; // rgb albedo, layer of the paint array
in float in_open; // share of the sky's light that comes through
uniform mat4 rel_from_mesh;
out vec2 uv;
out vec3 sunlit; // radiance of unshadowed sun
out vec3 skylit; // radiance without sun
out vec3 middle[5]; // where a ray to the sun is amid each shadow caster's slabs [m along it]
out float clear; // share that comes through the air
#if WATER
out vec2 ground_m; // from the camera's foot [m]
out float above_m; // over the mean sea
#endif
flat out float layer;

void main() {
    vec4 position = rel_from_mesh * vec4(in_position, 1.0);
    vec3 normal = mat3(rel_from_mesh) * in_normal;
    float up = -normal.z;
    vec3 sky_light = mix(horizon_rgb.rgb, zenith_rgb.rgb, 0.5 + 0.5 * up) * (0.62 + 0.38 * up);
    sky_light = mix(vec3(dot(sky_light, vec3(0.25, 0.55, 0.20))), sky_light, 0.55); // clouds and haze take out colour
    vec3 bounce = (0.10 * horizon_rgb.rgb + 0.06 * sun_rgb.rgb * max(-sun.z, 0.0)) * (0.5 - 0.5 * up);
    for (int which = 0; which < 5; which++)
        if ((SHADOWS & (1 << which)) != 0) {
            vec4 lifted = vec4(position.xyz + 0.004 * normal, 1.0);
            middle[which] = -(box_from_rel[which] * lifted).xyz * sun_in_box[which].xyz;
        }
    uv = in_uv;
    layer = in_paint.w;
    sunlit = in_paint.rgb * sun_rgb.rgb * max(dot(normal, sun.xyz), 0.0);
    skylit = in_paint.rgb * (sky_light + bounce) * in_open;
    clear = exp(-water_rgb.w * length(position.xyz));
#if WATER
    ground_m = position.xy;
    above_m = eye.x - position.z;
#endif
    gl_Position = clip_from_rel * position;
#if WATER
    gl_ClipDistance[0] = above_m + 0.3; // in the troughs
#else
    gl_ClipDistance[0] = eye.x - position.z; // nothing shows below the sea
#endif
}
