// Radiance of the painted face: sun through the boxes in SHADOWS (a bit each), and sky.
uniform sampler2DArray paints;
in vec2 uv;
in vec3 sunlit;
in vec3 skylit;
in vec3 middle[5];
in float clear;
flat in float layer;
out vec4 colour;

vec3 painted() {
    float open = 1.0;
    for (int which = 0; which < 5; which++)
        if ((SHADOWS & (1 << which)) != 0) // a ray that goes only a little through the box is dimmed only a little
            open *= 1.0 - clamp(path_in_box(middle[which], sun_in_box[which].xyz) * sun_in_box[which].w, 0.0, 1.0);
    vec3 texel = texture(paints, vec3(uv, layer)).rgb;
    return 4.0 * texel * texel * (sunlit * open + skylit);
}
