"""OpenGL without a window: context on EGL, packaged shaders, textures, off-screen targets."""

from __future__ import annotations

from importlib import resources
from typing import Any

import moderngl
import numpy as np
import numpy.typing as npt

from shipland.errors import SystemLibraryError

_HINT = (
    "drawn pictures need EGL and OpenGL 3.3; on Debian or Ubuntu: apt-get install libegl1 libgl1 libgl1-mesa-dri "
    "libegl-mesa0; `--vision geometric --no-video` flies without"
)
_LIBRARIES: dict[str, Any] = {"backend": "egl", "libgl": "libGL.so.1", "libegl": "libEGL.so.1"}
LONG_WAVES_UNIT, SHORT_WAVES_UNIT, CLOUDS_UNIT, PAINT_UNIT, MIRROR_UNIT = range(5)
"""Texture units: each scene has a context of its own, so they stay bound."""
_UNORM_16 = "nu2"  # moderngl's name of 16 bits that stand for 0 … 1


def open_context() -> moderngl.Context:
    """A stand-alone OpenGL 3.3 context on EGL: the GPU where there is one, Mesa's llvmpipe else.

    Raises:
        SystemLibraryError: the libraries are missing or give no context; the message names the packages.
    """
    try:
        context = moderngl.create_context(standalone=True, require=330, **_LIBRARIES)
    except Exception as error:  # glcontext and moderngl raise bare Exception, ImportError and ValueError
        said = " ".join(str(error).split()) or type(error).__name__
        raise SystemLibraryError(f"{_HINT} (OpenGL said: {said})") from None
    return context


def shader_source(name: str) -> str:
    """A packaged file of `shaders`."""
    return (resources.files("shipland.sim.scene") / "shaders" / name).read_text(encoding="utf-8")


def program(context: moderngl.Context, vertex: str, fragment: tuple[str, ...], **defines: int) -> moderngl.Program:
    """A program of packaged sources, each after `common.glsl`, with whole-number macros."""
    version, rest = shader_source("common.glsl").split("\n", 1)
    macros = "".join(f"#define {key} {value}\n" for key, value in defines.items())
    linked = context.program(
        vertex_shader=f"{version}\n{macros}{rest}\n{shader_source(vertex)}",
        fragment_shader="\n".join([version, f"#define FRAGMENT\n{macros}{rest}", *map(shader_source, fragment)]),
    )
    block: Any = linked.get("FrameBlock", None)
    if block is not None:
        block.binding = 0
    return linked


def write_uniform(linked: moderngl.Program, name: str, value: npt.NDArray[np.floating]) -> None:
    """Set a uniform of any shape; rows of an array are what the shader has as columns."""
    uniform: Any = linked[name]
    uniform.write(value.astype(np.float32).tobytes())


def write_depth(context: moderngl.Context, on: bool) -> None:
    """Let what is drawn into the bound target hide what comes after it, or not (veils, mist)."""
    bound: Any = context.fbo
    bound.depth_mask = on


class RenderTarget:
    """A picture to draw into, 16 bits a channel; `samples` > 0 makes it multisampled."""

    def __init__(
        self, context: moderngl.Context, width_px: int, height_px: int, *, samples: int = 0, depth: bool = True
    ) -> None:
        self.size = (width_px, height_px)
        colour: Any = context.renderbuffer if samples else context.texture
        extra = {"samples": samples} if samples else {}
        attached = context.depth_renderbuffer(self.size, samples=samples) if depth else None
        self.colour = colour(self.size, 4, dtype=_UNORM_16, **extra)
        self.fbo = context.framebuffer([self.colour], attached)

    def use(self, width: int, height: int) -> None:
        """Draw into its first columns and rows."""
        self.fbo.use()
        self.fbo.viewport = (0, 0, width, height)

    def read(self, left: int, top: int, width: int, height: int) -> npt.NDArray[np.uint16]:
        """(height,width,4) of it."""
        pixels = np.empty((height, width, 4), np.uint16)
        self.fbo.read_into(pixels, viewport=(left, top, width, height), components=4, dtype=_UNORM_16)
        return pixels


def resolve(context: moderngl.Context, source: RenderTarget, drawn: RenderTarget, part: tuple[int, ...]) -> None:
    """Average the samples of a part (left, top, width, height) of the bound target into another of its size."""
    bound: Any = source.fbo
    bound.scissor = part  # the time that it takes is its size's
    context.copy_framebuffer(drawn.fbo, source.fbo)
    bound.scissor = None


def mipmapped(context: moderngl.Context, picture: npt.NDArray[np.uint8], *, layers: bool = False) -> Any:  # noqa: ANN401
    """A repeating trilinear texture from uint8 (H,W,C), or an array of them from (L,H,W,C) with `layers`."""
    if layers:
        count, height, width, channels = picture.shape
        texture: Any = context.texture_array((width, height, count), channels, picture.tobytes())
    else:
        height, width, channels = picture.shape
        texture = context.texture((width, height), channels, picture.tobytes())
    texture.build_mipmaps()
    texture.filter = (moderngl.LINEAR_MIPMAP_LINEAR, moderngl.LINEAR)
    return texture
