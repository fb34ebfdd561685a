"""Spreading and reaction against closed forms: harmonics, travelling waves, conservation, order in time."""

import numpy as np
import pytest
import robust_laplacian
from scipy import sparse
from scipy.integrate import solve_ivp

from solver.contract import InvalidGeometry
from solver.decay import DecayParams
from solver.decay.fields.diffusion import linked, listed_around, rkl2, stages_for
from solver.decay.fields.gate import gates
from solver.decay.fields.layer import Layer
from solver.decay.fields.rates import Rates
from solver.decay.fields.reaction import react
from solver.decay.surfaces.surface import Surface, extent, geodesic, sampler, triangulated
from solver.fruit import directions, lattice

RATES = Rates(
    mobility=36.0, cap=0.01, consume=50.0, half=1.0, wither=50.0, a1=1 / 2400, a2=1 / 120, theta=0.05, feed=4e-4
)

NO_ROT = np.empty(0)


def line(count: int, length: float) -> Surface:
    """A line of cells, closed at its ends: the same data structure, one dimension."""
    h = length / (count - 1)
    near = [[j for j in (i - 1, i + 1) if 0 <= j < count] for i in range(count)]
    area = np.full(count, h)
    area[[0, -1]] = h / 2
    points = np.zeros((count, 3))
    points[:, 0] = np.linspace(0, length, count)
    start = np.concatenate([[0], np.cumsum([len(n) for n in near])])
    weight = np.full(start[-1], 1 / h)
    return Surface(points, np.zeros((0, 3), int), area, start, np.concatenate(near), weight, 4 / h**2)


def spread(s: Surface, y: np.ndarray, c: np.ndarray, scale: float, cap: float, dt: float, stages: int) -> np.ndarray:
    out = y.copy()
    everywhere = np.arange(len(y))
    links = linked(c, NO_ROT, everywhere, s.start, s.near, s.weight, s.area)
    rkl2(out, links, scale, cap, dt, stages, everywhere, s.area)
    return out


def laplacian(s: Surface, y: np.ndarray) -> np.ndarray:
    rows = np.repeat(np.arange(len(y)), np.diff(s.start))
    return np.bincount(rows, s.weight * (y[s.near] - y[rows]), len(y)) / s.area


def slope(errors: list[float], ratio: float = 2.0) -> float:
    return float(np.log(errors[-2] / errors[-1]) / np.log(ratio))


@pytest.mark.parametrize(
    ("degree", "harmonic"),
    [
        (2, lambda x, y, z: 3 * z**2 - 1),
        (4, lambda x, y, z: (x**3 - 3 * x * y**2) * z),
        (6, lambda x, y, z: ((x + 1j * y) ** 6).real),
    ],
)
def test_eigenvalues_of_the_sphere_come_with_order_two(degree, harmonic):
    errors = []
    for cells in (8, 16):
        sphere = triangulated(*geodesic(cells))
        y = harmonic(*sphere.points.T)
        value = -np.sum(sphere.area * y * laplacian(sphere, y)) / np.sum(sphere.area * y * y)
        errors.append(abs(value / (degree * (degree + 1)) - 1))
    assert errors[-1] < 0.02
    assert slope(errors) == pytest.approx(2, abs=0.1)


def test_a_harmonic_decays_at_its_rate():
    """exp(-l (l + 1) D t); the steps are long enough to need many stages, short enough not to show."""
    sphere = triangulated(*geodesic(16))
    y = 2 + sphere.points[:, 0] * sphere.points[:, 1]
    now, dt = y, 0.004
    stages = stages_for(dt, sphere.stiffest)
    assert stages > 3
    for _ in range(25):
        now = spread(sphere, now, np.ones_like(y), 1.0, 0.0, dt, stages)
    factor = np.sum(sphere.area * (now - 2) * (y - 2)) / np.sum(sphere.area * (y - 2) ** 2)
    assert factor == pytest.approx(np.exp(-6 * 0.1), rel=2e-3)


def test_super_time_steps_are_of_second_order():
    ring = line(65, 1.0)
    x = ring.points[:, 0]
    y = 1 + 0.5 * np.cos(np.pi * x)
    c = 1 + 0.3 * np.sin(2 * x)
    ends = []
    for steps in (8, 16, 32, 256):
        now, dt = y, 0.05 / steps
        for _ in range(steps):
            now = spread(ring, now, c, 1.0, 0.0, dt, stages_for(dt, 2 * ring.stiffest))
        ends.append(now)
    errors = [float(np.abs(e - ends[-1]).max()) for e in ends[:-1]]
    assert slope(errors) == pytest.approx(2, abs=0.25)


