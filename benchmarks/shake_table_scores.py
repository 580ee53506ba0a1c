"""Models of outcomes of tests, and their scores where they are left out: see `shake_table`."""

import dataclasses
import math

import numpy as np
import scipy

SPLITS, SEED = 25, 1
# Of .05, .1, .2, .3, .5 and .8 Hz those with the lowest Brier scores, of PGV alone and of PGA and PGV/PGA.
ALONE, BESIDE = 0.3, 0.5


def measures_of(arrays, step):
    """Intensity measures by name, (n,), of accelerations in g; velocities and displacements are high-passed.

    `step`: seconds between samples.
    """

    def velocities(corner):
        """Velocities of the table, m/s, high-passed at a corner in Hz."""
        high = scipy.signal.butter(2, corner * 2.0 * step, "high", output="sos")
        return [9.80665 * step * np.cumsum(scipy.signal.sosfiltfilt(high, np.pad(array, 2000))) for array in arrays]

    def peaks(series):
        """Largest absolute values."""
        return np.array([np.abs(values).max() for values in series])

    pga = peaks(arrays)
    return {
        "PGA": pga,
        "PGV": peaks(velocities(ALONE)),
        "PGV/PGA": peaks(velocities(BESIDE)) / pga,
        "PGD": peaks([step * np.cumsum(speeds) for speeds in velocities(ALONE)]),
        "Arias": np.array([(array**2).sum() * step for array in arrays]),
        "CAV": np.array([np.abs(array).sum() * step for array in arrays]),
    }


def logistic(features, outcome, steps=25, ridge=1e-3):
    """Coefficients of a logistic regression on features (n, d), standardized, with the intercept first."""
    x, b = np.column_stack([np.ones(len(features)), features]), np.zeros(features.shape[1] + 1)
    for _ in range(steps):
        p = scipy.special.expit(x @ b)
        hessian = (x * (p * (1 - p) + 1e-9)[:, None]).T @ x + ridge * np.eye(b.size)
        b = b + np.clip(np.linalg.solve(hessian, x.T @ (outcome - p) - ridge * b), -2.0, 2.0)
    return b


def by_logistic(*columns):
    """Model that predicts by a logistic regression on logarithms of measures (n,).

    A model is a function of outcomes (n,) that returns one of the tests that count, bool (n,): probabilities (n,).
    """
    logs = np.log(np.column_stack(columns))
    logs = (logs - logs.mean(axis=0)) / logs.std(axis=0)

    def fitted(observed):
        """Return the function of the tests that count."""

        def probabilities(counted):
            """Probabilities under all motions, fitted to those that count."""
            b = logistic(logs[counted], observed[counted])
            return scipy.special.expit(b[0] + logs @ b[1:])

        return probabilities

    return fitted


def by_block(calibration, spread=None, **prior):
    """Model that predicts by a calibration with another spread or other priors; a prior of None is left out."""
    laws = {name: law for name, law in (calibration.prior | prior).items() if law is not None}
    spread = calibration.spread if spread is None else spread

    def fitted(observed):
        """Return the function of the tests that count."""
        own = dataclasses.replace(calibration, prior=laws, spread=spread, observed=observed)
        return lambda counted: own.counting(counted).probability

    return fitted


def splits_of(record, count=SPLITS, seed=SEED):
    """Return the tests that are fitted to, bool (count, n): those of a random half of the ground motions each time."""
    rng, names = np.random.default_rng(seed), np.unique(record)
    return np.array([np.isin(record, rng.permutation(names)[: names.size // 2]) for _ in range(count)])


def cross_validated(model, observed, splits):
    """Mean Brier score, negative log-likelihood, share right and probability of each test, (4, n), where left out."""
    total, out, fitted = np.zeros((4, observed.size)), ~splits, model(observed)
    for counted, left in zip(splits, out, strict=True):
        p = np.clip(fitted(counted), 1e-6, 1 - 1e-6)
        values = (p - observed) ** 2, -np.log(np.where(observed, p, 1 - p)), (p > 0.5) == observed, p
        total += np.where(left, values, 0.0)
    return total / out.sum(axis=0)


def grouped_error(values, record):
    """Return the standard error of the mean of values (n,) that deviate together under one ground motion."""
    sums = np.array([(values - values.mean())[record == name].sum() for name in np.unique(record)])
    return math.sqrt((sums**2).sum() * sums.size / (sums.size - 1)) / values.size


def calibration_z(p, observed):
    """Deviates of the sum of the outcomes and of the Brier score (Spiegelhalter 1986) from what p (n,) makes likely."""
    variance, slope = p * (1 - p), 1 - 2 * p
    total = ((observed - p) * slope).sum() / math.sqrt((slope**2 * variance).sum())
    return (observed - p).sum() / math.sqrt(variance.sum()), total


def scores(models, observed, record, splits, main):
    """Scores of models by name and of their differences from the `main` one, with standard errors by ground motion."""
    results = {name: cross_validated(model, observed, splits) for name, model in models.items()}
    rows = {}
    for name, (brier, loss, right, p) in results.items():
        away, away_loss = brier - results[main][0], loss - results[main][1]
        z = calibration_z(p, observed)
        rows[name] = {
            "share right": right.mean(),
            "Brier": brier.mean(),
            "Brier error": grouped_error(brier, record),
            "log-likelihood": -loss.mean(),
            "z of the sum": z[0],
            "z of the Brier score": z[1],
            "Brier above": away.mean(),
            "Brier above, error": grouped_error(away, record),
            "loss above": away_loss.mean(),
            "loss above, error": grouped_error(away_loss, record),
        }
    rounded = {name: {key: round(float(value), 4) for key, value in row.items()} for name, row in rows.items()}
    return rounded, {name: values[3] for name, values in results.items()}


def area_under(measure, observed):
    """Probability that a measure is larger of a test that overturned than of one that stood (area under the ROC)."""
    ranks = scipy.stats.rankdata(measure)[observed]
    return float((ranks.sum() - ranks.size * (ranks.size + 1) / 2) / (ranks.size * (~observed).sum()))


def inversions(pga, record, observed):
    """Return where (n,) a specimen stood though a weaker motion of the record overturned it, and these motions."""
    same = record[:, None] == record
    weaker = same & (pga[:, None] > pga) & observed & ~observed[:, None]
    return weaker.any(axis=1) | weaker.any(axis=0)
