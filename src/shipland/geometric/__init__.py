"""The geometric camera: no picture, but what vision would make of one, with its errors."""