def numpy_twin(
    s: Surface, y: np.ndarray, c: np.ndarray, scale: float, cap: float, dt: float, stages: int
) -> np.ndarray:
    """RKL2 as Meyer, Balsara and Aslam print it, on whole arrays."""
    rows = np.repeat(np.arange(len(y)), np.diff(s.start))

    def flow(v: np.ndarray) -> np.ndarray:
        x = np.clip(v, 0, cap)
        phi = scale * (x**2 / 2 - x**3 / (3 * cap))
        mean = 2 * c[rows] * c[s.near] / (c[rows] + c[s.near])
        return np.bincount(rows, s.weight * mean * (phi[s.near] - phi[rows]), len(v)) / s.area

    b = [1 / 3, 1 / 3, 1 / 3] + [(j * j + j - 2) / (2 * j * (j + 1)) for j in range(3, stages + 1)]
    w = 4 / (stages**2 + stages - 2)
    levels = [y, y + b[1] * w * dt * flow(y)]
    for j in range(2, stages + 1):
        mu, nu = (2 * j - 1) / j * b[j] / b[j - 1], -(j - 1) / j * b[j] / b[j - 2]
        levels.append(
            mu * levels[-1]
            + nu * levels[-2]
            + (1 - mu - nu) * y
            + mu * w * dt * flow(levels[-1])
            - (1 - b[j - 1]) * mu * w * dt * flow(y)
        )
    return levels[-1]


def test_the_kernel_is_its_numpy_twin():
    sphere = triangulated(*geodesic(4))
    draw = np.random.default_rng(3)
    y, c = draw.uniform(0.002, 0.02, 162), draw.uniform(0.5, 1.5, 162)
    ours = spread(sphere, y, c, 36.0, 0.01, 0.05, 7)
    assert np.allclose(ours, numpy_twin(sphere, y, c, 36.0, 0.01, 0.05, 7), rtol=1e-12, atol=0)


def fronts(s: Surface, y: np.ndarray, cap: float, scale: float, rate: float, dt: float, steps: int, every: int):
    """Positions of y = 1/2 under logistic growth, exact in time, and spreading; Strang splitting."""
    found, c = [], np.ones_like(y)
    fastest = scale if cap <= 0 else scale * cap / 4
    stages = stages_for(dt, fastest * s.stiffest)
    for step in range(1, steps + 1):
        for half in (0, 1):
            y = y / (y + (1 - y) * np.exp(-rate * dt / 2))
            if half == 0:
                y = spread(s, y, c, scale, cap, dt, stages)
        if step % every == 0:
            i = int(np.flatnonzero(y > 0.5)[-1])
            found.append(s.points[i, 0] + (y[i] - 0.5) / (y[i] - y[i + 1]) * (s.points[1, 0] - s.points[0, 0]))
    return np.array(found), y


def test_fisher_s_exact_wave_comes_with_order_two():
    """Ablowitz and Zeppetella: u = (1 + exp((x - 5 t / sqrt 6) / sqrt 6))^-2 solves u_t = u_xx + u (1 - u)."""

    def exact(x: np.ndarray, t: float) -> np.ndarray:
        return (1 + np.exp((x - 40 - 5 / np.sqrt(6) * t) / np.sqrt(6))) ** -2.0

    errors = []
    for cells, steps in ((201, 20), (401, 40), (801, 80)):
        s = line(cells, 80.0)
        _, end = fronts(s, exact(s.points[:, 0], 0.0), 0.0, 1.0, 1.0, 4.0 / steps, steps, steps + 1)
        errors.append(float(np.abs(end - exact(s.points[:, 0], 4.0)).max()))
    assert errors[-1] < 1e-3
    assert slope(errors) == pytest.approx(2, abs=0.2)


def test_a_porous_front_runs_at_its_speed():
    """u_t = (u u_x)_x + u (1 - u): the sharp front of Aronson runs at sqrt(1/2). A cap of 1e6 makes D = u."""
    s = line(601, 30.0)
    x = s.points[:, 0]
    start = np.clip(1 - np.exp((x - 5) / np.sqrt(2)), 0, None)
    dt, every = 0.02, 250
    stages = stages_for(dt, s.stiffest)
    y, c, at = start, np.ones_like(x), []
    for step in range(1, 1001):
        for half in (0, 1):
            y = y / (y + (1 - y) * np.exp(-dt / 2))
            if half == 0:
                y = spread(s, y, c, 1.0, 1e6, dt, stages)
        if step % every == 0:
            i = int(np.flatnonzero(y > 0.5)[-1])
            at.append(x[i] + (y[i] - 0.5) / (y[i] - y[i + 1]) * (x[1] - x[0]))
    assert (at[-1] - at[0]) / (3 * every * dt) == pytest.approx(np.sqrt(0.5), rel=3e-3)
    assert y[x > at[-1] + 3].max() < 1e-12  # compact support: nothing ahead of the front


