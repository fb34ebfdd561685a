"""A growing disc by newton's vertex block descent on the CPU (not ours; Apache-2): run it where newton is installed.

pip install newton scipy; python benchmarks/peers/newton_disc.py disc.npz out.npz STEP ...

disc.npz: points (n, 3), triangles (f, 3), growth (f,) of rest lengths. Writes the positions after the given steps and
the CPU seconds until then. Damped dynamics: velocities are cut by a tenth in every step.
"""

import sys
import time

import newton
import numpy as np
import warp as wp


def main(given: str, out: str, steps: list[int]) -> None:
    wp.config.quiet = True
    wp.init()
    wp.set_device("cpu")
    disc = np.load(given)
    points, triangles, growth = disc["points"], disc["triangles"], disc["growth"]
    builder = newton.ModelBuilder(gravity=(0.0, 0.0, 0.0))
    builder.add_cloth_mesh(
        pos=wp.vec3(0, 0, 0),
        rot=wp.quat_identity(),
        scale=1.0,
        vel=wp.vec3(0, 0, 0),
        vertices=[wp.vec3(*p) for p in points],
        indices=triangles.ravel().tolist(),
        density=1.0,
        tri_ke=1e3,
        tri_ka=1e3,
        tri_kd=1e-3,
        edge_ke=float(disc["edge_ke"]),
        edge_kd=1e-4,
        particle_radius=0.002,
    )
    builder.color(include_bending=True)
    model = builder.finalize(device="cpu")
    # rest lengths grow: the inverse rest edges shrink by as much
    model.tri_poses.assign((model.tri_poses.numpy() / growth[:, None, None]).astype(np.float32))
    model.tri_areas.assign((model.tri_areas.numpy() * growth**2).astype(np.float32))
    # rest angles are those of the flat sheet, without the noise
    model.edge_rest_angle.assign(0 * model.edge_rest_angle.numpy())
    solver = newton.solvers.SolverVBD(model, iterations=10, particle_enable_self_contact=False)
    now, then, control = model.state(), model.state(), model.control()
    solver.step(now, then, control, None, 2e-3)  # compile
    now = model.state()
    found, seconds, begun = [], [], time.process_time()
    for step in range(1, max(steps) + 1):
        solver.step(now, then, control, None, 2e-3)
        now, then = then, now
        now.particle_qd.assign(now.particle_qd.numpy() * 0.9)
        if step in steps:
            seconds.append(time.process_time() - begun)
            found.append(now.particle_q.numpy().copy())
            print(step, f"{seconds[-1]:.1f} s", flush=True)
    np.savez(out, positions=found, seconds=seconds, steps=steps, version=newton.__version__)


if __name__ == "__main__":
    main(sys.argv[1], sys.argv[2], [int(step) for step in sys.argv[3:]])
