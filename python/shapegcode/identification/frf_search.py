"""Searches for modes in frequency responses: poles stable over model orders and bands, fitted window by window."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy.linalg

from shapegcode.errors import ArgumentError
from shapegcode.identification.frf_model import Lines, ModalFit, fit_modes, mode_columns
from shapegcode.identification.problem import Starts
from shapegcode.io.record import ComplexArray
from shapegcode.io.units import FloatArray

_BAND = 1.8  # upper end of a band of poles over its lower end
_STEP = 1.3  # ratio from band to band
_EDGE = 1.05  # poles this near to the end of a band belong to the next one
_SAME, _SAME_DAMPING = 0.35, 0.4  # poles count as one: distance in half-power half widths, and in ln zeta
_CORE = 1.35  # upper end of a window over its lower end
_MARGIN = 1.3  # a window's lines extend beyond its ends by this factor
_BESIDE = 0.02, 3.0  # relative distance beyond the lines within which modes are fitted: constant; per damping ratio
STABLE = 0.34  # a pole found in this fraction of the higher orders is fitted from the start
_SEEN = 0.12  # ... is tried later
_CLEARLY = 40.0  # times ln(samples): a mode is certainly needed if the fit without it, not refitted, is worse by more
_QUICK, _FULL = (8, 1e-3), (40, 1e-8)  # iterations, and the gain that ends them
_TRIED, _WEAKEST = 3, 2
_MORE_REAL = 2  # real modes may exceed 1.5 times the complex ones by this number
_UNUSUAL = 2.0  # times the median residual: a mode with more near it may be two
_FEW = 350  # lines of a window used in trials
_BAND_LINES = 48  # least lines of a band or window
_MAX_CHANGES, _ROUNDS = 60, 4  # largest number of changes of a model: with few lines, then with all
_MAX_MODES = 24  # of a window
_FEWEST = 12  # a window with no more lines is not fitted
_CLEAR, _OPPOSED = 6.0, 8.0  # gain needed by a mode beyond the information criterion; more if opposite to the force
_TWINS = 0.02  # modes nearer than this fraction of half their half-power width are one
_NO_VIBRATION = 0.5


@dataclass(frozen=True)
class Pole:
    """A pole of a model of some order in some band."""

    omega: float  # rad/s
    zeta: float
    order: int


@dataclass(frozen=True)
class StablePole:
    """A pole that occurs in models of several orders (stabilisation)."""

    omega: float  # rad/s
    zeta: float
    share: float  # fraction of the models of higher order that contain it


def candidates_of(parts: Sequence[Lines]) -> tuple[list[StablePole], list[Pole]]:
    """Poles stable over model orders and bands, ascending, and all poles."""
    low = min(float(lines.omega[0]) for lines in parts)
    high = max(float(lines.omega[-1]) for lines in parts)
    begin, found, everything = low, [], []
    while begin < high / _EDGE:
        end = _upper_end(parts, begin, _BAND, high)
        poles = band_poles(parts, begin, end)
        first = begin if begin == low else begin * _EDGE
        last = end if end == high else end / _EDGE
        kept = [pole for pole in poles if first <= pole.omega <= last]
        everything += kept
        highest = max((pole.order for pole in poles), default=0)
        orders = {pole.order for pole in poles if pole.order > highest // 3}
        found += _clusters([pole for pole in kept if pole.order in orders], len(orders))
        begin *= _STEP
    candidates: list[StablePole] = []
    for each in sorted(found, key=lambda each: -each.share):
        if each.share >= _SEEN and not any(_same(each, other) for other in candidates):
            candidates.append(each)
    return sorted(candidates, key=lambda each: each.omega), everything


def _clusters(poles: list[Pole], orders: int) -> list[StablePole]:
    """Group the poles of one band by mode; values are medians over the half of a group with the highest orders."""
    left = sorted(poles, key=lambda pole: -pole.order)
    found = []
    while left:
        near = [pole for pole in left if _same(left[0], pole)]
        top = near[: max(1, len(near) // 2)]
        share = len({pole.order for pole in near}) / orders
        omega, zeta = (float(np.median([getattr(pole, name) for pole in top])) for name in ("omega", "zeta"))
        found.append(StablePole(omega, zeta, share))
        left = [pole for pole in left if pole not in near]
    return found


def _same(one: Pole | StablePole, other: Pole | StablePole) -> bool:
    apart = abs(one.omega - other.omega)
    width = _SAME * max(one.zeta, other.zeta) + 1e-4
    return apart < width * one.omega and abs(np.log(one.zeta / other.zeta)) < _SAME_DAMPING


@dataclass(frozen=True, eq=False)
class Window:
    """A part of the lines and the fit to it."""

    low: float  # rad/s, limits of the modes used
    high: float
    parts: tuple[Lines, ...]  # including lines beyond both ends; responses of modes further away are subtracted
    fit: ModalFit

    def inside(self) -> list[int]:
        """Indices of the modes within the window."""
        return [i for i, omega in enumerate(self.fit.omega) if self.low <= omega < self.high]


def search(
    parts: Sequence[Lines], low: float, high: float, candidates: Sequence[StablePole], starts: Starts | None
) -> list[Window]:
    """Fit the modes of each window, starting from stable poles or `starts`; other modes are subtracted."""
    final, least = starts is not None, STABLE if starts is None else np.inf
    spare = [(each.omega, each.zeta) for each in candidates if each.share < least]
    if starts is None:
        starts = [(each.omega, each.zeta) for each in candidates if each.share >= STABLE]
    known = _linear(parts, starts)
    windows: list[Window] = []
    begin = low
    while begin < high:
        end = _upper_end(parts, begin / _MARGIN, _CORE * _MARGIN**2, high * _MARGIN) / _MARGIN
        if end * np.sqrt(_CORE) > high:
            end = high
        first, last = begin / _MARGIN, end * _MARGIN
        near = [
            index
            for index, (omega, zeta) in enumerate(starts)
            if first * (1.0 - _BESIDE[1] * zeta - _BESIDE[0]) < omega < last * (1.0 + _BESIDE[1] * zeta + _BESIDE[0])
        ]
        far = [index for index in range(len(starts)) if index not in near]
        rest = [_without(lines, [starts[i] for i in far], known[row, far]) for row, lines in enumerate(parts)]
        tried = [each for each in spare if first < each[0] < last]
        windows += _fit_window(rest, [starts[i] for i in near], tried, begin, end, final)
        begin = end
    return windows


def _upper_end(parts: Sequence[Lines], low: float, ratio: float, highest: float) -> float:
    """Upper end of a band: *ratio* times its lower end, higher where lines are sparse, at most *highest*."""
    fewest = max(
        float(lines.omega[min(int(np.searchsorted(lines.omega, low)) + _BAND_LINES, len(lines.s) - 1)])
        for lines in parts
    )
    return float(min(max(low * ratio, fewest), highest))


def modes_of(windows: Sequence[Window]) -> Starts:
    """All modes within their windows."""
    return [starts_of(window.fit)[i] for window in windows for i in window.inside()]


def _linear(parts: Sequence[Lines], starts: Starts) -> ComplexArray:
    """Residues of modes with fixed poles, (responses, modes)."""
    found = []
    omega, zeta = np.array(starts, dtype=np.float64).reshape(-1, 2).T
    for lines in parts:
        top = lines.s**lines.power
        columns = lines.weighted(np.column_stack((mode_columns(lines, omega, zeta)[0], top, top / lines.s**2)))
        norms = np.maximum(np.sqrt(np.sum(columns**2, axis=0)), 1e-300)
        factors = np.linalg.lstsq(columns / norms, lines.goal, rcond=1e-10)[0] / norms
        found.append(factors[: len(omega)])
    return np.array(found, dtype=np.complex128)


def _without(lines: Lines, modes: Starts, residues: ComplexArray) -> Lines:
    if not modes:
        return lines
    omega, zeta = np.array(modes).T
    # The imaginary part of a residue is multiplied by s/omega.
    gain = residues.real + residues.imag * (lines.s[:, None] / omega)
    return replace(lines, response=lines.response - np.sum(mode_columns(lines, omega, zeta)[0] * gain, axis=1))


def cut(lines: Lines, low: float, high: float, complex_modes: bool, degree: int = 2) -> Lines:
    """The lines between two angular frequencies, with a polynomial and, for real modes, a delay as background."""
    inside = (lines.omega >= low) & (lines.omega <= high)
    place = (lines.omega[inside] - 0.5 * (low + high)) / (0.5 * (high - low))
    powers = place[:, None] ** np.arange(degree + 1)
    delay = lines.s[inside, None] * lines.response[inside, None]
    return replace(
        lines, s=lines.s[inside], response=lines.response[inside], weight=lines.weight[inside],
        background=np.hstack((powers, 1j * powers, delay[:, : not complex_modes])), complex_modes=complex_modes,
    )  # fmt: skip


def residues_of(fit: ModalFit) -> ComplexArray:
    """(responses, m) residues; those of real modes are turned by the phase of each response's fitted delay."""
    if fit.complex_modes:
        return fit.residues
    delay_s = -np.array([factors[-1:] for factors in fit.background])
    return np.asarray(fit.residues / (1.0 + 1j * delay_s * fit.omega), dtype=np.complex128)


