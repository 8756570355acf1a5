"""Can this machine draw off screen? Exits 0 when an EGL device takes OpenGL, else 1 with the reason on one line.

Standard library only: it runs before anything is installed.
"""

import ctypes
import sys

EGL_OPENGL_API = 0x30A2
EGL_PLATFORM_DEVICE_EXT = 0x313F
MOST_DEVICES = 16


def reason_why_not() -> str | None:
    """What stands in the way of off-screen OpenGL, or None."""
    for name in ("libEGL.so.1", "libGL.so.1"):
        try:
            ctypes.CDLL(name)
        except OSError:
            return f"{name} is missing"
    egl = ctypes.CDLL("libEGL.so.1")
    egl.eglGetProcAddress.restype = ctypes.c_void_p
    query_address = egl.eglGetProcAddress(b"eglQueryDevicesEXT")
    display_address = egl.eglGetProcAddress(b"eglGetPlatformDisplayEXT")
    if not query_address or not display_address:
        return "libEGL.so.1 knows no devices"
    query_devices = ctypes.CFUNCTYPE(
        ctypes.c_uint, ctypes.c_int, ctypes.POINTER(ctypes.c_void_p), ctypes.POINTER(ctypes.c_int)
    )(query_address)
    get_display = ctypes.CFUNCTYPE(ctypes.c_void_p, ctypes.c_uint, ctypes.c_void_p, ctypes.c_void_p)(display_address)
    devices, count = (ctypes.c_void_p * MOST_DEVICES)(), ctypes.c_int()
    query_devices(MOST_DEVICES, devices, ctypes.byref(count))
    for device in devices[: count.value]:
        display = ctypes.c_void_p(get_display(EGL_PLATFORM_DEVICE_EXT, device, None))
        if display.value and egl.eglInitialize(display, None, None):
            usable = egl.eglBindAPI(EGL_OPENGL_API)
            egl.eglTerminate(display)
            if usable:
                return None
    return "no EGL device has a driver"


if __name__ == "__main__":
    reason = reason_why_not()
    if reason:
        print(reason)
    sys.exit(1 if reason else 0)
