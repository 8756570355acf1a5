"""Rotations of `frames` for compiled callers."""

from __future__ import annotations

from shipland.compiled import compiled
from shipland.frames import euler_from_quaternion, quaternion_from_euler, rows_from_euler, rows_from_quaternion

rows_of_euler = compiled(rows_from_euler)
rows_of_quaternion = compiled(rows_from_quaternion)
euler_of_quaternion = compiled(euler_from_quaternion)
quaternion_of_euler = compiled(quaternion_from_euler)
