"""OpenGL without a window: context on EGL, packaged shaders, off-screen targets."""

from __future__ import annotations

from importlib import resources
from typing import Any

import moderngl
import numpy as np
import numpy.typing as npt

from shipland.errors import SystemLibraryError

_HINT = "the rendered camera needs EGL and OpenGL 3.3; on Debian or Ubuntu: apt-get install libegl1 libgl1"


def open_context() -> moderngl.Context:
    """A stand-alone OpenGL 3.3 context on EGL: the GPU where there is one, Mesa's llvmpipe else.

    Raises:
        SystemLibraryError: the libraries are missing or give no context; the message names the packages.
    """
    try:
        context = moderngl.create_context(
            standalone=True, backend="egl", require=330, libgl="libGL.so.1", libegl="libEGL.so.1"
        )
    except Exception as error:  # glcontext and moderngl raise bare Exception, ImportError and ValueError
        raise SystemLibraryError(f"{_HINT} (said: {str(error).strip() or type(error).__name__})") from None
    context.gc_mode = "auto"
    return context


def shader_source(name: str) -> str:
    """A packaged file of `shaders`."""
    return (resources.files("shipland.sim") / "shaders" / name).read_text(encoding="utf-8")


def program(context: moderngl.Context, vertex: str, fragment: tuple[str, ...], **defines: int) -> moderngl.Program:
    """A program of packaged sources, each after `common.glsl`, with whole-number macros."""
    head = shader_source("common.glsl")
    version, rest = head.split("\n", 1)
    macros = "".join(f"#define {key} {value}\n" for key, value in defines.items())
    linked = context.program(
        vertex_shader=f"{version}\n{macros}{rest}\n{shader_source(vertex)}",
        fragment_shader="\n".join([version, f"#define FRAGMENT\n{macros}{rest}", *map(shader_source, fragment)]),
    )
    if "FrameBlock" in linked:
        linked["FrameBlock"].binding = 0
    return linked


class Target:
    """A picture to draw into, with depth; `samples` > 0 makes it multisampled."""

    def __init__(self, context: moderngl.Context, width_px: int, height_px: int, samples: int = 0) -> None:
        size = (width_px, height_px)
        self.size = size
        self.texture: Any = None if samples else context.texture(size, 4)
        self._colour = context.renderbuffer(size, 4, samples=samples) if samples else self.texture
        self._depth = context.depth_renderbuffer(size, samples=samples)
        self.fbo = context.framebuffer([self._colour], self._depth)
        if self.texture is not None:
            self.texture.filter = (moderngl.LINEAR, moderngl.LINEAR)
            self.texture.repeat_x = self.texture.repeat_y = False

    def release(self) -> None:
        """Give the memory back."""
        for item in (self.fbo, self._colour, self._depth):
            item.release()


def mipmapped(
    context: moderngl.Context, picture: npt.NDArray[np.uint8], *, layers: bool = False, mipmaps: bool = True
) -> Any:  # noqa: ANN401 - Texture or TextureArray
    """A repeating trilinear texture from uint8 (H,W,C), or (L,H,W,C) with `layers`."""
    if layers:
        count, height, width, channels = picture.shape
        texture: Any = context.texture_array((width, height, count), channels, picture.tobytes())
    else:
        height, width, channels = picture.shape
        texture = context.texture((width, height), channels, picture.tobytes())
    if mipmaps:
        texture.build_mipmaps()
    texture.filter = (moderngl.LINEAR_MIPMAP_LINEAR, moderngl.LINEAR)
    return texture
