"""MountainCar as pmeta_core/env/mountain_car simulates it, on arrays, and its optimal policy."""

import numpy as np

NAME = "mountain_car"  # of the environment
LOWEST, HIGHEST = -1.2, 0.6
FASTEST = 0.07
GOAL = 0.5
HORIZON = 200
ACTIONS = (0, 1, 2)  # push left, not at all, right


class MountainCar:
    """One task; positions and velocities (a step) may be arrays of any equal shape."""

    def __init__(self, zeta, force, gravity):
        self.zeta, self.force, self.gravity = zeta, force, gravity

    def step(self, position, velocity, action):
        """(position, velocity, whether the goal is reached) after one step."""
        velocity = velocity + ((action - 1.0) * self.force
                               + np.cos(self.zeta * position) * -self.gravity)
        velocity = np.clip(velocity, -FASTEST, FASTEST)
        position = np.clip(position + velocity, LOWEST, HIGHEST)
        # the wall on the left takes all speed
        velocity = np.where((position == LOWEST) & (velocity < 0), 0.0, velocity)
        return position, velocity, (position >= GOAL) & (velocity >= 0)

    def trajectory(self, choose, start):
        """States (steps + 1) x 2 of an episode from rest at `start`, and whether it got there.

        `choose` maps arrays of positions and velocities to actions.
        """
        states, done = [(start, 0.0)], False
        while not done and len(states) <= HORIZON:
            position, velocity = (np.array([x]) for x in states[-1])
            position, velocity, reached = self.step(position, velocity, choose(position, velocity))
            states.append((float(position[0]), float(velocity[0])))
            done = bool(reached[0])
        return np.array(states), done


class Optimum:
    """Optimal values by value iteration on a grid, with bilinear interpolation between its points.

    Its paths are within 0.2 steps of those of a grid twice as fine, in the mean over the starts.
    """

    def __init__(self, car, gamma, positions=241, velocities=201, tolerance=1e-3, sweeps=1000):
        self.car, self.gamma = car, gamma
        self.positions = np.linspace(LOWEST, HIGHEST, positions)
        self.velocities = np.linspace(-FASTEST, FASTEST, velocities)
        self.table = np.zeros((positions, velocities))
        position, velocity = np.meshgrid(self.positions, self.velocities, indexing="ij")
        steps = [self._corners(*car.step(position, velocity, action)) for action in ACTIONS]
        goal = (position >= GOAL) & (velocity >= 0)
        # undiscounted, a track without a way to the goal would go on for ever
        for _ in range(sweeps):
            values = np.max([self._action_value(*step) for step in steps], axis=0)
            # an episode is over there
            values[goal] = 0
            change = np.abs(values - self.table).max()
            self.table = values
            if change < tolerance:
                break

    def values(self, position, velocity):
        """The largest action value of each state."""
        return self._action_values(position, velocity).max(axis=0)

    def choose(self, position, velocity):
        return self._action_values(position, velocity).argmax(axis=0)

    def _action_values(self, position, velocity):
        return np.array([self._action_value(*self._corners(*self.car.step(position, velocity, a)))
                         for a in ACTIONS])

    def _corners(self, position, velocity, reached):
        """Flat indices and weights of the grid points around each state; weight 0 at the goal."""
        x = (position - LOWEST) / (HIGHEST - LOWEST) * (len(self.positions) - 1)
        y = (velocity + FASTEST) / (2 * FASTEST) * (len(self.velocities) - 1)
        i = np.clip(x.astype(int), 0, len(self.positions) - 2)
        j = np.clip(y.astype(int), 0, len(self.velocities) - 2)
        x, y = x - i, y - j
        width = len(self.velocities)
        indices = [i * width + j, i * width + j + 1, (i + 1) * width + j, (i + 1) * width + j + 1]
        weights = [(1 - x) * (1 - y), (1 - x) * y, x * (1 - y), x * y]
        return indices, [self.gamma * weight * ~reached for weight in weights]

    def _action_value(self, indices, weights):
        flat = self.table.ravel()
        return -1 + sum(weight * flat[index] for index, weight in zip(indices, weights))
