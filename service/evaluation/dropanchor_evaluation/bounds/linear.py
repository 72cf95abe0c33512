"""A linear model of named states, their transitions and their measurements, for the bound's recursion."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from dropanchor_evaluation.bounds.recursion import recursion
from dropanchor_service.estimation.columns import Array

Number = Array | float
WAVE_DAMPING = 0.45
"""Fits the correlation of the simulator's waves with a rms error of 0.1, whatever their lengths."""


@dataclass(frozen=True)
class Bound:
    """position: E[(x - x̂)² + (y - ŷ)²] after each instant, (n,) m². errors: of an efficient estimator, (n, draws, 2) m.

    The errors are drawn from the Gaussian whose covariance is the bound, with the correlation over time of a filter.
    """

    position: Array
    errors: Array


@dataclass
class LinearModel:
    """A model over n instants. Coefficients, variances and standard deviations are numbers or (n,).

    A state without any uncertainty is left out, with all its coefficients. The first two states must be x and y.
    """

    instants: int
    names: list[str] = field(default_factory=list)
    _exact: set[str] = field(default_factory=set)
    _prior: list[float] = field(default_factory=list)
    _growth: list[Array] = field(default_factory=list)
    _fresh: list[bool] = field(default_factory=list)
    _moves: list[tuple[int, int, Array]] = field(default_factory=list)
    _measured: list[tuple[Array, list[tuple[int, Array]]]] = field(default_factory=list)

    def state(self, name: str, std: float, growth: Number = 0.0) -> None:
        """Add a state with the standard deviation of its prior and the variance that each step adds."""
        if std == 0.0 and not np.any(growth):
            self._exact.add(name)
            return
        self._add(name, std, growth, fresh=False)

    def white(self, name: str, std: float) -> None:
        """Add a state that is drawn anew at every instant, before the others move."""
        self._add(name, std, 0.0, fresh=True)

    def gauss_markov(self, name: str, std: float, tau: float, dt: float) -> None:
        """Add a first-order Gauss-Markov process."""
        decay = math.exp(-dt / tau)
        self.state(name, std, std**2 * (1.0 - decay**2))
        self.move(name, name, decay - 1.0)

    def waves(self, name: str, std: float, lengths: tuple[float, float], du: Number) -> None:
        """Add a smooth process of log-uniform wavelengths over u as `name` and its derivative `name/du`.

        It is a second-order Gauss-Markov process with the standard deviation of the value and of the slope of the
        waves. du: the change of u in each step.
        """
        short, long = (2.0 * math.pi / length for length in lengths)
        w = math.sqrt((short**2 - long**2) / (2.0 * math.log(short / long)))
        self.state(name, std)
        self.state(f"{name}/du", std * w, 4.0 * WAVE_DAMPING * w**3 * std**2 * np.asarray(du))
        self.move(name, f"{name}/du", du)
        self.move(f"{name}/du", name, -(w**2) * np.asarray(du))
        self.move(f"{name}/du", f"{name}/du", -2.0 * WAVE_DAMPING * w * np.asarray(du))

    def move(self, name: str, by: str, coefficient: Number) -> None:
        """Add `coefficient` times `by` (before the step) to a state in each step. The first instant has no step."""
        if self._known(name) and self._known(by):
            self._moves.append((self.names.index(name), self.names.index(by), self._column(coefficient)))

    def observe(self, std: Number, coefficients: Mapping[str, Number], at: NDArray[np.bool_] | None = None) -> None:
        """Add a measurement with white noise at every instant, or where `at` is true."""
        variance = self._column(std) ** 2
        if at is not None:
            variance = np.where(at, variance, np.inf)
        terms = [(self.names.index(n), self._column(c)) for n, c in coefficients.items() if self._known(n)]
        if terms:
            self._measured.append((variance, terms))

    def bound(self, draws: int, seed: int) -> Bound:
        """Return the bound, and the errors of `draws` efficient estimators."""
        terms = [term for _, own in self._measured for term in own]
        firsts = np.cumsum([0, *(len(own) for _, own in self._measured)])
        position, errors = recursion(
            np.diag(np.array(self._prior) ** 2),
            np.array(self._fresh),
            np.column_stack(self._growth),
            np.array([(to, by) for to, by, _ in self._moves]),
            np.column_stack([coefficient for *_, coefficient in self._moves]),
            firsts,
            np.array([index for index, _ in terms]),
            np.column_stack([coefficient for _, coefficient in terms]),
            np.column_stack([variance for variance, _ in self._measured]),
            draws,
            seed,
        )
        return Bound(position, errors)

    def _add(self, name: str, std: float, growth: Number, fresh: bool) -> None:
        self.names.append(name)
        self._prior.append(std)
        self._growth.append(self._column(growth))
        self._fresh.append(fresh)

    def _known(self, name: str) -> bool:
        if name not in self.names and name not in self._exact:
            raise KeyError(f"there is no state {name!r}")
        return name in self.names

    def _column(self, value: Number) -> Array:
        return np.broadcast_to(np.asarray(value, float), self.instants)
