void main() { colour = vec4(display(mix(horizon_rgb.rgb, painted(), clear)).bgr, 1.0); }
