"""Watch of the axes for controllers, sample by sample, in a subset of Python.

The functions repeat `hil.watching` with numbers in place of arrays; `hil.export.watch_constants`
translates them into other languages. Exported Python modules contain this text unchanged, from
`start_watch` on. Constants `c` and the state `s` are described in `hil.export.watch_constants`.
Sums over a block replace the block's samples. Zeros among the friction columns are left out.
"""

from __future__ import annotations

from math import exp, sqrt
from typing import Any


def start_watch(c: Any, s: Any, learned: bool) -> None:
    """Begin a watch with learned thresholds, or learn anew, from a state of zeros."""
    if learned:
        s.moved = c.needed
    for j in range(c.joints):
        s.unknown[j] = 1.0
        s.taken[j] = c.first_taken[j]
        for k in range(c.unknowns):
            for m in range(c.unknowns):
                s.p[j][k][m] = c.first_p[j][k][m]
        if learned:
            s.weight[j] = c.learned_weight[j]
            s.seen[j] = c.learned_seen[j]
            for w in range(c.n_windows):
                s.squares[j][w] = c.learned_squares[j][w]
            for d in range(c.n_distances):
                for k in range(3):
                    s.shown[j][k][d] = c.learned_shown[j][k][d]
            choose_distance(c, s, j)
        bound_scatter(c, s, j)


def watch_sample(c: Any, s: Any, elapsed: float, q: Any, tau: Any) -> None:
    """Process a sample, `elapsed` [s] after the previous sample; NaN is a missing sample."""
    s.lost += elapsed
    there: bool = True
    for j in range(c.joints):
        if not (abs(q[j]) < c.blind and abs(tau[j]) < c.blind):
            there = False
    if there:
        if s.lost > c.gap * c.period:
            s.held = 0
            s.since = 0
        for j in range(c.joints):
            s.quiet[j] += s.lost
        s.lost = 0.0
        if s.held == 2:
            judge_sample(c, s, q)
        for j in range(c.joints):
            s.before[j] = s.now[j]
            s.now[j] = q[j]
            s.measured[j] = tau[j]
        if s.held < 2:
            s.held += 1


def judge_sample(c: Any, s: Any, q: Any) -> None:
    """Judge the previous sample, whose acceleration is known with the present one."""
    for j in range(c.joints):
        back: float = s.now[j] - s.before[j]
        forth: float = q[j] - s.now[j]
        s.velocity[j] = (forth + back) / (2.0 * c.period)
        s.acceleration[j] = (forth - back) / (c.period * c.period)
    c.rigid_bodies(s.now, s.velocity, s.acceleration, s.rigid)
    c.regressor(s.now, s.velocity, s.columns)
    moving: bool = False
    for j in range(c.joints):
        judge_axis(c, s, j)
        if abs(s.velocity[j]) > c.slow * c.fastest[j]:
            moving = True
    s.newest = s.newest + 1 if s.newest + 1 < c.longest else 0
    s.latest = s.latest + 1 if s.latest + 1 < c.rest else 0
    if s.since >= c.longest - 1:
        if s.moved < c.needed:
            if moving:
                s.moved += 1
        else:
            for j in range(c.joints):
                if abs(s.external[j]) >= s.threshold[j]:
                    s.alarm[j] = True
                    s.quiet[j] = 0.0
                if s.quiet[j] > c.over:
                    s.alarm[j] = False
    s.since += 1
    s.in_block += 1
    if s.in_block == c.block:
        s.in_block = 0
        for j in range(c.joints):
            learn_axis(c, s, j)