def _fit_window(
    parts: Sequence[Lines], near: Starts, spare: Starts, low: float, high: float, final: bool
) -> list[Window]:
    """Fit the modes of a window from starts near it; evidence decides how many. Empty: too few lines, or no mode."""
    found: list[tuple[float, Window]] = []
    most = _MAX_MODES
    for complex_modes in (True, False) if final else (True,):
        wide = tuple(cut(lines, low / _MARGIN, high * _MARGIN, complex_modes) for lines in parts)
        if min(len(lines.s) for lines in wide) <= _FEWEST:
            return []
        room = min(most, min(len(lines.s) for lines in wide) // 4)  # four lines per mode
        best = _best_of(wide, near, spare, room, final)
        if best is None:
            break
        near, most = starts_of(best), len(best.omega) + len(best.omega) // 2 + _MORE_REAL
        found.append((evidence_of(best, min(lines.independent for lines in wide)), Window(low, high, wide, best)))
    return [min(found, key=lambda each: each[0])[1]] if found else []


def _best_of(wide: Sequence[Lines], near: Starts, spare: Starts, room: int, final: bool) -> ModalFit | None:
    fewer = [_thinned(lines) for lines in wide]
    both = [_Selection(fewer, near[:room]).best_of(spare, room)]
    # The second search of complex modes starts from those of the first.
    pruned = near[:room] if final and wide[0].complex_modes else _pruned(fewer, [*near, *spare])[:room]
    if sorted(pruned) != sorted(near[:room]):
        both.append(_Selection(fewer, pruned).best_of(spare, room))
    share = min(lines.independent for lines in fewer)
    best = min(filter(None, both), key=lambda fit: evidence_of(fit, share), default=None)
    if final and fewer[0] is not wide[0]:
        best = _Selection(wide, starts_of(best)).best_of(spare, room, _ROUNDS)
    return fitted(wide, starts_of(best), _FULL if final else _QUICK)


def _thinned(lines: Lines) -> Lines:
    step = len(lines.s) // _FEW
    if step < 2:
        return lines
    return replace(
        lines, s=lines.s[::step], response=lines.response[::step], weight=lines.weight[::step],
        background=lines.background[::step], correlation=lines.correlation[::step],
    )  # fmt: skip


class _Selection:
    """Selects the modes of a window: adds, splits or removes one at a time while that improves the evidence."""

    def __init__(self, parts: Sequence[Lines], starts: Starts) -> None:
        self.parts, self.share = parts, min(lines.independent for lines in parts)
        self.best = fitted(parts, starts, _QUICK)
        while starts and (self.best is None or _twins(self.best)):
            starts = starts[:-1] if self.best is None else _apart(self.best)
            self.best = fitted(parts, starts, _QUICK)
        self.evidence = self._empty() if self.best is None else evidence_of(self.best, self.share)

    def best_of(self, spare: Starts, room: int, rounds: int = _MAX_CHANGES) -> ModalFit | None:
        for _ in range(rounds):
            has_room = self.best is None or len(self.best.omega) < room
            if not (self._reduces() or (has_room and (self._grows(spare) or self._splits()))):
                break
        return self.best

    def _betters(self, starts: Starts, *, apart: bool = False) -> bool:
        """Fit from these modes and keep the fit if it is better; with `apart` only if no two of its modes coincide."""
        found = fitted(self.parts, starts, _QUICK)
        if found is None or (apart and _twins(found)) or not evidence_of(found, self.share) < self.evidence:
            return False
        self.best, self.evidence = found, evidence_of(found, self.share)
        return True

    def _empty(self) -> float:
        """Evidence of a model without modes."""
        squares, samples, columns = 0.0, 0.0, 0
        for lines in self.parts:
            basis, goal = lines.weighted(lines.background), lines.goal
            squares += float(np.sum((goal - basis @ np.linalg.lstsq(basis, goal, rcond=None)[0]) ** 2))
            samples += len(goal) * self.share
            columns += basis.shape[1]
        return float(samples * np.log(max(squares, 1e-300)) + columns * np.log(samples))

    def _reduces(self) -> bool:
        """Remove one of the modes that explain least, if the evidence does not support it; True if one was removed."""
        fit = self.best
        if fit is None:
            return False
        samples = 2 * sum(map(len, fit.left)) * self.share
        # Standard errors of the residues, up to a common factor.
        spread = [_inverse(jacobian, 1e-13)[1:] for jacobian in fit.jacobian]
        squares = np.max((np.abs(fit.residues) / [each[: len(fit.omega)] for _, each in spread]) ** 2, axis=0)
        for index in np.argsort(squares)[:_WEAKEST]:
            if samples * np.log1p(squares[index] / fit.squares) > _CLEARLY * np.log(samples):
                break
            starts = [each for place, each in enumerate(starts_of(fit)) if place != index]
            if not starts and (empty := self._empty()) < self.evidence:
                self.best, self.evidence = None, empty
                return True
            if self._betters(starts):
                return True
        return False

    def _grows(self, spare: Starts) -> bool:
        """Add a mode that the evidence supports: from the pool, or at the largest residual; True if one was added."""
        parts = self.parts
        whole = [lines.weight * lines.response for lines in parts]
        left: Sequence[ComplexArray] = whole if self.best is None else self.best.left
        highest = float(parts[0].omega[int(np.argmax(np.convolve(np.abs(left[0]), np.ones(3), "same")))])
        tried = [*spare, *((highest, zeta) for zeta in (0.005, 0.02, 0.06))]
        gains = []
        for omega, zeta in tried:
            gain = 0.0
            for lines, rest in zip(parts, left, strict=True):
                column = lines.weight * mode_columns(lines, np.array([omega]), np.array([zeta]))[0][:, 0]
                near = np.abs(lines.omega - omega) < 3.0 * max(zeta * omega, lines.omega[1] - lines.omega[0])
                norm = float(np.sum(np.abs(column[near]) ** 2))
                gain += float(np.sum((np.conj(column[near]) * rest[near]).real)) ** 2 / norm if norm > 0.0 else 0.0
            gains.append(gain)
        squares = sum(float(np.sum(np.abs(part) ** 2)) for part in left)
        samples = 2 * sum(map(len, left)) * self.share
        for index in np.argsort(gains)[::-1][:_TRIED]:
            # As its pole moves, a mode may explain several times more than at its start.
            if samples * np.log(max(1.0 - 3.0 * gains[index] / squares, 1e-9)) + 4.0 * np.log(samples) > 0.0:
                break
            if self._betters([*starts_of(self.best), tried[index]], apart=True):
                return True
        return False

    def _splits(self) -> bool:
        """Replace one of the modes with most residual within their widths by two, if that is better; True if it was."""
        if self.best is None:
            return False
        fit, left = self.best, []
        for omega, zeta in starts_of(fit):
            near = np.abs(self.parts[0].omega - omega) < 2.0 * zeta * omega
            enough = np.count_nonzero(near) > _FEWEST // 2
            left.append(float(np.mean(np.abs(fit.left[0][near]) ** 2)) if enough else 0.0)
        usual = float(np.median(np.abs(fit.left[0]) ** 2))
        for index in np.argsort(left)[::-1][:_TRIED]:
            if left[index] < _UNUSUAL * usual:
                break
            starts = starts_of(fit)
            omega, zeta = starts.pop(index)
            pair = [(omega * (1.0 - 0.5 * zeta), 0.8 * zeta), (omega * (1.0 + 0.5 * zeta), 0.8 * zeta)]
            if self._betters([*starts, *pair], apart=True):
                return True
        return False


def _pruned(parts: Sequence[Lines], starts: Starts) -> Starts:
    """Select the poles that explain most, as many as the evidence supports, without changing them."""
    if not starts:
        return []
    omega, zeta = np.array(starts).T
    share = min(lines.independent for lines in parts)
    gram, goal, squares, samples = [], [], 0.0, 0.0
    for lines in parts:
        columns, wanted = lines.weighted(np.hstack((lines.background, mode_columns(lines, omega, zeta)[0]))), lines.goal
        columns /= np.maximum(np.sqrt(np.sum(columns**2, axis=0)), 1e-300)
        gram.append(columns.T @ columns + 1e-13 * np.eye(columns.shape[1]))
        goal.append(columns.T @ wanted)
        squares += float(wanted @ wanted)
        samples += len(wanted) * share
    kept, fixed = list(range(len(starts))), parts[0].background.shape[1]
    best, chosen = np.inf, kept
    while True:
        index = [*range(fixed), *(fixed + each for each in kept)]
        left, loss = squares, np.zeros(len(kept))
        for one, right in zip(gram, goal, strict=True):
            inverse = np.linalg.inv(one[np.ix_(index, index)])
            factors = inverse @ right[index]
            left -= float(factors @ right[index])
            loss += factors[fixed:] ** 2 / np.maximum(np.diag(inverse)[fixed:], 1e-300)
        parameters = len(parts) * (fixed + len(kept)) + 3 * len(kept)
        evidence = samples * np.log(max(left, 1e-12 * squares)) + parameters * np.log(samples) + _CLEAR * len(kept)
        if evidence < best:
            best, chosen = evidence, list(kept)
        if not kept:
            return [starts[each] for each in chosen]
        kept.pop(int(np.argmin(loss)))


def evidence_of(fit: ModalFit, share: float) -> float:
    """Bayesian information criterion of a fit, with more cost for each mode: lower is better."""
    samples = 2 * sum(len(part) for part in fit.left) * share
    opposed = np.count_nonzero(fit.residues.real < 0.0) if len(fit.residues) == 1 else 0
    cost = (fit.parameters + len(fit.omega)) * np.log(samples) + _OPPOSED * opposed + _CLEAR * len(fit.omega)
    return float(samples * np.log(max(fit.squares, 1e-300)) + cost)


def fitted(parts: Sequence[Lines], starts: Starts, effort: tuple[int, float] = _FULL) -> ModalFit | None:
    """A fit; None without starts, with too few lines, or if it fails."""
    if not starts:
        return None
    try:
        fit = fit_modes(parts, starts, *effort)
    except (ArgumentError, np.linalg.LinAlgError):
        return None
    return fit if np.isfinite(fit.squares) else None


def starts_of(fit: ModalFit | None) -> Starts:
    """Modes of a fit, as starts of another one."""
    return [] if fit is None else list(zip(fit.omega.tolist(), fit.zeta.tolist(), strict=True))


def _twins(fit: ModalFit) -> bool:
    """Whether two modes of a fit coincide (one then fits no real mode), or one has too much damping to vibrate."""
    order = np.argsort(fit.omega)
    omega, zeta = fit.omega[order], fit.zeta[order]
    near = np.diff(omega) < _TWINS * np.maximum(zeta[1:], zeta[:-1]) * omega[1:]
    return bool(np.any(near) or np.any(zeta > _NO_VIBRATION))


def _apart(fit: ModalFit) -> Starts:
    """Modes of a fit, less those heavily damped or near a stronger one; if there are none such, less the weakest."""
    order = np.argsort(np.max(np.abs(fit.residues), axis=0))[::-1]
    kept: list[int] = []
    for index in order:
        width = _TWINS * fit.zeta[index] * fit.omega[index]
        if fit.zeta[index] <= _NO_VIBRATION and all(abs(fit.omega[index] - fit.omega[i]) > width for i in kept):
            kept.append(int(index))
    starts = starts_of(fit)
    return [starts[i] for i in kept[: len(starts) - 1]]


def _inverse(jacobian: FloatArray, rcond: float) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Inverse of the normal matrix of scaled columns; norms of the columns; standard errors up to a common factor."""
    norms = np.maximum(np.sqrt(np.sum(jacobian**2, axis=0)), 1e-300)
    scaled = jacobian / norms
    inverse = np.linalg.pinv(scaled.T @ scaled, hermitian=True, rcond=rcond)
    return inverse, norms, np.sqrt(np.maximum(np.diag(inverse), 1e-300)) / norms


@dataclass(frozen=True, eq=False)
class Uncertainty:
    """Covariances of the modes of a window."""

    each: FloatArray  # (responses, m, 3, 3) of ln omega, ln zeta and the residue's real part
    freedom: float  # independent samples minus parameters
    step: FloatArray  # (p, 2n) maps residual to parameters; for the scatter of impacts


def uncertainty_of(window: Window) -> Uncertainty:
    """Covariances from the residual noise and its correlation between lines."""
    fit, parts = window.fit, window.parts
    modes = len(fit.omega)
    counts = [jacobian.shape[1] - 2 * modes for jacobian in fit.jacobian]
    rows = [jacobian.shape[0] for jacobian in fit.jacobian]
    size = sum(counts) + 2 * modes
    linear, poles = zip(*((each[:, : -2 * modes], each[:, -2 * modes :]) for each in fit.jacobian), strict=True)
    jacobian = np.hstack((scipy.linalg.block_diag(*linear), np.vstack(poles)))
    inverse, norms, _ = _inverse(jacobian, 1e-14)
    scaled = jacobian / norms
    spread = np.zeros((size, size))
    at = 0
    for lines, count in zip(parts, rows, strict=True):
        block = scaled[at : at + count]
        paired = block[: count // 2] + 1j * block[count // 2 :]
        spread += (paired.conj().T @ _correlated(paired, lines.correlation)).real
        at += count
    lost = float(np.trace(inverse @ spread))
    variance = fit.squares / max(sum(rows) - lost, 1.0)
    whole = variance * (inverse @ spread @ inverse) / np.outer(norms, norms)
    freedom = max(sum(count * lines.independent for count, lines in zip(rows, parts, strict=True)) - size, 2.0)
    first = sum(counts)
    begins = np.cumsum([0, *counts[:-1]])
    chosen = [[[first + 2 * i, first + 2 * i + 1, int(begin) + i] for i in range(modes)] for begin in begins]
    each = np.array([[whole[np.ix_(index, index)] for index in row] for row in chosen])
    return Uncertainty(each, freedom, (inverse @ scaled.T) / norms[:, None])


def _correlated(columns: ComplexArray, correlation: ComplexArray) -> ComplexArray:
    """Columns times the correlation matrix of the lines' noise."""
    if len(correlation) == 1:
        return columns
    kernel = np.concatenate((np.conj(correlation[:0:-1]), correlation))
    count = len(columns) + len(kernel) - 1
    product = np.fft.ifft(np.fft.fft(columns, count, axis=0) * np.fft.fft(kernel, count)[:, None], axis=0)
    return np.asarray(product[len(correlation) - 1 :][: len(columns)], dtype=np.complex128)


_LINES_PER_ORDER, _MAX_ORDER, _MIN_ORDER, _MAX_POLE_DAMPING = 4, 24, 2, 0.3


def band_poles(parts: Sequence[Lines], low: float, high: float) -> list[Pole]:
    """Poles between two angular frequencies, of models of ascending order (pLSCF).

    Source: P. Guillaume et al., A poly-reference implementation of the least-squares complex frequency-domain
    estimator, IMAC 21, 2003.
    """
    chosen = [(lines, (lines.omega >= low) & (lines.omega <= high)) for lines in parts]
    fewest = min(int(np.count_nonzero(inside)) for _, inside in chosen)
    most = min(_MAX_ORDER, fewest // _LINES_PER_ORDER)
    if most < _MIN_ORDER:
        return []
    width = 2.0 * np.pi * 0.85 / (high - low)  # a band is mapped onto 85 % of the unit circle
    sides: list[tuple[ComplexArray, ComplexArray, ComplexArray]] = []
    for lines, inside in chosen:
        z = np.exp(-width * (lines.s[inside] - 1j * low))
        weight = lines.weight[inside]
        response = lines.response[inside]
        numerator = np.asarray(weight[:, None] * z[:, None] ** np.arange(most + 1), dtype=np.complex128)
        denominator = -response[:, None] * numerator
        sides.append(
            (numerator.conj().T @ numerator, numerator.conj().T @ denominator, denominator.conj().T @ denominator)
        )
    found = []
    for order in range(_MIN_ORDER, most + 1):
        size = order + 1
        normal = np.zeros((size, size), dtype=np.complex128)
        for numerators, mixed, denominators in sides:
            solved = scipy.linalg.lstsq(numerators[:size, :size], mixed[:size, :size], check_finite=False)[0]
            normal += denominators[:size, :size] - mixed[:size, :size].conj().T @ solved
        try:
            # With the highest coefficient fixed, noise poles are unstable.
            free = np.linalg.solve(normal[:-1, :-1], -normal[:-1, -1])
        except np.linalg.LinAlgError:
            continue
        roots = np.roots(np.append(free, 1.0)[::-1])
        roots = roots[np.abs(roots) > 0.0]
        exponent = -np.log(np.abs(roots)) / width - 1j * (np.angle(roots) % (-2.0 * np.pi)) / width
        for pole in exponent + 1j * low:
            omega = float(np.abs(pole))
            zeta = float(-pole.real / omega)
            if low <= omega <= high and 0.0 < zeta < _MAX_POLE_DAMPING:
                found.append(Pole(omega, zeta, order))
    return found
