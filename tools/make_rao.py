"""Compute the motion responses (RAOs) of an FFG-7-like frigate and write `src/shipland/sim/data/frigate_rao.npz`.

    python tools/make_rao.py [--out FILE] [--zero-speed-forces]

Needs capytaine (`pip install capytaine`); takes less than a minute on one core. The package ships the table, so
nobody has to run this. Method:

1. A parametric hull with the main dimensions of the FFG-7 class; no lines plan of that class is behind it.
2. Radiation potentials at zero speed by capytaine (deep water, lid against irregular frequencies) on a grid of
   encounter frequencies.
3. Speed terms of Salvesen, Tuck and Faltinsen (1970), without the transom's end terms; the exciting forces by
   Haskind's relation, so that the scattered wave has the encounter frequency, as in their paper.
4. Added roll damping, 10 % of critical; weak course-keeping springs in surge, sway and yaw, which have no
   restoring force of their own and would drift without bound in a following sea.

Axes here are capytaine's: forward, port, up, origin midships on the waterline, time factor exp(-iωt). The table has
the ship's axes (forward, starboard, down) and the time factor exp(+iωt).
"""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import logging
import time
from dataclasses import dataclass, replace
from pathlib import Path

import capytaine as cpt
import numpy as np
import tyro
from scipy.integrate import trapezoid
from scipy.optimize import brentq

from shipland.sim.ship.sea import ResponseTable, SeaParameters, significant_amplitude

RHO, G = 1025.0, 9.81
KNOT_MPS = 0.514444

LENGTH_M, BEAM_M, DRAUGHT_M = 124.4, 13.7, 4.8  # waterline; FFG-7: 408 ft × 45 ft, draught 4.5–5 m
ROLL_PERIOD_S = 10.8  # fixes GM
ROLL_GYRADIUS_M = 0.38 * BEAM_M  # chosen: usual for frigates 0.35–0.40 B
PITCH_GYRADIUS_M = 0.25 * LENGTH_M  # usual value
ROLL_DAMPING = 0.10  # added, of critical: bilge keels, rudder, eddies
COURSE_KEEPING_RAD_S, COURSE_KEEPING_DAMPING = 0.06, 0.7  # chosen: far below every wave encounter that matters

ENCOUNTER_RAD_S = np.concatenate([np.arange(0.1, 1.0, 0.05), np.arange(1.0, 2.41, 0.1)])
OMEGA_RAD_S = np.concatenate([np.arange(0.10, 0.31, 0.05), np.arange(0.32, 0.901, 0.02), np.arange(0.95, 2.001, 0.05)])
SPEED_KN = np.arange(0.0, 15.1, 2.5)
HEADING_DEG = np.arange(0.0, 181.0, 5.0)

SHIP_FROM_CAPYTAINE = np.array([1.0, -1.0, -1.0, 1.0, -1.0, -1.0])


def half_hull_station(x: float) -> tuple[float, float, float]:
    """Half breadth [m], draught [m] and fullness exponent of the section at x ∈ [-L/2, L/2]."""
    xi = x / LENGTH_M
    breadth = 1.0 - 0.28 * (2.0 * xi) ** 2 if xi < 0.0 else 1.0 - (2.0 * xi) ** 1.5
    aft = np.clip((-0.05 - xi) / 0.45, 0.0, 1.0)
    draught = 1.0 - 0.85 * aft**1.6
    exponent = 2.0 - 0.8 * np.clip(2.0 * xi, 0.0, 1.0) ** 1.0
    return 0.5 * BEAM_M * max(breadth, 0.0), DRAUGHT_M * draught, exponent