def judge_axis(c: Any, s: Any, j: int) -> None:
    """Compare the torque of an axis with the model, over the windows."""
    speed: float = abs(s.velocity[j])
    heavy: float = abs(s.rigid[j])
    place: float = min(speed * c.per_node[j], c.last_place)
    node: int = int(place)
    share: float = place - float(node)
    offset: float = c.offset[j][node] + share * (c.offset[j][node + 1] - c.offset[j][node])
    offset += heavy * c.offset_of_load[j]
    level: float = c.level[j][node] + share * (c.level[j][node + 1] - c.level[j][node])
    level = max(level + heavy * c.level_of_load[j], 0.0)
    s.friction[j] = s.measured[j] - (s.rigid[j] + c.inertia[j] * s.acceleration[j] + offset)
    s.level[j] = level
    turn_axis(c, s, j)
    speed = speed / c.fastest[j]
    direction: float = s.row[j][s.taken[j]]
    # deviation of friction: between two nodes of speed, and offset
    low: int = 0
    for k in range(1, c.last_speed):
        if speed >= c.speeds[k]:
            low = k
    part: float = min((speed - c.speeds[low]) / (c.speeds[low + 1] - c.speeds[low]), 1.0)
    high: float = direction * level / c.limit[j]
    x: float = high * (1.0 - part)
    y: float = high * part
    end: int = c.unknowns - 1
    error: float = x * (x * s.p[j][low][low] + 2.0 * (y * s.p[j][low][low + 1] + s.p[j][low][end]))
    error += y * (y * s.p[j][low + 1][low + 1] + 2.0 * s.p[j][low + 1][end]) + s.p[j][end][end]
    drifted: float = x * s.x[j][low] + y * s.x[j][low + 1] + s.x[j][end]
    for k in range(c.parameters):
        half: float = 0.5 * c.covariance[k][k] * s.columns[j * c.parameters + k]
        for m in range(k):
            half += c.covariance[k][m] * s.columns[j * c.parameters + m]
        error += 2.0 * half * s.columns[j * c.parameters + k] / (c.limit[j] * c.limit[j])
    left: float = s.friction[j] - direction * level - s.damped[j]
    left = left / c.limit[j] - drifted
    wrong: float = min(max(1.0 - speed / c.slow, 0.0), 1.0) * (1.0 + abs(direction))
    wrong = max(s.doubt[j], wrong)
    s.residuals[j][s.newest] = left
    s.bands[j][s.newest] = wrong * level / c.limit[j]
    sure: bool = speed > c.slow and s.doubt[j] < c.sure
    compare_windows(c, s, j, 4.0 * error, sure)
    if sure:
        s.used[j] += 1.0
        s.f[j][low][low] += x * x
        s.f[j][low][low + 1] += x * y
        s.f[j][low + 1][low] += x * y
        s.f[j][low + 1][low + 1] += y * y
        s.f[j][low][end] += x
        s.f[j][end][low] += x
        s.f[j][low + 1][end] += y
        s.f[j][end][low + 1] += y
        s.f[j][end][end] += 1.0
        s.b[j][low] += x * left
        s.b[j][low + 1] += y * left
        s.b[j][end] += left


def turn_axis(c: Any, s: Any, j: int) -> None:
    """Follow the direction of an axis's friction over every presliding distance."""
    way: float = s.now[j] - s.before[j]
    s.path[j] += way
    s.paths[j][s.latest] = s.path[j]
    least: float = s.path[j]
    most: float = s.path[j]
    for k in range(c.rest):
        least = min(least, s.paths[j][k])
        most = max(most, s.paths[j][k])
    still: bool = most - least < c.distances[0]
    sign: float = 0.0
    if way > 0.0:
        sign = 1.0
    if way < 0.0:
        sign = -1.0
    taken: int = s.taken[j]
    slower: int = taken + 1 if taken + 1 < c.n_distances else taken
    faster: int = taken - 1 if taken > 0 else taken
    for d in range(c.n_distances):
        s.row[j][d] = sign - (sign - s.row[j][d]) * exp(-abs(way) / c.distances[d])
    if still:
        s.unknown[j] = 1.0 + abs(s.row[j][taken])
    else:
        s.unknown[j] = s.unknown[j] * exp(-abs(way) / c.distances[slower])
    turning: bool = abs(s.row[j][c.n_distances - 1] - s.row[j][0]) > c.turning
    if turning and not still and s.level[j] > 0.0:
        s.seen_now[j] += 1.0
        for d in range(c.n_distances):
            slip: float = s.velocity[j] - abs(s.velocity[j]) * s.row[j][d]
            miss: float = s.friction[j] - s.level[j] * s.row[j][d]
            s.shown_now[j][0][d] += miss * miss
            s.shown_now[j][1][d] += miss * slip
            s.shown_now[j][2][d] += slip * slip
    s.damped[j] = s.damping[j] * (s.velocity[j] - abs(s.velocity[j]) * s.row[j][taken])
    s.doubt[j] = max(abs(s.row[j][slower] - s.row[j][faster]), s.unknown[j])
    s.doubt[j] += c.damping_doubt * abs(s.damped[j]) / max(s.level[j], 1e-9)
    if turning and s.seen[j] < c.enough_seen:
        s.doubt[j] = c.unclear


def compare_windows(c: Any, s: Any, j: int, error: float, sure: bool) -> None:
    """Compare the mean residual of an axis over every window with its threshold."""
    total: float = 0.0
    width: float = 0.0
    best: float = -1.0
    w: int = 0
    at: int = s.newest
    for k in range(c.longest):
        total += s.residuals[j][at]
        width += s.bands[j][at]
        at = at - 1 if at > 0 else c.longest - 1
        length: int = k + 1
        if length == c.windows[w]:
            mean: float = total / float(length)
            bound: float = c.sigmas * s.bound[j][w]
            level: float = sqrt(bound * bound + error) + width / float(length)
            if level > c.visible:
                level = c.blind
            if abs(mean) > level:
                s.doubtful[j] = True
            if sure:
                s.squares_now[j][w] += mean * mean
            if abs(mean) / level > best:
                best = abs(mean) / level
                s.external[j] = -mean * c.limit[j]
                s.threshold[j] = level * c.limit[j]
            w += 1


