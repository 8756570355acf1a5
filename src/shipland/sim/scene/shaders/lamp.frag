// A face that shines by itself.
uniform vec3 lamp_rgb;
in float clear;
out vec4 colour;

void main() { colour = vec4(exposed(mix(horizon_rgb.rgb, lamp_rgb, clear)), 1.0); }
