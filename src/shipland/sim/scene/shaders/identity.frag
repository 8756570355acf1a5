uniform float identity;
out vec4 colour;

void main() { colour = vec4(identity, 0.0, 0.0, 1.0); }