def hull_mesh(stations: int = 37, levels: int = 7) -> cpt.Mesh:
    """Wetted hull with transom; sections are superellipses."""
    x_m = -0.5 * LENGTH_M * np.cos(np.linspace(0.0, np.pi, stations)) * 0.35 + 0.65 * np.linspace(
        -0.5 * LENGTH_M, 0.5 * LENGTH_M, stations
    )
    theta = np.linspace(0.0, 0.5 * np.pi, levels)
    points = np.zeros((stations, 2 * levels - 1, 3))
    for i, x in enumerate(x_m):
        half_breadth, draught, exponent = half_hull_station(x)
        y = half_breadth * np.cos(theta).clip(0.0) ** (2.0 / exponent)
        z = -draught * np.sin(theta).clip(0.0) ** (2.0 / exponent)
        points[i, :, 0] = x
        points[i, :, 1] = np.concatenate([-y, y[-2::-1]])
        points[i, :, 2] = np.concatenate([z, z[-2::-1]])
    index = np.arange(points.shape[0] * points.shape[1]).reshape(points.shape[:2])
    faces = [
        [index[i, j], index[i, j + 1], index[i + 1, j + 1], index[i + 1, j]]
        for i in range(stations - 1)
        for j in range(2 * levels - 2)
    ]
    last = 2 * levels - 2
    faces += [[index[0, j], index[0, last - j], index[0, last - j - 1], index[0, j + 1]] for j in range(levels - 1)]
    return cpt.Mesh(vertices=points.reshape(-1, 3), faces=faces, name="frigate")


@dataclass
class Radiation:
    """Zero-speed radiation on the hull for six modes about the origin.

    Attributes:
        centres, normals, areas: panels; normals point into the water.
        modes: (6, N) generalised normals.
        potential: (F, 6, N) potentials for unit velocity at `ENCOUNTER_RAD_S`.
    """

    centres: np.ndarray
    normals: np.ndarray
    areas: np.ndarray
    modes: np.ndarray
    potential: np.ndarray

    def potential_at(self, omega_e: float) -> np.ndarray:
        """(6, N), linear between the computed frequencies, conjugate for negative ones."""
        size = abs(omega_e)
        upper = int(np.clip(np.searchsorted(ENCOUNTER_RAD_S, size), 1, ENCOUNTER_RAD_S.size - 1))
        low, high = ENCOUNTER_RAD_S[upper - 1], ENCOUNTER_RAD_S[upper]
        weight = np.clip((size - low) / (high - low), 0.0, 1.0)
        value = (1.0 - weight) * self.potential[upper - 1] + weight * self.potential[upper]
        return value if omega_e >= 0.0 else value.conj()


def radiation(mesh: cpt.Mesh) -> Radiation:
    """Solve the radiation problems."""
    body = cpt.FloatingBody(
        mesh=mesh, lid_mesh=mesh.generate_lid(), dofs=cpt.rigid_body_dofs(rotation_center=(0, 0, 0)), name="frigate"
    )
    solver = cpt.BEMSolver()
    names = ["Surge", "Sway", "Heave", "Roll", "Pitch", "Yaw"]
    potential = np.zeros((ENCOUNTER_RAD_S.size, 6, mesh.nb_faces), dtype=complex)
    for i, omega in enumerate(ENCOUNTER_RAD_S):
        problems = [cpt.RadiationProblem(body=body, omega=omega, radiating_dof=name, rho=RHO, g=G) for name in names]
        for result in solver.solve_all(problems, n_jobs=1, progress_bar=False):
            potential[i, names.index(result.radiating_dof)] = result.potential[: mesh.nb_faces] / (-1j * omega)
    centres, normals = mesh.faces_centers, mesh.faces_normals
    modes = np.vstack([normals.T, np.cross(centres, normals).T])
    return Radiation(centres, normals, mesh.faces_areas, modes, potential)


@dataclass
class Ship:
    """Hydrostatics and masses.

    Attributes:
        volume_m3, waterplane_m2, buoyancy_z_m: of the mesh.
        centre: (3,) centre of gravity.
        gm_m: metacentric height.
        mass: (6, 6) about the centre of gravity.
        stiffness: (6, 6) about the centre of gravity.
        to_centre: (6, 6) modes about the centre of gravity from modes about the origin.
        roll_damping: added [N m s].
    """

    volume_m3: float
    waterplane_m2: float
    buoyancy_z_m: float
    centre: np.ndarray
    gm_m: float
    mass: np.ndarray
    stiffness: np.ndarray
    to_centre: np.ndarray
    roll_damping: float
    roll_rad_s: float


def added_mass(waves: Radiation, omega_e: float, to_centre: np.ndarray) -> np.ndarray:
    """Complex added mass A + iB/ω (6, 6) at zero speed."""
    psi = to_centre @ waves.potential_at(omega_e)
    modes = to_centre @ waves.modes
    value = -RHO * (modes * waves.areas) @ psi.T
    return 0.5 * (value + value.T)


