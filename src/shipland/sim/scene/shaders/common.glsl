#version 330
// One block for every program: packed by scene_block.py, in this order.
layout(std140) uniform FrameBlock {
    mat4 clip_from_rel;   // camera-relative ned [m] to clip
    vec4 ray_x;           // ray in ned = ray_0 + u ray_x + v ray_y, u, v in px of the whole picture
    vec4 ray_y;
    vec4 ray_0;
    vec4 crop;            // left edge, top edge [px], px a sample, samples a px
    vec4 sun;             // unit vector to the sun in ned; cosine of the disc's radius
    vec4 sun_rgb;         // irradiance on a plane facing the sun; strength of the glare
    vec4 zenith_rgb;      // radiance straight up; cloud cover
    vec4 horizon_rgb;     // radiance at the horizon; clouds' drift [texture units]
    vec4 glow_rgb;        // added around the sun; exposure over the target's full scale
    vec4 water_rgb;       // radiance that comes up out of the water; extinction of the air [1/m]
    vec4 eye;             // height above the sea [m], focal length [px], far sea's whitecap cover, time [s]
    vec4 sea_scale;       // texture units a metre of the four wave layers
    vec4 sea_offset_a;    // texture coordinates at the camera's foot: layers 0, 1
    vec4 sea_offset_b;    // layer 2; wave height of a texture unit [m]; strength of the foam around the hull
    vec4 sea_gain;        // slope a texture unit of the long and the short tile; residual variance; foam threshold
    vec4 ground;          // north and east of the camera [m]
    mat4 box_from_rel[5]; // shadow casters: camera-relative ned to a cube of ±1
    vec4 sun_in_box[5];   // 1 / direction to the sun in that cube; 1 / path to full shade [1/m]
};

#ifdef FRAGMENT
const mat2 TURN = mat2(0.940, 0.342, -0.342, 0.940); // of the second wave layer against the first

// Slab test of the ray to the sun, `amid` the slabs: its path through a box [m].
float path_in_box(vec3 amid, vec3 inverse) {
    vec3 reach = abs(inverse);
    vec3 near3 = amid - reach, far3 = amid + reach;
    return min(min(far3.x, far3.y), far3.z) - max(max(near3.x, near3.y), max(near3.z, 0.0));
}

vec2 picture_px() { return crop.xy + gl_FragCoord.xy * crop.z; }
#endif

vec3 ray_at(vec2 px) { return normalize(ray_0.xyz + px.x * ray_x.xyz + px.y * ray_y.xyz); }

// What is stored of a radiance, blue first: light on the sensor, linear, so that every average is of light.
vec3 exposed(vec3 radiance) { return min(radiance * glow_rgb.w, 1.0).bgr; }

// Clear sky without clouds and disc; up = sine of the elevation.
vec3 sky(vec3 direction, float up) {
    float low = 1.0 - clamp(up, 0.0, 1.0);
    float low2 = low * low;
    float towards = max(dot(direction, sun.xyz), 0.0);
    float s2 = towards * towards, s4 = s2 * s2, s8 = s4 * s4, s32 = s8 * s8 * s8 * s8;
    float near_horizon = low2 * low2 * low;
    vec3 base = mix(zenith_rgb.rgb, horizon_rgb.rgb, near_horizon);
    return base + glow_rgb.rgb * (s4 * (0.10 + 0.55 * near_horizon * low2) + 0.5 * s32);
}

vec3 through_air(vec3 radiance, float distance_m) {
    return mix(horizon_rgb.rgb, radiance, exp(-water_rgb.w * distance_m));
}
