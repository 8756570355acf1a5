"""The rendered camera."""