def make_ship(waves: Radiation) -> Ship:
    """Place the centre of gravity so that the roll period is `ROLL_PERIOD_S`."""
    x, _, z = waves.centres.T
    nz = waves.normals[:, 2]
    volume = float(np.sum(-nz * -z * waves.areas))
    z_b = float(np.sum(-nz * -0.5 * z**2 * waves.areas)) / volume
    x_b = float(np.sum(-nz * -z * x * waves.areas)) / volume
    # waterplane integrals by stations
    s = np.linspace(-0.5 * LENGTH_M, 0.5 * LENGTH_M, 2001)
    y = np.array([half_hull_station(v)[0] for v in s])
    area = float(trapezoid(2 * y, s))
    x_f = float(trapezoid(2 * y * s, s)) / area
    transverse = float(trapezoid(2.0 / 3.0 * y**3, s)) / volume
    longitudinal = float(trapezoid(2 * y * s**2, s)) / volume
    mass = RHO * volume

    def with_height(z_g: float) -> Ship:
        centre = np.array([x_b, 0.0, z_g])
        to_centre = np.eye(6)
        to_centre[3, 1] = z_g
        to_centre[4, 0], to_centre[4, 2] = -z_g, x_b
        to_centre[5, 1] = -x_b
        gm = z_b + transverse - z_g
        stiffness = np.zeros((6, 6))
        stiffness[2, 2] = RHO * G * area
        stiffness[2, 4] = stiffness[4, 2] = -RHO * G * area * (x_f - x_b)
        stiffness[3, 3] = mass * G * gm
        gm_l = z_b - z_g + longitudinal
        stiffness[4, 4] = mass * G * gm_l - RHO * G * area * (2 * x_f * x_b - x_b**2)
        inertia = np.diag([mass] * 3 + [mass * r**2 for r in (ROLL_GYRADIUS_M, PITCH_GYRADIUS_M, PITCH_GYRADIUS_M)])
        return Ship(volume, area, z_b, centre, gm, inertia, stiffness, to_centre, 0.0, 0.0)

    target = 2.0 * np.pi / ROLL_PERIOD_S

    def misfit(z_g: float) -> float:
        ship = with_height(z_g)
        total = ship.mass[3, 3] + added_mass(waves, target, ship.to_centre)[3, 3].real
        return float(np.sqrt(max(ship.stiffness[3, 3], 0.0) / total)) - target

    ship = with_height(brentq(misfit, z_b, z_b + transverse))
    a44 = added_mass(waves, target, ship.to_centre)[3, 3].real
    critical = 2.0 * np.sqrt(ship.stiffness[3, 3] * (ship.mass[3, 3] + a44))
    ship.roll_damping, ship.roll_rad_s = ROLL_DAMPING * critical, target
    for i in (0, 1, 5):
        ship.stiffness[i, i] = COURSE_KEEPING_RAD_S**2 * ship.mass[i, i]
    return ship


SPEED_MODES = np.zeros((6, 6))
SPEED_MODES[4, 2], SPEED_MODES[5, 1] = 1.0, -1.0


def exciting_force(
    waves: Radiation, ship: Ship, omega: float, omega_e: float, speed: float, heading_rad: float
) -> np.ndarray:
    """(6,) Froude-Krylov and diffraction force for a wave of 1 m amplitude (crest at the origin at t = 0)."""
    k = omega**2 / G
    direction = np.array([np.cos(heading_rad), np.sin(heading_rad)])
    incident = -1j * G / omega * np.exp(k * waves.centres[:, 2] + 1j * k * (waves.centres[:, :2] @ direction))
    slope = k * incident * (waves.normals[:, 2] + 1j * (waves.normals[:, :2] @ direction))
    psi = ship.to_centre @ waves.potential_at(omega_e)
    modes = ship.to_centre @ waves.modes
    froude_krylov = -1j * RHO * omega * (modes @ (incident * waves.areas))
    return froude_krylov + RHO * ((1j * omega_e * psi + speed * (SPEED_MODES @ psi)) @ (slope * waves.areas))


