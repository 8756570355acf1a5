// Radiance of the painted face: sun through the boxes in SHADOWS (a bit each), and sky.
uniform sampler2DArray paints;
in vec2 uv;
in vec3 sunlit;
in vec3 skylit;
in vec3 middle[5];
in float clear;
flat in float layer;
out vec4 colour;

// Slab test of the ray to the sun; a ray that goes only a little through the box is dimmed only a little.
float behind_box(vec3 amid, vec4 inverse) {
    vec3 reach = abs(inverse.xyz);
    vec3 near3 = amid - reach, far3 = amid + reach;
    float enter = max(max(near3.x, near3.y), max(near3.z, 0.0));
    float leave = min(min(far3.x, far3.y), far3.z);
    return clamp((leave - enter) * inverse.w, 0.0, 1.0);
}

vec3 painted() {
    float open = 1.0;
    for (int which = 0; which < 5; which++)
        if ((SHADOWS & (1 << which)) != 0) open *= 1.0 - behind_box(middle[which], sun_in_box[which]);
    vec3 texel = texture(paints, vec3(uv, layer)).rgb;
    return 4.0 * texel * texel * (sunlit * open + skylit);
}
