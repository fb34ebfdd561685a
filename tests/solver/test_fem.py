"""Reference elements and rules against closed forms, in exact fractions where there is one: scikit-fem is on trial."""

from __future__ import annotations

import itertools
import subprocess
import sys
from fractions import Fraction

import numpy as np
import pytest
import skfem

from solver.decay.body.material import inverse_edges
from solver.dehydration.implicit import hexahedron
from solver.dehydration.kernel import algebra, metric
from solver.fem import HEX8, HEX27, QUAD9, Box, gauss, lobatto, segment, tetrahedron_gradients

BOXES = [Box(1, 1), Box(2, 1), Box(8, 1), Box(1, 2), QUAD9, HEX8, HEX27]


def points_of(box: Box) -> np.ndarray:
    rng = np.random.default_rng(box.order)
    return np.concatenate([rng.uniform(-1, 1, (40, box.dimensions)), box.nodes, np.zeros((1, box.dimensions))])


@pytest.mark.parametrize("box", BOXES)
def test_each_function_is_one_at_its_own_node_alone(box: Box) -> None:
    assert box.shape(box.nodes) == pytest.approx(np.eye((box.order + 1) ** box.dimensions), abs=2e-14)


@pytest.mark.parametrize("box", BOXES)
def test_nodes_run_with_the_last_coordinate_fastest(box: Box) -> None:
    wanted = list(itertools.product(lobatto(box.order), repeat=box.dimensions))
    assert np.array_equal(box.nodes, wanted)


@pytest.mark.parametrize("box", BOXES)
def test_every_monomial_up_to_the_order_is_reproduced_with_its_slopes(box: Box) -> None:
    """Partition of unity is the monomial 1; each coordinate's power may be as high as the order."""
    at = points_of(box)
    shape, slopes = box.shape(at), box.gradients(at)
    for powers in itertools.product(range(box.order + 1), repeat=box.dimensions):
        at_nodes = np.prod(box.nodes**powers, axis=1)
        assert shape @ at_nodes == pytest.approx(np.prod(at**powers, axis=1), abs=3e-14)
        for axis, power in enumerate(powers):
            lowered = [p - (k == axis) if power else 0 for k, p in enumerate(powers)]
            exact = power * np.prod(at**lowered, axis=1)
            assert slopes[:, :, axis] @ at_nodes == pytest.approx(exact, abs=3e-13)


@pytest.mark.parametrize("order", [1, 2, 3, 8])
def test_segments_are_lagrange_s_polynomials_in_exact_fractions(order: int) -> None:
    nodes = [Fraction(float(node)) for node in lobatto(order)]
    at = gauss(order + 2)[0][:, 0]
    values, slopes = segment(order, at)
    for point, value, slope in zip(at, values, slopes, strict=True):
        t = Fraction(float(point))
        for own, a in enumerate(nodes):
            others = [b for b in nodes if b != a]
            exact = np.prod([(t - b) / (a - b) for b in others])
            assert value[own] == pytest.approx(float(exact), abs=1e-15)
            steep = sum(1 / (a - b) * np.prod([(t - c) / (a - c) for c in others if c != b]) for b in others)
            assert slope[own] == pytest.approx(float(steep), rel=1e-13, abs=2e-15)


def test_inner_nodes_of_lobatto_are_where_legendre_s_polynomial_is_level() -> None:
    for order in (2, 3, 5, 8):
        inner = lobatto(order)[1:-1]
        slope = np.polynomial.legendre.Legendre.basis(order).deriv()
        assert np.abs(slope(inner)).max() < 1e-12
        assert np.array_equal(lobatto(order), -lobatto(order)[::-1])
    assert lobatto(3)[2] == pytest.approx(5**-0.5, rel=1e-15)


@pytest.mark.parametrize(("count", "dimensions"), [(2, 1), (3, 1), (10, 1), (3, 2), (2, 3), (3, 3)])
def test_rules_are_exact_to_their_degree_and_not_beyond(count: int, dimensions: int) -> None:
    points, weights = gauss(count, dimensions)
    assert points.shape == (count**dimensions, dimensions)
    degrees = range(2 * count)
    for powers in itertools.product(degrees, repeat=dimensions):
        exact = np.prod([0 if power % 2 else 2 / (power + 1) for power in powers])
        assert weights @ np.prod(points**powers, axis=1) == pytest.approx(exact, abs=2e-14)
    beyond = weights @ points[:, 0] ** (2 * count)
    assert abs(beyond - 2**dimensions / (2 * count + 1)) > 1e-7
    with pytest.raises(ValueError, match="two points"):
        gauss(1)


