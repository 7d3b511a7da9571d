"""Components of a contact force, the friction cone, and its polyhedral approximation.

A force is what the ground exerts on the robot, shape (3,), world frame [N]. Normals point out of
the ground. Source: [FBR]_, §4.2.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal, TypeAlias

import numpy as np
import numpy.typing as npt

from floatbase._validation import (
    Array,
    Value,
    as_array,
    as_bool,
    as_integer,
    as_number,
    as_positive,
    cached_property,
    checked,
    read_only,
    unit_vector,
)
from floatbase.friction._polytopes import MAX_FACETS

TOLERANCE = 1e-9  # N, by which `contains` lets a force lie outside: rounding of forces up to 1 MN
# fraction of the friction limit μ α_⊥ within which a force counts as on the surface: measured
# forces scatter
ACTIVE_TOLERANCE = 0.02

Status: TypeAlias = Literal["inside", "active", "outside"]


def tangents(normal: npt.ArrayLike) -> Array:
    """Return two unit vectors t1, t2 that span the tangent plane, with t1 × t2 = normal.

    Parameters
    ----------
    normal : array_like, shape (3,)
        Normal in the world frame; it is normalized.

    Returns
    -------
    ndarray, shape (2, 3)
        t1 and t2 as rows, in the world frame. t1 is the projection of the world's x axis onto the
        tangent plane, or of the y axis if the x axis is nearly normal to that plane.

    Raises
    ------
    InputError
        If `normal` is zero.
    """
    n = unit_vector("normal", normal)
    axis = np.array([1.0, 0.0, 0.0]) if abs(n[0]) < 0.9 else np.array([0.0, 1.0, 0.0])
    t1 = axis - n * (n @ axis)
    t1 /= np.linalg.norm(t1)
    return read_only([t1, np.cross(n, t1)])


@dataclass(frozen=True, eq=False)
class Decomposition(Value):
    """Normal and tangential components of a contact force, f = f_perp + f_par.

    Parameters
    ----------
    f_perp : ndarray, shape (3,)
        Normal component n nᵀ f in the world frame [N].
    f_par : ndarray, shape (3,)
        Tangential component (I - n nᵀ) f in the world frame [N].
    alpha_perp : float
        Normal force α_⊥ = nᵀ f, negative if the force pulls on the ground [N].
    alpha_par : float
        Tangential force α_∥ = ‖f_par‖ ≥ 0 [N].

    Notes
    -----
    [FBR]_, Figure 3.
    """

    f_perp: Array
    f_par: Array
    alpha_perp: float
    alpha_par: float


def decompose(force: npt.ArrayLike, normal: npt.ArrayLike) -> Decomposition:
    """Split a contact force into its normal and tangential components.

    Parameters
    ----------
    force : array_like, shape (3,)
        Contact force in the world frame [N].
    normal : array_like, shape (3,)
        Normal of the ground in the world frame, pointing out of the ground; it is normalized.

    Returns
    -------
    Decomposition
        The components and their magnitudes. Friction requires α_∥ ≤ μ α_⊥.

    Raises
    ------
    InputError
        If an argument has the wrong shape, or if `normal` is zero.

    Notes
    -----
    [FBR]_, eq. (28) and Figure 3.

    Examples
    --------
    >>> parts = decompose([3.0, 4.0, 10.0], [0.0, 0.0, 1.0])
    >>> parts.alpha_perp, parts.alpha_par
    (10.0, 5.0)
    """
    f, n = as_array("force", force, (3,), "N"), unit_vector("normal", normal)
    alpha = float(n @ f)
    f_par = f - alpha * n
    return Decomposition(
        read_only(alpha * n), read_only(f_par), alpha, float(np.linalg.norm(f_par))
    )


@dataclass(frozen=True, eq=False)
class FrictionCone(Value):
    """Circular cone of the contact forces that Coulomb friction allows, α_∥ ≤ μ α_⊥.

    The ground only pushes: α_⊥ ≥ 0.

    Parameters
    ----------
    normal : array_like, shape (3,)
        Normal of the ground in the world frame, pointing out of the ground; it is normalized.
    mu : float
        Coefficient of friction μ > 0 [-].

    Notes
    -----
    [FBR]_, eq. (28).

    Examples
    --------
    >>> cone = FrictionCone([0.0, 0.0, 1.0], 0.5)
    >>> cone.contains([3.0, 0.0, 10.0]), cone.margin([3.0, 0.0, 10.0])
    (True, 2.0)
    """

    normal: Array = field(metadata=checked(unit_vector))
    mu: float = field(metadata=checked(as_positive))

    @property
    def angle(self) -> float:
        """Angle between the normal and the surface of the cone, arctan μ [rad]."""
        return float(np.arctan(self.mu))

    def margin(self, force: npt.ArrayLike) -> float:
        """Return the slack of the friction constraint, μ α_⊥ - α_∥.

        Parameters
        ----------
        force : array_like, shape (3,)
            Contact force in the world frame [N].

        Returns
        -------
        float
            Tangential force that may be added in any direction before the foot slips [N]. The slack
            is negative outside the cone. Divided by √(1 + μ²), it is the distance to the surface of
            the cone.
        """
        parts = decompose(force, self.normal)
        return self.mu * parts.alpha_perp - parts.alpha_par

    def contains(self, force: npt.ArrayLike, tolerance: float = TOLERANCE) -> bool:
        """Return whether friction can produce a force, that is, whether margin ≥ -tolerance.

        Parameters
        ----------
        force : array_like, shape (3,)
            Contact force in the world frame [N].
        tolerance : float, optional
            Margin by which the force may lie outside [N].

        Returns
        -------
        bool
            True if the force lies in the cone.

        Notes
        -----
        [FBR]_, eq. (28).
        """
        return self.margin(force) >= -as_positive("tolerance", tolerance, "N", allow_zero=True)

    def status(self, force: npt.ArrayLike) -> Status:
        """Classify a force as inside the cone, on its surface or outside.

        Parameters
        ----------
        force : array_like, shape (3,)
            Contact force in the world frame [N].

        Returns
        -------
        {"inside", "active", "outside"}
            "active" means on the surface, to within `ACTIVE_TOLERANCE` of μ α_⊥.

        Notes
        -----
        [FBR]_, eq. (28).
        """
        f = as_array("force", force, (3,), "N")
        alpha = float(self.normal @ f)  # as in `decompose`, but faster: pictures need many
        return _status(float(np.linalg.norm(f - alpha * self.normal)), self.mu * alpha)

    def project(self, force: npt.ArrayLike) -> Array:
        """Return the force of the cone that is nearest to a given force.

        Parameters
        ----------
        force : array_like, shape (3,)
            Contact force in the world frame [N].

        Returns
        -------
        ndarray, shape (3,)
            The Euclidean projection onto the cone, in the world frame [N].

        Notes
        -----
        A force inside the cone does not change. A force of the polar cone, μ α_∥ ≤ -α_⊥, gives
        zero. Any other force is projected at a right angle onto the line n + μ f_par / α_∥ of the
        surface.
        """
        parts = decompose(force, self.normal)
        if parts.alpha_par <= self.mu * parts.alpha_perp:
            return as_array("force", force, (3,), "N")
        scale = max(0.0, parts.alpha_perp + self.mu * parts.alpha_par) / (1.0 + self.mu**2)
        if not scale:
            return read_only(np.zeros(3))
        return read_only(scale * (self.normal + self.mu * parts.f_par / parts.alpha_par))


@dataclass(frozen=True, eq=False)
class FrictionPolyhedron(Value):
    """Polyhedral approximation of a friction cone, with n facets: linear constraints on the force.

    Parameters
    ----------
    normal : array_like, shape (3,)
        Normal of the ground in the world frame, pointing out of the ground; it is normalized.
    mu : float
        Coefficient of friction μ > 0 [-].
    facets : int, optional
        Number of facets n ≥ 3.
    inner_approximation : bool, optional
        If True, the polyhedron lies inside the cone: this is safe, since it allows no force that
        slips. The middle of a facet then allows μ cos(π/n), and only the edges reach μ. If False,
        the polyhedron lies outside and touches the cone: this is optimistic.
    facet_rotation : float, optional
        Angle by which all facets are rotated about the normal [rad]. At zero, facet 0 faces t1 of
        `tangents`.

    Notes
    -----
    [FBR]_, eq. (28).

    Examples
    --------
    >>> inner = FrictionPolyhedron([0.0, 0.0, 1.0], 0.5)
    >>> inner.face_matrix.shape
    (4, 3)
    """

    _example = "FrictionPolyhedron(normal, mu)"
    normal: Array = field(metadata=checked(unit_vector))
    mu: float = field(metadata=checked(as_positive))
    facets: int = field(
        default=4, metadata=checked(as_integer, 3, MAX_FACETS, "μ is never known more accurately")
    )
    inner_approximation: bool = field(default=True, metadata=checked(as_bool))
    facet_rotation: float = field(default=0.0, metadata=checked(as_number, "rad"))

    @property
    def mu_facet(self) -> float:
        """Friction that the middle of a facet allows: μ cos(π/n) inside the cone, μ outside [-]."""
        return self.mu * float(np.cos(np.pi / self.facets)) if self.inner_approximation else self.mu

    @property
    def area_ratio(self) -> float:
        """Ratio of the cross-section's area to that of the cone [-].

        The ratio is sin(2π/n) / (2π/n) for an inner approximation, tan(π/n) / (π/n) for an outer
        one.
        """
        half = np.pi / self.facets
        return float(
            np.sin(2.0 * half) / (2.0 * half) if self.inner_approximation else np.tan(half) / half
        )

    @cached_property
    def face_matrix(self) -> Array:
        """Face matrix, shape (n, 3): face_matrix @ f ≤ 0 for every f in the polyhedron.

        Row i is d_i - μ_facet · normal, where d_i is the unit tangent that facet i faces. Together
        the rows imply normal · f ≥ 0.
        """
        return read_only(self._directions(0.0) - self.mu_facet * self.normal)

    @cached_property
    def rays(self) -> Array:
        """Edges, shape (n, 3), world frame, each with normal component 1.

        Ray i lies between facets i and i + 1.
        """
        return read_only(
            self.normal + self.mu_facet / np.cos(np.pi / self.facets) * self._directions(0.5)
        )

    def margin(self, force: npt.ArrayLike) -> float:
        """Return the tangential force that may be added before a facet is reached.

        Parameters
        ----------
        force : array_like, shape (3,)
            Contact force in the world frame [N].

        Returns
        -------
        float
            The minimum of -face_matrix @ f; negative outside [N].
        """
        return float(np.min(-self.face_matrix @ as_array("force", force, (3,), "N")))

    def contains(self, force: npt.ArrayLike, tolerance: float = TOLERANCE) -> bool:
        """Return whether a force lies in the polyhedron, that is, whether margin ≥ -tolerance.

        Parameters
        ----------
        force : array_like, shape (3,)
            Contact force in the world frame [N].
        tolerance : float, optional
            Margin by which the force may lie outside [N].

        Returns
        -------
        bool
            True if the force lies in the polyhedron.
        """
        return self.margin(force) >= -as_positive("tolerance", tolerance, "N", allow_zero=True)

    def status(self, force: npt.ArrayLike) -> Status:
        """Classify a force as inside the polyhedron, on a facet or outside.

        Parameters
        ----------
        force : array_like, shape (3,)
            Contact force in the world frame [N].

        Returns
        -------
        {"inside", "active", "outside"}
            "active" means on a facet, to within `ACTIVE_TOLERANCE` of the limit μ_facet α_⊥.
        """
        tangential, limit = self._tangential_forces(force)
        return _status(float(tangential.max()), limit)

    def active_facets(self, force: npt.ArrayLike) -> tuple[int, ...]:
        """Return the facets that a force has reached (within `ACTIVE_TOLERANCE`) or passed.

        Parameters
        ----------
        force : array_like, shape (3,)
            Contact force in the world frame [N].

        Returns
        -------
        tuple of int
            Indices of the facets; empty if the force pulls on the ground.
        """
        tangential, limit = self._tangential_forces(force)
        if limit <= 0.0:
            return ()
        return tuple(np.flatnonzero(tangential > (1.0 - ACTIVE_TOLERANCE) * limit).tolist())

    def project(self, force: npt.ArrayLike) -> Array:
        """Return the force of the polyhedron that is nearest to a given force.

        Parameters
        ----------
        force : array_like, shape (3,)
            Contact force in the world frame [N].

        Returns
        -------
        ndarray, shape (3,)
            The Euclidean projection onto the polyhedron, min ‖raysᵀ w - f‖ over weights w ≥ 0, in
            the world frame [N].
        """
        from scipy.optimize import nnls  # slow to load, and rarely needed

        f = as_array("force", force, (3,), "N")
        if self.margin(f) >= 0.0:
            return f
        size = np.linalg.norm(f)
        return read_only(size * (self.rays.T @ nnls(self.rays.T, f / size)[0]))

    def _tangential_forces(self, force: npt.ArrayLike) -> tuple[Array, float]:
        """Return the force along each facet's d_i, (n,) [N], and the limit μ_facet α_⊥ [N]."""
        f = as_array("force", force, (3,), "N")
        limit = self.mu_facet * float(self.normal @ f)
        return self.face_matrix @ f + limit, limit

    def _directions(self, shift: float) -> Array:
        """Return unit tangents, shape (n, 3), rotated by `shift` times the angle of a facet."""
        angles = self.facet_rotation + 2.0 * np.pi * (np.arange(self.facets) + shift) / self.facets
        t1, t2 = tangents(self.normal)
        return np.outer(np.cos(angles), t1) + np.outer(np.sin(angles), t2)


def _status(tangential: float, limit: float) -> Status:
    """Classify a tangential force against its limit [N], which is negative if the force pulls."""
    if tangential > (1.0 + ACTIVE_TOLERANCE) * limit:
        return "outside"
    return "active" if tangential > (1.0 - ACTIVE_TOLERANCE) * limit else "inside"
