// Slopes of the sea at a point: long waves twice, turned against each other, and short ones.
uniform sampler2D long_waves;
uniform sampler2D short_waves;
uniform vec2 px_a_sample;
out vec4 colour;

const mat2 TURN_BACK = mat2(0.766, -0.643, 0.643, 0.766);

struct Sea {
    vec2 slope;     // of the surface's normal
    float variance; // of what the texture has averaged away, both directions together
    float grain;    // fine unevenness for foam, 0 … 1
    float crest;    // height on the waves, 0 on average, deviation 0.149
};

Sea sea_at(vec2 foot, float down) {
    // Mipmaps follow the footprint's long side; a bias takes back part of that blur across the view.
    float bias = 0.35 * log2(down) - 0.3;
    vec4 a0 = texture(long_waves, foot * sea_scale.x + sea_offset_a.xy, bias);
    vec4 a1 = texture(long_waves, TURN * foot * sea_scale.y + sea_offset_a.zw, bias);
    vec4 b0 = texture(short_waves, TURN_BACK * foot * sea_scale.z + sea_offset_b.xy, bias);
    vec2 slope_a0 = (a0.xy - 0.5) * sea_gain.x, slope_a1 = (a1.xy - 0.5) * sea_gain.x;
    vec2 slope_b0 = (b0.xy - 0.5) * sea_gain.y;
    float variance = (a0.z + a1.z) * sea_gain.x * sea_gain.x + b0.z * sea_gain.y * sea_gain.y;
    variance -= dot(slope_a0, slope_a0) + dot(slope_a1, slope_a1) + dot(slope_b0, slope_b0);
    Sea sea;
    sea.slope = slope_a0 + slope_a1 * TURN + slope_b0 * TURN_BACK;
    sea.variance = max(variance, 0.0) + sea_gain.z;
    sea.grain = clamp(0.62 + 4.5 * (b0.x - 0.5) - 3.0 * (b0.y - 0.5), 0.0, 1.0);
    sea.crest = 0.55 * (a0.w + a1.w - 1.0) + 0.9 * (b0.w - 0.5);
    return sea;
}
