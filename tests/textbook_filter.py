"""The wrench filter written out as textbooks print it, for its test: one 2 x 2 matrix an axis and motion.

Source: Bar-Shalom, Li and Kirubarajan, Estimation with Applications to Tracking and Navigation (DOI
10.1002/0471221279), 5.2 and 11.6; Joseph's form of the correction.
"""

from __future__ import annotations

import numpy as np
from scipy import stats

from sensing.wrench.filter import LOST_NIS, MANEUVER_NIS


class Textbook:
    """Every axis and motion apart with 2 x 2 matrices, Joseph's form as it is printed; probabilities by Bayes' rule."""

    def __init__(self, motions, noise, sigma, arm):
        self.motions, self.noise, self.sigma, self.arm, count = motions, noise, sigma, arm, len(motions)
        self.x = np.zeros((count, 6, 2))
        rates = np.outer([motion.start_rate for motion in motions], arm)
        self.P = np.stack([noise, 0 * noise, 0 * noise, rates**2], axis=2).reshape(count, 6, 2, 2)
        self.probability, self.lost = np.full((count, 6), 1 / count), 0

    def predict(self, dt):
        F, G = np.array([[1, dt], [0, 1]]), np.array([[dt**3 / 3, dt**2 / 2], [dt**2 / 2, dt]])
        for m, motion in enumerate(self.motions):
            for axis in range(6):
                kick = self.arm[axis] ** 2 * (motion.acceleration * G + motion.walk * np.diag([dt, 0.0]))
                self.x[m, axis], self.P[m, axis] = F @ self.x[m, axis], F @ self.P[m, axis] @ F.T + kick

    def nis(self, measured):
        reported = self.value()
        spread = (self.probability * (self.P[:, :, 0, 0] + (self.x[:, :, 0] - reported) ** 2)).sum(axis=0)
        return ((measured - reported) ** 2 / (spread + (self.probability * self.noise).sum(axis=0))).sum()

    def weigh(self, measured):
        density = stats.norm.pdf(measured, self.x[:, :, 0], np.sqrt(self.P[:, :, 0, 0] + self.noise))
        probability = self.probability**0.8 * density
        probability = np.maximum(probability / probability.sum(axis=0), 1e-3)
        self.probability = probability / probability.sum(axis=0)

    def correct(self, measured):
        """Returns whether the sample was a surprise to every motion."""
        innovation = measured - self.x[:, :, 0]
        squares = innovation**2 / (self.P[:, :, 0, 0] + self.noise)
        surprise = squares.sum(axis=1).min() > MANEUVER_NIS
        for m, motion in enumerate(self.motions):
            for axis in range(6):
                P, error = self.P[m, axis], innovation[m, axis]
                if surprise:
                    P = P + np.diag([error**2, (motion.start_rate * self.arm[axis]) ** 2])
                elif motion.steady and squares[m, axis] > LOST_NIS:
                    P, self.lost = P + np.diag([error**2, 0.0]), self.lost + 1
                K = P[:, :1] / (P[0, 0] + self.noise[m, axis])
                keep = np.eye(2) - K @ np.array([[1.0, 0.0]])
                self.x[m, axis] += K[:, 0] * error
                self.P[m, axis] = keep @ P @ keep.T + self.noise[m, axis] * K @ K.T
        return surprise

    def value(self):
        return (self.probability * self.x[:, :, 0]).sum(axis=0)

    def variance(self):
        scatter = (self.x[:, :, 0] - self.value()) ** 2
        return (self.probability * (self.P[:, :, 0, 0] + self.sigma**2 - self.noise + scatter)).sum(axis=0)
