"""Affine maps and quadratic costs, on which all other packages build."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import lru_cache
from types import MappingProxyType

import numpy as np
import numpy.typing as npt

from floatbase._validation import (
    MAX_MAGNITUDE,
    Array,
    Value,
    as_array,
    as_instance,
    as_integer,
    as_number,
    as_positive,
    numeric_copy,
    read_only,
    short_repr,
)
from floatbase.errors import InputError, explain_arguments

__all__ = ["Affine", "Quadratic"]

MAX_VARIABLES = 10_000  # a matrix with as many rows and columns takes 0.8 GB
CURVATURE_TOLERANCE = 1e-12  # curvature below this fraction of the largest counts as zero
# fraction of the largest curvature by which a curvature may be negative: rounding of pullbacks
_NEGATIVE_CURVATURE_TOLERANCE = 1e-9
# fraction of 1 + the largest |g| that a slope without curvature may have: rounding of pullbacks
_SLOPE_TOLERANCE = 1e-7

_NO_BLOCKS: Mapping[str, slice] = MappingProxyType({})


@dataclass(frozen=True, eq=False, init=False)
class Affine(Value):
    """The affine map x -> A x + b.

    `f(x)` evaluates the map, `f @ g` composes two maps, and `f["tau"]` is the map of one named
    block of the output. Maps can be added, multiplied by a number, and unpacked as `A, b = f`.

    Parameters
    ----------
    A : array_like, shape (m, n)
        Matrix of the map.
    b : array_like, shape (m,)
        Value of the map at x = 0.
    blocks : mapping of str to slice, optional
        Names of slices of the output.

    Raises
    ------
    InputError
        If the shapes do not match, or if an entry is not finite.

    Examples
    --------
    >>> f = fb.Affine([[1.0, 2.0]], [3.0])
    >>> f([1.0, 1.0])
    array([6.])
    >>> (f @ fb.Affine.linear(2.0 * np.eye(2))).A
    array([[2., 4.]])
    """

    _example = "fb.Affine(A, b)"
    A: Array
    b: Array
    blocks: Mapping[str, slice]
    __array_ufunc__ = None  # lets array + map, array * map and array @ map call the methods below

    def __init__(
        self, A: npt.ArrayLike, b: npt.ArrayLike, blocks: Mapping[str, slice] = _NO_BLOCKS
    ):
        # written directly, since user-defined tasks make a map at every tick
        values = self.__dict__
        values["A"] = A = as_array("A", A, (None, None))
        values["b"], values["blocks"] = as_array("b", b, (len(A),)), as_blocks(blocks)

    @staticmethod
    def linear(A: npt.ArrayLike) -> Affine:
        """Make the linear map x -> A x.

        Parameters
        ----------
        A : array_like, shape (m, n)
            Matrix of the map.

        Returns
        -------
        Affine
            Map with b = 0.
        """
        A = as_array("A", A, (None, None))
        return Affine(A, np.zeros(A.shape[0]))

    @staticmethod
    def identity(n: int) -> Affine:
        """Make the identity map x -> x.

        Parameters
        ----------
        n : int
            Size of x.

        Returns
        -------
        Affine
            Map with A = 1 and b = 0.
        """
        return _identity(as_dimension("n", n))

    @staticmethod
    def constant(b: npt.ArrayLike, n: int) -> Affine:
        """Make the constant map x -> b.

        Parameters
        ----------
        b : array_like, shape (m,)
            Value of the map.
        n : int
            Size of x.

        Returns
        -------
        Affine
            Map with A = 0.
        """
        b = as_array("b", b, (None,))
        return Affine(np.zeros((b.size, as_dimension("n", n))), b)

    @staticmethod
    def stack(**parts: Affine) -> Affine:
        """Stack the outputs of several maps of the same x.

        Parameters
        ----------
        **parts : Affine
            Maps with the same size of x.

        Returns
        -------
        Affine
            Map with one block for each part, named like its argument.

        Raises
        ------
        InputError
            If there are no parts, or if the sizes of x differ.
        """
        if not parts:
            raise InputError("stack needs at least one map, such as Affine.stack(tau=f).")
        widths = {name: as_instance(name, f, Affine).n_in for name, f in parts.items()}
        if len(set(widths.values())) > 1:
            raise InputError(
                f"Stacked maps must have the same input size, but their sizes are {widths}."
            )
        ends = np.cumsum([f.n_out for f in parts.values()])
        blocks = {
            name: slice(int(end) - f.n_out, int(end))
            for (name, f), end in zip(parts.items(), ends, strict=True)
        }
        A = np.vstack([f.A for f in parts.values()])
        return Affine(A, np.concatenate([f.b for f in parts.values()]), blocks)

    @property
    def n_in(self) -> int:
        """Size n of the input x."""
        return int(self.A.shape[1])

    @property
    def n_out(self) -> int:
        """Size m of the output A x + b."""
        return int(self.A.shape[0])

    def __call__(self, x: npt.ArrayLike) -> Array:
        """Evaluate A x + b for x of shape (n,), or (n, N) with one point in each column."""
        numeric = numeric_copy(x)
        x = as_array("x", x, (self.n_in,)) if numeric is None else numeric
        if x.ndim not in (1, 2) or x.shape[0] != self.n_in:
            raise InputError(
                f"x has shape {x.shape}, but this map needs shape ({self.n_in},) or "
                f"({self.n_in}, N)."
            )
        x = as_array("x", x, x.shape)
        return self.A @ x + (self.b if x.ndim == 1 else self.b[:, None])

    def __getitem__(self, block: str) -> Affine:
        """Return the map of one named block."""
        if not isinstance(block, str) or block not in self.blocks:
            raise InputError(
                f"This map has no block {short_repr(block)}. Its blocks are {list(self.blocks)}."
            )
        rows = self.blocks[block]
        return Affine(self.A[rows], self.b[rows])

    def __matmul__(self, inner: Affine) -> Affine:
        """Compose two maps, (f @ g)(x) = f(g(x)), with the block names of f."""
        if not isinstance(inner, Affine):
            raise InputError(
                "f @ g composes two Affine maps. To evaluate f at x, write f(x). To compose with a "
                "matrix B, write f @ Affine.linear(B)."
            )
        if inner.n_out != self.n_in:
            raise InputError(
                f"Cannot compose the maps: the output of the inner map has size {inner.n_out}, but "
                f"the input of the outer map has size {self.n_in}."
            )
        return Affine(self.A @ inner.A, self.A @ inner.b + self.b, self.blocks)

    def __add__(self, other: Affine | npt.ArrayLike) -> Affine:
        """Add two maps of the same sizes, or a map and a constant vector of shape (m,)."""
        if isinstance(other, Affine):
            if other.A.shape != self.A.shape:
                raise InputError(
                    f"Cannot add maps of shapes {self.A.shape} and {other.A.shape}. Their shapes "
                    f"must be equal."
                )
            return Affine(self.A + other.A, self.b + other.b, self.blocks)
        return Affine(self.A, self.b + as_array("the constant", other, (self.n_out,)), self.blocks)

    def __sub__(self, other: Affine | npt.ArrayLike) -> Affine:
        return self + (
            -1.0 * other
            if isinstance(other, Affine)
            else -as_array("the constant", other, (self.n_out,))
        )

    def __radd__(self, other: npt.ArrayLike) -> Affine:
        """Return constant + map, the same as map + constant."""
        return self + other

    def __rsub__(self, other: npt.ArrayLike) -> Affine:
        """Return the map x -> other - (A x + b)."""
        return -self + other

    def __rmul__(self, scale: float) -> Affine:
        """Return the map x -> scale (A x + b)."""
        scale = _as_factor("map", scale)
        return Affine(scale * self.A, scale * self.b, self.blocks)

    def __mul__(self, scale: float) -> Affine:
        """Return scale * map."""
        return self.__rmul__(scale)

    def __rmatmul__(self, outer: npt.ArrayLike) -> Affine:
        """Return the map x -> outer (A x + b) for a matrix `outer` of shape (p, m)."""
        return Affine.linear(as_array("the matrix", outer, (None, self.n_out))) @ self

    def __neg__(self) -> Affine:
        return -1.0 * self

    def __iter__(self) -> Iterator[Array]:
        """Iterate over A and b, so that `A, b = f` unpacks the map."""
        return iter((self.A, self.b))


@dataclass(frozen=True, eq=False)
class Quadratic(Value):
    """The quadratic cost x -> ½ xᵀ H x + gᵀ x + c.

    `cost(x)` evaluates it. Costs can be added and multiplied by a number.

    Parameters
    ----------
    H : array_like, shape (n, n)
        Hessian; the symmetric part is kept.
    g : array_like, shape (n,)
        Gradient at x = 0.
    c : float, optional
        Cost at x = 0 [unit of the cost].

    Raises
    ------
    InputError
        If the shapes do not match, or if an entry is not finite.

    Examples
    --------
    >>> cost = fb.Quadratic.from_residual(np.eye(2), [1.0, 2.0])
    >>> cost([1.0, 2.0])
    0.0
    >>> cost.minimizer()
    array([1., 2.])
    """

    _example = "fb.Quadratic(H, g)"
    H: Array
    g: Array
    c: float = 0.0
    __array_ufunc__ = None  # lets array * cost call the methods below, which refuse it

    def __post_init__(self) -> None:
        g = as_array("g", self.g, (None,))
        H = as_array("H", self.H, (g.size, g.size))
        object.__setattr__(self, "g", g)
        object.__setattr__(self, "H", read_only(0.5 * (H + H.T)))
        object.__setattr__(self, "c", as_number("c", self.c))

    @staticmethod
    def from_residual(A: npt.ArrayLike, r: npt.ArrayLike, weight: float = 1.0) -> Quadratic:
        """Make the cost (weight / 2) ‖A x - r‖².

        Parameters
        ----------
        A : array_like, shape (m, n)
            Matrix of the residual.
        r : array_like, shape (m,)
            Target of A x.
        weight : float, optional
            Weight ≥ 0, dimensionless or per squared unit of the residual.

        Returns
        -------
        Quadratic
            Cost on x.
        """
        A = as_array("A", A, (None, None))
        r = as_array("r", r, (A.shape[0],))
        w = as_positive("weight", weight, allow_zero=True)
        return Quadratic(w * A.T @ A, -w * A.T @ r, 0.5 * w * float(r @ r))

    @staticmethod
    def zero(n: int) -> Quadratic:
        """Make the cost that is zero everywhere.

        Parameters
        ----------
        n : int
            Size of x.

        Returns
        -------
        Quadratic
            Cost with H = 0, g = 0 and c = 0.
        """
        return Quadratic(np.zeros((as_dimension("n", n), n)), np.zeros(n))

    @property
    def n(self) -> int:
        """Size n of x."""
        return int(self.g.size)

    def __call__(self, x: npt.ArrayLike) -> float:
        """Evaluate the cost at x, shape (n,)."""
        x = as_array("x", x, (self.n,))
        return float(0.5 * x @ self.H @ x + self.g @ x + self.c)

    def gradient(self, x: npt.ArrayLike) -> Array:
        """Compute the gradient H x + g.

        Parameters
        ----------
        x : array_like, shape (n,)
            Point.

        Returns
        -------
        ndarray, shape (n,)
            Gradient at x.
        """
        return self.H @ as_array("x", x, (self.n,)) + self.g

    def pullback(self, f: Affine) -> Quadratic:
        """Pull the cost back through a map: x -> cost(f(x)).

        Parameters
        ----------
        f : Affine
            Map whose output is the argument of the cost.

        Returns
        -------
        Quadratic
            Cost on the input of f.

        Raises
        ------
        InputError
            If the output of f does not have the size of the cost.

        Notes
        -----
        [FBR]_, eqs. (15), (18).
        """
        if as_instance("f", f, Affine).n_out != self.n:
            raise InputError(
                f"Cannot pull the cost back: the output of the map has size {f.n_out}, but the "
                f"cost is on {self.n} variables."
            )
        return Quadratic(f.A.T @ self.H @ f.A, f.A.T @ (self.H @ f.b + self.g), self(f.b))

    def minimizer(self) -> Array:
        """Compute the point of least cost that has the smallest norm.

        Returns
        -------
        ndarray, shape (n,)
            Point of least cost.

        Raises
        ------
        InputError
            If the cost has no minimum.
        """
        return self.argmin_over(np.eye(self.n)).b

    def argmin_over(self, N: npt.ArrayLike) -> Affine:
        """Compute the point of least cost on x + span N, for every x.

        The least cost itself is `cost.pullback(cost.argmin_over(N))`. The result does not move
        along directions without cost.

        Parameters
        ----------
        N : array_like, shape (n, p)
            Orthonormal columns.

        Returns
        -------
        Affine
            Map from x to the point of least cost.

        Raises
        ------
        InputError
            If the cost has no minimum along the columns of N, because of negative curvature or of a
            slope without curvature.
        """
        N = as_array("N", N, (self.n, None))
        values, vectors = np.linalg.eigh(N.T @ self.H @ N)
        largest = float(np.abs(values).max(initial=0.0))
        if values.size and values[0] < -_NEGATIVE_CURVATURE_TOLERANCE * largest:
            raise InputError(
                f"The cost has no minimum: its smallest curvature is {values[0]:.3g}, but no "
                f"curvature may be negative."
            )
        curved = values > CURVATURE_TOLERANCE * largest
        slope = vectors.T @ (N.T @ self.g)
        if np.any(
            np.abs(slope[~curved])
            > _SLOPE_TOLERANCE * (1.0 + float(np.abs(self.g).max(initial=0.0)))
        ):
            raise InputError(
                "The cost has no minimum: it decreases without bound along a direction without "
                "curvature. Add a cost on this direction."
            )
        W = N @ vectors[:, curved]
        step = W / values[curved]
        return Affine(np.eye(self.n) - step @ (W.T @ self.H), -step @ slope[curved])

    def __add__(self, other: Quadratic) -> Quadratic:
        if not isinstance(other, Quadratic):
            return NotImplemented
        if other.n != self.n:
            raise InputError(
                f"Cannot add costs on {self.n} and {other.n} variables. Their numbers of variables "
                f"must be equal."
            )
        return Quadratic(self.H + other.H, self.g + other.g, self.c + other.c)

    def __rmul__(self, scale: float) -> Quadratic:
        scale = _as_factor("cost", scale)
        return Quadratic(scale * self.H, scale * self.g, scale * self.c)

    def __mul__(self, scale: float) -> Quadratic:
        """Return scale * cost."""
        return self.__rmul__(scale)


def _as_factor(kind: str, scale: object) -> float:
    """Return the factor of a map or cost as a float."""
    factor = numeric_copy(scale)
    if factor is not None and factor.ndim == 0 and abs(factor) <= MAX_MAGNITUDE:
        return float(factor)
    what = (
        f"an array of shape {scale.shape}" if isinstance(scale, np.ndarray) else short_repr(scale)
    )
    raise InputError(
        f"A {kind} can be multiplied only by a finite number, not by {what}. To compose maps, "
        f"write f @ g."
    )


def as_dimension(name: str, n: int) -> int:
    """Check the number of variables of a map or a cost.

    Parameters
    ----------
    name : str
        Name of the argument in messages.
    n : int
        Number of variables.

    Returns
    -------
    int
        The number, from 0 to `MAX_VARIABLES`.
    """
    return as_integer(name, n, 0, MAX_VARIABLES, "larger matrices do not fit in memory")


@lru_cache(maxsize=64)
def _identity(n: int) -> Affine:
    """Make the identity map on n variables."""
    return Affine(np.eye(n), np.zeros(n))


def as_blocks(blocks: Mapping[str, slice]) -> Mapping[str, slice]:
    """Check named slices and copy them into a read-only mapping.

    Parameters
    ----------
    blocks : mapping of str to slice
        Names of slices.

    Returns
    -------
    mapping of str to slice
        Read-only copy.
    """
    if blocks is _NO_BLOCKS or (type(blocks) is dict and not blocks):
        return _NO_BLOCKS  # most maps have none
    if isinstance(blocks, Mapping) and all(
        isinstance(k, str) and isinstance(v, slice) for k, v in blocks.items()
    ):
        return MappingProxyType(dict(blocks))
    raise InputError(
        f'blocks must map names to slices, as in {{"tau": slice(0, 12)}}, not {short_repr(blocks)}.'
    )


explain_arguments(globals())