def response(
    waves: Radiation, ship: Ship, omega: float, speed: float, heading_rad: float, zero_speed_forces: bool = False
) -> np.ndarray:
    """(6,) complex motion at the origin for a wave of 1 m amplitude."""
    omega_e = omega - omega**2 / G * speed * np.cos(heading_rad)
    omega_e = omega_e if abs(omega_e) > 1e-3 else 1e-3
    a = added_mass(waves, omega_e, ship.to_centre)
    radiated = (
        (1j * omega_e * np.eye(6) + speed * SPEED_MODES) @ a @ (-1j * omega_e * np.eye(6) + speed * SPEED_MODES.T)
    )
    damping = np.zeros((6, 6))
    damping[3, 3] = ship.roll_damping
    for i in (0, 1, 5):
        damping[i, i] = 2.0 * COURSE_KEEPING_DAMPING * COURSE_KEEPING_RAD_S * ship.mass[i, i]
    system = -(omega_e**2) * ship.mass - radiated - 1j * omega_e * damping + ship.stiffness
    at_speed = (omega, 0.0) if zero_speed_forces else (omega_e, speed)
    motion = np.linalg.solve(system, exciting_force(waves, ship, omega, *at_speed, heading_rad))
    motion[:3] += np.cross(motion[3:], -ship.centre)
    return motion


TABLE = Path(__file__).resolve().parents[1] / "src/shipland/sim/data/frigate_rao.npz"


def main(out: Path = TABLE, kept_radiation: Path | None = None, *, zero_speed_forces: bool = False) -> None:
    """Write the table and print what came out.

    Args:
        out: file to write.
        kept_radiation: file that keeps the potentials between runs.
        zero_speed_forces: exciting forces of a ship at rest, to compare with.
    """
    logging.getLogger("capytaine").setLevel(logging.ERROR)
    started = time.process_time()
    mesh = hull_mesh()
    if kept_radiation and kept_radiation.exists():
        with np.load(kept_radiation) as kept:
            waves = Radiation(**{name: kept[name] for name in kept.files})
    else:
        waves = radiation(mesh)
        if kept_radiation:
            np.savez(kept_radiation, **vars(waves))
    ship = make_ship(waves)
    block = ship.volume_m3 / (LENGTH_M * BEAM_M * DRAUGHT_M)
    print(f"panels {len(waves.areas)}, volume {ship.volume_m3:.0f} m3, C_B {block:.3f}, ", end="")
    print(f"C_WP {ship.waterplane_m2 / LENGTH_M / BEAM_M:.3f}, centre {np.round(ship.centre, 2)}, GM {ship.gm_m:.2f} m")
    natural = {"roll": ship.roll_rad_s}
    for name, i in (("heave", 2), ("pitch", 4)):

        def misfit(omega: float, i: int = i) -> float:
            total = ship.mass[i, i] + added_mass(waves, omega, ship.to_centre)[i, i].real
            return float(omega**2 * total - ship.stiffness[i, i])

        natural[name] = brentq(misfit, 0.5, 2.3)
    print("natural periods", {name: round(2 * np.pi / omega, 2) for name, omega in natural.items()})

    table = np.zeros((SPEED_KN.size, HEADING_DEG.size, OMEGA_RAD_S.size, 6), dtype=np.complex64)
    for i, speed_kn in enumerate(SPEED_KN):
        for j, heading_deg in enumerate(HEADING_DEG):
            for k, omega in enumerate(OMEGA_RAD_S):
                motion = response(waves, ship, omega, speed_kn * KNOT_MPS, np.radians(heading_deg), zero_speed_forces)
                table[i, j, k] = SHIP_FROM_CAPYTAINE * motion.conj()
    found = ResponseTable(
        speed_kn=SPEED_KN,
        heading_deg=HEADING_DEG,
        omega_rad_s=OMEGA_RAD_S,
        rao=table,
        natural_period_s=2 * np.pi / np.array([natural["heave"], natural["roll"], natural["pitch"]]),
        particulars=np.array([LENGTH_M, BEAM_M, DRAUGHT_M, ship.volume_m3, ship.gm_m, *ship.centre]),
    )
    out.parent.mkdir(parents=True, exist_ok=True)
    np.savez_compressed(out, **vars(found))
    sea = SeaParameters()
    for waves_from_deg in (120.0, 60.0):
        amplitude = significant_amplitude(replace(sea, waves_from_deg=waves_from_deg), found)
        amplitude[3:] = np.degrees(amplitude[3:])
        print(f"waves from {waves_from_deg:g}°: significant amplitudes {amplitude.round(2)}")
    size_kb = out.stat().st_size / 1024
    print(f"{out.name}: {size_kb:.0f} kB, {time.process_time() - started:.0f} s of CPU")


if __name__ == "__main__":
    tyro.cli(main)