def learn_axis(c: Any, s: Any, j: int) -> None:
    """Learn from the block's samples of an axis, unless a push is possible."""
    if s.doubtful[j] and s.weight[j] >= c.enough:
        s.doubted[j] += float(c.block) * c.period
    else:
        s.doubted[j] = 0.0
    trusted: bool = s.doubted[j] <= 0.0 or s.doubted[j] > c.lasting
    if trusted:
        s.seen[j] += s.seen_now[j]
        for d in range(c.n_distances):
            for k in range(3):
                s.shown[j][k][d] += s.shown_now[j][k][d]
    choose_distance(c, s, j)
    if s.since >= c.longest + c.block:
        used: float = s.used[j] if trusted else 0.0
        s.weight[j] = min(s.weight[j] + used, c.most)
        for w in range(c.n_windows):
            mean: float = s.squares_now[j][w] / max(s.used[j], 1.0)
            s.squares[j][w] += used / max(s.weight[j], 1.0) * (mean - s.squares[j][w])
        bound_scatter(c, s, j)
        follow_friction(c, s, j, 1.0 / (c.error * c.error * float(c.block)) if trusted else 0.0)
    s.doubtful[j] = False
    s.used[j] = 0.0
    s.seen_now[j] = 0.0
    for d in range(c.n_distances):
        for k in range(3):
            s.shown_now[j][k][d] = 0.0
    for w in range(c.n_windows):
        s.squares_now[j][w] = 0.0
    for k in range(c.unknowns):
        s.b[j][k] = 0.0
        for m in range(c.unknowns):
            s.f[j][k][m] = 0.0


def choose_distance(c: Any, s: Any, j: int) -> None:
    """Choose the best fitting presliding distance and damping of an axis."""
    if s.seen[j] >= c.enough_seen:
        least: float = 0.0
        best: int = 0
        for d in range(c.n_distances):
            damping: float = max(s.shown[j][1][d], 0.0) / max(s.shown[j][2][d], 1e-12)
            misfit: float = s.shown[j][0][d] - damping * s.shown[j][1][d]
            if d == 0 or misfit < least:
                least = misfit
                best = d
        if c.free[j] > 0.0:
            s.taken[j] = best
        best = s.taken[j]
        s.damping[j] = max(s.shown[j][1][best], 0.0) / max(s.shown[j][2][best], 1e-12)


def bound_scatter(c: Any, s: Any, j: int) -> None:
    """Compute an upper bound of the scatter of an axis's means, after Wilson and Hilferty."""
    for w in range(c.n_windows):
        s.bound[j][w] = sqrt(s.squares[j][w])
        if s.weight[j] < c.enough:
            ninths: float = 2.0 / 9.0 * float(c.windows[w]) / max(s.weight[j], 1e-9)
            low: float = 1.0 - ninths - c.allowance * sqrt(ninths)
            if low > 0.0:
                s.bound[j][w] = s.bound[j][w] / sqrt(low * low * low)
            else:
                s.bound[j][w] = c.blind


def follow_friction(c: Any, s: Any, j: int, scale: float) -> None:
    """Update the Kalman filter for an axis's friction by the sums of a block."""
    for k in range(c.unknowns):
        for m in range(c.unknowns):
            s.p[j][k][m] += c.wander[k][m]
    # solve (1 + P F) X = P by elimination with pivots
    for k in range(c.unknowns):
        for m in range(c.unknowns):
            total: float = 0.0
            for i in range(c.unknowns):
                total += s.p[j][k][i] * s.f[j][i][m]
            s.g[k][m] = total * scale
            s.h[k][m] = s.p[j][k][m]
        s.g[k][k] += 1.0
    for k in range(c.unknowns):
        pivot: int = k
        for i in range(k + 1, c.unknowns):
            if abs(s.g[i][k]) > abs(s.g[pivot][k]):
                pivot = i
        for m in range(c.unknowns):
            held: float = s.g[k][m]
            s.g[k][m] = s.g[pivot][m]
            s.g[pivot][m] = held
            held = s.h[k][m]
            s.h[k][m] = s.h[pivot][m]
            s.h[pivot][m] = held
        for i in range(c.unknowns):
            if i != k:
                factor: float = s.g[i][k] / s.g[k][k]
                for m in range(c.unknowns):
                    s.g[i][m] -= factor * s.g[k][m]
                    s.h[i][m] -= factor * s.h[k][m]
    for k in range(c.unknowns):
        for m in range(c.unknowns):
            s.p[j][k][m] = 0.5 * (s.h[k][m] / s.g[k][k] + s.h[m][k] / s.g[m][m])
    for k in range(c.unknowns):
        for m in range(c.unknowns):
            s.x[j][k] += s.p[j][k][m] * s.b[j][m] * scale