def test_points_and_weights_are_those_of_the_closed_form() -> None:
    points, weights = gauss(3, 3)
    root = 0.6**0.5
    assert points == pytest.approx(np.array(list(itertools.product([-root, 0.0, root], repeat=3))), abs=2e-16)
    assert weights == pytest.approx([np.prod(w) for w in itertools.product([5 / 9, 8 / 9, 5 / 9], repeat=3)], rel=1e-14)


@pytest.mark.parametrize("box", [QUAD9, HEX8, HEX27])
def test_functions_are_mirrored_to_the_last_bit(box: Box) -> None:
    at = points_of(box)
    order = np.arange((box.order + 1) ** box.dimensions).reshape((box.order + 1,) * box.dimensions)
    for axis in range(box.dimensions):
        sign = np.where(np.arange(box.dimensions) == axis, -1.0, 1.0)
        back = np.flip(order, axis).ravel()
        moved = np.abs(box.nodes[:, axis]) == 1  # those in the middle are their own image
        assert np.array_equal(box.shape(at * sign)[:, back][:, moved], box.shape(at)[:, moved])


@pytest.mark.parametrize(
    ("box", "theirs"), [(QUAD9, skfem.ElementQuad2()), (HEX8, skfem.ElementHex1()), (HEX27, skfem.ElementHex2())]
)
def test_products_of_segments_are_scikit_fem_s_own_elements(box: Box, theirs: skfem.Element) -> None:
    at = points_of(box)
    for node, place in enumerate(box.nodes):
        (number,) = np.flatnonzero((2 * theirs.doflocs - 1 == place).all(axis=1))
        value, slope = theirs.lbasis((1 + at.T) / 2, int(number))
        assert box.shape(at)[:, node] == pytest.approx(value, abs=1e-14)
        assert pytest.approx(np.asarray(slope) / 2, abs=3e-14) == box.gradients(at)[:, node].T


def test_the_kernel_s_points_are_the_rule_s() -> None:
    """Its force is generated with 1 / sqrt 3 written out, in this order."""
    points, weights = gauss(2, 3)
    assert np.array_equal(metric.GAUSS_POINTS, points)
    assert np.array_equal(weights, algebra.CORE_WEIGHTS)
    assert sum(algebra.EXOCARP_WEIGHTS) == pytest.approx(8, rel=1e-15)


def test_the_mixed_element_integrates_its_own_volume() -> None:
    # a brick sheared and stretched: 8 det A
    a = np.array([[1.0, 0.2, 0.1], [0.0, 0.7, -0.3], [0.3, 0.1, 1.4]])
    corners = HEX27.nodes @ a.T
    jacobians = np.einsum("ai,qak->qik", corners, hexahedron.SHAPE_GRADIENTS)
    assert np.linalg.det(jacobians) @ hexahedron.WEIGHTS == pytest.approx(8 * np.linalg.det(a), rel=1e-14)


def test_tetrahedra_carry_affine_maps() -> None:
    assert np.array_equal(tetrahedron_gradients(), [[-1, -1, -1], [1, 0, 0], [0, 1, 0], [0, 0, 1]])
    rng = np.random.default_rng(5)
    points, f = rng.normal(size=(4, 3)), rng.normal(size=(3, 3))
    inverse = inverse_edges(points, np.arange(4)[None])[0]
    moved = points @ f.T + [1.0, 2.0, 3.0]
    assert (moved[1:] - moved[0]).T @ inverse == pytest.approx(f, abs=1e-12)


@pytest.mark.parametrize("module", ["service.app", "solver", "solver.registry", "solver.fem", "sweeps.commands"])
def test_it_is_imported_only_where_finite_elements_are(module: str) -> None:
    code = f"import sys, {module}; from solver import registry; [registry.get(n) for n in registry.names()];" + (
        "print('skfem' in sys.modules)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["False"]
