"""Train learned.py: python train_learned.py HEALTHY [--signal pitch_rate] [--pieces 400]

HEALTHY is a flown campaign without faults, with its logs.  Pieces of its flights get a fault in one channel each, of
sizes drawn from 0.05 to 3 thresholds; every tenth frame of every channel is a sample, faulty from half a second after
the onset on.  Half of the flights train, the other half tests.
"""

import argparse
import json
from pathlib import Path

import numpy as np
from learned import Features
from scipy.optimize import minimize
from scipy.special import expit

import rig
from rig.core.frame import INDEX

LENGTH, ONSET, LATER, EVERY = 2500, 1500, 50, 10  # frames
KINDS = ("none", "offset", "drift", "noise", "oscillation", "stuck")


def flights(folder, signal):
    """Return the channels of each flight, (n, 4), in thresholds of its scenario."""
    found = []
    for path in sorted((folder / "logs").glob("*.mcap")):
        log = rig.read_log(path)
        threshold = json.loads(log.metadata["scenario"])["redundancy"]["signals"][signal]["threshold"]
        found.append(log.rows["channels"][:, INDEX[signal]] / threshold)
    return found


def faulty(piece, kind, channel, rng):
    """Put a fault into one channel of a piece (n, 4), from ONSET on."""
    size, frames = np.exp(rng.uniform(np.log(0.05), np.log(3.0))), np.arange(LENGTH - ONSET)
    x = piece[ONSET:, channel]
    if kind == "offset":
        x += size * rng.choice([-1, 1])
    elif kind == "drift":
        x += size * rng.choice([-1, 1]) * frames / 100.0
    elif kind == "noise":
        x += size * rng.standard_normal(len(x))
    elif kind == "oscillation":
        x += size * np.sin(2 * np.pi * np.exp(rng.uniform(np.log(0.5), np.log(10.0))) * frames / 100.0)
    elif kind == "stuck":
        x[:] = piece[ONSET - 1, channel]


def samples(found, pieces, rng):
    """Return features (m, 4) and labels (m,)."""
    cut, labels, channels = np.empty((pieces, LENGTH, 4)), np.zeros((pieces, 4), bool), np.arange(pieces) % 4
    for i in range(pieces):
        flight = found[rng.integers(len(found))]
        begin = rng.integers(len(flight) - LENGTH)
        cut[i] = flight[begin : begin + LENGTH]
        kind = KINDS[i % len(KINDS)]
        faulty(cut[i], kind, channels[i], rng)
        labels[i, channels[i]] = kind != "none"
    features, inputs, outputs = Features(pieces), [], []
    for k in range(LENGTH):
        now = features.update(cut[:, k] - np.median(cut[:, k], axis=1)[:, None])
        if k % EVERY == 0 and k > 500 and not ONSET <= k < ONSET + LATER:
            inputs.append(now.reshape(-1, 4))
            outputs.append((labels & (k >= ONSET)).ravel())
    return np.concatenate(inputs), np.concatenate(outputs)


def trained(x, y):
    """Return weights and constant of the largest likelihood, with a slight penalty on the weights."""

    def loss(w):
        z = x @ w[:-1] + w[-1]
        value = (np.logaddexp(0.0, z) - y * z).mean() + 1e-5 * (w[:-1] ** 2).sum()
        slope = expit(z) - y
        return value, np.append(x.T @ slope / len(y) + 2e-5 * w[:-1], slope.mean())

    bounds = [(0.0, None)] * 4 + [(None, None)]  # more of a feature is never a sign of health
    best = minimize(loss, np.zeros(x.shape[1] + 1), jac=True, method="L-BFGS-B", bounds=bounds)
    return best.x[:-1], best.x[-1]


def main():
    """Train, test, and write learned.json beside this file."""
    parser = argparse.ArgumentParser()
    parser.add_argument("healthy", type=Path)
    parser.add_argument("--signal", default="pitch_rate")
    parser.add_argument("--pieces", type=int, default=400)
    asked = parser.parse_args()
    rng, found = np.random.default_rng(0), flights(asked.healthy, asked.signal)
    weights, constant = trained(*samples(found[0::2], asked.pieces, rng))
    x, y = samples(found[1::2], asked.pieces, rng)
    z = x @ weights + constant
    print(f"other flights: {(z[y] > 0).mean():.1%} of faulty frames above 0, {(z[~y] > 0).mean():.2%} of healthy ones")
    text = json.dumps({"weights": [round(w, 3) for w in weights], "constant": round(constant, 3)})
    Path(__file__).with_name("learned.json").write_text(text + "\n")


if __name__ == "__main__":
    main()