def test_reaction_keeps_the_total_and_the_sign_for_any_step():
    draw = np.random.default_rng(1)
    u, v, n = draw.uniform(0, 1, (3, 500)) * [[0.05], [0.02], [1.0]]
    n[:20] = 0.0
    u[20:40] = 0.0
    before = RATES.theta * n + u + v
    for dt in (1e-3, 0.1, 10.0, 1e4):
        react(u, v, n, np.arange(500), dt, RATES)
        assert min(u.min(), v.min(), n.min()) >= 0
        assert np.abs(RATES.theta * n + u + v - before).max() < 1e-16 * 50


def test_reaction_is_of_second_order():
    ends = []
    for steps in (40, 80, 160, 5120):
        u, v, n = np.array([0.004]), np.zeros(1), np.ones(1)
        for _ in range(steps):
            react(u, v, n, np.arange(1), 0.8 / steps, RATES)
        ends.append(np.concatenate([u, v, n]))
    errors = [float(np.linalg.norm(e - ends[-1])) for e in ends[:-1]]
    assert slope(errors) == pytest.approx(2, abs=0.2)


@pytest.fixture(scope="module")
def layer() -> Layer:
    sphere = triangulated(*geodesic(8))
    x, y, z = sphere.points.T
    return Layer(sphere, RATES, 0.8 + 0.2 * x * y, 1 + 0.3 * z)


def test_a_whole_step_keeps_the_budget_to_round_off_and_the_sign(layer):
    state = layer.seeded(layer.fresh, np.array([0.0, 1.0, 0.0]), 0.4)
    for _ in range(80):
        state = layer.advance(state, 0.05)
        assert min(state.u.min(), state.v.min(), state.n.min()) >= 0
    assert layer.share(state).max() > 0.3
    assert layer.budget_error(state) < 1e-14


def test_a_step_reacts_as_long_as_it_says():
    """Everything even: nothing spreads, and Eq. 2, 3, 7-9 are three ordinary equations, solved by another library."""

    def slopes(_: float, y: np.ndarray) -> list[float]:
        u, _v, n = y
        eaten = RATES.consume * n * u / (1 + RATES.half * n)
        tired = RATES.wither * u / ((1 + u / RATES.a1) * (1 + n / RATES.a2))
        return [RATES.theta * eaten - tired, tired, -eaten]

    sphere = triangulated(*geodesic(2))
    even = np.ones(len(sphere.points))
    plain = Layer(sphere, RATES, 0.9 * even, even)
    state = plain.fresh._replace(u=0.004 * even)
    for _ in range(100):
        state = plain.advance(state, 0.005)
    exact = solve_ivp(slopes, (0, 0.5), [0.004, 0.0, 0.9], rtol=1e-10, atol=1e-14).y[:, -1]
    assert exact[2] < 0.85  # a good part of 0.9 has been eaten
    for part, value in zip((state.u, state.v, state.n), exact, strict=True):
        assert part == pytest.approx(value, rel=2e-3)


def test_a_step_spreads_as_far_as_it_says():
    """Weak form on the unit sphere: cos(angle) is a harmonic of degree 1, so its moment of u falls by 2 of that of Phi.

    Nothing reacts; n = 0.8 and motility are even. Within one step of 0.002 days the moment of Phi falls by 1 %.
    """
    still = RATES._replace(consume=0.0, wither=0.0, feed=0.0)
    sphere = triangulated(*geodesic(16))
    even = np.ones(len(sphere.points))
    y = sphere.points[:, 1]
    plain = Layer(sphere, still, 0.8 * even, even)
    u = 0.004 * (1 + 0.5 * y)
    dt = 0.002
    then = plain.advance(plain.fresh._replace(u=u), dt).u
    phi = 0.8 * still.mobility * (u**2 / 2 - u**3 / (3 * still.cap))
    fall = np.sum(sphere.area * y * (u - then))
    assert fall == pytest.approx(2 * dt * np.sum(sphere.area * y * phi), rel=0.02)


