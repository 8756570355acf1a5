in vec2 in_ndc;

void main() { gl_Position = vec4(in_ndc, 0.0, 1.0); }