def test_splitting_is_of_second_order(layer):
    """A smooth, wide colony whose spread and nutrients all move at once."""
    state = layer.seeded(layer.fresh, np.array([0.0, 1.0, 0.0]), 1.5)
    ends = []
    for steps in (4, 8, 16, 128):
        now = state
        for _ in range(steps):
            now = layer.advance(now, 0.2 / steps)
        ends.append(np.concatenate([now.u, now.v, RATES.theta * now.n]))
    errors = [float(np.linalg.norm(e - ends[-1]) / np.linalg.norm(ends[-1])) for e in ends[:-1]]
    assert slope(errors) == pytest.approx(2, abs=0.35), errors


def test_only_what_is_infected_is_listed_and_the_rest_would_not_matter(layer):
    state = layer.seeded(layer.fresh, np.array([0.0, 1.0, 0.0]), 0.4)
    s = layer.surface
    listed = listed_around(state.u, 1e-10, 3, s.start, s.near)
    assert 0 < len(listed) < len(state.u) / 3
    few, all_ = state.u.copy(), state.u.copy()
    for u, which in ((few, listed), (all_, np.arange(len(few)))):
        links = linked(state.n, NO_ROT, which, s.start, s.near, s.weight, s.area)
        rkl2(u, links, 36.0, 0.01, 0.02, 5, which, s.area)
    assert np.abs(few - all_).max() < 1e-10 * few.max()


def test_nothing_enters_where_the_gate_is_shut(layer):
    rot = np.where(layer.surface.points[:, 1] > 0.7, 1.0, 0.001)
    gate = gates(rot)
    state = layer.seeded(layer.fresh, np.array([0.0, 1.0, 0.0]), 0.4, gate)
    for _ in range(40):
        state = layer.advance(state, 0.05, rot)
    assert (state.u + state.v)[gate == 0].max() == 0
    assert state.u[gate > 0].min() > 0


@pytest.mark.parametrize("cells", [1, 3, 5, 6])
def test_a_geodesic_sphere_is_closed_even_and_holds_its_halves(cells):
    points, faces = geodesic(cells)
    assert points.shape == (10 * cells**2 + 2, 3)
    assert faces.shape == (20 * cells**2, 3)
    edges = np.sort(np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]]), axis=1)
    assert (np.unique(edges, axis=0, return_counts=True)[1] == 2).all()
    a, b, c = (points[faces[:, k]] for k in range(3))
    volumes = np.einsum("ti,ti->t", np.cross(a, b), c)
    assert volumes.min() > volumes.max() / 2.5
    twice, _ = geodesic(2 * cells)
    assert np.abs(points[:, None] - twice).sum(axis=-1).min(axis=1).max() < 1e-12


def test_obtuse_triangles_get_no_negative_weight():
    points = np.array([[x, y, 0.0] for y in np.linspace(0, 1, 6) for x in np.linspace(0, 12, 6)])
    points[:, 0] += 2.9 * points[:, 1]
    a = np.array([i + 6 * j for j in range(5) for i in range(5)])
    faces = np.concatenate([np.stack([a, a + 1, a + 7], 1), np.stack([a, a + 7, a + 6], 1)])
    sheet = triangulated(points, faces)
    assert sheet.weight.min() >= 0
    assert np.sum(sheet.area) == pytest.approx(12.0)


def test_a_mesh_that_is_delaunay_gets_the_weights_of_the_library():
    """Ours without the library where no edge wants to be flipped; its mollification moves them by 1e-5."""
    points, faces = geodesic(6)
    ours = triangulated(points * [1.0, 0.8, 1.1], faces)
    laplacian, mass = robust_laplacian.mesh_laplacian(points * [1.0, 0.8, 1.1], faces)
    theirs = sparse.csr_array(laplacian)
    rows = np.repeat(np.arange(len(points)), np.diff(ours.start))
    assert np.abs(ours.weight + theirs[rows, ours.near]).max() < 1e-4 * ours.weight.max()
    assert ours.area == pytest.approx(mass.diagonal(), rel=1e-4)


def test_area_and_volume_of_a_sphere():
    fruit = DecayParams(exocarp_thickness=0.1)
    assert extent(fruit) == pytest.approx((4 * np.pi * 1.1**2, 4 / 3 * np.pi * 1.1**3), rel=1e-5)


def test_a_surface_without_triangles_is_refused():
    with pytest.raises(InvalidGeometry, match="no triangles"):
        triangulated(np.zeros((0, 3)), np.zeros((0, 3), int))


def test_the_lattice_sees_what_the_mesh_holds():
    errors = []
    for cells in (4, 8):
        rays, _ = geodesic(cells)
        wanted = directions(*lattice(24)).reshape(-1, 3)
        errors.append(float(np.abs(sampler(cells, 24) @ rays - wanted).max()))
    assert slope(errors) == pytest.approx(2, abs=0.2)
